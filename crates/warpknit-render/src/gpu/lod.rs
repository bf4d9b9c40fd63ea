//! Level of detail and view-frustum culling: which yarns a pass draws, and how finely.
//!
//! In: chunks with their bounding balls, and a [`Frustum`] with the size of a pixel. Out: the
//! [`Chunks`] inside the frustum, and their [`DrawPlan`], instances sorted into batches that share a
//! step length, a cross-section and a set of textures.
//!
//! With level of detail, steps are doubled until they are as long as a pixel, or would cut off windings
//! of the yarn. A cross-section has
//! no more edges than its radius in pixels can show. A yarn of few pixels becomes a strip that
//! faces the eye, an impostor: its shader restores the round shape for a fifth of the triangles.
//!
//! Both are textbook methods (Luebke et al. 2003, 'Level of detail for 3D graphics'). Cost: linear
//! in the number of chunks. Not promised: continuous transitions. A chunk switches levels at once.

use std::collections::BTreeMap;
use std::f32::consts::PI;

use glam::{Mat4, Vec4, Vec4Swizzles};
use rayon::prelude::*;

use super::data::{PARTS, STEPS};
use super::pages::{ChunkBounds, Page};
use crate::RenderOptions;
use crate::scene::{Scene, Shape};
use warpknit_core::ids::index32;

/// Radius up to which a tube is drawn as a strip, pixels. Above it, the strip's flat silhouette in
/// bends would show.
const STRIP_PIXELS: f32 = 1.25;
/// Tolerance of a cross-section's polygon against its circle, pixels. Larger ones show corners in
/// the outline.
const SECTION_ERROR: f32 = 0.1;

/// A view of the yarns: its projection and the size of its pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frustum {
    pub(super) clip_from_world: Mat4,
    /// As `eye` of the shaders' `ViewUniform`.
    pub(super) eye: Vec4,
    /// Size of a pixel at distance 1, mm. For an eye at infinity, the size at every distance.
    pub(super) pixel: f32,
}

impl Frustum {
    /// Size of a pixel at the nearest point of a ball, mm.
    fn pixel_on(&self, bounds: &ChunkBounds) -> f32 {
        // An eye at infinity: orthographic.
        if self.eye.w == 0.0 {
            return self.pixel;
        }
        self.pixel * (self.eye.xyz().distance(bounds.centre) - bounds.reach).max(0.0)
    }

    /// The four side planes, normalised, positive inside (Gribb and Hartmann 2001, 'Fast extraction
    /// of viewing frustum planes').
    fn sides(&self) -> [Vec4; 4] {
        // A point is inside where -w <= x <= w, so the planes are sums and differences of the
        // matrix' rows.
        let m = self.clip_from_world;
        let sides =
            [m.row(3) + m.row(0), m.row(3) - m.row(0), m.row(3) + m.row(1), m.row(3) - m.row(1)];
        // Normalised, so that plane . centre is a distance that compares with the ball's radius.
        sides.map(|side| side / side.xyz().length().max(f32::MIN_POSITIVE))
    }
}

/// Whether a ball reaches into all four half-spaces. It may pass near a corner without being
/// visible; that only costs time.
fn ball_in_view(sides: &[Vec4; 4], &ChunkBounds { centre, reach, .. }: &ChunkBounds) -> bool {
    sides.iter().all(|side| side.dot(centre.extend(1.0)) > -reach)
}

/// Numbers of chunks, by page.
#[derive(Clone, Debug)]
pub(super) struct Chunks(Vec<Vec<u32>>);

impl Chunks {
    /// All chunks inside a frustum.
    pub(super) fn inside(pages: &[Page], frustum: &Frustum) -> Self {
        let sides = frustum.sides();
        let of_page = |page: &Page| {
            let all = (0..).zip(&page.chunk_bounds);
            all.filter(|(_, bounds)| ball_in_view(&sides, bounds))
                .map(|(number, _)| number)
                .collect()
        };
        Self(pages.par_iter().map(of_page).collect())
    }

    /// Those of them inside a frustum.
    pub(super) fn within(&self, pages: &[Page], frustum: &Frustum) -> Self {
        let sides = frustum.sides();
        let of_page = |(numbers, page): (&Vec<u32>, &Page)| {
            let is_inside =
                |&number: &u32| ball_in_view(&sides, &page.chunk_bounds[number as usize]);
            numbers.iter().copied().filter(is_inside).collect()
        };
        Self(self.0.par_iter().zip(pages).map(of_page).collect())
    }

    /// Their bounds.
    pub(super) fn bounds<'a>(
        &'a self,
        pages: &'a [Page],
    ) -> impl Iterator<Item = &'a ChunkBounds> + Clone {
        let of_page = |(numbers, page): (&'a Vec<u32>, &'a Page)| {
            numbers.iter().map(|&number| &page.chunk_bounds[number as usize])
        };
        self.0.iter().zip(pages).flat_map(of_page)
    }
}

/// State that the instances of a batch share.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct BatchKey {
    /// Edges of the cross-section; 2 for flat primitives.
    pub(super) edges: u32,
    pub(super) maps: Option<u16>,
    /// Points a step.
    pub(super) stride: u32,
}

/// Instances with one key on one page.
#[derive(Clone, Copy, Debug)]
pub(super) struct Batch {
    pub(super) page: usize,
    pub(super) key: BatchKey,
    /// Index of its first instance in the page's parts.
    pub(super) first: u32,
    pub(super) count: u32,
}

/// Everything that a pass draws.
#[derive(Debug)]
pub(super) struct DrawPlan {
    /// For each page the instances, batch after batch: chunk times [`PARTS`] plus the part.
    pub(super) parts: Vec<Vec<u32>>,
    /// Batches, grouped by page.
    pub(super) batches: Vec<Batch>,
}

