//! Frames: where wales and courses may lie in a photo.
//!
//! In: a photo's light without slow shading. Out: [`Frame`]s, the vectors from wale to wale and from
//! course to course.
//!
//! Method: peaks of the power spectrum; lattices of two waves that explain most of their power;
//! all bases of these lattices that may be a wale and a course of some repeat (unimodular changes of
//! basis). A cloth rarely repeats after one wale and one course, so each basis is tried as that of
//! each common repeat. A photo shows a long cell a few times only, and its waves tell its vectors to some
//! hundredths: such a lattice is moved until its copies have most in common.
//!
//! Cost: one Fourier transform of a megapixel and some thousand bases; for the lattice of a long cell some
//! hundred looks at 100 000 pixels at most.
//!
//! Not promised: that the right frame is the first. Sketches decide among them.

use glam::{DMat2, DVec2};

use crate::capture::lattice::Lattice;
use crate::fourier::Fourier;
use crate::plane::{Plane, double, narrow, whole, whole_f64};

/// Vectors of a wale (x) and of a course (y, downward), pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame(pub(super) DMat2);

/// A wave of the photo: cycles a pixel, and its modulus.
#[derive(Clone, Copy, Debug)]
struct PhotoWave {
    vector: DVec2,
    strength: f64,
}

/// Side of the spectrum. A photo of half of it has its peaks between two of its lines at most.
const SIDE: usize = 1024;
/// Waves that are looked at.
const MOST_WAVES: usize = 26;
/// The weakest wave, as a share of the strongest.
const WEAKEST: f64 = 0.02;
/// Longest and shortest waves of a lattice's basis, pixels.
const WAVELENGTHS: [f64; 2] = [4.0, 140.0];
/// How far a wave may lie from a point of the lattice, in its vectors.
const NEAR: f64 = 0.12;
/// Lattices that are looked at, and those with frames that are kept.
const MOST_LATTICES: usize = 24;
/// Pairs of waves that are looked at for them, the best first.
const MOST_BASES: usize = 3000;
const MOST_FRAMED: usize = 5;
/// What a coarser lattice of waves is better, an e-fold of its cell: it explains fewer waves by
/// chance.
const COARSER: f64 = 0.06;
/// Wale spacings that are looked for, pixels.
const WALES: [f64; 2] = [7.0, 64.0];
/// Course spacings, in wale spacings.
const COURSES: [f64; 2] = [0.38, 1.3];
/// Turns of the wales against the photo's rows, and of the courses against its columns, as slopes.
const TURNS: [f64; 2] = [0.2, 0.25];
/// Entries of the changes of basis.
const REACH: i32 = 3;
/// Repeats that a lattice may stand for: two vectors in wales and courses.
const REPEATS: [[f64; 4]; 19] = [
    [1.0, 0.0, 0.0, 1.0],
    [1.0, 0.0, 0.0, 2.0],
    [1.0, 0.0, 0.5, 1.0],
    [2.0, 0.0, 0.0, 1.0],
    [2.0, 0.0, 0.0, 2.0],
    [2.0, 0.0, 1.0, 1.0],
    [2.0, 0.0, 1.0, 2.0],
    [2.0, 0.0, 1.0, 3.0],
    [2.0, 0.0, 1.0, 5.0],
    [1.0, 0.0, 0.0, 3.0],
    [1.0, 0.0, 0.0, 4.0],
    [1.0, 0.0, 0.0, 6.0],
    [1.0, 0.0, 0.0, 8.0],
    [1.0, 0.0, 0.0, 10.0],
    [1.0, 0.0, 0.5, 3.0],
    [2.0, 0.0, 0.0, 4.0],
    [2.0, 0.0, 0.0, 6.0],
    [4.0, 0.0, 0.0, 1.0],
    [4.0, 0.0, 0.0, 2.0],
];
/// A cell is long if it is longer than this share of the photo's shorter side. Registration, whose window is
/// 0.11 of that side, can't tell the waves of such a cell from each other: it took a tulle of 0.4 for a pillar.
const LONG: f64 = 0.25;
/// Steps by which the lattice of a long cell is moved, pixels at the photo's border, one after the other.
const SHARPENING_STEPS: [f64; 4] = [3.0, 1.5, 0.75, 0.4];
/// Moves by a step of one size, at most.
const MOST_MOVES: usize = 6;
/// Size of the bins in which copies of a cell are compared, pixels, and how many of them there are along a
/// vector. With fewer than three, the share that copies have in common depends on where bins begin.
const BIN: f64 = 2.5;
const BINS: [usize; 2] = [4, 64];
/// How many of a photo's pixels are compared, at most.
const MOST_COMPARED: f64 = 1e5;
/// Frames count as one if no entry differs by more than this share of the largest.
const SAME: f64 = 0.04;

