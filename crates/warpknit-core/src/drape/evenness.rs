//! Unevenness of real cloth: stitches that are no copies of each other.
//!
//! In: a place on the flat cloth, or a place along a yarn. Out: by how much the cloth is displaced
//! there ([`shift`]), how thick the yarn is ([`thickness`]) and how light ([`shade`]). Everything
//! depends on these places alone, so a part of a cloth looks as it does in the whole, and the same
//! cloth is the same on every machine.
//!
//! Method: sums of value noise over several lengths. Displacements are drawn from one smooth field
//! over the cloth. So yarns that touch move together and keep touching, and measured lengths hardly
//! change. Yarn thickness has about as much power at each length (1/f), as spun yarn has in Uster's
//! spectrograms. Tables hold the fields, so a point costs some nanoseconds.
//!
//! Not promised: the statistics of a given yarn. Measurements are always of regular cloth.

use std::sync::LazyLock;

use glam::DVec2;

use crate::ids::YarnId;
use crate::number::{float, narrow};
use crate::yarn::random::mixed;

/// Whether stitches are copies of each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Evenness {
    /// They are: what is measured.
    #[default]
    Regular,
    /// They vary as in real cloth: what is shown.
    Uneven,
}

/// Wales, and courses, after which displacements repeat. Any part of a picture that shows single
/// stitches is smaller.
const SIDE: usize = 256;
/// Points after which a yarn's thickness repeats, in [`STEP`]s.
const LENGTH: usize = 4096;
/// Points from one entry of the thickness table to the next: most of a stitch. The thinnest places
/// of spun yarn are some millimetres long.
const STEP: i64 = 8;
/// Displacements along the courses, in wales, and along the wales, in courses: the wales and courses
/// of a noise cell, and its largest displacement. Short cells make stitches unlike, and long ones
/// make wales wander. With these, stitches far apart are about as alike as in a scanned jersey
/// (0.6 to 0.8). Twice as much makes cloth that looks badly knitted: likeness 0.3, with patches.
const ALONG_COURSES: [NoiseCell; 3] = [([2, 8], 0.09), ([8, 32], 0.065), ([32, 64], 0.065)];
const ALONG_WALES: [NoiseCell; 3] = [([2, 4], 0.1), ([16, 4], 0.055), ([32, 32], 0.065)];
/// Sum of the amplitudes of the octaves of a yarn's thickness, relative to its mean radius: a
/// coefficient of variation of 10 % of its mass.
const THICKNESS: f32 = 0.16;
/// Lengths of those octaves, in [`STEP`]s.
const OCTAVES: [usize; 5] = [1, 4, 16, 64, 256];
/// Largest difference of a yarn's lightness from the mean. Yarns of one lot differ by less than what
/// makes stripes.
const SHADE: f32 = 0.04;

/// Wales and courses of a noise cell, and the largest displacement.
type NoiseCell = ([usize; 2], f64);

/// Displacement of the cloth at a place of a panel, both in wales and courses.
#[must_use]
pub fn shift(panel: usize, place: DVec2) -> DVec2 {
    static FIELD: LazyLock<Vec<[f32; 2]>> = LazyLock::new(field);
    // Panels differ: each begins at another place of the field.
    let start = hash(0x5eed, panel as u64);
    let corner = place.floor();
    let share = place - corner;
    #[expect(clippy::cast_possible_truncation, reason = "cells are counted in wales and courses")]
    let [wale, course] = [corner.x as i64, corner.y as i64];
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "wraps at SIDE")]
    let at = |right: i64, up: i64| {
        let wale = wale.wrapping_add(right).wrapping_add(start as i64) as usize % SIDE;
        let course = course.wrapping_add(up).wrapping_add((start >> 32) as i64) as usize % SIDE;
        let [x, y] = FIELD[course * SIDE + wale];
        DVec2::new(f64::from(x), f64::from(y))
    };
    let low = at(0, 0).lerp(at(1, 0), share.x);
    low.lerp(at(0, 1).lerp(at(1, 1), share.x), share.y)
}

/// Factor on a yarn's radius at a data point, counted along the yarn.
#[must_use]
pub fn thickness(yarn: YarnId, point: i64) -> f32 {
    static SPECTRUM: LazyLock<Vec<f32>> = LazyLock::new(spectrum);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "wraps at LENGTH")]
    let start = (point.div_euclid(STEP) as u64).wrapping_add(hash(0x7e, yarn.0.into())) as usize;
    #[expect(clippy::cast_precision_loss, reason = "less than STEP")]
    let share = point.rem_euclid(STEP) as f32 / STEP as f32;
    let [low, high] = [start, start.wrapping_add(1)].map(|at| SPECTRUM[at % LENGTH]);
    low + (high - low) * share
}

/// Factor on a yarn's base colour.
#[must_use]
pub fn shade(yarn: YarnId) -> f32 {
    1.0 + SHADE * narrow(uniform(hash(0x5ade, yarn.0.into())))
}

/// The displacements of all wales and courses, course by course.
fn field() -> Vec<[f32; 2]> {
    let mut all = vec![[0.0; 2]; SIDE * SIDE];
    for (axis, octaves) in [ALONG_COURSES, ALONG_WALES].into_iter().enumerate() {
        for (number, (cell, amplitude)) in octaves.into_iter().enumerate() {
            let seed = (axis * octaves.len() + number) as u64;
            for (at, shift) in all.iter_mut().enumerate() {
                let noise = noise([at % SIDE, at / SIDE], cell, [SIDE; 2], seed);
                shift[axis] += narrow(amplitude * noise);
            }
        }
    }
    all
}

