//! Step 6, seamless: one repeat of the yarn that tiles without a visible seam.
//!
//! In: the flattened strip and the repeat's length. Out: the unit (one repeat, resampled to a whole
//! number of texels), and [`Seam`], which says how its ends were joined and how well.
//!
//! Method: image quilting in one dimension (Efros and Freeman 2001, "Image quilting for texture
//! synthesis and transfer"). The strip behind the unit's end overlaps the unit's beginning. The two
//! are joined along the minimum-error boundary cut, found by dynamic programming, or they are
//! cross-blended, whichever leaves the smaller seam error. The unit may begin at any phase of the
//! repeat; some beginnings are tried, each where the yarn and its copy one repeat on differ least.
//!
//! The seam error compares the mean squared gradient along the yarn in the joint with that of the
//! rest. It is the logarithm of their ratio: 0 where they are equal. A larger gradient is a visible
//! break and counts in full, at the very ends too. A smaller one is a blurred patch and counts
//! half.
//!
//! Cost: some passes over the unit for each beginning that is tried, 16 bytes a texel. Around a
//! tube the unit closes already, since `light` lets the colours of both flanks meet under the fuzz.

use std::ops::RangeInclusive;

use glam::Vec4;
use image::{Rgba, RgbaImage};
use rayon::prelude::*;

use crate::plane::{column_sums, double, float, narrow, side, whole};

/// Lengths of the overlap that are tried, as shares of the unit. A long overlap gives the cut more
/// paths; a short one leaves more of the unit untouched.
const OVERLAPS: [f64; 2] = [0.25, 0.1];
/// Number of phases of the repeat, in each of which the best beginning is tried in full. More cost
/// time, fewer may miss the phase at which the joint is least visible.
const PHASES: usize = 12;
/// About how many rows of the strip are compared in the search for beginnings.
const COMPARED_ROWS: usize = 256;
/// Gradient energy of noise of half a grey level, for each texel. It keeps the ratio of energies
/// finite on a plain yarn.
const LEAST_ENERGY: f32 = 1e-5;
/// Weight of the colour of a transparent texel, so that it has a colour at all.
const LEAST_WEIGHT: f32 = 1e-3;

/// How a unit's ends were joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Along the path on which both sides differ least.
    Cut,
    /// One side fading into the other.
    Blend,
}

/// How a unit's ends were joined, and how well.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seam {
    /// Cut or blend.
    pub method: Method,
    /// The seam error, 0 at best.
    pub error: f32,
    /// The least errors of a cut and of a blend.
    pub errors: [f32; 2],
    /// Mean squared gradient along the yarn in the joint, or at the unit's very ends if it is
    /// larger there, over that of the rest.
    pub energy: f32,
    /// Where on the strip the unit begins, pixels.
    pub start: f64,
    /// Texels of the overlap.
    pub overlap: usize,
}

/// A grid of texels with premultiplied alpha, row by row.
#[derive(Clone)]
struct UnitTexels {
    width: usize,
    height: usize,
    texels: Vec<Vec4>,
}

/// Makes one repeat of a strip tile along the yarn.
pub(super) fn seamless(strip: &RgbaImage, length: f64) -> (RgbaImage, Seam) {
    let columns = strip.width() as usize;
    let width = whole(narrow(length.round())).clamp(1, columns);
    let room = double(columns - 1) - length;
    let differences = differences(strip, length);
    let mut best: Option<Seam> = None;
    let mut errors = [f32::MAX; 2];
    // The strip may be hardly longer than the repeat: the overlap shrinks to what there is.
    for share in OVERLAPS {
        let overlap = whole(narrow((share * length).max(2.0).min(room - 1.0).max(1.0))).min(width);
        for start in beginnings(&differences, length, overlap) {
            let source = sampled(strip, start, length / double(width), width + overlap);
            let gradients = source.gradient_energies();
            for (at, method) in [Method::Cut, Method::Blend].into_iter().enumerate() {
                let [joint, ends] =
                    joint_energies(&source, &gradients, &joint(&source, width, method));
                // ln > 0 is a break, ln < 0 a blur. The ends can't be too smooth: they are a single
                // column.
                let (energy, error) =
                    (joint.max(ends), joint.ln().max(-0.5 * joint.ln()).max(ends.ln()));
                errors[at] = errors[at].min(error);
                if best.is_none_or(|seam| error < seam.error) {
                    best = Some(Seam { method, error, errors, energy, start, overlap });
                }
            }
        }
    }
    let seam = Seam { errors, ..best.expect("there is at least one beginning") };
    // The best unit is made a second time: keeping the best so far would hold two in memory.
    let source = sampled(strip, seam.start, length / double(width), width + seam.overlap);
    (source.picture(width, &joint(&source, width, seam.method)), seam)
}