impl Frame {
    /// Wale spacing, pixels.
    pub(super) fn wale(self) -> f64 {
        self.0.x_axis.length()
    }

    /// Course spacing, pixels: the area of a stitch over its width.
    pub(super) fn course(self) -> f64 {
        self.0.determinant().abs() / self.wale()
    }

    fn is_like(self, other: Self) -> bool {
        let entries = |frame: Self| frame.0.to_cols_array();
        let largest = entries(other).into_iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        entries(self).into_iter().zip(entries(other)).all(|(a, b)| (a - b).abs() < SAME * largest)
    }
}

/// Lattices of a photo, the likeliest first, with the frames that only they have.
pub(super) fn frames(even: &Plane) -> Vec<(DMat2, Vec<Frame>)> {
    let mut found: Vec<Frame> = Vec::new();
    let mut all = Vec::new();
    let waves = waves(even);
    for lattice in lattices(&waves) {
        if frames_of(lattice, &found).is_empty() {
            continue;
        }
        let lattice = if is_long(lattice, even) { sharpened(lattice, even) } else { lattice };
        let own = frames_of(lattice, &found);
        if !own.is_empty() {
            found.extend_from_slice(&own);
            all.push((lattice, own));
        }
        if all.len() == MOST_FRAMED {
            break;
        }
    }
    all
}

/// The likely frames of a lattice that are not known yet.
fn frames_of(lattice: DMat2, known: &[Frame]) -> Vec<Frame> {
    let mut found: Vec<Frame> = Vec::new();
    for repeat in REPEATS {
        let repeat = DMat2::from_cols_array(&repeat).inverse();
        for change in changes() {
            let frame = Frame(lattice * change * repeat);
            let mut others = known.iter().chain(&found);
            if frame.is_likely() && !others.any(|other| frame.is_like(*other)) {
                found.push(frame);
            }
        }
    }
    found
}

/// Whether a lattice's cell is long for a photo.
pub(super) fn is_long(lattice: DMat2, photo: &Plane) -> bool {
    let cell = Lattice::reduced(lattice.x_axis, lattice.y_axis);
    cell.longer() > LONG * double(photo.width.min(photo.height))
}

/// The lattice near one whose copies have most in common in a photo.
fn sharpened(lattice: DMat2, photo: &Plane) -> DMat2 {
    let half = 0.5 * double(photo.width.max(photo.height));
    let vectors = [lattice.x_axis, lattice.y_axis];
    let bins = vectors.map(|vector| whole(narrow(vector.length() / BIN)).clamp(BINS[0], BINS[1]));
    let mut best = (in_common(lattice, bins, photo), lattice);
    for off in SHARPENING_STEPS {
        // A vector is changed so far that its copies at the photo's border move by so many pixels.
        let [first, second] = vectors.map(|vector| off * vector.length() / half);
        for _ in 0..MOST_MOVES {
            let before = best;
            for by in [DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::NEG_Y] {
                for change in [
                    DMat2::from_cols(first * by, DVec2::ZERO),
                    DMat2::from_cols(DVec2::ZERO, second * by),
                ] {
                    let changed = before.1 + change;
                    let share = in_common(changed, bins, photo);
                    if share > best.0 {
                        best = (share, changed);
                    }
                }
            }
            if best == before {
                break;
            }
        }
    }
    best.1
}

/// The share of a photo's squares that the mean of all copies of a lattice's cell explains, of so many
/// bins along its vectors.
fn in_common(lattice: DMat2, [across, down]: [usize; 2], photo: &Plane) -> f64 {
    let inverse = lattice.inverse();
    let mut bins = vec![[0.0_f32; 2]; across * down];
    let skip = whole(narrow((double(photo.values.len()) / MOST_COMPARED).sqrt().ceil())).max(1);
    let mut all = 0.0;
    for y in (0..photo.height).step_by(skip) {
        for x in (0..photo.width).step_by(skip) {
            let at = inverse * DVec2::new(double(x), double(y));
            let [column, row] = (at - at.floor()).to_array();
            let column = whole_f64(column * double(across)).min(across - 1);
            let row = whole_f64(row * double(down)).min(down - 1);
            let value = photo.at(x, y);
            let bin = &mut bins[row * across + column];
            bin[0] += value;
            bin[1] += 1.0;
            all += value * value;
        }
    }
    let common: f32 = bins.iter().map(|[sum, count]| sum * sum / count.max(1.0)).sum();
    f64::from(common / all.max(f32::MIN_POSITIVE))
}

