//! Step 1, orient and crop: from a photo to a strip in which the yarn lies level.
//!
//! In: a photo. Out: [`YarnOrientation`], which maps each pixel of the strip to a place on the
//! photo, and the strip itself.
//!
//! Method: the ground's light is subtracted, and Otsu's threshold (Otsu 1979, "A threshold
//! selection method from gray-level histograms") separates yarn and ground. The largest connected
//! component is the yarn, together with all that is connected to it and differs from the ground;
//! without that extension a yarn with plies of several colours would keep the brightest plies only.
//! A morphological opening removes the fibres, and `axis` fits the yarn's direction and width to
//! the rest. The strip is as long as yarn and ground on both sides of it are on the photo.
//!
//! Cost: the search runs on a photo reduced to at most [`SEARCHED_SIDE`] pixels a side. The strip
//! takes one bicubic look-up a pixel.
//!
//! Not promised: a yarn that bends is refused, not straightened. A shadow counts as yarn here where
//! its contrast to the ground is at least a tenth of the yarn's.

use image::RgbImage;
use rayon::prelude::*;

use super::axis::YarnAxis;
use super::binarise::{Split, binarise, is_light, otsu};
use super::error::DevelopError;
use super::ground::{Ground, border};
use super::mask::Mask;
use crate::plane::{Plane, byte, double, float, narrow, side, whole};

/// Longest side of the reduced photo in which the yarn is searched, pixels. The axis is fitted to
/// hundreds of cross sections there, which is enough for a fraction of a degree.
const SEARCHED_SIDE: usize = 800;
/// Least contrast between yarn and ground, grey levels.
const LEAST_CONTRAST: f32 = 6.0;
/// Least contrast in standard deviations of the ground. Normal noise that a threshold splits at its
/// mean gives 2.7, so a lower limit would find yarns in noise.
const LEAST_DISTANCE: f32 = 4.0;
/// Share of the contrast from which on a pixel differs from the ground at all. A higher share loses
/// dark plies, a lower one adds shadows.
const LEAST_SHARE: f32 = 0.1;
/// Half the largest thickness of a fibre, in widths of the yarn. What is thicker counts as a ply.
pub(super) const FIBRE: f64 = 0.05;
/// Least and greatest share of a picture that a yarn covers, percent.
pub(super) const SHARES: (f32, f32) = (0.5, 95.0);
/// Least share of the foreground that the yarn must have. It is less where a second yarn lies on
/// the photo, or where the ground was taken for the yarn.
const LEAST_COMPONENT: f32 = 0.6;

/// Where the strip lies on the photo, and what the search for the yarn found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct YarnOrientation {
    /// The yarn's direction on the photo, from x toward y (down), radians, over -π/2 up to π/2.
    pub angle: f64,
    /// The centre of the strip's first pixel on the photo. The centre of the photo's first pixel is
    /// at 0, 0.
    pub origin: [f64; 2],
    /// Size of the strip along and across the yarn, pixels.
    pub size: (u32, u32),
    /// Whether the ground is lighter than the yarn.
    pub light_ground: bool,
    /// Share of the photo's pixels that show yarn.
    pub share: f32,
}

impl YarnOrientation {
    /// The place on the photo of a place on the strip.
    #[must_use]
    pub fn on_photo(&self, x: f64, y: f64) -> [f64; 2] {
        let (sin, cos) = self.angle.sin_cos();
        [self.origin[0] + x * cos - y * sin, self.origin[1] + x * sin + y * cos]
    }

    /// The places on the photo of the pixels in a row of the strip.
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
    let step = longer.div_ceil(SEARCHED_SIDE);
    let grey = Plane::grey(photo, step);
    let ground = Ground::fit(&grey);
    let (mask, light_ground) = segmented(&grey, &ground)?;
    // Fibres that stand off on one side would turn the axis. The first fit only gives the width,
    // and with it the size of the opening that removes them; the second fit is the one that counts.
    let mask = mask.largest_opened(whole(narrow(FIBRE * YarnAxis::fit(&mask)?.width)));
    let axis = YarnAxis::fit(&mask)?;
    let stretch = axis.usable_stretch(&mask)?;
    let scale = double(step);
    // The strip's first pixel is the upper left pixel of the stretch, on the full photo. A pixel of
    // the reduced photo covers `scale` x `scale` of the full one, so its centre is half a pixel
    // off.
    let [x, y] =
        axis.place(stretch.along.start - 0.5 + 0.5 / scale, -stretch.half - 0.5 + 0.5 / scale);
    let along = stretch.along.end - stretch.along.start;
    let orientation = YarnOrientation {
        angle: axis.angle,
        origin: [x, y].map(|place| (place + 0.5) * scale - 0.5),
        size: (full_pixels(along, scale), full_pixels(2.0 * stretch.half + 1.0, scale)),
        light_ground,
        share: mask.share(),
    };
    Ok((orientation, ground))
}

/// A length on the reduced photo in whole pixels of the full one.
fn full_pixels(length: f64, scale: f64) -> u32 {
    side(whole(narrow((length * scale).floor())).max(1))
}

