//! Step 1, orient and crop: from a photo to a strip with the yarn lying level in it.
//!
//! In: a photo. Out: [`YarnOrientation`], which says where each pixel of the strip lies on the photo,
//! and the strip itself.
//!
//! What stands off from the ground's light is split by Otsu's threshold; its largest piece, with
//! all that is linked to it and no ground, is the yarn: of plies of many colours the threshold
//! would take the brightest alone. Fibres are worn off. Its second moments give the principal
//! direction; but where a tilted yarn leaves the photo its ends are cut aslant, which turns that
//! direction, so a line is then fitted through the medians of its cross sections, those alone that
//! lie on the photo as wholes. The strip is as long as yarn and ground on both sides of it are on
//! the photo. Cost: the search runs on a photo made smaller to [`SEARCHED`] pixels a side; the
//! strip is one look-up (Catmull-Rom) a pixel.
//!
//! Not promised: a yarn that bends is refused, not straightened. A shadow that is a tenth as far
//! from the ground as the yarn counts as yarn here.

use std::ops::Range;

use image::RgbImage;
use rayon::prelude::*;

use super::binarise::{Split, binarise, is_light, otsu};
use super::error::DevelopError;
use super::ground::{Ground, border};
use super::mask::Mask;
use crate::plane::{Plane, byte, double, float, narrow, side, whole};

/// The longer side of the photo in which the yarn is searched.
const SEARCHED: usize = 800;
/// Grey levels that a yarn differs from the ground at least.
const LEAST_CONTRAST: f32 = 6.0;
/// The same, in spreads of the ground: noise split by a threshold comes to 2.7.
const LEAST_DISTANCE: f32 = 4.0;
/// What differs from the ground at all, as a share of that contrast.
const LEAST_SHARE: f32 = 0.1;
/// Half the thickness of what is a fibre and no ply, in widths of the yarn.
pub(super) const FIBRE: f64 = 0.05;
/// Percent of a picture that a yarn takes.
pub(super) const SHARES: (f32, f32) = (0.5, 95.0);
/// Share of all that stands off from the ground that the yarn is: a second yarn, or the ground
/// taken for one, leaves less.
const LEAST_PIECE: f32 = 0.6;
/// Length over width of what may be a yarn.
const LEAST_LENGTH: f64 = 2.0;
/// How far a yarn's cross sections may lie off a line, in widths.
const MOST_BEND: f64 = 0.35;
/// Ground on each side of the yarn that the strip shows, in widths, best first. The fuzz is in
/// there.
const MARGINS: [f64; 5] = [0.5, 0.35, 0.25, 0.15, 0.08];
/// Share of the strip's length that may be given up for a wider margin.
const GIVEN_UP: f64 = 0.25;
/// Length of a strip, in widths of the yarn, that is worth going on with.
const LEAST_STRIP: f64 = 1.5;
/// What is cut off at a yarn's loose end, in widths: it frays.
const FRAYED: f64 = 0.4;

/// Where the strip lies on the photo, and what the search found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct YarnOrientation {
    /// The yarn's direction on the photo, from x toward y (down), radians, over -π/2 up to π/2.
    pub angle: f64,
    /// Where the middle of the strip's first pixel lies on the photo, with the middle of the
    /// photo's first pixel at 0, 0.
    pub origin: [f64; 2],
    /// Pixels of the strip along and across.
    pub size: (u32, u32),
    /// Whether the ground is lighter than the yarn.
    pub light_ground: bool,
    /// Share of the photo that is yarn.
    pub share: f32,
}

impl YarnOrientation {
    /// The place on the photo of a place on the strip.
    #[must_use]
    pub fn on_photo(&self, x: f64, y: f64) -> [f64; 2] {
        let (sin, cos) = self.angle.sin_cos();
        [self.origin[0] + x * cos - y * sin, self.origin[1] + x * sin + y * cos]
    }

