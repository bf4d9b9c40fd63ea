//! Step 2, levels: the strip's grey with a flat ground, stretched to the whole range.
//!
//! In: the strip, its place on the photo, the ground's light there. Out: a grey plane, 0..=255, and
//! the greys that became black and white.
//!
//! Method: the ground's polynomial is subtracted, and the greys between two percentiles are
//! stretched to the whole range. This grey only serves to find the yarn; the maps keep the photo's
//! colours. A brightness or contrast that the user chose replaces the stretch and changes the
//! strip's colours as well. Cost: one pass for the grey, one for the percentiles.

use image::RgbImage;

use super::ground::Ground;
use super::orient::YarnOrientation;
use crate::plane::{Plane, byte, double, float, narrow, percentile};

/// Percentiles that become black and white. Without clipping, one hot pixel or speck of dust would
/// decide the stretch.
const CLIPPED: (f32, f32) = (0.005, 0.995);
/// Least difference between the greys that become black and white. It keeps a plain strip from a
/// division by 0, and its noise from becoming contrast.
const LEAST_RANGE: f32 = 4.0;

/// The user's levels: a share of white that is added, and a factor around middle grey.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ChosenLevels {
    pub(super) brightness: f32,
    pub(super) contrast: f32,
}

/// The greys of the photo that become black and white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct GreyRange {
    pub(super) black: f32,
    pub(super) white: f32,
}

/// The strip's grey after levels. Changes the strip's colours if the user chose levels.
pub(super) fn levels(
    strip: &mut RgbImage,
    orientation: &YarnOrientation,
    photo: (u32, u32),
    ground: &Ground,
    chosen: Option<ChosenLevels>,
) -> (Plane, GreyRange) {
    let grey = Plane::grey(strip, 1);
    let last = double(grey.width - 1).max(1.0);
    let flat = Plane::from_rows(grey.width, grey.height, |y, row| {
        // The ground is a polynomial of degree two, so along a row it is a parabola. Three values
        // determine it, and the inner loop needs no evaluation of six terms.
        let [start, middle, end] = [0.0, 0.5, 1.0].map(|share| {
            ground_excess(ground, orientation.on_photo(share * last, double(y)), photo)
        });
        let bend = 2.0 * (start - 2.0 * middle + end);
        for (x, (value, grey)) in row.iter_mut().zip(grey.row(y)).enumerate() {
            let t = float(x) / narrow(last);
            *value = grey - (start + t * (end - start - bend + t * bend));
        }
    });
    let range = match chosen {
        Some(levels) => levels.range(),
        None => stretch(&flat),
    };
    if chosen.is_some() {
        strip
            .as_mut()
            .iter_mut()
            .for_each(|value| *value = byte(range.stretched(f32::from(*value))));
    }
    (flat.map(|value| range.stretched(value)), range)
}

/// How much brighter than on average the ground is at a place of the photo.
fn ground_excess(ground: &Ground, [x, y]: [f64; 2], (width, height): (u32, u32)) -> f32 {
    let x = narrow((x + 0.5) / f64::from(width));
    let y = narrow((y + 0.5) / f64::from(height));
    ground.at(x, y) - ground.level
}

impl ChosenLevels {
    fn range(self) -> GreyRange {
        // (g - 127.5) contrast + 127.5 + 255 brightness is 0 and 255 there.
        let middle = 127.5 - 255.0 * self.brightness / self.contrast;
        GreyRange { black: middle - 127.5 / self.contrast, white: middle + 127.5 / self.contrast }
    }
}

impl GreyRange {
    fn stretched(self, grey: f32) -> f32 {
        ((grey - self.black) / (self.white - self.black) * 255.0).clamp(0.0, 255.0)
    }
}

/// The range between two percentiles.
fn stretch(flat: &Plane) -> GreyRange {
    let mut sampled: Vec<f32> = flat.sampled().collect();
    let (black, white) = (percentile(&mut sampled, CLIPPED.0), percentile(&mut sampled, CLIPPED.1));
    let more = (LEAST_RANGE - (white - black)).max(0.0) / float(2);
    GreyRange { black: black - more, white: white + more }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chosen_levels_move_and_spread_the_greys() {
        let plain = ChosenLevels { brightness: 0.0, contrast: 1.0 }.range();
        assert!((plain.stretched(40.0) - 40.0).abs() < 1e-4);
        let both = ChosenLevels { brightness: 0.1, contrast: 2.0 }.range();
        assert!(
            (both.stretched(127.5) - 153.0).abs() < 1e-3
                && (both.stretched(137.5) - 173.0).abs() < 1e-3
        );
        assert_eq!(both.stretched(250.0), 255.0);
    }

    #[test]
    fn the_stretch_takes_nearly_all_greys_and_never_divides_by_nothing() {
        let ramp = stretch(&Plane::from_fn(100, 10, |x, _| float(x)));
        assert!(ramp.black < 2.0 && ramp.white > 97.0);
        let flat = stretch(&Plane::from_fn(10, 10, |_, _| 7.0));
        assert!((flat.stretched(7.0) - 127.5).abs() < 1e-3);
    }
}