/// Squared difference between each column of the strip and the column one repeat on, summed over
/// some of the rows.
fn differences(strip: &RgbaImage, length: f64) -> Vec<f64> {
    let rows = strip.height() as usize;
    let end = double(strip.width() as usize - 1);
    let count = whole(narrow(end - length)) + 1;
    column_sums(count, (0..rows).step_by(rows.div_ceil(COMPARED_ROWS)), |x, y| {
        let row = row(strip, y);
        (texel(row, double(x)) - texel(row, (double(x) + length).min(end))).length_squared()
    })
}

/// The beginnings to try: in each phase of the repeat the one whose overlap differs least from the
/// strip one repeat on.
fn beginnings(differences: &[f64], length: f64, overlap: usize) -> Vec<f64> {
    let mut chosen: [Option<(f64, usize)>; PHASES] = [None; PHASES];
    for start in 0..=differences.len().saturating_sub(overlap + 1) {
        let difference: f64 =
            differences[start..(start + overlap).min(differences.len())].iter().sum();
        let phase = (double(start) / length).fract();
        let slot = &mut chosen[whole(narrow(phase * double(PHASES))).min(PHASES - 1)];
        if slot.is_none_or(|(least, _)| difference < least) {
            *slot = Some((difference, start));
        }
    }
    chosen.into_iter().flatten().map(|(_, start)| double(start)).collect()
}

/// The bytes of a row.
fn row(strip: &RgbaImage, y: usize) -> &[u8] {
    let stride = 4 * strip.width() as usize;
    &strip.as_raw()[stride * y..][..stride]
}

/// Premultiplied colour and alpha between two pixels of a row, by linear interpolation.
fn texel(row: &[u8], x: f64) -> Vec4 {
    let last = row.len() / 4 - 1;
    let first = whole(narrow(x)).min(last);
    let [before, after] = [first, (first + 1).min(last)].map(|x| premultiplied(row, x));
    before.lerp(after, narrow(x - double(first)))
}

/// A texel's colour times its alpha, and its alpha. Interpolation and blending need this form: with
/// straight alpha, the colours of transparent texels would bleed into the fuzz. A transparent texel
/// keeps a small weight, so that its colour survives and can be divided out again.
fn premultiplied(row: &[u8], x: usize) -> Vec4 {
    let [r, g, b, a] = [0, 1, 2, 3].map(|channel| f32::from(row[4 * x + channel]) * (1.0 / 255.0));
    Vec4::new(r, g, b, 1.0) * (a + LEAST_WEIGHT) - Vec4::W * LEAST_WEIGHT
}

/// `width` columns of the strip from `start` on, `step` pixels apart.
fn sampled(strip: &RgbaImage, start: f64, step: f64, width: usize) -> UnitTexels {
    let height = strip.height() as usize;
    let mut texels = vec![Vec4::ZERO; width * height];
    texels.par_chunks_mut(width).enumerate().for_each(|(y, texels)| {
        let row = row(strip, y);
        texels
            .iter_mut()
            .enumerate()
            .for_each(|(x, value)| *value = texel(row, start + double(x) * step));
    });
    UnitTexels { width, height, texels }
}