    /// Where the pixels of a row of the strip lie on the photo.
    pub(super) fn row(&self, y: usize) -> impl Fn(usize) -> [f64; 2] {
        let ([x0, y0], (sin, cos)) = (self.on_photo(0.0, double(y)), self.angle.sin_cos());
        move |x| [x0 + double(x) * cos, y0 + double(x) * sin]
    }
}

/// Finds the yarn on a photo, and the light of the ground around it.
///
/// # Errors
/// Whatever shows that there is no straight yarn with ground on both sides.
pub(super) fn orient(photo: &RgbImage) -> Result<(YarnOrientation, Ground), DevelopError> {
    let longer = photo.width().max(photo.height()) as usize;
    let step = longer.div_ceil(SEARCHED);
    let grey = Plane::grey(photo, step);
    let ground = Ground::fit(&grey);
    let (mask, light_ground) = yarn(&grey, &ground)?;
    // Fibres that stand off on one side would turn the axis: it is fitted again without them.
    let mask = mask.largest_opened(whole(narrow(FIBRE * YarnAxis::fit(&mask)?.width)));
    let axis = YarnAxis::fit(&mask)?;
    let strip = axis.strip(&mask)?;
    let share = mask.share();
    let scale = double(step);
    // A pixel of the smaller photo has its middle in the middle of a square of the large one.
    let full = |place: f64| (place + 0.5) * scale - 0.5;
    let [x, y] = axis.place(strip.along.start - 0.5 + 0.5 / scale, -strip.half - 0.5 + 0.5 / scale);
    let pixels = |length: f64| side(whole(narrow((length * scale).floor())).max(1));
    let size = (pixels(strip.along.end - strip.along.start), pixels(2.0 * strip.half + 1.0));
    Ok((
        YarnOrientation {
            angle: axis.angle,
            origin: [full(x), full(y)],
            size,
            light_ground,
            share,
        },
        ground,
    ))
}

/// The yarn's pixels, and whether the ground is the lighter.
fn yarn(grey: &Plane, light: &Ground) -> Result<(Mask, bool), DevelopError> {
    let (columns, rows) = (float(grey.width), float(grey.height));
    let smooth = grey.blurred(1, false);
    let off = Plane::from_fn(grey.width, grey.height, |x, y| {
        smooth.at(x, y) - light.at(float(x) / columns, float(y) / rows)
    });
    let (low, high) =
        off.values.iter().fold((f32::MAX, f32::MIN), |(low, high), &v| (low.min(v), high.max(v)));
    if high - low < LEAST_CONTRAST {
        return Err(DevelopError::Blank { contrast: high - low });
    }
    let scale = 255.0 / (high - low);
    let stretched = off.map(|value| (value - low) * scale);
    let threshold = otsu(&stretched);
    let split = Split::at(threshold, &stretched);
    let light_ground = is_light(&stretched, &border(grey), threshold);
    let contrast = split.contrast() / scale;
    let (_, spread) = split.ground(light_ground);
    if contrast < LEAST_CONTRAST {
        return Err(DevelopError::Blank { contrast });
    }
    if contrast * scale < LEAST_DISTANCE * spread {
        return Err(DevelopError::NoGround { contrast, spread: spread / scale });
    }
    // A ply may lie nearer to the ground than to the other plies, and so below the threshold:
    // whatever is linked to the yarn and no ground is yarn.
    let (ground, sign) = (split.ground(light_ground).0, if light_ground { -1.0 } else { 1.0 });
    let least = (LEAST_SHARE * contrast * scale).max(LEAST_DISTANCE * spread);
    let differs = Mask::from_plane(&stretched, |value| sign * (value - ground) >= least);
    let stands_off = binarise(&stretched, threshold, light_ground);
    let mask = differs.connected_to(&stands_off.largest()).largest();
    let both =
        Mask { set: mask.set.iter().zip(&stands_off.set).map(|(a, b)| *a && *b).collect(), ..mask };
    let found = both.share() / stands_off.share();
    if found < LEAST_PIECE {
        return Err(DevelopError::Pieces { percent: 100.0 * found });
    }
    // Smoothing makes a thread of one pixel thrice as wide.
    let ground = ground / scale + low;
    let is_yarn = |at: &usize| {
        let (x, y) = (at % grey.width, at / grey.width);
        let off = grey.at(x, y) - light.at(float(x) / columns, float(y) / rows);
        mask.set[*at] && (off - ground).abs() >= 0.5 * contrast
    };
    let share = float((0..mask.set.len()).filter(is_yarn).count()) / float(mask.set.len());
    check_share(share, "take it nearer, on a plain ground, or choose it with --crop")?;
    Ok((mask, light_ground))
}

