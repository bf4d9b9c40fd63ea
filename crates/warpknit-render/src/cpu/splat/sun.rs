//! Shadow map of the sun: the nearest depths on a grid across the sun's rays (Williams 1978,
//! 'Casting curved shadows on curved surfaces').
//!
//! In: pieces, a body's mesh, the picture's screen and the direction to the sun. Out: [`ShadowMap`], 4
//! bytes a texel. It covers what the picture shows. Distant shadows, such as that of one fold on
//! another, have a penumbra as wide as the sun makes it (after Fernando 2005, 'Percentage-closer soft
//! shadows'). The penumbra of one yarn on its neighbour is finer than a pixel and is left out.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::outline::CapsuleOutline;
use super::pieces::{SeenSection, SplatPieces, Viewpoint};
use super::screen::Screen;
use crate::light::SKY_REACH_RADII;
use crate::set::{Mesh, SKIN};

/// Size of a texel, radii of the thinnest yarn. Finer texels resolve what no pixel shows. Coarser
/// ones let light through between yarns, or close the gaps.
const TEXEL_RADII: f32 = 1.4;
/// Lower limit of a texel's size, in pixels of the picture, which cannot show finer shadows.
const TEXEL_PIXELS: f32 = 0.5;
/// Limit of the number of texels: 128 MB. Rounding up may add a little for very thin strips.
const MAX_TEXELS: f32 = 33e6;
/// Depth bias, in texels and in radii of the yarn that is tested. Without it, a yarn would shadow
/// itself because of the map's resolution ('shadow acne'). Too large a bias loses the shadows of
/// yarns that touch.
const BIAS_TEXELS: f32 = 0.5;
const BIAS_RADII: f32 = 0.3;

/// Side of the blocks in which occluders of distant shadows are searched, texels: as wide as the
/// penumbra that a garment's far side casts. Smaller blocks would cut penumbras off; larger ones
/// find occluders that matter less.
const BLOCK: usize = 64;
/// Distance to the occluder from which a shadow gets a penumbra, radii of the yarn that it falls
/// on. A nearer occluder is the cloth itself.
const SOFT_RADII: f32 = 12.0;

/// Depths along the sun's rays.
pub(super) struct ShadowMap {
    across: Vec3,
    up: Vec3,
    toward: Vec3,
    /// Origin of the grid, mm along `across`, `up` and the rays.
    low: Vec3,
    texel: f32,
    size: [u32; 2],
    /// Bits of the nearest depth at each texel's centre.
    nearest: Vec<AtomicU32>,
    /// Nearest depth in each block and in the eight blocks around it.
    blocks: Vec<f32>,
}

impl ShadowMap {
    /// The map for what `screen` shows, where a pixel is `pixel` mm wide.
    pub(super) fn new(pieces: &SplatPieces, screen: &Screen, pixel: f32, toward: Vec3) -> Self {
        let (across, up) = toward.any_orthonormal_pair();
        // The grid covers what is shown. Points outside of the picture may still cast shadows into
        // it, so their depth counts.
        let nothing = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        let boxes = pieces.points().map(|point| {
            let at = Vec3::new(point.dot(across), point.dot(up), -point.dot(toward));
            let [low, high] = if screen.shows(point) { [at, at] } else { nothing };
            [low.with_z(at.z), high]
        });
        let [low, high] = boxes.reduce(|| nothing, |a, b| [a[0].min(b[0]), a[1].max(b[1])]);
        let thinnest = pieces.scene.cloth_radii().0;
        // A piece may be visible although neither of its ends is.
        let margin = pieces.scene.widest_reach() + pieces.longest();
        let extent = (high.truncate() - low.truncate()).max(Vec2::ZERO);
        let finest = (TEXEL_RADII * thinnest).max(TEXEL_PIXELS * pixel);
        // Coarsen the grid where it would exceed the memory limit.
        let texel = finest.max((extent.x * extent.y / MAX_TEXELS).sqrt());
        // Texels and blocks lie the same whatever margin there is, so that yarns out of view do not
        // change how the shadows in it are sampled.
        let block = BLOCK as f32 * texel;
        let corner = ((low.truncate() - margin) / block).floor() * block;
        let extent = high.truncate() + margin - corner;
        let low = corner.extend(low.z - margin);
        let size =
            (extent / texel).ceil().clamp(Vec2::ONE, Vec2::splat(MAX_TEXELS)).as_uvec2().to_array();
        let texels = (0..size[0] as usize * size[1] as usize).into_par_iter();
        let nearest = texels.map(|_| AtomicU32::new(f32::INFINITY.to_bits())).collect();
        let mut map = Self { across, up, toward, low, texel, size, nearest, blocks: Vec::new() };
        pieces.for_each(&map, |ends, silhouette| map.splat(ends, silhouette));
        map.blocks = map.blocks();
        map
    }