/// The yarn's pixels, and whether the ground is lighter than the yarn.
fn segmented(grey: &Plane, light: &Ground) -> Result<(Mask, bool), DevelopError> {
    let (columns, rows) = (float(grey.width), float(grey.height));
    // Subtracting the ground's light first lets one global threshold serve a photo that is lit from
    // one side.
    let smooth = grey.blurred(1, false);
    let off = Plane::from_fn(grey.width, grey.height, |x, y| {
        smooth.at(x, y) - light.at(float(x) / columns, float(y) / rows)
    });
    let (low, high) =
        off.values.iter().fold((f32::MAX, f32::MIN), |(low, high), &v| (low.min(v), high.max(v)));
    if high - low < LEAST_CONTRAST {
        return Err(DevelopError::Blank { contrast: high - low });
    }
    // Otsu's histogram has 256 bins over 0..=255: a dim photo would use few of them unstretched.
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
    // Otsu splits anything, noise too. Two classes that overlap are no yarn and ground.
    if contrast * scale < LEAST_DISTANCE * spread {
        return Err(DevelopError::NoGround { contrast, spread: spread / scale });
    }
    // Hysteresis thresholding (Canny 1986, "A computational approach to edge detection"): Otsu's
    // threshold gives the seeds, and a much lower one the rest. A ply may lie nearer to the ground
    // than to the other plies, and so below Otsu's threshold. Whatever differs from the ground and
    // is connected to the yarn is yarn.
    let (ground, sign) = (split.ground(light_ground).0, if light_ground { -1.0 } else { 1.0 });
    let least = (LEAST_SHARE * contrast * scale).max(LEAST_DISTANCE * spread);
    let differs = Mask::from_plane(&stretched, |value| sign * (value - ground) >= least);
    let foreground = binarise(&stretched, threshold, light_ground);
    let mask = differs.connected_to(&foreground.largest()).largest();
    let both =
        Mask { set: mask.set.iter().zip(&foreground.set).map(|(a, b)| *a && *b).collect(), ..mask };
    let found = both.share() / foreground.share();
    if found < LEAST_COMPONENT {
        return Err(DevelopError::Pieces { percent: 100.0 * found });
    }
    // The share is counted on the unsmoothed photo: the smoothing makes a thread of one pixel three
    // pixels wide, and would let it pass as a yarn.
    let ground = ground / scale + low;
    let count = mask
        .pixels()
        .filter(|at| {
            let (x, y) = (at % grey.width, at / grey.width);
            let off = grey.at(x, y) - light.at(float(x) / columns, float(y) / rows);
            (off - ground).abs() >= 0.5 * contrast
        })
        .count();
    let share = float(count) / float(mask.set.len());
    check_share(share, "take it nearer, on a plain ground, or choose it with --crop")?;
    Ok((mask, light_ground))
}

/// Refuses a yarn that covers too little or too much of a picture.
pub(super) fn check_share(share: f32, remedy: &'static str) -> Result<(), DevelopError> {
    let (percent, (least, most)) = (100.0 * share, SHARES);
    if (least..=most).contains(&percent) {
        Ok(())
    } else {
        Err(DevelopError::NoYarn { percent, least, most, remedy })
    }
}

/// Samples the photo at the strip's pixels.
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

/// The colour at a place between pixels: bicubic interpolation with the Catmull-Rom kernel (Keys
/// 1981, "Cubic convolution interpolation for digital image processing", a = -1/2). Outside the
/// photo its border pixels continue.
fn look_up(photo: &RgbImage, [x, y]: [f64; 2]) -> [u8; 3] {
    let (columns, across) = catmull_rom(x, photo.width());
    let (rows, down) = catmull_rom(y, photo.height());
    let stride = 3 * photo.width() as usize;
    let lies_inside = columns[3] == columns[0] + 3;
    // The kernel is separable: first the four rows are added, then the four columns. The twelve
    // sums (four pixels of three channels) lie side by side, so that the compiler can use SIMD.
    let mut sums = [0.0_f32; 12];
    for (row, weight) in rows.into_iter().zip(down) {
        let line = &photo.as_raw()[row as usize * stride..][..stride];
        if lies_inside {
            add_weighted(&mut sums, &line[3 * columns[0] as usize..][..12], weight);
        } else {
            // At the border the four columns are not neighbours in memory.
            for (column, at) in columns.iter().zip([0, 3, 6, 9]) {
                add_weighted(&mut sums[at..], &line[3 * *column as usize..][..3], weight);
            }
        }
    }
    let mut sum = [0.0_f32; 3];
    for (pixel, weight) in sums.chunks_exact(3).zip(across) {
        sum.iter_mut().zip(pixel).for_each(|(sum, value)| *sum += weight * value);
    }
    sum.map(byte)
}

/// The four pixels around a place on one axis, and their Catmull-Rom weights.
fn catmull_rom(place: f64, size: u32) -> ([u32; 4], [f32; 4]) {
    let first = place.floor();
    #[expect(clippy::cast_possible_truncation, reason = "places on a photo are small")]
    let (first, t) = (first as i64, (place - first) as f32);
    let weights = [
        t * (-0.5 + t * (1.0 - 0.5 * t)),
        1.0 + t * t * (-2.5 + 1.5 * t),
        t * (0.5 + t * (2.0 - 1.5 * t)),
        t * t * (-0.5 + 0.5 * t),
    ];
    let pixels = [-1, 0, 1, 2]
        .map(|offset| u32::try_from((first + offset).clamp(0, i64::from(size) - 1)).unwrap_or(0));
    (pixels, weights)
}

/// Adds weighted bytes to sums.
fn add_weighted(sums: &mut [f32], bytes: &[u8], weight: f32) {
    sums.iter_mut().zip(bytes).for_each(|(sum, byte)| *sum += weight * f32::from(*byte));
}

#[cfg(test)]
mod tests {
    use super::super::axis::upright;
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
