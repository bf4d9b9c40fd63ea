//! The part of a photo that is worked on, and its resolution: cells of eight pixels and more, in a
//! picture of about a megapixel.
//!
//! In: the photo. Out: [`PhotoView`]s, in the order in which they are tried: all of it, made
//! smaller if it is large; its middle at the photo's resolution; the middle of that, enlarged
//! twice, where yarns are a few pixels wide.
//!
//! Not promised: the rim of a large photo with a small repeat, which only the first view shows.

use glam::DVec2;
use image::RgbImage;
use image::imageops::{FilterType, crop_imm, resize};

/// Pixels each way, at most. Time and memory of the autocorrelation grow with the square.
const MAX_SIDE: u32 = 1200;
/// Enlargement of the last view.
const ENLARGED: u32 = 2;

/// A part of a photo.
pub(super) struct PhotoView {
    pub(super) picture: RgbImage,
    /// Its pixels per pixel of the photo.
    pub(super) scale: f64,
    /// The centre of its first pixel in the photo, where the centre of the photo's first one is 0.
    pub(super) corner: DVec2,
}

impl PhotoView {
    /// All views of a photo.
    pub(super) fn all(photo: &RgbImage) -> impl Iterator<Item = Self> {
        let (width, height) = photo.dimensions();
        let is_large = width.max(height) > MAX_SIDE;
        let shrunk = is_large.then_some(0).into_iter();
        // Lazily: the first view is enough for most photos.
        shrunk
            .chain([1, ENLARGED])
            .map(|times| if times == 0 { Self::shrunk(photo) } else { Self::middle(photo, times) })
    }

    fn shrunk(photo: &RgbImage) -> Self {
        let (width, height) = photo.dimensions();
        let scale = f64::from(MAX_SIDE) / f64::from(width.max(height));
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a side of at most 1200 pixels"
        )]
        let [columns, rows] =
            [width, height].map(|side| (f64::from(side) * scale).round().max(1.0) as u32);
        // A triangle filter widens with the reduction, so that fine yarns don't alias into a
        // coarser repeat.
        Self::new(resize(photo, columns, rows, FilterType::Triangle), scale, DVec2::ZERO)
    }

    /// The middle, each pixel `times` as large.
    fn middle(photo: &RgbImage, times: u32) -> Self {
        let (width, height) = photo.dimensions();
        let [columns, rows] = [width, height].map(|side| side.min(MAX_SIDE / times));
        let (x, y) = ((width - columns) / 2, (height - rows) / 2);
        let part = crop_imm(photo, x, y, columns, rows).to_image();
        let picture = if times == 1 {
            part
        } else {
            resize(&part, columns * times, rows * times, FilterType::CatmullRom)
        };
        Self::new(picture, f64::from(times), DVec2::new(f64::from(x), f64::from(y)))
    }

    /// The part of a photo from its pixel `first` on.
    fn new(picture: RgbImage, scale: f64, first: DVec2) -> Self {
        // Pixel centres: the first pixel of the view covers 1 / scale of the photo's pixels.
        Self { picture, scale, corner: first + 0.5 / scale - 0.5 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_are_bearable_and_of_the_middle() {
        let views: Vec<_> = PhotoView::all(&RgbImage::new(3000, 1500)).collect();
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
            PhotoView::all(&RgbImage::new(100, 80))
                .map(|view| view.picture.dimensions())
                .collect::<Vec<_>>(),
            [(100, 80), (200, 160)]
        );
    }
}
