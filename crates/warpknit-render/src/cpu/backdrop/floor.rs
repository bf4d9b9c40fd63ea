//! The light of a studio's floor: the shadow of what stands on it.
//!
//! In: a [`Set`] and its [`Cove`]. Out: [`FloorLight`], the fractions of the sun's and of the sky's
//! light in squares of the floor, interpolated between their middles. In pictures of common sizes,
//! squares are about a hundredth of the cloth wide. The sun's penumbra is wider than that but for
//! the last centimetres of a cloth.

use glam::{Vec2, Vec3, Vec3Swizzles};
use rayon::prelude::*;

use super::sun_on_floor;
use super::suns::spread;
use crate::cpu::sample::{SampleDimension, Sampler};
use crate::light::Rig;
use crate::set::{Cove, Set};

/// Pixels of the picture's width for each square across, and limits of their number. More squares
/// resolve the shadow's edge at the cloth's foot, at a cost of as many rays.
const PIXELS: usize = 6;
const SIDES: [usize; 2] = [48, 192];
/// Half the side of the lit square of the floor, in diagonals of the cloth's box.
const REACH: f32 = 1.25;
/// Share of it, at its border, over which shadows fade out.
const FADE: f32 = 0.2;
/// Rays from each square into the sky and to the sun.
const SKY_RAYS: u32 = 64;
const SUN_RAYS: u32 = 16;
/// Rays to the sun where its shadow ends.
const SHADE_RAYS: u32 = 64;
/// Difference of the sun's fractions around a place from which on the place needs rays of its own.
const SHARP: f32 = 0.2;
/// Difference of the sky's fractions in squares that are interpolated from every second one.
const ALIKE: f32 = 0.05;

/// Light in squares of the floor.
#[derive(Debug)]
pub(super) struct FloorLight {
    /// The corner with the smallest x and z, mm.
    corner: Vec2,
    /// Squares across and down.
    side: usize,
    /// Side of a square, mm.
    step: f32,
    /// Of each square the fractions of the sun's and of the sky's light.
    squares: Vec<[f32; 2]>,
}

impl FloorLight {
    /// The light of the floor in a picture of so many pixels across.
    pub(super) fn new(set: &Set, cove: &Cove, rig: &Rig, width: u32) -> Self {
        let side = (width as usize / PIXELS).clamp(SIDES[0], SIDES[1]);
        let step = 2.0 * REACH * cove.size / side as f32;
        let corner = cove.foot.xz() - REACH * cove.size;
        let suns = Sampler::new(0, 0, 0).pairs(SampleDimension::Sun, SHADE_RAYS);
        let place = |[column, row]: [usize; 2]| {
            let at = corner + (Vec2::new(column as f32, row as f32) + 0.5) * step;
            Vec3::new(at.x, cove.foot.y, at.y)
        };
        let sky = |square| set.open_sky(place(square), Vec3::Y, SKY_RAYS);
        let coarse = coarse_squares(side, sky);
        let squares = (0..side * side).into_par_iter().map(|number| {
            let square = [number % side, number / side];
            let sun = |rays| sun_on_floor(set, rig, place(square), &suns, rays);
            let few = sun(SUN_RAYS);
            // More rays where the shadow ends, whose light is smooth then.
            let sun = if few > 0.0 && few < 1.0 { sun(SHADE_RAYS) } else { few };
            [sun, coarse_at(&coarse, side, square).unwrap_or_else(|| sky(square))]
        });
        Self { corner, side, step, squares: squares.collect() }
    }

    /// The fractions at a place of the floor, or above it, and whether the sun's shadow ends there
    /// within a square.
    pub(super) fn at(&self, place: Vec3) -> ([f32; 2], bool) {
        let at = (place.xz() - self.corner) / self.step - 0.5;
        let last = (self.side - 1) as f32;
        let inside = at.min(last - at).min_element();
        if inside <= 0.0 {
            return ([1.0; 2], false);
        }
        let (corner, part) = (at.floor(), at.fract());
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside")]
        let first = corner.y as usize * self.side + corner.x as usize;
        let [top, bottom] = [first, first + self.side]
            .map(|row| mix(self.squares[row], self.squares[row + 1], part.x));
        let fade = (inside / (FADE * last / 2.0)).min(1.0);
        let suns = [first, first + 1, first + self.side, first + self.side + 1]
            .map(|square| self.squares[square][0]);
        // Shadows that fade out have no sharp ends.
        let is_sharp = fade >= 1.0 && spread(suns) > SHARP;
        (mix([1.0; 2], mix(top, bottom, part.y), fade), is_sharp)
    }
}

/// What every second square of every second row has.
fn coarse_squares(side: usize, of: impl Fn([usize; 2]) -> f32 + Sync) -> Vec<f32> {
    let half = side.div_ceil(2);
    let squares = (0..half * half).into_par_iter();
    squares.map(|number| of([number % half * 2, number / half * 2])).collect()
}

/// What a square has as one of the coarse ones, or as the mean of those around it if they are
/// alike.
fn coarse_at(coarse: &[f32], side: usize, [column, row]: [usize; 2]) -> Option<f32> {
    let half = side.div_ceil(2);
    let last = half - 1;
    let (left, right) = (column / 2, column.div_ceil(2).min(last));
    let (above, below) = (row / 2, row.div_ceil(2).min(last));
    let around = [(left, above), (right, above), (left, below), (right, below)]
        .map(|(column, row)| coarse[row * half + column]);
    (spread(around) <= ALIKE).then(|| around.iter().sum::<f32>() / 4.0)
}

fn mix(one: [f32; 2], other: [f32; 2], share: f32) -> [f32; 2] {
    std::array::from_fn(|i| one[i] + (other[i] - one[i]) * share)
}