/// Refuses what takes too little or too much of a picture.
pub(super) fn check_share(share: f32, remedy: &'static str) -> Result<(), DevelopError> {
    let (percent, (least, most)) = (100.0 * share, SHARES);
    if (least..=most).contains(&percent) {
        Ok(())
    } else {
        Err(DevelopError::NoYarn { percent, least, most, remedy })
    }
}

/// The line that a yarn lies along.
#[derive(Clone, Copy, Debug)]
struct YarnAxis {
    angle: f64,
    middle: [f64; 2],
    /// Median length of the yarn's cross sections.
    width: f64,
    /// Half of the band that holds nearly all of the yarn.
    reach: f64,
}

/// The part of a band that is used: along the axis, and to both sides.
struct UsableStretch {
    along: Range<f64>,
    half: f64,
}

/// Pixels of a cross section: where along the axis, how many, and the median of their distances.
struct CrossSection {
    along: f64,
    count: f64,
    median: f64,
}

impl YarnAxis {
    /// The axis of a yarn's pixels.
    fn fit(mask: &Mask) -> Result<Self, DevelopError> {
        let mut axis = Self::principal(mask);
        for _ in 0..6 {
            let sections = axis.sections(mask);
            axis.width = median(sections.iter().map(|section| section.count));
            let length = double(sections.len());
            if length < LEAST_LENGTH * axis.width {
                return Err(DevelopError::NotLong { length, width: axis.width });
            }
            let half = 0.5 * axis.width + 1.0;
            let whole_ones: Vec<_> = (sections.iter())
                .filter(|section| section.count > 0.5 * axis.width)
                .filter(|section| axis.is_on(mask, section.along, half))
                .map(|section| (section.along, section.median))
                .collect();
            let needed = LEAST_STRIP * axis.width;
            if double(whole_ones.len()) < needed.max(4.0) {
                return Err(DevelopError::LeavesThroughSide {
                    shown: double(whole_ones.len()),
                    needed,
                });
            }
            let (offset, slope, off) = line(&whole_ones);
            if off > MOST_BEND * axis.width {
                return Err(DevelopError::Bent { off, width: axis.width });
            }
            axis.middle = axis.place(0.0, offset);
            axis.angle += slope.atan();
        }
        axis.angle = upright(axis.angle);
        axis.reach = axis.fitted_reach(mask);
        Ok(axis)
    }

    /// The direction in which the pixels spread most, through their mean.
    fn principal(mask: &Mask) -> Self {
        let pixels = || pixels(mask);
        let count = pixels().fold(0.0, |count, _| count + 1.0);
        let sum = pixels().fold([0.0; 2], |sum: [f64; 2], at| [sum[0] + at[0], sum[1] + at[1]]);
        let middle = sum.map(|sum| sum / count);
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for [x, y] in pixels() {
            let (dx, dy) = (x - middle[0], y - middle[1]);
            xx += dx * dx;
            xy += dx * dy;
            yy += dy * dy;
        }
        Self { angle: 0.5 * (2.0 * xy).atan2(xx - yy), middle, width: 0.0, reach: 0.0 }
    }