/// The joint: the overlap's columns, from the strip behind the unit's end on the left to the unit's
/// own beginning on the right. Column 0 so continues the unit's last column.
fn joint(source: &UnitTexels, width: usize, method: Method) -> UnitTexels {
    let overlap = source.width - width;
    let path = match method {
        Method::Cut => path(source, width),
        Method::Blend => vec![0; source.height],
    };
    let mut texels = Vec::with_capacity(overlap * source.height);
    for (row, cut) in source.texels.chunks_exact(source.width).zip(path) {
        for x in 0..overlap {
            let own = match method {
                // The texel on the path is the mean of both sides, which hides the cut's stairs.
                Method::Cut => (0.5 + float(x) - float(cut)).clamp(0.0, 1.0),
                Method::Blend => smooth_step(float(x + 1) / float(overlap + 1)),
            };
            texels.push(row[width + x].lerp(row[x], own));
        }
    }
    UnitTexels { width: overlap, height: source.height, texels }
}

fn smooth_step(t: f32) -> f32 {
    t * t * (3.0 - 2.0 * t)
}

/// The minimum-error boundary cut: for each row the column of the overlap where the cut lies.
///
/// Dynamic programming as in Efros and Freeman 2001, section 2.1: `sums[y][x]` is the cost of the
/// cheapest path from the top row to (x, y), E(x, y) = e(x, y) + min E(x - 1..x + 1, y - 1). The
/// path is traced back from the cheapest end in the last row.
fn path(source: &UnitTexels, width: usize) -> Vec<usize> {
    let overlap = source.width - width;
    // Squared difference of the two candidates for a texel: cutting where it is small is invisible.
    let cost = |x: usize, y: usize| {
        let row = &source.texels[y * source.width..];
        (row[x] - row[width + x]).length_squared()
    };
    let mut sums: Vec<Vec<f32>> = vec![(0..overlap).map(|x| cost(x, 0)).collect()];
    for y in 1..source.height {
        let above = &sums[y - 1];
        let mut row = Vec::with_capacity(overlap);
        for x in 0..overlap {
            let least = neighbours(x, overlap).map(|x| above[x]).fold(f32::MAX, f32::min);
            row.push(cost(x, y) + least);
        }
        sums.push(row);
    }
    let mut at = cheapest(&sums[source.height - 1], 0..=overlap - 1);
    let mut path = vec![at];
    for y in (0..source.height - 1).rev() {
        at = cheapest(&sums[y], neighbours(at, overlap));
        path.push(at);
    }
    path.reverse();
    path
}

/// The columns that a path may come from: it moves by at most one column a row.
fn neighbours(x: usize, overlap: usize) -> RangeInclusive<usize> {
    x.saturating_sub(1)..=(x + 1).min(overlap - 1)
}

/// The column with the least sum.
fn cheapest(sums: &[f32], columns: RangeInclusive<usize>) -> usize {
    columns.min_by(|&a, &b| sums[a].total_cmp(&sums[b])).unwrap_or(0)
}

/// Mean squared gradient along the yarn all over the joint, and where one unit meets the next, each
/// over that of the rest. `gradients` are those of the source, which the joint changes only in its
/// own columns.
fn joint_energies(source: &UnitTexels, gradients: &[f64], joint: &UnitTexels) -> [f32; 2] {
    let (overlap, width) = (joint.width, source.width - joint.width);
    let texel = |x: usize, y: usize| if x < overlap { joint.row(y)[x] } else { source.row(y)[x] };
    let is_joint = |x: usize| x <= overlap || x + 1 == width;
    // The gradient of the last column leads to the first one: the unit is periodic.
    let gradient = |x: usize| {
        let pair = |y: usize| f64::from((texel((x + 1) % width, y) - texel(x, y)).length_squared());
        if x < overlap || x + 1 == width {
            (0..source.height).map(pair).sum()
        } else {
            gradients[x]
        }
    };
    let gradients: Vec<f64> = (0..width).into_par_iter().map(gradient).collect();
    let mean = |is_counted: &dyn Fn(usize) -> bool| {
        let own: Vec<f64> = (0..width).filter(|&x| is_counted(x)).map(|x| gradients[x]).collect();
        narrow(own.iter().sum::<f64>() / double(own.len().max(1) * source.height)) + LEAST_ENERGY
    };
    let rest = mean(&|x| !is_joint(x));
    [mean(&is_joint) / rest, mean(&|x| x == 0 || x + 2 >= width) / rest]
}

