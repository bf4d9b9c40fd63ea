//! Step 4, cut out: the yarn without its ground, soft at the fuzz.
//!
//! In: the strip's grey, B, the ground's side of the threshold. Out: [`CutOut`], alpha a pixel, and
//! the yarn's width.
//!
//! A pixel at the edge shows both yarn and ground: I = a F + (1 - a) G. G is the ground's grey; F
//! is the yarn's beside the pixel, since yarns are round and darken toward their flanks, and plies
//! differ. So F is a mean over what surely is yarn near by, two pixels inside of what differs from
//! the ground at all, and the grey gives the matte a. What is at least half yarn and linked to B is
//! the body; its core, fibres worn off and holes filled, is opaque however dark its grooves are,
//! and measures the width. Fibres whose matte stands out of the ground's noise stay where they are
//! linked to the body, and specks do not. Cost: some sixty passes whatever the yarn's width, 30
//! bytes a pixel.
//!
//! Not promised: parts of a yarn that are as dark as the ground, and open to it.

use rayon::prelude::*;

use super::binarise::Split;
use super::mask::Mask;
use super::orient::FIBRE;
use crate::plane::{Plane, double, float, narrow, percentile, whole};

/// Least matte of a fibre; JPEG rings with about half of it around an edge.
const LEAST_MATTE: f32 = 0.16;
/// What differs from the ground at all, as a share of the yarn's contrast.
const LEAST_CONTRAST: f32 = 0.1;
/// The same two in deviations of the ground's noise, and by how much smoothing weakens that.
const LEAST_DISTANCE: f32 = 4.0;
const SMOOTHING: f32 = 3.0;
/// Radius of the mean that F is, in widths of the yarn.
const NEAR: f64 = 0.06;
/// Half the thickness of a fibre in pixels, at least: blur makes any fibre some pixels thick.
const LEAST_WEAR: usize = 3;
/// Pixels at the body's rim that show ground too, and pixels below them that are asked.
const RIM: usize = 2;
const RING: usize = 2;
/// Share of the yarn's pixels that differ less from the ground than its fibres do.
const FIBRE_SHARE: f32 = 0.8;

/// A yarn without its ground.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CutOut {
    /// Share of each pixel that is yarn.
    pub(super) alpha: Plane,
    /// Mean length of the yarn's cross sections without the fuzz, pixels.
    pub(super) width: f64,
    /// The row in the middle of the yarn.
    pub(super) middle: f64,
}

/// Cuts the yarn out. With `keeps_threshold` its edge is where B says, however bright the yarn is
/// there.
pub(super) fn cut_out(
    grey: &Plane,
    yarn: &Mask,
    split: &Split,
    light_ground: bool,
    keeps_threshold: bool,
) -> CutOut {
    let (ground, spread) = split.ground(light_ground);
    let sign = if light_ground { -1.0 } else { 1.0 };
    let off = grey.map(|value| sign * (value - ground));
    let smooth = off.blurred(1, false);
    let noise = LEAST_DISTANCE * spread / SMOOTHING;
    let contrast = split.contrast().max(1.0);
    let yarn = yarn.largest();
    let full = if keeps_threshold {
        off.map(|_| 2.0 * (split.threshold - ground).abs().max(0.5))
    } else {
        let differs = Mask::from_plane(&smooth, |off| off >= noise.max(LEAST_CONTRAST * contrast))
            .connected_to(&yarn);
        full_yarn(&off, &core(&differs), contrast)
    };
    let matte = |x: usize, y: usize| (off.at(x, y) / full.at(x, y)).clamp(0.0, 1.0);
    let matted = Plane::from_fn(grey.width, grey.height, matte);
    let half = Mask::from_plane(&matted, |matte| matte >= 0.5).connected_to(&yarn);
    let core = core(&half);
    let body = half.or(&core);

    let least = LEAST_MATTE.max(noise / contrast);
    let fibres = Mask::from_plane(&smooth, |off| off >= least * contrast).or(&body);
    let kept = fibres.connected_to(&body).dilated(1);
    let inside = body.eroded(RIM);
    let floor = 0.5 * least;
    let alpha =
        Plane::from_fn(grey.width, grey.height, |x, y| match (inside.at(x, y), kept.at(x, y)) {
            (true, _) => 1.0,
            // The body's edge is where half is yarn: the floor under the noise must not move it.
            (false, true) if matted.at(x, y) < 0.5 => {
                (0.5 * (matted.at(x, y) - floor) / (0.5 - floor)).max(0.0)
            }
            (false, true) => matted.at(x, y),
            (false, false) => 0.0,
        });
    let (width, middle) = extent(&core);
    CutOut { alpha, width, middle }
}

/// The yarn without fibres that stand off it, and without holes: what a fibre and the yarn close in
/// between them is none.
fn core(yarn: &Mask) -> Mask {
    let (width, _) = extent(yarn);
    let times = whole(narrow(FIBRE * width)).max(LEAST_WEAR);
    yarn.largest_opened(times).filled()
}