    fn place(&self, along: f64, across: f64) -> [f64; 2] {
        let (sin, cos) = self.angle.sin_cos();
        [self.middle[0] + along * cos - across * sin, self.middle[1] + along * sin + across * cos]
    }

    fn axis_coordinates(&self, [x, y]: [f64; 2]) -> (f64, f64) {
        let (sin, cos) = self.angle.sin_cos();
        let (dx, dy) = (x - self.middle[0], y - self.middle[1]);
        (dx * cos + dy * sin, dy * cos - dx * sin)
    }

    /// Cross sections, a pixel apart, empty ones too.
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
        let section = |(bin, distances): (usize, Vec<f64>)| CrossSection {
            along: first + double(bin) + 0.5,
            count: double(distances.len()),
            median: median(distances.into_iter()),
        };
        distances.into_iter().enumerate().map(section).collect()
    }

    /// Whether the band of so many pixels to both sides is on the photo here.
    fn is_on(&self, mask: &Mask, along: f64, half: f64) -> bool {
        [-half, half].map(|across| self.place(along, across)).iter().all(|[x, y]| {
            *x >= -0.5
                && *y >= -0.5
                && *x <= double(mask.width) - 0.5
                && *y <= double(mask.height) - 0.5
        })
    }

    fn fitted_reach(&self, mask: &Mask) -> f64 {
        let mut off: Vec<f32> =
            pixels(mask).map(|at| narrow(self.axis_coordinates(at).1.abs())).collect();
        f64::from(crate::plane::percentile(&mut off, 0.98))
            .clamp(0.5 * self.width, 0.7 * self.width)
    }

    /// The longest stretch of yarn with ground on both sides, as wide as that costs little length.
    fn strip(&self, mask: &Mask) -> Result<UsableStretch, DevelopError> {
        let sections = self.sections(mask);
        let is_yarn = |section: &&CrossSection| section.count > 0.6 * self.width;
        let yarn = (sections.iter().find(is_yarn), sections.iter().rev().find(is_yarn));
        let (Some(first), Some(last)) = yarn else {
            return Err(DevelopError::NotLong { length: 0.0, width: self.width });
        };
        let loose = |section: &CrossSection| {
            let frayed = FRAYED * self.width;
            self.is_on(mask, section.along - frayed, 0.5 * self.width)
                && self.is_on(mask, section.along + frayed, 0.5 * self.width)
        };
        let cut = |section: &CrossSection| if loose(section) { FRAYED * self.width } else { 0.0 };
        let (from, to) = (first.along + cut(first), last.along - cut(last));
        let stretch = |margin: f64| {
            let half = (self.reach + margin * self.width).ceil();
            let mut on = sections
                .iter()
                .map(|section| section.along)
                .filter(|along| (from..=to).contains(along));
            let start = on.find(|&along| self.is_on(mask, along, half + 0.5))?;
            let end = on.take_while(|&along| self.is_on(mask, along, half + 0.5)).last()?;
            Some(UsableStretch { along: start..end, half })
        };
        let length = |strip: &UsableStretch| strip.along.end - strip.along.start;
        let longest = MARGINS
            .iter()
            .filter_map(|&margin| stretch(margin))
            .map(|strip| length(&strip))
            .fold(0.0, f64::max);
        let needed = LEAST_STRIP * self.width;
        if longest < needed {
            return Err(DevelopError::LeavesThroughSide { shown: longest, needed });
        }
        let fits =
            |strip: &UsableStretch| length(strip) >= ((1.0 - GIVEN_UP) * longest).max(needed);
        let strip = MARGINS.iter().filter_map(|&margin| stretch(margin)).find(fits);
        strip.ok_or(DevelopError::LeavesThroughSide { shown: longest, needed })
    }
}