    /// Adds the shadow of a body, whose places are in the world, to that of pieces around `centre`.
    /// Its skin casts none.
    pub(super) fn add_body(&mut self, body: &Mesh, centre: Vec3) {
        let away = centre + self.toward * SKIN;
        body.corners().for_each(|corners| {
            self.fill(corners.map(|corner| self.place(corner - away)));
        });
        self.blocks = self.blocks();
    }

    /// Rasterises a triangle into the map.
    fn fill(&self, [a, b, c]: [Vec3; 3]) {
        let limit = Vec2::new(self.size[0] as f32, self.size[1] as f32);
        let clamp = |at: Vec3| at.truncate().clamp(Vec2::ZERO, limit);
        let low = clamp(a.min(b).min(c)).floor().as_uvec2();
        let high = clamp(a.max(b).max(c)).ceil().as_uvec2();
        let (one, other) = (b - a, c - a);
        let area = one.truncate().perp_dot(other.truncate());
        if area == 0.0 {
            return;
        }
        for y in low.y..high.y {
            for x in low.x..high.x {
                let at = Vec2::new(x as f32, y as f32) + 0.5 - a.truncate();
                let u = at.perp_dot(other.truncate()) / area;
                let v = one.truncate().perp_dot(at) / area;
                if u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
                    let depth = (a.z + u * one.z + v * other.z).max(0.0).to_bits();
                    let texel = y as usize * self.size[0] as usize + x as usize;
                    self.nearest[texel].fetch_min(depth, Ordering::Relaxed);
                }
            }
        }
    }

    /// Rasterises one piece into the map.
    fn splat(&self, [one, other]: [Vec3; 2], silhouette: SeenSection) {
        let half_width = silhouette.half_width / self.texel;
        let outline = CapsuleOutline::new([one.truncate(), other.truncate()], half_width);
        for y in outline.rows(&(0..self.size[1])) {
            let row = &self.nearest[y as usize * self.size[0] as usize..][..self.size[0] as usize];
            for first in outline.columns(y, self.size[0]).step_by(4) {
                let middles = Vec4::splat(first as f32) + Vec4::new(0.5, 1.5, 2.5, 3.5);
                let within = outline.within([middles, Vec4::splat(y as f32 + 0.5)]);
                let depths = within.depths([one.z, other.z], silhouette.rise);
                for lane in within.covered() {
                    // The last group of four may extend beyond the row.
                    let Some(texel) = row.get(first as usize + lane) else { break };
                    let depth = depths[lane].max(0.0).to_bits();
                    if depth < texel.load(Ordering::Relaxed) {
                        texel.fetch_min(depth, Ordering::Relaxed);
                    }
                }
            }
        }
    }

    /// Minimum filter over blocks, then over 3 x 3 blocks.
    fn blocks(&self) -> Vec<f32> {
        let [width, height] = self.size.map(|side| side as usize);
        let across = width.div_ceil(BLOCK);
        let down = height.div_ceil(BLOCK);
        let single: Vec<Vec<f32>> =
            self.nearest.par_chunks(width * BLOCK).map(|rows| block_row(rows, width)).collect();
        let mut blocks = Vec::with_capacity(down * across);
        for y in 0..down {
            for x in 0..across {
                let rows = &single[y.saturating_sub(1)..(y + 2).min(down)];
                let columns = x.saturating_sub(1)..(x + 2).min(across);
                let around = rows.iter().flat_map(|row| &row[columns.clone()]);
                blocks.push(around.copied().fold(f32::INFINITY, f32::min));
            }
        }
        blocks
    }

    /// Fraction of the sun's disc whose light reaches a point on a yarn of this radius. `suns` are
    /// unit directions to points that are spread over the disc.
    ///
    /// The distance to the occluder comes from the map, or, where the sun's centre is visible, from
    /// the nearest depth in the blocks around. Each ray is followed for that distance and looked up
    /// there. It counts as blocked if the depth there lies more than halfway to the occluder.
    pub(super) fn lit_share(&self, place: Vec3, radius: f32, suns: &[Vec3]) -> f32 {
        let at = self.place(place);
        let texel = self.texel_at(at.truncate());
        let before = at.z - self.depth(texel);
        // Three cases. The sun's centre is hidden: the occluder is known. It is visible, but
        // something stands far in front nearby: a penumbra is possible. Otherwise the point is lit.
        let away = if before > BIAS_TEXELS * self.texel + BIAS_RADII * radius {
            before
        } else {
            let blocks_across = (self.size[0] as usize).div_ceil(BLOCK);
            let block = texel[1] / BLOCK * blocks_across + texel[0] / BLOCK;
            let around = at.z - self.blocks[block];
            if around <= SOFT_RADII * radius {
                return 1.0;
            }
            around
        };
        let lit = suns.iter().filter(|toward| {
            // Offset per unit of depth of this ray from the ray to the sun's centre.
            let slope =
                Vec2::new(toward.dot(self.across), toward.dot(self.up)) / toward.dot(self.toward);
            let there = self.texel_at(at.truncate() + slope * (away / self.texel));
            at.z - self.depth(there) <= 0.5 * away
        });
        lit.count() as f32 / suns.len() as f32
    }

    /// Whether the sun's centre lights a point on a yarn of this radius. `None` where the shadow is
    /// that of cloth farther away than what is traced around a place.
    pub(super) fn lit_by_near(&self, place: Vec3, radius: f32) -> Option<bool> {
        let at = self.place(place);
        let before = at.z - self.depth(self.texel_at(at.truncate()));
        (before <= SKY_REACH_RADII * radius)
            .then_some(before <= BIAS_TEXELS * self.texel + BIAS_RADII * radius)
    }

    /// The texel at a place of the grid, clamped to its border.
    fn texel_at(&self, at: Vec2) -> [usize; 2] {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates, then is clamped to the grid"
        )]
        let texel = [(at.x as u32).min(self.size[0] - 1), (at.y as u32).min(self.size[1] - 1)];
        texel.map(|index| index as usize)
    }

    /// The nearest depth in a texel.
    fn depth(&self, [x, y]: [usize; 2]) -> f32 {
        f32::from_bits(self.nearest[y * self.size[0] as usize + x].load(Ordering::Relaxed))
    }

    /// Column and row in texels, and depth in mm.
    fn place(&self, point: Vec3) -> Vec3 {
        let from = Vec3::new(point.dot(self.across), point.dot(self.up), -point.dot(self.toward))
            - self.low;
        (from.truncate() / self.texel).extend(from.z)
    }
}