/// How far a pixel that is yarn alone would be from the ground: by the core's flank near by. Fibres
/// that stand off are lit from all around, as the yarn's brighter parts are.
fn full_yarn(off: &Plane, core: &Mask, contrast: f32) -> Plane {
    let (width, _) = extent(core);
    let radius = whole(narrow(NEAR * width)).max(1);
    let inside = core.eroded(RIM);
    let deep = inside.eroded(RING);
    let near = core.dilated(1);
    let step = (off.values.len() >> 20).max(1);
    let mut yarn: Vec<f32> = core.pixels().step_by(step).map(|at| off.values[at]).collect();
    let bright = percentile(&mut yarn, FIBRE_SHARE).max(contrast);
    let weight = |x: usize, y: usize| if inside.at(x, y) && !deep.at(x, y) { 1.0 } else { 0.0 };
    let weights = Plane::from_fn(off.width, off.height, weight).blurred(radius, false);
    let sums = Plane::from_fn(off.width, off.height, |x, y| weight(x, y) * off.at(x, y))
        .blurred(radius, false);
    Plane::from_fn(off.width, off.height, |x, y| {
        let weight = weights.at(x, y);
        // Below the flank all is yarn, whatever it looks like.
        if deep.at(x, y) {
            return off.at(x, y).max(LEAST_CONTRAST);
        }
        let is_near = near.at(x, y) && weight > 1e-3;
        if is_near { (sums.at(x, y) / weight).max(LEAST_CONTRAST * contrast) } else { bright }
    })
}

/// Mean length of the columns' longest runs, and the row around which they lie. Fibres are thin and
/// seldom part of a run.
fn extent(body: &Mask) -> (f64, f64) {
    let runs: Vec<(f32, f32)> =
        (0..body.width).into_par_iter().filter_map(|x| longest_run(body, x)).collect();
    let mut lengths: Vec<f32> = runs.iter().map(|run| run.0).collect();
    let typical = percentile(&mut lengths, 0.5);
    let usual: Vec<_> = runs.iter().filter(|run| (run.0 / typical - 1.0).abs() < 0.5).collect();
    let count = double(usual.len().max(1));
    let sum =
        |of: &dyn Fn(&(f32, f32)) -> f32| usual.iter().map(|run| f64::from(of(run))).sum::<f64>();
    (sum(&|run| run.0) / count, sum(&|run| run.1) / count)
}

/// Length and middle of a column's longest run.
fn longest_run(body: &Mask, x: usize) -> Option<(f32, f32)> {
    let (mut best, mut length) = (None, 0);
    for y in 0..body.height {
        length = if body.at(x, y) { length + 1 } else { 0 };
        if length > best.map_or(0, |(length, _)| length) {
            best = Some((length, y));
        }
    }
    best.map(|(length, end)| (float(length), float(end) - 0.5 * float(length - 1)))
}

impl CutOut {
    /// Rows of the yarn without its fuzz: the first, and the one after the last.
    pub(super) fn rows(&self) -> std::ops::Range<usize> {
        let half = 0.5 * self.width;
        let row = |place: f64| whole(narrow(place.round())).min(self.alpha.height);
        let first = row(self.middle - half + 0.5).min(self.alpha.height - 1);
        first..row(self.middle + half + 0.5).max(first + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::super::binarise::{binarise, otsu};
    use super::*;

    /// A yarn of 20 rows that is darker at its flanks, with a fibre that leaves it, a speck, a dark
    /// groove and half a pixel of edge.
    fn strip() -> Plane {
        Plane::from_fn(60, 40, |x, y| match (x, y) {
            (30, 5..10) | (10..12, 3..5) => 160.0,
            (40..44, 19..21) => 20.0,
            (_, 10) => 74.0,
            (_, 11..15 | 26..30) => 120.0,
            (_, 15..26) => 220.0,
            _ => 20.0,
        })
    }

    #[test]
    fn the_fibre_stays_the_speck_goes_and_the_groove_is_filled() {
        let grey = strip();
        let threshold = otsu(&grey);
        let split = Split::at(threshold, &grey);
        let cut = cut_out(&grey, &binarise(&grey, threshold, false), &split, false, false);
        assert!(
            (cut.alpha.at(30, 7) - 0.7).abs() < 0.01,
            "the fibre is less bright than the yarn: {}",
            cut.alpha.at(30, 7)
        );
        assert_eq!(cut.alpha.at(10, 3), 0.0, "the speck");
        assert_eq!(cut.alpha.at(42, 19), 1.0, "the groove");
        assert_eq!((cut.alpha.at(5, 2), cut.alpha.at(5, 20)), (0.0, 1.0));
        assert!((0.3..0.7).contains(&cut.alpha.at(5, 10)), "{}", cut.alpha.at(5, 10));
        assert!((19.0..=20.2).contains(&cut.width), "{}", cut.width);
    }

    #[test]
    fn a_light_ground_gives_the_same() {
        let (grey, light) = (strip(), strip().map(|value| 255.0 - value));
        let cut = |grey: &Plane, light_ground| {
            let threshold = otsu(grey);
            cut_out(
                grey,
                &binarise(grey, threshold, light_ground),
                &Split::at(threshold, grey),
                light_ground,
                false,
            )
        };
        let (dark, light) = (cut(&grey, false), cut(&light, true));
        let off = dark
            .alpha
            .values
            .iter()
            .zip(&light.alpha.values)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f32::max);
        assert!(off < 0.01 && dark.width == light.width, "{off}");
    }
}
