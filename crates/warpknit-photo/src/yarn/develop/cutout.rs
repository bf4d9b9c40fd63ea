//! Step 4, cut out: an alpha channel for the yarn, soft at its fuzz.
//!
//! In: the strip's grey, the binary mask of step 3, the classes of its threshold. Out: [`CutOut`]:
//! the alpha of each pixel, and the yarn's width.
//!
//! Method: matting with the compositing equation `I = a F + (1 - a) G` (Porter and Duff 1984,
//! "Compositing digital images"). A pixel at the edge shows both yarn (F) and ground (G), so its
//! alpha is `a = (I - G) / (F - G)`. G is the ground's median grey. F is estimated beside the
//! pixel, since yarns are round and darken toward their flanks, and since plies differ: it is the
//! mean over nearby pixels that are surely yarn, two pixels inside of everything that differs from
//! the ground.
//!
//! The body of the yarn is what is at least half yarn and is connected to the mask of step 3. Its
//! core is the body after an opening that removes the fibres, with its holes filled. The core is
//! opaque however dark its grooves are, and it gives the width. Fibres whose matte stands out of
//! the ground's noise stay where they are connected to the body. Specks do not.
//!
//! Cost: some sixty passes whatever the yarn's width, 30 bytes a pixel.
//!
//! Not promised: parts of a yarn that are as dark as the ground and not enclosed by yarn are lost.

use rayon::prelude::*;

use super::binarise::Split;
use super::mask::Mask;
use super::orient::FIBRE;
use crate::plane::{Plane, double, float, narrow, percentile, whole};

/// Least matte of a fibre. JPEG's ringing around an edge reaches about half of it, so a lower limit
/// would keep a halo; a higher one loses fine fibres.
const LEAST_MATTE: f32 = 0.16;
/// Share of the yarn's contrast from which on a pixel differs from the ground at all.
const LEAST_CONTRAST: f32 = 0.1;
/// The same limit in standard deviations of the ground's noise.
const LEAST_DISTANCE: f32 = 4.0;
/// The factor by which smoothing over 3 x 3 pixels reduces white noise.
const NOISE_REDUCTION: f32 = 3.0;
/// Radius of the mean that estimates F, in widths of the yarn. A larger one mixes plies, a smaller
/// one is noisy.
const FOREGROUND_RADIUS: f64 = 0.06;
/// Least radius of the opening that removes fibres, pixels: blur makes any fibre some pixels thick.
const LEAST_OPENING: usize = 3;
/// Pixels at the body's edge that show ground as well and so say nothing about F.
const MIXED_EDGE: usize = 2;
/// Thickness of the ring of pixels below that edge from which F is estimated.
const SAMPLED_RING: usize = 2;
/// Percentile of the yarn's greys that stands for F in fibres off the body.
const FIBRE_PERCENTILE: f32 = 0.8;

/// The yarn separated from its ground.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CutOut {
    /// Share of each pixel that is yarn.
    pub(super) alpha: Plane,
    /// Mean length of the yarn's cross sections without the fuzz, pixels.
    pub(super) width: f64,
    /// The row in the middle of the yarn.
    pub(super) middle: f64,
}

/// Computes the alpha of each pixel. With `keeps_threshold` the half-covered edge lies where the
/// threshold puts it, however bright the yarn is there; that is for a threshold the user chose.
pub(super) fn cut_out(
    grey: &Plane,
    yarn: &Mask,
    split: &Split,
    light_ground: bool,
    keeps_threshold: bool,
) -> CutOut {
    let (ground, spread) = split.ground(light_ground);
    // From here on all greys are differences to the ground, positive toward the yarn: I - G.
    let sign = if light_ground { -1.0 } else { 1.0 };
    let off = grey.map(|value| sign * (value - ground));
    let smooth = off.blurred(1, false);
    let noise = LEAST_DISTANCE * spread / NOISE_REDUCTION;
    let contrast = split.contrast().max(1.0);
    let yarn = yarn.largest();
    // F - G. Twice the distance to the threshold makes the matte exactly one half on it.
    let foreground = if keeps_threshold {
        off.map(|_| 2.0 * (split.threshold - ground).abs().max(0.5))
    } else {
        let differs = Mask::from_plane(&smooth, |off| off >= noise.max(LEAST_CONTRAST * contrast))
            .connected_to(&yarn);
        foreground_difference(&off, &core(&differs), contrast)
    };
    let matted = Plane::from_fn(grey.width, grey.height, |x, y| {
        (off.at(x, y) / foreground.at(x, y)).clamp(0.0, 1.0)
    });
    let half = Mask::from_plane(&matted, |matte| matte >= 0.5).connected_to(&yarn);
    let core = core(&half);
    let body = half.or(&core);

    // Fibres are found on the smoothed picture, where they are continuous and noise is weaker. The
    // dilation keeps the soft pixels beside them.
    let least = LEAST_MATTE.max(noise / contrast);
    let fibres = Mask::from_plane(&smooth, |off| off >= least * contrast).or(&body);
    let kept = fibres.connected_to(&body).dilated(1);
    let inside = body.eroded(MIXED_EDGE);
    let floor = 0.5 * least;
    let alpha =
        Plane::from_fn(grey.width, grey.height, |x, y| match (inside.at(x, y), kept.at(x, y)) {
            (true, _) => 1.0,
            // The ramp removes the floor of noise below it, but leaves the matte of one half where
            // it is: there lies the body's edge, which must not move.
            (false, true) if matted.at(x, y) < 0.5 => {
                (0.5 * (matted.at(x, y) - floor) / (0.5 - floor)).max(0.0)
            }
            (false, true) => matted.at(x, y),
            (false, false) => 0.0,
        });
    let (width, middle) = extent(&core);
    CutOut { alpha, width, middle }
}

