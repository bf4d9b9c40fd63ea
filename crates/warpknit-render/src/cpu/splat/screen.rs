//! Screen space: projection of points and pieces into the picture.
//!
//! In: a camera, and points relative to the scene's centre. Out: column, row and depth of a point,
//! and a piece's stroke. Columns and rows count cells: pixels, or equal parts of them.

use glam::{Mat4, Vec2, Vec3, Vec4Swizzles};

use super::masks::Stroke;
use super::pieces::{SplatPiece, Viewpoint};
use crate::cpu::to_f32;
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
    /// Size of a cell at distance 1.
    cell: f32,
    /// Cells across and down.
    pub(super) size: [u32; 2],
}

impl Screen {
    /// The screen of a picture whose pixels are `split` cells wide and high.
    pub(super) fn new(
        bounds: &Bounds,
        camera: &Camera,
        options: &RenderOptions,
        split: u32,
    ) -> Self {
        let centre = bounds.centre().as_dvec3();
        let pixel = to_f32(camera.pixel_size(1.0, options.height));
        Self {
            // The near and far planes affect clip z only, which is not used here.
            clip_from_world: camera.clip_from_world(centre, options.aspect(), 1.0, 2.0),
            eye: (camera.eye() - centre).as_vec3(),
            right: camera.to_world(Vec3::X),
            up: camera.to_world(Vec3::Y),
            ahead: -camera.to_world(Vec3::Z),
            cell: pixel / split as f32,
            size: [options.width, options.height].map(|side| side.saturating_mul(split)),
        }
    }

    /// Whether a point lies in the picture or within a cell of it.
    pub(super) fn shows(&self, point: Vec3) -> bool {
        self.project(point).is_some_and(|at| {
            at.truncate().cmpge(Vec2::NEG_ONE).all()
                && at.truncate().cmple(self.extent() + 1.0).all()
        })
    }

    /// A piece in the picture whose ends are projected already.
    ///
    /// A sphere away from the picture's centre projects to an ellipse. Here it stays a circle,
    /// which is indistinguishable for a yarn of two pixels.
    pub(super) fn stroke(&self, [start, end]: [Vec3; 2], half_width: f32) -> Stroke {
        Stroke::new([start.truncate(), end.truncate()], self.radius(half_width, start.z))
    }

    /// The piece in the picture.
    pub(super) fn stroke_of(&self, piece: &SplatPiece) -> Option<Stroke> {
        let start = self.project(piece.ends[0])?;
        let end = self.project(piece.ends[1]).unwrap_or(start);
        Some(self.stroke([start, end], piece.half_width(self.toward_viewer(piece.ends[0]))))
    }

    /// A radius in cells, at a depth.
    #[inline]
    pub(super) fn radius(&self, radius: f32, depth: f32) -> f32 {
        radius / (self.cell * depth)
    }

    /// The direction in the world of one in the picture.
    pub(super) fn to_world(&self, at: Vec2) -> Vec3 {
        self.right * at.x - self.up * at.y
    }

    /// Distance along the camera's axis.
    pub(super) fn depth(&self, point: Vec3) -> f32 {
        (point - self.eye).dot(self.ahead)
    }

    /// Size of a cell at a point, mm.
    pub(super) fn cell_at(&self, place: Vec3) -> f32 {
        self.cell * self.eye.distance(place)
    }

    /// The picture's size as floats.
    fn extent(&self) -> Vec2 {
        Vec2::new(self.size[0] as f32, self.size[1] as f32)
    }
}

impl Viewpoint for Screen {
    /// Column, row, and distance along the camera's axis. `None` for points behind the eye.
    fn project(&self, point: Vec3) -> Option<Vec3> {
        let clip = self.clip_from_world * point.extend(1.0);
        (clip.w > 0.0).then(|| {
            // From clip space (y up, -1..1) to cells (y down).
            ((clip.xy() / clip.w * Vec2::new(0.5, -0.5) + 0.5) * self.extent()).extend(clip.w)
        })
    }

    fn toward_viewer(&self, point: Vec3) -> Vec3 {
        self.eye - point
    }
}