impl UnitTexels {
    fn row(&self, y: usize) -> &[Vec4] {
        &self.texels[y * self.width..(y + 1) * self.width]
    }

    /// Squared gradient along the yarn from each column to the next, summed over the rows.
    fn gradient_energies(&self) -> Vec<f64> {
        column_sums(self.width - 1, 0..self.height, |x, y| {
            (self.row(y)[x + 1] - self.row(y)[x]).length_squared()
        })
    }

    /// The first `width` columns, with the joint in place of their beginning, with straight alpha.
    fn picture(&self, width: usize, joint: &Self) -> RgbaImage {
        RgbaImage::from_fn(side(width), side(self.height), |x, y| {
            let (x, y) = (x as usize, y as usize);
            let texel = joint.row(y).get(x).unwrap_or(&self.row(y)[x]);
            // Undoes `premultiplied`.
            let color = *texel / (texel.w + LEAST_WEIGHT);
            let [r, g, b, a] =
                [color.x, color.y, color.z, texel.w].map(warpknit_render::tone::byte);
            Rgba([r, g, b, a])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Slanted waves that drift slowly in their length and brightness.
    fn strip() -> RgbaImage {
        RgbaImage::from_fn(240, 30, |x, y| {
            let (x, y) = (f64::from(x), f64::from(y));
            let wave = (TAU * (x / 40.0 + x * x / 200_000.0 + y / 30.0)).sin();
            let grey = crate::plane::byte(narrow(128.0 + (70.0 + x / 10.0) * wave));
            Rgba([grey, grey / 2, 90, if (4.0..26.0).contains(&y) { 255 } else { 0 }])
        })
    }

    #[test]
    fn the_end_leads_into_the_beginning() {
        let (unit, seam) = seamless(&strip(), 40.0);
        assert_eq!(unit.dimensions(), (40, 30));
        assert!(
            seam.error <= seam.errors[0] && seam.error <= seam.errors[1] && seam.energy < 1.2,
            "{seam:?}"
        );
        let jump = |a: u32, b: u32| {
            let off = |y: u32| {
                i32::from(unit.get_pixel(a, y).0[0]) - i32::from(unit.get_pixel(b, y).0[0])
            };
            (4..26).map(|y| off(y).pow(2)).sum::<i32>()
        };
        let most = (10..39).map(|x| jump(x, x + 1)).max().unwrap();
        assert!(jump(39, 0) < 2 * most, "{} {most}", jump(39, 0));
    }

    #[test]
    fn a_cut_goes_around_what_differs() {
        // One texel of the overlap is alike in each row, on a slant.
        let texels = (0..8)
            .flat_map(|y| (0..14).map(move |x| if x >= 8 && x - 8 != (y / 2) { 1.0 } else { 0.0 }))
            .map(Vec4::splat);
        let source = UnitTexels { width: 14, height: 8, texels: texels.collect() };
        assert_eq!(path(&source, 8), [0, 0, 1, 1, 2, 2, 3, 3]);
    }

    #[test]
    fn a_strip_hardly_longer_than_the_repeat_still_gives_a_unit() {
        let (unit, seam) = seamless(&strip(), 236.5);
        assert!((236..=237).contains(&unit.width()) && seam.error.is_finite());
    }
}