/// The yarn without the fibres that stand off it, and without holes. The fibres go first: an area
/// that a fibre and the yarn enclose together is ground, not a hole.
fn core(yarn: &Mask) -> Mask {
    let (width, _) = extent(yarn);
    let radius = whole(narrow(FIBRE * width)).max(LEAST_OPENING);
    yarn.largest_opened(radius).filled()
}

/// F - G for each pixel: how much a pixel that shows yarn only would differ from the ground.
fn foreground_difference(off: &Plane, core: &Mask, contrast: f32) -> Plane {
    let (width, _) = extent(core);
    let radius = whole(narrow(FOREGROUND_RADIUS * width)).max(1);
    let inside = core.eroded(MIXED_EDGE);
    let deep = inside.eroded(SAMPLED_RING);
    let near = core.dilated(1);
    // Fibres off the body have no flank beside them. They are lit from all around, so the brighter
    // part of the yarn stands for them.
    let step = (off.values.len() >> 20).max(1);
    let mut yarn: Vec<f32> = core.pixels().step_by(step).map(|at| off.values[at]).collect();
    let bright = percentile(&mut yarn, FIBRE_PERCENTILE).max(contrast);
    // Normalised convolution (Knutsson and Westin 1993): the blurred values of the ring over the
    // blurred weights are a local mean that ignores all other pixels.
    let weight = |x: usize, y: usize| if inside.at(x, y) && !deep.at(x, y) { 1.0 } else { 0.0 };
    let weights = Plane::from_fn(off.width, off.height, weight).blurred(radius, false);
    let sums = Plane::from_fn(off.width, off.height, |x, y| weight(x, y) * off.at(x, y))
        .blurred(radius, false);
    Plane::from_fn(off.width, off.height, |x, y| {
        let weight = weights.at(x, y);
        // Deep inside every pixel is yarn, whatever it looks like: its matte is 1 by definition.
        if deep.at(x, y) {
            return off.at(x, y).max(LEAST_CONTRAST);
        }
        let is_near = near.at(x, y) && weight > 1e-3;
        if is_near { (sums.at(x, y) / weight).max(LEAST_CONTRAST * contrast) } else { bright }
    })
}

/// Width and middle row of a yarn: means over the columns' longest runs of set pixels. Fibres are
/// thin and are seldom part of a longest run.
fn extent(body: &Mask) -> (f64, f64) {
    let runs: Vec<(f32, f32)> =
        (0..body.width).into_par_iter().filter_map(|x| longest_run(body, x)).collect();
    let mut lengths: Vec<f32> = runs.iter().map(|run| run.0).collect();
    let typical = percentile(&mut lengths, 0.5);
    // Runs that differ from the median by half are fibres, gaps or a second thing: outliers.
    let usual: Vec<_> = runs.iter().filter(|run| (run.0 / typical - 1.0).abs() < 0.5).collect();
    let count = double(usual.len().max(1));
    let width: f64 = usual.iter().map(|run| f64::from(run.0)).sum();
    let middle: f64 = usual.iter().map(|run| f64::from(run.1)).sum();
    (width / count, middle / count)
}

/// Length and middle of a column's longest run of set pixels, if it has one.
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
    /// The rows of the yarn without its fuzz, at least one.
    pub(super) fn rows(&self) -> std::ops::Range<usize> {
        let half = 0.5 * self.width;
        let [first, end] = [self.middle - half + 0.5, self.middle + half + 0.5]
            .map(|place| whole(narrow(place.round())).min(self.alpha.height));
        let first = first.min(self.alpha.height - 1);
        first..end.max(first + 1)
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
