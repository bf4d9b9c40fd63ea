//! The axis of a yarn on a photo: a straight line with a width, fitted to a mask.
//!
//! In: the [`Mask`] of the yarn's pixels on the reduced photo. Out: [`YarnAxis`] (direction, a
//! point on it, width), and [`UsableStretch`], the part of the yarn that has ground on both sides.
//!
//! Method: the second central moments of the mask give a first direction (principal axis; Hu 1962,
//! "Visual pattern recognition by moment invariants"). A tilted yarn that leaves the photo has
//! slanted ends, and these turn the principal axis. So a line is then fitted to the medians of the
//! cross sections by least squares with outlier rejection, and only cross sections that lie on the
//! photo as a whole take part. Cost: some ten passes over the mask.
//!
//! Not promised: a curved axis. A yarn that bends is refused.

use std::ops::Range;

use super::error::DevelopError;
use super::mask::Mask;
use crate::plane::{double, narrow, percentile, whole};

/// Least length of a yarn over its width. A blob that is rounder has no reliable direction.
const LEAST_LENGTH: f64 = 2.0;
/// Largest root mean square distance of the cross sections' medians from the axis, in widths of the
/// yarn. A yarn that bends more leaves the strip.
const MOST_BEND: f64 = 0.35;
/// Widths of the ground on each side of the yarn that the strip may show, in widths of the yarn,
/// widest first. The fuzz lies there.
const MARGINS: [f64; 5] = [0.5, 0.35, 0.25, 0.15, 0.08];
/// Share of the longest possible strip that may be lost to a wider margin.
const LENGTH_TRADED: f64 = 0.25;
/// Least length of a strip, in widths of the yarn.
const LEAST_STRIP: f64 = 1.5;
/// Length that is cut off at a loose end, in widths of the yarn, because yarns fray there.
const FRAYED: f64 = 0.4;
/// Rounds of fitting. The direction of a round decides which cross sections the next one uses, and
/// it no longer changes after a few; there is no convergence test.
const FIT_ROUNDS: usize = 6;
/// Rounds of outlier rejection within a line fit.
const REJECTION_ROUNDS: usize = 4;

/// The straight line that a yarn lies along.
#[derive(Clone, Copy, Debug)]
pub(super) struct YarnAxis {
    /// From x toward y (down), radians, over -π/2 up to π/2.
    pub(super) angle: f64,
    /// A point on the axis, pixels.
    middle: [f64; 2],
    /// Median length of the yarn's cross sections, pixels.
    pub(super) width: f64,
    /// Half the width of the band that holds 98 % of the yarn's pixels.
    reach: f64,
}

/// The part of a yarn that the strip shows.
pub(super) struct UsableStretch {
    /// From where to where along the axis.
    pub(super) along: Range<f64>,
    /// How far to both sides of the axis.
    pub(super) half: f64,
}

/// The pixels of one cross section.
struct CrossSection {
    /// Its place along the axis.
    along: f64,
    /// How many pixels it has.
    count: f64,
    /// The median of their distances from the axis.
    median: f64,
}

/// `y = offset + slope x`, and how far the points lie from it.
struct LineFit {
    offset: f64,
    slope: f64,
    /// Root mean square of all residuals, outliers included.
    rms: f64,
}

impl YarnAxis {
    /// Fits the axis to a yarn's pixels.
    pub(super) fn fit(mask: &Mask) -> Result<Self, DevelopError> {
        let mut axis = Self::principal(mask);
        for _ in 0..FIT_ROUNDS {
            let sections = axis.sections(mask);
            axis.width = median(sections.iter().map(|section| section.count));
            let length = double(sections.len());
            if length < LEAST_LENGTH * axis.width {
                return Err(DevelopError::NotLong { length, width: axis.width });
            }
            // Only cross sections that the photo shows completely have a median on the axis. One
            // that the photo's border cuts has its median shifted to the inner side. A section with
            // less than half of the usual pixels is a frayed end or a gap.
            let half = 0.5 * axis.width + 1.0;
            let complete: Vec<_> = (sections.iter())
                .filter(|section| section.count > 0.5 * axis.width)
                .filter(|section| axis.is_on_photo(mask, section.along, half))
                .map(|section| (section.along, section.median))
                .collect();
            let needed = LEAST_STRIP * axis.width;
            if double(complete.len()) < needed.max(4.0) {
                return Err(DevelopError::LeavesThroughSide {
                    shown: double(complete.len()),
                    needed,
                });
            }
            let line = fitted_line(&complete);
            if line.rms > MOST_BEND * axis.width {
                return Err(DevelopError::Bent { off: line.rms, width: axis.width });
            }
            // The line is given in the axis's own coordinates: move and turn the axis onto it.
            axis.middle = axis.place(0.0, line.offset);
            axis.angle += line.slope.atan();
        }
        axis.angle = upright(axis.angle);
        axis.reach = axis.fitted_reach(mask);
        Ok(axis)
    }