impl Viewpoint for ShadowMap {
    fn project(&self, point: Vec3) -> Option<Vec3> {
        Some(self.place(point))
    }

    fn toward_viewer(&self, _: Vec3) -> Vec3 {
        self.toward
    }
}

/// Nearest depth in each block of a row of blocks. `texels` are its rows of texels.
fn block_row(texels: &[AtomicU32], width: usize) -> Vec<f32> {
    let mut blocks = vec![f32::INFINITY; width.div_ceil(BLOCK)];
    for row in texels.chunks(width) {
        for (block, texels) in blocks.iter_mut().zip(row.chunks(BLOCK)) {
            *block = texels
                .iter()
                .map(|texel| f32::from_bits(texel.load(Ordering::Relaxed)))
                .fold(*block, f32::min);
        }
    }
    blocks
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Scene, YarnLook};
    use crate::{Camera, RenderOptions, View};

    #[test]
    fn a_sheet_shadows_what_lies_behind_it_softly_at_its_edge() {
        let mut scene =
            Scene { looks: vec![YarnLook::plain(Vec3::ONE, 0.5, 0.2)], ..Scene::default() };
        for (z, half) in [(0.0, 30.0), (20.0, 10.0)] {
            for line in 0_u16..150 {
                let y = (f32::from(line) / 75.0 - 1.0) * half;
                scene.push_strand(
                    (0_u8..=60).map(|i| Vec3::new((f32::from(i) / 30.0 - 1.0) * half, y, z)),
                    0,
                );
            }
        }
        let options = RenderOptions { width: 60, height: 60, ..RenderOptions::default() };
        let camera = Camera::view(View::Front, &scene.positions, 0.3, 1.0, 1.0);
        let bounds = scene.bounds().unwrap();
        let screen = Screen::new(&bounds, &camera, &options, 1);
        let pieces = SplatPieces::new(&scene, bounds.centre());
        let sun = ShadowMap::new(&pieces, &screen, 1.0, Vec3::Z);
        // Through a sun a tenth wide: shares of its light at places of the lower sheet, on top of
        // its yarns.
        let lit = |x: f32, z: f32| {
            let place = Vec3::new(x, 0.0, z + 0.2) - bounds.centre();
            let suns: [Vec3; 41] = std::array::from_fn(|i| {
                Vec3::new((i as f32 / 20.0 - 1.0) * 0.1, 0.0, 1.0).normalize()
            });
            (sun.lit_share(place, 0.2, &suns) * 41.0).round()
        };
        assert_eq!(
            [lit(0.0, 0.0), lit(0.0, 20.0), lit(25.0, 0.0), lit(-25.0, 0.0)],
            [0.0, 41.0, 41.0, 41.0]
        );
        let edge = [8.5, 9.5, 10.5, 11.5].map(|x| lit(x, 0.0));
        assert!(
            edge.is_sorted()
                && edge[0] > 0.0
                && edge[3] < 41.0
                && (10.0..31.0).contains(&edge[1].midpoint(edge[2])),
            "{edge:?}"
        );
    }
}