impl Frame {
    /// Whether wales and courses are of a likely size and direction.
    fn is_likely(self) -> bool {
        let [wale, course] = [self.0.x_axis, self.0.y_axis];
        let (width, height) = (wale.length(), course.length());
        wale.x > 0.0
            && course.y > 0.0
            && (WALES[0]..WALES[1]).contains(&width)
            && (COURSES[0]..COURSES[1]).contains(&(height / width))
            && wale.y.abs() < TURNS[0] * width
            && course.x.abs() < TURNS[1] * height
    }
}

/// Changes of basis: whole matrices of determinant 1 or -1.
fn changes() -> impl Iterator<Item = DMat2> {
    let range = || -REACH..=REACH;
    range().flat_map(move |a| {
        range().flat_map(move |b| {
            range().flat_map(move |c| {
                range()
                    .filter(move |d| (a * d - b * c).abs() == 1)
                    .map(move |d| DMat2::from_cols_array(&[a, b, c, d].map(f64::from)))
            })
        })
    })
}

/// The strongest waves of a photo.
fn waves(even: &Plane) -> Vec<PhotoWave> {
    let fourier = Fourier::new(SIDE, SIDE);
    let mut grid = vec![0.0_f32; SIDE * SIDE];
    let window = |at: usize, side: usize| {
        0.5 - 0.5 * (std::f64::consts::TAU * (double(at) + 0.5) / double(side)).cos()
    };
    let across: Vec<f32> = (0..even.width).map(|x| narrow(window(x, even.width))).collect();
    for (y, row) in grid.chunks_exact_mut(SIDE).take(even.height).enumerate() {
        let down = narrow(window(y, even.height));
        for ((value, own), weight) in row.iter_mut().zip(even.row(y)).zip(&across) {
            *value = own * weight * down;
        }
    }
    let spectrum = fourier.spectrum(&grid);
    drop(grid);
    // Half of the plane; low frequencies, which shading fills, are left out.
    let side = even.width.min(even.height);
    let reach = whole(narrow(2.1 * double(SIDE) / double(side))).max(2);
    let half = SIDE / 2;
    let modulus = |x: usize, y: usize| -> f32 { spectrum[(y % SIDE) * SIDE + x % SIDE].norm() };
    let lowest = double(SIDE) / WAVELENGTHS[1];
    let highest = double(SIDE) * 0.45;
    let mut found: Vec<PhotoWave> = Vec::new();
    for y in 0..=half {
        for x in 0..SIDE {
            let signed =
                DVec2::new(if x < half { double(x) } else { double(x) - double(SIDE) }, double(y));
            if signed.length() < lowest
                || signed.max_element() > highest
                || signed.x < -highest
                || y == 0 && signed.x < 0.0
            {
                continue;
            }
            let own = modulus(x, y);
            let is_top = (0..=2 * reach).all(|down| {
                (0..=2 * reach)
                    .all(|right| modulus(x + SIDE + right - reach, y + SIDE + down - reach) <= own)
            });
            if is_top {
                let before = |dx: usize, dy: usize| modulus(x + SIDE - dx, y + SIDE - dy);
                let off = DVec2::new(
                    parabola_top(before(1, 0), own, modulus(x + 1, y)),
                    parabola_top(before(0, 1), own, modulus(x, y + 1)),
                );
                found.push(PhotoWave {
                    vector: (signed + off) / double(SIDE),
                    strength: own.into(),
                });
            }
        }
    }
    found.sort_by(|a, b| b.strength.total_cmp(&a.strength));
    let strongest = found.first().map_or(0.0, |wave| wave.strength);
    found.retain(|wave| wave.strength > WEAKEST * strongest);
    found.truncate(MOST_WAVES);
    found
}

