//! Where places lie in the picture.
//!
//! In: a camera and a point relative to the scene's middle. Out: its column, row and depth; and
//! what a piece of yarn covers of the picture.

use glam::{Mat4, Vec2, Vec3, Vec4, Vec4Swizzles};

use super::outline::CapsuleOutline;
use super::pieces::SplatPiece;
use crate::render::{Camera, RenderOptions};
use crate::scene::Bounds;

/// A picture's frame.
pub(super) struct Screen {
    clip_from_world: Mat4,
    /// The eye.
    pub(super) eye: Vec3,
    pub(super) right: Vec3,
    up: Vec3,
    /// Where the camera looks.
    ahead: Vec3,
    /// Size of a pixel at distance 1.
    pixel: f32,
    /// Pixels across and down.
    pub(super) size: [u32; 2],
}

impl Screen {
    pub(super) fn new(bounds: &Bounds, camera: &Camera, options: &RenderOptions) -> Self {
        let centre = bounds.centre().as_dvec3();
        #[expect(clippy::cast_possible_truncation, reason = "a pixel's size")]
        let pixel = camera.pixel_size(1.0, options.height) as f32;
        Self {
            // RayTracer and far matter to z alone, which nobody reads.
            clip_from_world: camera.clip_from_world(centre, options.aspect(), 1.0, 2.0),
            eye: (camera.eye() - centre).as_vec3(),
            right: camera.to_world(Vec3::X),
            up: camera.to_world(Vec3::Y),
            ahead: -camera.to_world(Vec3::Z),
            pixel,
            size: [options.width, options.height],
        }
    }

    /// Column and row, and the distance along the camera's axis; nothing for what is behind the
    /// eye.
    pub(super) fn project(&self, point: Vec3) -> Option<Vec3> {
        let clip = self.clip_from_world * point.extend(1.0);
        (clip.w > 0.0).then(|| {
            ((clip.xy() / clip.w * Vec2::new(0.5, -0.5) + 0.5) * self.extent()).extend(clip.w)
        })
    }

    /// Whether a point lies in the picture or a pixel beside it.
    pub(super) fn shows(&self, point: Vec3) -> bool {
        let inside = |at: Vec3| {
            at.truncate().cmpge(Vec2::NEG_ONE).all()
                && at.truncate().cmple(self.extent() + 1.0).all()
        };
        self.project(point).is_some_and(inside)
    }

    /// The outline of a piece with both ends in place.
    ///
    /// A ball away from the picture's middle is seen as an ellipse; here it stays a circle.
    pub(super) fn outline(&self, [one, other]: [Vec3; 2], radius: f32) -> CapsuleOutline {
        CapsuleOutline::new([one.truncate(), other.truncate()], radius / (self.pixel * one.z))
    }

    /// Where along a piece a place in the picture lies, and how far aside of its axis, in radii.
    pub(super) fn locate(&self, piece: &SplatPiece, place: Vec2) -> Option<(f32, Vec3)> {
        let start = self.project(piece.ends[0])?;
        let ends = [start, self.project(piece.ends[1]).unwrap_or(start)];
        let outline = self.outline(ends, piece.radius);
        let share = outline.within([Vec4::splat(place.x), Vec4::splat(place.y)]).share.x;
        let aside = (place - outline.at(share)) * (self.pixel * ends[0].z / piece.radius);
        Some((share, self.right * aside.x - self.up * aside.y))
    }

    /// Distance along the camera's axis.
    pub(super) fn depth(&self, point: Vec3) -> f32 {
        (point - self.eye).dot(self.ahead)
    }

    /// Size of a pixel at a place, mm.
    pub(super) fn pixel_at(&self, place: Vec3) -> f32 {
        self.pixel * self.eye.distance(place)
    }

    fn extent(&self) -> Vec2 {
        Vec2::new(self.size[0] as f32, self.size[1] as f32)
    }
}