/// The factors on the radius along an endless yarn.
fn spectrum() -> Vec<f32> {
    let each = THICKNESS / float(OCTAVES.len());
    let at = |point| {
        let octaves = OCTAVES.iter().zip(0x1f..);
        let noise = octaves.map(|(&cell, seed)| noise([point, 0], [cell, 1], [LENGTH, 1], seed));
        1.0 + each * narrow(noise.sum())
    };
    (0..LENGTH).map(at).collect()
}

/// Value noise between -1 and 1: random numbers at the corners of cells, smoothly interpolated. It
/// repeats after `period`, which is a whole number of cells.
fn noise(at: [usize; 2], cell: [usize; 2], period: [usize; 2], seed: u64) -> f64 {
    let corner = |right: usize, up: usize| {
        let wrapped =
            |axis: usize, next: usize| (at[axis] / cell[axis] + next) % (period[axis] / cell[axis]);
        uniform(hash(seed, (wrapped(0, right) * SIDE + wrapped(1, up)) as u64))
    };
    #[expect(clippy::cast_precision_loss, reason = "smaller than a cell")]
    let [x, y] = [0, 1].map(|axis| smooth((at[axis] % cell[axis]) as f64 / cell[axis] as f64));
    let mix = |low: f64, high: f64, share: f64| low + (high - low) * share;
    mix(mix(corner(0, 0), corner(1, 0), x), mix(corner(0, 1), corner(1, 1), x), y)
}

/// The cubic that goes from 0 to 1 without a slope at either end.
fn smooth(share: f64) -> f64 {
    share * share * (3.0 - 2.0 * share)
}

/// A number from -1 to 1 from a hash.
fn uniform(hash: u64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "the upper 53 bits")]
    let share = (hash >> 11) as f64 / (1_u64 << 53) as f64;
    2.0 * share - 1.0
}

/// A hash of a number, another one for each seed.
fn hash(seed: u64, number: u64) -> u64 {
    // An odd constant spreads neighbouring seeds over all 64 bits.
    mixed(number.wrapping_add(seed.wrapping_mul(0xD1B5_4A32_D192_ED03)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean and standard deviation.
    fn spread(values: impl Iterator<Item = f64>) -> [f64; 2] {
        let values: Vec<_> = values.collect();
        let count = f64::from(crate::ids::index32(values.len()));
        let mean = values.iter().sum::<f64>() / count;
        let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        [mean, (squares / count).sqrt()]
    }

    fn places() -> impl Iterator<Item = DVec2> {
        let along = |at: u16| f64::from(at) * 0.37 - 60.0;
        (0..400).flat_map(move |x| (0..400).map(move |y| DVec2::new(along(x), along(y))))
    }

    #[test]
    fn stitches_move_by_a_twentieth_and_neighbours_move_together() {
        for axis in [0, 1] {
            let [mean, deviation] = spread(places().map(|place| shift(3, place)[axis]));
            assert!(mean.abs() < 0.02 && (0.03..0.08).contains(&deviation), "{mean} {deviation}");
            // The strain of the cloth between two places a radius apart.
            for step in [DVec2::X * 0.1, DVec2::Y * 0.1] {
                let strain = |place| 10.0 * (shift(3, place + step) - shift(3, place)).length();
                let most = places().map(strain).fold(0.0, f64::max);
                assert!(most < 0.25, "{most}");
                assert!(spread(places().map(strain))[0] < 0.08);
            }
        }
    }

    #[test]
    fn the_field_has_no_seam_and_panels_differ() {
        let period = f64::from(crate::ids::index32(SIDE));
        for place in [DVec2::new(255.9, 3.0), DVec2::new(-0.1, 255.999), DVec2::new(-700.3, -0.2)] {
            assert!(shift(0, place).distance(shift(0, place + period)) < 1e-9);
            let moved = shift(0, place + 1e-4).distance(shift(0, place));
            assert!(moved < 1e-3, "{moved}");
            assert!(shift(0, place) != shift(1, place));
        }
    }

    #[test]
    fn yarn_varies_by_some_per_cent_over_short_and_long_stretches() {
        let at = |point: i64| f64::from(thickness(YarnId(7), point));
        let [mean, deviation] = spread((0..30_000).map(at));
        assert!(
            (mean - 1.0).abs() < 0.01 && (0.02..0.08).contains(&deviation),
            "{mean} {deviation}"
        );
        let of_means = |length: i64| {
            let mean = move |start: i64| spread((start..start + length).map(at))[0];
            spread((0..30_000 / length).map(move |run| mean(run * length)))[1]
        };
        // Means over a hundred stitches still differ: the yarn has no single shortest wave.
        assert!(of_means(1000) > 0.25 * deviation, "{}", of_means(1000));
        let step = (-200..200).map(|point| (at(point + 1) - at(point)).abs()).fold(0.0, f64::max);
        assert!(step < 0.02, "{step}");
        assert!(at(100) != f64::from(thickness(YarnId(8), 100)));
    }

    #[test]
    fn yarns_differ_little_in_lightness() {
        let [mean, deviation] = spread((0..2000).map(|yarn| shade(YarnId(yarn)).into()));
        assert!((mean - 1.0).abs() < 0.003 && (0.02..0.03).contains(&deviation));
    }
}