impl DrawPlan {
    /// Plans a pass over chunks.
    pub(super) fn new(
        rules: &LodRules,
        pages: &[Page],
        chunks: &Chunks,
        frustum: &Frustum,
        options: &RenderOptions,
    ) -> Self {
        let of_page = |(number, (page, chunks)): (usize, (&Page, &Vec<u32>))| {
            // An ordered map, so that batches come in the same order every time.
            let mut sorted: BTreeMap<BatchKey, Vec<u32>> = BTreeMap::new();
            for &chunk in chunks {
                let bounds = &page.chunk_bounds[chunk as usize];
                // One decision per chunk, by the pixel at its nearest point, so that no part of it
                // is too coarse.
                let key = rules.key(bounds, frustum.pixel_on(bounds), options);
                let parts = bounds.pieces.div_ceil(STEPS * key.stride);
                sorted.entry(key).or_default().extend((0..parts).map(|part| chunk * PARTS + part));
            }
            let (mut batches, mut all) = (Vec::new(), Vec::new());
            for (key, parts) in sorted {
                let (first, count) = (index32(all.len()), index32(parts.len()));
                batches.push(Batch { page: number, key, first, count });
                all.extend(parts);
            }
            (batches, all)
        };
        let (batches, parts): (Vec<_>, Vec<_>) =
            pages.par_iter().zip(&chunks.0).enumerate().map(of_page).unzip();
        Self { parts, batches: batches.into_iter().flatten().collect() }
    }
}

/// Properties of a scene that decide how its chunks are drawn.
#[derive(Clone, Debug)]
pub(super) struct LodRules {
    shape: Shape,
    /// Radius and texture of each look.
    looks: Vec<(f32, Option<u16>)>,
}

impl LodRules {
    pub(super) fn new(scene: &Scene) -> Self {
        Self {
            shape: scene.shape,
            looks: scene
                .looks
                .iter()
                .map(|look| (look.radius, scene.maps_of(look).and(look.maps)))
                .collect(),
        }
    }

    /// The batch of a chunk on which a pixel is `pixel` mm wide.
    fn key(&self, bounds: &ChunkBounds, pixel: f32, options: &RenderOptions) -> BatchKey {
        let (radius, maps) = self.looks[usize::from(bounds.look)];
        // Without level of detail, `sr` counts as it is given.
        let edges = match self.shape {
            Shape::Ribbon => 2,
            Shape::Tube if options.lod => edges(radius, pixel, options.sr),
            Shape::Tube => options.sr,
        };
        let stride =
            if options.lod { stride(bounds.piece, pixel, bounds.most_stride.into()) } else { 1 };
        BatchKey { edges, maps, stride }
    }
}

/// The smallest power of two that makes a step at least a pixel long, up to `most`.
fn stride(piece: f32, pixel: f32, most: u32) -> u32 {
    let mut stride = 1;
    let mut step = piece;
    // Powers of two divide a chunk's steps evenly.
    while step < pixel && stride < most {
        stride *= 2;
        step *= 2.0;
    }
    stride
}

/// Edges of a cross-section, at most `sr`; 2 for a strip.
fn edges(radius: f32, pixel: f32, sr: u32) -> u32 {
    let pixels = radius / pixel.max(f32::MIN_POSITIVE);
    // Few pixels: an impostor.
    if pixels <= STRIP_PIXELS {
        return 2;
    }
    // The sagitta of a chord over the angle 2 h is r (1 - cos h). Set it to the tolerance.
    let half_angle = (1.0 - SECTION_ERROR / pixels).acos();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates, and is clamped to `sr`"
    )]
    let shown = (PI / half_angle).ceil() as u32;
    shown.clamp(3, sr)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn steps_are_a_pixel_long_at_least_unless_windings_need_shorter_ones() {
        for (piece, pixel, most, expected) in [
            (1.0, 0.5, 32, 1),
            (1.0, 1.0, 32, 1),
            (1.0, 1.1, 32, 2),
            (1.0, 3.9, 32, 4),
            (1.0, 4.1, 32, 8),
            (1.0, 4.1, 4, 4),
            (0.0, 1.0, 32, 32),
        ] {
            assert_eq!(stride(piece, pixel, most), expected, "{piece} {pixel} {most}");
        }
    }

    #[test]
    fn sections_grow_with_their_pixels() {
        assert_eq!(edges(1.25, 1.0, 64), 2);
        assert_eq!([1.3, 3.0, 10.0, 1e6].map(|radius| edges(radius, 1.0, 14)), [8, 13, 14, 14]);
        assert!(edges(100.0, 1.0, 64) > edges(10.0, 1.0, 64));
        assert_eq!(edges(1.0, 0.0, 6), 6, "an eye ball_in_view the yarn");
    }

    #[test]
    fn what_is_beside_the_picture_is_left_out() {
        let frustum = Frustum {
            clip_from_world: Mat4::from_scale(Vec3::splat(0.1)),
            eye: Vec4::Z,
            pixel: 1.0,
        };
        let sides = frustum.sides();
        let ball = |centre| ChunkBounds {
            centre,
            reach: 1.0,
            piece: 1.0,
            pieces: 1,
            look: 0,
            most_stride: 1,
        };
        let cases = [(0.0, true), (10.9, true), (11.1, false), (-10.9, true), (-11.1, false)];
        for (at, expected) in cases {
            assert_eq!(ball_in_view(&sides, &ball(Vec3::X * at)), expected, "{at}");
            assert_eq!(ball_in_view(&sides, &ball(Vec3::Y * at)), expected, "{at}");
        }
    }
}
