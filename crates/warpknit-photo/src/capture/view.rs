//! Which part of a photo is worked on, and how large: cells of eight pixels and more, in a picture
//! of a megapixel or so.
//!
//! In: the photo. Out: [`View`]s, in the order in which they are tried: all of it, made smaller if
//! it is large; its middle as it is; the middle of that, twice as large, where yarns are a few
//! pixels wide.

use glam::DVec2;
use image::RgbImage;
use image::imageops::{FilterType, crop_imm, resize};

/// Most pixels each way.
const MOST: u32 = 1200;
/// How much larger the last view is.
const ENLARGED: u32 = 2;

/// A part of a photo.
pub(super) struct View {
    pub(super) picture: RgbImage,
    /// Its pixels for each of the photo's.
    pub(super) scale: f64,
    /// Where the middle of its first pixel is in the photo, whose own first one's is at 0.
    pub(super) corner: DVec2,
}

impl View {
    /// All views of a photo.
    pub(super) fn all(photo: &RgbImage) -> impl Iterator<Item = Self> {
        let (width, height) = photo.dimensions();
        let is_large = width.max(height) > MOST;
        let shrunk = is_large.then_some(0).into_iter();
        // One at a time: the first is enough for most photos.
        shrunk
            .chain([1, ENLARGED])
            .map(|times| if times == 0 { Self::shrunk(photo) } else { Self::middle(photo, times) })
    }

    fn shrunk(photo: &RgbImage) -> Self {
        let (width, height) = photo.dimensions();
        let scale = f64::from(MOST) / f64::from(width.max(height));
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a side of at most 1200 pixels"
        )]
        let [columns, rows] =
            [width, height].map(|side| (f64::from(side) * scale).round().max(1.0) as u32);
        Self::of(resize(photo, columns, rows, FilterType::Triangle), scale, DVec2::ZERO)
    }

    /// The middle, each pixel `times` as large.
    fn middle(photo: &RgbImage, times: u32) -> Self {
        let (width, height) = photo.dimensions();
        let [columns, rows] = [width, height].map(|side| side.min(MOST / times));
        let (x, y) = ((width - columns) / 2, (height - rows) / 2);
        let part = crop_imm(photo, x, y, columns, rows).to_image();
        let picture = if times == 1 {
            part
        } else {
            resize(&part, columns * times, rows * times, FilterType::CatmullRom)
        };
        Self::of(picture, f64::from(times), DVec2::new(f64::from(x), f64::from(y)))
    }

    /// The part of a photo from one of its pixels on.
    fn of(picture: RgbImage, scale: f64, first: DVec2) -> Self {
        Self { picture, scale, corner: first + 0.5 / scale - 0.5 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_are_bearable_and_of_the_middle() {
        let views: Vec<_> = View::all(&RgbImage::new(3000, 1500)).collect();
        let seen: Vec<_> =
            views.iter().map(|view| (view.picture.dimensions(), view.scale, view.corner)).collect();
        assert_eq!(
            seen,
            [
                ((1200, 600), 0.4, DVec2::splat(0.75)),
                ((1200, 1200), 1.0, DVec2::new(900.0, 150.0)),
                ((1200, 1200), 2.0, DVec2::new(1199.75, 449.75))
            ]
        );
        assert_eq!(
            View::all(&RgbImage::new(100, 80))
                .map(|view| view.picture.dimensions())
                .collect::<Vec<_>>(),
            [(100, 80), (200, 160)]
        );
    }
}