/// Where the parabola through three values has its top, from the middle one.
fn parabola_top(before: f32, middle: f32, after: f32) -> f64 {
    let bend = before - 2.0 * middle + after;
    if bend < 0.0 { f64::from(0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 }
}

/// Direct lattices whose waves these are, the likeliest first.
fn lattices(waves: &[PhotoWave]) -> Vec<DMat2> {
    let total: f64 = waves.iter().map(|wave| wave.strength).sum();
    let mut basis: Vec<DVec2> = waves.iter().map(|wave| wave.vector).collect();
    for (at, wave) in waves.iter().enumerate().take(12) {
        basis.extend(waves[..at].iter().map(|other| wave.vector - other.vector));
        basis.extend(waves[..at].iter().map(|other| wave.vector + other.vector));
    }
    let frequencies = WAVELENGTHS[1].recip()..WAVELENGTHS[0].recip();
    basis.retain(|vector| frequencies.contains(&vector.length()));
    let mut scored: Vec<(f64, DMat2)> = Vec::new();
    for (at, &first) in basis.iter().enumerate() {
        for &second in &basis[..at] {
            let matrix = DMat2::from_cols(first, second);
            let area = matrix.determinant().abs();
            if area < 6e-5 {
                continue;
            }
            let inverse = matrix.inverse();
            let covered: f64 = waves
                .iter()
                .filter(|wave| on(inverse * wave.vector))
                .map(|wave| wave.strength / total)
                .sum();
            scored.push((covered + COARSER * (area / 1e-3).ln(), matrix));
        }
    }
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut found: Vec<DMat2> = Vec::new();
    for (_, matrix) in scored.into_iter().take(MOST_BASES) {
        let direct = fitted(matrix, waves).inverse().transpose();
        // Changes of basis have small entries, so they start from the shortest vectors.
        let direct = Lattice::reduced(direct.x_axis, direct.y_axis).matrix();
        let is_same = |other: &DMat2| {
            let change = other.inverse() * direct;
            let near = change
                .to_cols_array()
                .into_iter()
                .all(|entry| (entry - entry.round()).abs() < 0.05);
            near && (change.determinant().abs() - 1.0).abs() < 0.05
        };
        if direct.is_finite() && !found.iter().any(is_same) {
            found.push(direct);
            if found.len() == MOST_LATTICES {
                break;
            }
        }
    }
    found
}

/// Whether counts of both vectors are nearly whole.
fn on(count: DVec2) -> bool {
    (count - count.round()).abs().max_element() < NEAR
}

/// The waves' basis that fits those near it best, by weighted least squares.
fn fitted(matrix: DMat2, waves: &[PhotoWave]) -> DMat2 {
    let inverse = matrix.inverse();
    let (mut normal, mut right) = (DMat2::ZERO, DMat2::ZERO);
    for wave in waves {
        let count = inverse * wave.vector;
        if on(count) {
            let count = count.round() * wave.strength;
            let vector = wave.vector * wave.strength;
            normal += DMat2::from_cols(count * count.x, count * count.y);
            // Sum of vector times count, transposed.
            right += DMat2::from_cols(vector * count.x, vector * count.y);
        }
    }
    if normal.determinant().abs() < 1e-9 * normal.x_axis.x.max(normal.y_axis.y).powi(2) {
        return matrix;
    }
    right * normal.inverse()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_cell_is_sharpened() {
        let truth = DMat2::from_cols_array(&[17.0, 1.0, -9.0, 120.5]);
        let inverse = truth.inverse();
        let cloth = Plane::from_fn(300, 300, |x, y| {
            let at = std::f64::consts::TAU * (inverse * DVec2::new(double(x), double(y)));
            narrow(at.x.cos() + (at.x + at.y).sin() + (10.0 * at.y).cos() + (3.0 * at.y).sin())
        });
        let before = DMat2::from_cols_array(&[17.4, 0.95, -8.0, 118.0]);
        // Where the photo ends, by how many pixels copies are off.
        let off = |found: DVec2, vector: DVec2| 150.0 * found.distance(vector) / vector.length();
        let after = sharpened(before, &cloth);
        assert!(is_long(truth, &cloth));
        for (before, after, truth) in [
            (before.x_axis, after.x_axis, truth.x_axis),
            (before.y_axis, after.y_axis, truth.y_axis),
        ] {
            assert!(off(before, truth) > 3.0 && off(after, truth) < 1.0, "{after} {truth}");
        }
    }
}
