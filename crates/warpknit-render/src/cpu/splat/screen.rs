//! Screen space: projection of points and pieces into the picture.
//!
//! In: a camera, and points relative to the scene's centre. Out: column, row and depth of a point,
//! and the outline of a piece.

use glam::{Mat4, Vec2, Vec3, Vec4, Vec4Swizzles};

use super::outline::CapsuleOutline;
use super::pieces::SplatPiece;
use crate::scene::Bounds;
use crate::{Camera, RenderOptions};

/// The camera and the picture's size.
pub(super) struct Screen {
    clip_from_world: Mat4,
    /// The eye, relative to the scene's centre.
    pub(super) eye: Vec3,
    pub(super) right: Vec3,
    up: Vec3,
    /// Unit vector in which the camera looks.
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
            // The near and far planes affect clip z only, which is not used here.
            clip_from_world: camera.clip_from_world(centre, options.aspect(), 1.0, 2.0),
            eye: (camera.eye() - centre).as_vec3(),
            right: camera.to_world(Vec3::X),
            up: camera.to_world(Vec3::Y),
            ahead: -camera.to_world(Vec3::Z),
            pixel,
            size: [options.width, options.height],
        }
    }

    /// Column, row, and distance along the camera's axis. `None` for points behind the eye.
    pub(super) fn project(&self, point: Vec3) -> Option<Vec3> {
        let clip = self.clip_from_world * point.extend(1.0);
        (clip.w > 0.0).then(|| {
            // From clip space (y up, -1..1) to pixels (y down).
            ((clip.xy() / clip.w * Vec2::new(0.5, -0.5) + 0.5) * self.extent()).extend(clip.w)
        })
    }

    /// Whether a point lies in the picture or within a pixel of it.
    pub(super) fn shows(&self, point: Vec3) -> bool {
        self.project(point).is_some_and(|at| {
            at.truncate().cmpge(Vec2::NEG_ONE).all()
                && at.truncate().cmple(self.extent() + 1.0).all()
        })
    }

    /// Outline of a piece whose ends are projected already.
    ///
    /// A sphere away from the picture's centre projects to an ellipse. Here it stays a circle,
    /// which is indistinguishable for a yarn thinner than a pixel.
    pub(super) fn outline(&self, [one, other]: [Vec3; 2], radius: f32) -> CapsuleOutline {
        CapsuleOutline::new([one.truncate(), other.truncate()], radius / (self.pixel * one.z))
    }

    /// Parameter along a piece of the point nearest to a place in the picture, and the offset of
    /// that place from the axis, in world directions and radii.
    pub(super) fn locate(&self, piece: &SplatPiece, place: Vec2) -> Option<(f32, Vec3)> {
        let start = self.project(piece.ends[0])?;
        let ends = [start, self.project(piece.ends[1]).unwrap_or(start)];
        let outline = self.outline(ends, piece.radius);
        let share = outline.within([Vec4::splat(place.x), Vec4::splat(place.y)]).share.x;
        // From pixels to radii at the piece's distance.
        let aside = (place - outline.at(share)) * (self.pixel * ends[0].z / piece.radius);
        Some((share, self.right * aside.x - self.up * aside.y))
    }

    /// Distance along the camera's axis.
    pub(super) fn depth(&self, point: Vec3) -> f32 {
        (point - self.eye).dot(self.ahead)
    }

    /// Size of a pixel at a point, mm.
    pub(super) fn pixel_at(&self, place: Vec3) -> f32 {
        self.pixel * self.eye.distance(place)
    }

    /// The picture's size as floats.
    fn extent(&self) -> Vec2 {
        Vec2::new(self.size[0] as f32, self.size[1] as f32)
    }
}