    /// The principal axis of the pixels, through their centroid.
    fn principal(mask: &Mask) -> Self {
        let count = pixels(mask).fold(0.0, |count, _| count + 1.0);
        let sum = pixels(mask).fold([0.0; 2], |sum: [f64; 2], at| [sum[0] + at[0], sum[1] + at[1]]);
        let middle = sum.map(|sum| sum / count);
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for [x, y] in pixels(mask) {
            let (dx, dy) = (x - middle[0], y - middle[1]);
            xx += dx * dx;
            xy += dx * dy;
            yy += dy * dy;
        }
        // Direction of the covariance matrix's larger eigenvector in closed form:
        // tan 2θ = 2 xy / (xx - yy).
        Self { angle: 0.5 * (2.0 * xy).atan2(xx - yy), middle, width: 0.0, reach: 0.0 }
    }

    /// The place on the photo of a point in axis coordinates.
    pub(super) fn place(&self, along: f64, across: f64) -> [f64; 2] {
        let (sin, cos) = self.angle.sin_cos();
        [self.middle[0] + along * cos - across * sin, self.middle[1] + along * sin + across * cos]
    }

    /// A place on the photo in axis coordinates: along and across.
    fn axis_coordinates(&self, [x, y]: [f64; 2]) -> (f64, f64) {
        let (sin, cos) = self.angle.sin_cos();
        let (dx, dy) = (x - self.middle[0], y - self.middle[1]);
        (dx * cos + dy * sin, dy * cos - dx * sin)
    }

    /// All cross sections, one pixel apart; those in gaps of the yarn are empty.
    fn sections(&self, mask: &Mask) -> Vec<CrossSection> {
        let first =
            pixels(mask).map(|at| self.axis_coordinates(at).0).fold(f64::MAX, f64::min).floor();
        let mut distances: Vec<Vec<f64>> = Vec::new();
        for at in pixels(mask) {
            let (along, across) = self.axis_coordinates(at);
            let bin = whole(narrow((along - first).floor()));
            if distances.len() <= bin {
                distances.resize(bin + 1, Vec::new());
            }
            distances[bin].push(across);
        }
        let mut sections = Vec::with_capacity(distances.len());
        for (bin, distances) in distances.into_iter().enumerate() {
            sections.push(CrossSection {
                along: first + double(bin) + 0.5,
                count: double(distances.len()),
                // The median, unlike the mean, ignores a fibre that stands off on one side.
                median: median(distances.into_iter()),
            });
        }
        sections
    }

    /// Whether the photo shows `half` pixels on both sides of the axis at this place.
    fn is_on_photo(&self, mask: &Mask, along: f64, half: f64) -> bool {
        [-half, half].map(|across| self.place(along, across)).iter().all(|[x, y]| {
            *x >= -0.5
                && *y >= -0.5
                && *x <= double(mask.width) - 0.5
                && *y <= double(mask.height) - 0.5
        })
    }

    /// The half-width that holds 98 % of the pixels.
    fn fitted_reach(&self, mask: &Mask) -> f64 {
        let mut off: Vec<f32> =
            pixels(mask).map(|at| narrow(self.axis_coordinates(at).1.abs())).collect();
        // The clamp guards against masks whose fuzz is wide (above) or cut off (below).
        f64::from(percentile(&mut off, 0.98)).clamp(0.5 * self.width, 0.7 * self.width)
    }

    /// The longest stretch of yarn with ground on both sides. The margin of ground is the widest
    /// that costs little length.
    pub(super) fn usable_stretch(&self, mask: &Mask) -> Result<UsableStretch, DevelopError> {
        let sections = self.sections(mask);
        let ends = (
            sections.iter().find(|section| self.is_yarn(section)),
            sections.iter().rev().find(|section| self.is_yarn(section)),
        );
        let (Some(first), Some(last)) = ends else {
            return Err(DevelopError::NotLong { length: 0.0, width: self.width });
        };
        let usable = first.along + self.frayed_length(mask, first)
            ..=last.along - self.frayed_length(mask, last);
        let candidates: Vec<UsableStretch> = (MARGINS.iter())
            .filter_map(|&margin| {
                let half = (self.reach + margin * self.width).ceil();
                let along = sections.iter().map(|section| section.along);
                self.first_run_on_photo(mask, half, along.filter(|along| usable.contains(along)))
            })
            .collect();
        let longest = candidates.iter().map(UsableStretch::length).fold(0.0, f64::max);
        let needed = LEAST_STRIP * self.width;
        if longest < needed {
            return Err(DevelopError::LeavesThroughSide { shown: longest, needed });
        }
        // On a tilted yarn a wider margin reaches the photo's border sooner and so costs length.
        let least = ((1.0 - LENGTH_TRADED) * longest).max(needed);
        (candidates.into_iter())
            .find(|stretch| stretch.length() >= least)
            .ok_or(DevelopError::LeavesThroughSide { shown: longest, needed })
    }

