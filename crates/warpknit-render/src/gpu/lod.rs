//! What of the yarns a pass draws, and how finely.
//!
//! In: chunks with their extents, and a [`Sight`]: from where they are seen and how large a pixel
//! is there. Out: [`Plan`], instances sorted into batches of one stride, one section and one set of
//! maps. Chunks out of view are left out. With level of detail no step is shorter than a pixel as
//! long as doubling it keeps it so, a section has no more edges than its radius in pixels can show,
//! and a yarn of few pixels is a strip that faces the eye: its shader gives it back its roundness
//! for a fifth of the triangles.

use std::collections::BTreeMap;
use std::f32::consts::PI;

use glam::{Mat4, Vec3, Vec4, Vec4Swizzles};

use super::data::{PARTS, STEPS};
use super::pages::{Extent, Page};
use crate::Options;
use crate::scene::{Scene, Shape};
use warpknit_core::ids::index32;

/// Radius up to which a tube is drawn as a strip, pixels.
const STRIP_PIXELS: f32 = 1.25;
/// How far a section's chord may leave its circle, pixels.
const SECTION_ERROR: f32 = 0.1;
/// Longest step, points: an instance then takes a whole chunk.
const MOST_STRIDE: u32 = PARTS;

/// From where yarns are seen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    pub(super) clip_from_world: Mat4,
    /// As `eye` of the shaders' `View`.
    pub(super) eye: Vec4,
    /// Size of a pixel at distance 1, or at every distance for an eye infinitely far, mm.
    pub(super) pixel: f32,
}

impl Sight {
    /// Size of a pixel on the nearest point of a ball.
    fn pixel_on(&self, extent: &Extent) -> f32 {
        if self.eye.w == 0.0 {
            return self.pixel;
        }
        self.pixel * (self.eye.xyz().distance(extent.centre) - extent.reach).max(0.0)
    }

    /// The four planes at the picture's sides, inside where positive.
    fn sides(&self) -> [Vec4; 4] {
        let m = self.clip_from_world;
        let sides =
            [m.row(3) + m.row(0), m.row(3) - m.row(0), m.row(3) + m.row(1), m.row(3) - m.row(1)];
        sides.map(|side| side / side.xyz().length().max(f32::MIN_POSITIVE))
    }
}

/// Whether a ball reaches into all half-spaces.
fn inside(sides: &[Vec4; 4], centre: Vec3, reach: f32) -> bool {
    sides.iter().all(|side| side.dot(centre.extend(1.0)) > -reach)
}

/// The chunks that are in view.
pub(super) fn seen<'a>(pages: &'a [Page], sight: &Sight) -> impl Iterator<Item = &'a Extent> {
    let sides = sight.sides();
    pages
        .iter()
        .flat_map(|page| &page.extents)
        .filter(move |extent| inside(&sides, extent.centre, extent.reach))
}

/// What draws of one kind have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Kind {
    /// Edges of the section; 2 for what is flat.
    pub(super) edges: u32,
    pub(super) maps: Option<u16>,
    /// Points a step.
    pub(super) stride: u32,
}

/// Instances of one kind on one page.
#[derive(Clone, Copy, Debug)]
pub(super) struct Batch {
    pub(super) page: usize,
    pub(super) kind: Kind,
    /// Its first instance in the page's parts.
    pub(super) first: u32,
    pub(super) count: u32,
}

/// All that a pass draws.
#[derive(Debug, Default)]
pub(super) struct Plan {
    /// For each page, chunk times [`PARTS`] plus the part, batch after batch.
    pub(super) parts: Vec<Vec<u32>>,
    /// Grouped by page.
    pub(super) batches: Vec<Batch>,
}