/// The photo, looked up where the strip lies.
pub(super) fn strip(photo: &RgbImage, orientation: &YarnOrientation) -> RgbImage {
    let (width, height) = orientation.size;
    let mut strip = RgbImage::new(width, height);
    strip.as_mut().par_chunks_mut(3 * width as usize).enumerate().for_each(|(y, row)| {
        let place = orientation.row(y);
        for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
            pixel.copy_from_slice(&look_up(photo, place(x)));
        }
    });
    strip
}

/// Between sixteen pixels, by Catmull and Rom's cubic; the rim goes on outside.
fn look_up(photo: &RgbImage, [x, y]: [f64; 2]) -> [u8; 3] {
    let cell = |place: f64, size: u32| {
        let first = place.floor();
        #[expect(clippy::cast_possible_truncation, reason = "places on a photo are small")]
        let (first, t) = (first as i64, (place - first) as f32);
        let weights = [
            t * (-0.5 + t * (1.0 - 0.5 * t)),
            1.0 + t * t * (-2.5 + 1.5 * t),
            t * (0.5 + t * (2.0 - 1.5 * t)),
            t * t * (-0.5 + 0.5 * t),
        ];
        let at = |offset: i64| {
            u32::try_from((first + offset).clamp(0, i64::from(size) - 1)).unwrap_or(0)
        };
        ([at(-1), at(0), at(1), at(2)], weights)
    };
    let ((columns, across), (rows, down)) = (cell(x, photo.width()), cell(y, photo.height()));
    let stride = 3 * photo.width() as usize;
    let lies_inside = columns[3] == columns[0] + 3;
    // Four pixels of three colours, one above the other: processors sum them side by side.
    let mut sums = [0.0_f32; 12];
    for (row, v) in rows.into_iter().zip(down) {
        let line = &photo.as_raw()[row as usize * stride..][..stride];
        let mut add = |from: usize, pixels: &[u8]| {
            sums[from..]
                .iter_mut()
                .zip(pixels)
                .for_each(|(sum, byte)| *sum += v * f32::from(*byte));
        };
        if lies_inside {
            add(0, &line[3 * columns[0] as usize..][..12]);
        } else {
            columns
                .iter()
                .zip([0, 3, 6, 9])
                .for_each(|(column, at)| add(at, &line[3 * *column as usize..][..3]));
        }
    }
    let mut sum = [0.0_f32; 3];
    for (pixel, u) in sums.chunks_exact(3).zip(across) {
        sum.iter_mut().zip(pixel).for_each(|(sum, value)| *sum += u * value);
    }
    sum.map(byte)
}

/// Pixels of a mask, x and y.
fn pixels(mask: &Mask) -> impl Iterator<Item = [f64; 2]> {
    let place = |at: usize| [double(at % mask.width), double(at / mask.width)];
    (0..mask.set.len()).filter(|&at| mask.set[at]).map(place)
}

/// The line through points, without those that lie far off it: its height at 0, its slope, and the
/// root mean square of distances.
fn line(points: &[(f64, f64)]) -> (f64, f64, f64) {
    let (mut offset, mut slope) = (median(points.iter().map(|point| point.1)), 0.0);
    let mut spread = f64::MAX;
    let off = |point: &(f64, f64), offset: f64, slope: f64| point.1 - offset - slope * point.0;
    for _ in 0..4 {
        let kept: Vec<_> =
            points.iter().filter(|point| off(point, offset, slope).abs() <= spread).collect();
        let count = double(kept.len());
        let mean = (
            kept.iter().map(|p| p.0).sum::<f64>() / count,
            kept.iter().map(|p| p.1).sum::<f64>() / count,
        );
        let xx: f64 = kept.iter().map(|p| (p.0 - mean.0).powi(2)).sum();
        let xy: f64 = kept.iter().map(|p| (p.0 - mean.0) * (p.1 - mean.1)).sum();
        slope = if xx > 0.0 { xy / xx } else { 0.0 };
        offset = mean.1 - slope * mean.0;
        spread = 4.0 * median(points.iter().map(|point| off(point, offset, slope).abs())) + 0.5;
    }
    let square = points.iter().map(|point| off(point, offset, slope).powi(2)).sum::<f64>()
        / double(points.len());
    (offset, slope, square.sqrt())
}