    /// Whether a cross section shows most of the yarn's width.
    fn is_yarn(&self, section: &CrossSection) -> bool {
        section.count > 0.6 * self.width
    }

    /// The length to cut off at an end of the yarn: none where the yarn leaves the photo, since
    /// only a loose end frays.
    fn frayed_length(&self, mask: &Mask, end: &CrossSection) -> f64 {
        let frayed = FRAYED * self.width;
        let is_loose = self.is_on_photo(mask, end.along - frayed, 0.5 * self.width)
            && self.is_on_photo(mask, end.along + frayed, 0.5 * self.width);
        if is_loose { frayed } else { 0.0 }
    }

    /// The first run of places at which the photo shows `half` pixels on both sides of the axis.
    fn first_run_on_photo(
        &self,
        mask: &Mask,
        half: f64,
        mut places: impl Iterator<Item = f64>,
    ) -> Option<UsableStretch> {
        let start = places.find(|&along| self.is_on_photo(mask, along, half + 0.5))?;
        let end = places.take_while(|&along| self.is_on_photo(mask, along, half + 0.5)).last()?;
        Some(UsableStretch { along: start..end, half })
    }
}

impl UsableStretch {
    fn length(&self) -> f64 {
        self.along.end - self.along.start
    }
}

/// The set pixels of a mask, x and y.
fn pixels(mask: &Mask) -> impl Iterator<Item = [f64; 2]> {
    mask.pixels().map(|at| [double(at % mask.width), double(at / mask.width)])
}

/// Fits a line by least squares to the points that are no outliers.
fn fitted_line(points: &[(f64, f64)]) -> LineFit {
    let (mut offset, mut slope) = (median(points.iter().map(|point| point.1)), 0.0);
    let mut tolerance = f64::MAX;
    for _ in 0..REJECTION_ROUNDS {
        let kept: Vec<_> = (points.iter())
            .filter(|point| residual(point, offset, slope).abs() <= tolerance)
            .collect();
        let count = double(kept.len());
        let mean = (
            kept.iter().map(|p| p.0).sum::<f64>() / count,
            kept.iter().map(|p| p.1).sum::<f64>() / count,
        );
        let xx: f64 = kept.iter().map(|p| (p.0 - mean.0).powi(2)).sum();
        let xy: f64 = kept.iter().map(|p| (p.0 - mean.0) * (p.1 - mean.1)).sum();
        slope = if xx > 0.0 { xy / xx } else { 0.0 };
        offset = mean.1 - slope * mean.0;
        // Four median absolute deviations are 2.7 standard deviations of normal noise. The half
        // pixel keeps a perfectly straight yarn, whose deviation is 0, from losing its points.
        let deviation = median(points.iter().map(|point| residual(point, offset, slope).abs()));
        tolerance = 4.0 * deviation + 0.5;
    }
    let square = points.iter().map(|point| residual(point, offset, slope).powi(2)).sum::<f64>()
        / double(points.len());
    LineFit { offset, slope, rms: square.sqrt() }
}

/// The signed distance of a point from a line, along y.
fn residual(point: &(f64, f64), offset: f64, slope: f64) -> f64 {
    point.1 - offset - slope * point.0
}

/// The angle of an undirected line: over -π/2 up to π/2.
pub(super) fn upright(angle: f64) -> f64 {
    let half_turn = std::f64::consts::PI;
    let turned = (angle + 0.5 * half_turn).rem_euclid(half_turn) - 0.5 * half_turn;
    if turned <= -0.5 * half_turn { 0.5 * half_turn } else { turned }
}

/// The median (the upper one of an even count), 0 of none.
fn median(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut numbers: Vec<f64> = numbers.collect();
    if numbers.is_empty() {
        return 0.0;
    }
    let middle = numbers.len() / 2;
    *numbers.select_nth_unstable_by(middle, f64::total_cmp).1
}
