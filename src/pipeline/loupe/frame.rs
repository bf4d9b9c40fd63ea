//! The drawing of a loupe: the inset in its round frame, the mark where it looks, and the line
//! between them.
//!
//! In: a picture or some of its rows, and the inset. Out: the picture with both. Method: signed
//! distances, blended over a pixel's width, so that lines are smooth. Lines are dark between two
//! light ones, so that they show on any cloth and any background.

use glam::DVec2;
use image::{Rgba, RgbaImage};

/// The dark line, and the light ones along it.
const DARK: [f64; 3] = [40.0; 3];
const LIGHT: [f64; 3] = [250.0; 3];
/// Opacity of the light lines.
const LIGHT_ALPHA: f64 = 0.85;

/// A circle in a picture, pixels from its top left corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Disc {
    pub(super) middle: DVec2,
    pub(super) radius: f64,
}

impl Disc {
    /// Distance of a place from the rim, negative inside.
    fn distance(&self, at: DVec2) -> f64 {
        at.distance(self.middle) - self.radius
    }
}

/// The lines of a loupe.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lines {
    /// Where the inset lies.
    pub(super) inset: Disc,
    /// Around the place that it magnifies.
    pub(super) mark: Disc,
    /// Width of the frame, pixels; the mark and the line are thinner.
    pub(super) width: f64,
}

impl Lines {
    /// Draws the inset and all lines into a picture whose first row is `first_row` of the whole.
    pub(super) fn draw(&self, picture: &mut RgbaImage, first_row: u32, inset: &RgbaImage) {
        let corner = (self.inset.middle - self.inset.radius).round();
        for (x, y, pixel) in picture.enumerate_pixels_mut() {
            let row = first_row + y;
            let at = DVec2::new(f64::from(x), f64::from(row)) + 0.5;
            let to_inset = self.inset.distance(at);
            let to_mark = self.mark.distance(at);
            // The line ends at both rims.
            let to_line = self.line(at).max(-to_inset).max(-to_mark);
            let thin = (0.6 * self.width).max(1.0);
            over_line(pixel, to_line, thin);
            over_line(pixel, to_mark.abs(), thin);
            let source = at - 0.5 - corner;
            let is_held = source.min_element() >= 0.0
                && source.x < f64::from(inset.width())
                && source.y < f64::from(inset.height());
            if is_held {
                let source = source.as_uvec2();
                mix(pixel, *inset.get_pixel(source.x, source.y), (0.5 - to_inset).clamp(0.0, 1.0));
            }
            over_line(pixel, to_inset.abs(), self.width);
        }
    }

    /// Distance of a place from the line between the two middles.
    fn line(&self, at: DVec2) -> f64 {
        let (start, way) = (self.mark.middle, self.inset.middle - self.mark.middle);
        let along = (at - start).dot(way) / way.length_squared().max(1e-12);
        at.distance(start + way * along.clamp(0.0, 1.0))
    }
}

/// Draws a line of this width at this distance over a pixel: dark, with light beside it.
fn over_line(pixel: &mut Rgba<u8>, distance: f64, width: f64) {
    let covered = |width: f64| (0.5 + width / 2.0 - distance).clamp(0.0, 1.0);
    over(pixel, LIGHT, LIGHT_ALPHA * covered(width + 2.0));
    over(pixel, DARK, covered(width));
}

/// An opaque colour over a pixel of straight alpha (Porter and Duff 1984).
fn over(pixel: &mut Rgba<u8>, color: [f64; 3], alpha: f64) {
    if alpha > 0.0 {
        let [red, green, blue] = color.map(to_byte);
        let full = Rgba([red, green, blue, u8::MAX]);
        mix(pixel, full, alpha);
    }
}

/// Replaces a share of a pixel of straight alpha by another one.
fn mix(pixel: &mut Rgba<u8>, other: Rgba<u8>, share: f64) {
    let alphas = [pixel, &other].map(|pixel| f64::from(pixel.0[3]) / 255.0);
    let weights = [(1.0 - share) * alphas[0], share * alphas[1]];
    let alpha = weights[0] + weights[1];
    if share <= 0.0 {
        return;
    }
    for channel in 0..3 {
        let sum =
            weights[0] * f64::from(pixel.0[channel]) + weights[1] * f64::from(other.0[channel]);
        pixel.0[channel] = if alpha > 0.0 { to_byte(sum / alpha) } else { 0 };
    }
    pixel.0[3] = to_byte(255.0 * alpha);
}

fn to_byte(value: f64) -> u8 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
    let byte = value.round().clamp(0.0, 255.0) as u8;
    byte
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: Rgba<u8> = Rgba([200, 10, 10, 255]);
    const BLUE: Rgba<u8> = Rgba([10, 10, 200, 255]);

    fn lines() -> Lines {
        Lines {
            inset: Disc { middle: DVec2::new(70.0, 40.0), radius: 20.0 },
            mark: Disc { middle: DVec2::new(20.0, 40.0), radius: 6.0 },
            width: 2.0,
        }
    }

    #[test]
    fn the_inset_is_copied_into_its_frame_and_the_rest_stays() {
        let mut picture = RgbaImage::from_pixel(100, 80, RED);
        let mut inset = RgbaImage::from_pixel(40, 40, BLUE);
        inset.put_pixel(25, 20, Rgba([1, 2, 3, 255]));
        lines().draw(&mut picture, 0, &inset);
        assert_eq!(*picture.get_pixel(70, 40), BLUE);
        // Pixel (25, 20) of the inset lies at its corner (50, 20) and that much farther.
        assert_eq!(*picture.get_pixel(75, 40), Rgba([1, 2, 3, 255]));
        for (x, y) in [(5, 5), (52, 22), (70, 10), (20, 60), (20, 40), (40, 30)] {
            assert_eq!(*picture.get_pixel(x, y), RED, "{x} {y}");
        }
        // The frame above the middle, the mark, and the line between both are dark.
        for (x, y) in [(70, 20), (14, 40), (36, 40)] {
            assert!(picture.get_pixel(x, y).0[0] < 130, "{x} {y}: {:?}", picture.get_pixel(x, y));
        }
    }

    #[test]
    fn rows_of_a_picture_are_those_of_the_whole() {
        let inset = RgbaImage::from_pixel(40, 40, BLUE);
        let mut whole = RgbaImage::from_pixel(100, 80, RED);
        lines().draw(&mut whole, 0, &inset);
        let mut rows = RgbaImage::from_pixel(100, 30, RED);
        lines().draw(&mut rows, 35, &inset);
        assert_eq!(rows.as_raw(), &whole.as_raw()[4 * 100 * 35..4 * 100 * 65]);
    }

    #[test]
    fn a_transparent_background_stays_so_beside_the_lines() {
        let clear = Rgba([0, 0, 0, 0]);
        let mut picture = RgbaImage::from_pixel(100, 80, clear);
        lines().draw(&mut picture, 0, &RgbaImage::from_pixel(40, 40, clear));
        assert_eq!(*picture.get_pixel(5, 5), clear);
        assert_eq!(picture.get_pixel(70, 40).0[3], 0);
        assert!(picture.get_pixel(70, 20).0[3] > 200);
    }
}