/// An angle without regard to direction: over -π/2 up to π/2.
fn upright(angle: f64) -> f64 {
    let half_turn = std::f64::consts::PI;
    let turned = (angle + 0.5 * half_turn).rem_euclid(half_turn) - 0.5 * half_turn;
    if turned <= -0.5 * half_turn { 0.5 * half_turn } else { turned }
}

fn median(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut numbers: Vec<f64> = numbers.collect();
    if numbers.is_empty() {
        return 0.0;
    }
    let middle = numbers.len() / 2;
    *numbers.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    /// A plain band, `width` wide, through the middle of a photo of 300 x 200.
    fn band(degrees: f64, width: f64) -> RgbImage {
        let (sin, cos) = degrees.to_radians().sin_cos();
        RgbImage::from_fn(300, 200, |x, y| {
            let (dx, dy) = (f64::from(x) - 149.5, f64::from(y) - 99.5);
            Rgb([if (dy * cos - dx * sin).abs() < width / 2.0 { 210 } else { 25 }; 3])
        })
    }

    #[test]
    fn a_band_is_found_at_any_angle_with_its_middle_in_the_strips_middle() {
        for degrees in [0.0, 12.0, 30.0, -25.0, 60.0, 89.0] {
            let (found, _) = orient(&band(degrees, 30.0)).unwrap();
            let off = upright(found.angle - f64::to_radians(degrees)).to_degrees();
            assert!(off.abs() < 0.2, "{degrees}: {off}");
            let (width, height) = found.size;
            let [x, y] = found.on_photo(f64::from(width - 1) / 2.0, f64::from(height - 1) / 2.0);
            let (sin, cos) = degrees.to_radians().sin_cos();
            let across = (y - 99.5) * cos - (x - 149.5) * sin;
            assert!(
                across.abs() < 1.0 && width > 90 && height > 40,
                "{degrees}: {across} {width} {height}"
            );
        }
    }

    #[test]
    fn a_strip_is_the_photo_looked_up_level() {
        let photo = band(20.0, 30.0);
        let (found, _) = orient(&photo).unwrap();
        let strip = strip(&photo, &found);
        let middle = strip.height() / 2;
        assert!(
            (0..strip.width())
                .all(|x| strip.get_pixel(x, middle).0[0] > 190 && strip.get_pixel(x, 0).0[0] < 60)
        );
    }

    #[test]
    fn no_photo_of_a_yarn_is_refused_with_its_reason() {
        let error = |of: &dyn Fn(u32, u32) -> u8| {
            orient(&RgbImage::from_fn(300, 200, |x, y| Rgb([of(x, y); 3]))).unwrap_err()
        };
        assert!(matches!(error(&|_, _| 90), DevelopError::Blank { .. }));
        assert!(matches!(
            error(&|x, y| 90 + byte(float(((x * 31 + y * 17 + x * y) % 11) as usize))),
            DevelopError::Blank { .. }
        ));
        let thread = RgbImage::from_fn(300, 260, |_, y| Rgb([if y == 100 { 200 } else { 20 }; 3]));
        assert!(matches!(orient(&thread).unwrap_err(), DevelopError::NoYarn { .. }));
        assert!(matches!(
            error(&|x, y| if x.abs_diff(150) + y.abs_diff(100) < 60 { 200 } else { 20 }),
            DevelopError::NotLong { .. }
        ));
        assert!(matches!(
            error(&|_, y| if y < 40 { 200 } else { 20 }),
            DevelopError::LeavesThroughSide { .. }
        ));
    }
}