impl Plan {
    /// Plans a pass.
    pub(super) fn of(kinds: &Kinds, pages: &[Page], sight: &Sight, options: &Options) -> Self {
        let sides = sight.sides();
        let mut plan = Self::default();
        for (number, page) in pages.iter().enumerate() {
            let mut sorted: BTreeMap<Kind, Vec<u32>> = BTreeMap::new();
            for (chunk, extent) in (0..).zip(&page.extents) {
                if !inside(&sides, extent.centre, extent.reach) {
                    continue;
                }
                let kind = kinds.kind(extent, sight.pixel_on(extent), options);
                let parts = extent.pieces.div_ceil(STEPS * kind.stride);
                sorted.entry(kind).or_default().extend((0..parts).map(|part| chunk * PARTS + part));
            }
            let mut all = Vec::new();
            for (kind, parts) in sorted {
                let (first, count) = (index32(all.len()), index32(parts.len()));
                plan.batches.push(Batch { page: number, kind, first, count });
                all.extend(parts);
            }
            plan.parts.push(all);
        }
        plan
    }
}

/// What of a scene decides how its chunks are drawn.
#[derive(Clone, Debug)]
pub(super) struct Kinds {
    shape: Shape,
    /// Radius and maps of each look.
    looks: Vec<(f32, Option<u16>)>,
}

impl Kinds {
    pub(super) fn of(scene: &Scene) -> Self {
        Self {
            shape: scene.shape,
            looks: scene
                .looks
                .iter()
                .map(|look| (look.radius, scene.maps_of(look).and(look.maps)))
                .collect(),
        }
    }

    fn kind(&self, extent: &Extent, pixel: f32, options: &Options) -> Kind {
        let (radius, maps) = self.looks[usize::from(extent.look)];
        let edges = match self.shape {
            Shape::Ribbon => 2,
            Shape::Tube if options.lod => edges(radius, pixel, options.sr),
            Shape::Tube => options.sr,
        };
        let stride = if options.lod { stride(extent.piece, pixel) } else { 1 };
        Kind { edges, maps, stride }
    }
}

/// The least power of two that makes a step as long as a pixel.
fn stride(piece: f32, pixel: f32) -> u32 {
    let mut stride = 1;
    let mut step = piece;
    while step < pixel && stride < MOST_STRIDE {
        stride *= 2;
        step *= 2.0;
    }
    stride
}

/// Edges of a section, `sr` at most; 2 for a strip.
fn edges(radius: f32, pixel: f32, sr: u32) -> u32 {
    let pixels = radius / pixel.max(f32::MIN_POSITIVE);
    if pixels <= STRIP_PIXELS {
        return 2;
    }
    let half_angle = (1.0 - SECTION_ERROR / pixels).acos();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates, and is held to `sr`"
    )]
    let shown = (PI / half_angle).ceil() as u32;
    shown.clamp(3, sr)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_step_is_shorter_than_a_pixel_and_none_is_twice_as_long_as_need_be() {
        for (piece, pixel, expected) in [
            (1.0, 0.5, 1),
            (1.0, 1.0, 1),
            (1.0, 1.1, 2),
            (1.0, 3.9, 4),
            (1.0, 4.1, 8),
            (0.0, 1.0, 32),
        ] {
            assert_eq!(stride(piece, pixel), expected, "{piece} {pixel}");
        }
    }

    #[test]
    fn sections_grow_with_their_pixels() {
        assert_eq!(edges(1.25, 1.0, 64), 2);
        assert_eq!([1.3, 3.0, 10.0, 1e6].map(|radius| edges(radius, 1.0, 14)), [8, 13, 14, 14]);
        assert!(edges(100.0, 1.0, 64) > edges(10.0, 1.0, 64));
        assert_eq!(edges(1.0, 0.0, 6), 6, "an eye inside the yarn");
    }

    #[test]
    fn what_is_beside_the_picture_is_left_out() {
        let sight =
            Sight { clip_from_world: Mat4::from_scale(Vec3::splat(0.1)), eye: Vec4::Z, pixel: 1.0 };
        let sides = sight.sides();
        let cases = [(0.0, true), (10.9, true), (11.1, false), (-10.9, true), (-11.1, false)];
        for (at, expected) in cases {
            assert_eq!(inside(&sides, Vec3::X * at, 1.0), expected, "{at}");
            assert_eq!(inside(&sides, Vec3::Y * at, 1.0), expected, "{at}");
        }
    }
}
