//! Why a photo gives no maps: each error names what was measured, the limit, and a remedy.

/// The reason why no maps can be made of a photo.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DevelopError {
    /// Fewer pixels than the steps need.
    #[error(
        "{width} x {height} pixels are too few: at least {least} are needed each way; \
         take a larger photo, or a larger part of it"
    )]
    TooSmall {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// The limit.
        least: u32,
    },
    /// More pixels than fit the memory or a graphics card.
    #[error(
        "{width} x {height} pixels are too many: make it {most_side} or fewer each way and \
         {most_megapixels} megapixels at the most"
    )]
    TooLarge {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// The limit of a side.
        most_side: u32,
        /// The limit of all pixels, millions.
        most_megapixels: u64,
    },
    /// A rectangle that isn't on the photo.
    #[error(
        "--crop {},{},{},{} reaches over the photo of {width} x {height} pixels: \
         choose a rectangle on it",
        .crop[0], .crop[1], .crop[2], .crop[3]
    )]
    CropOutside {
        /// x, y, width, height.
        crop: [u32; 4],
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
    },
    /// A photo without contrast.
    #[error(
        "the photo is blank (nothing stands off by more than {contrast:.1} of 255 grey levels): \
         take the yarn on a plain ground that is clearly darker or lighter"
    )]
    Blank {
        /// The contrast that was found, of 255 grey levels.
        contrast: f32,
    },
    /// Foreground and background that differ no more than the background within itself.
    #[error(
        "yarn and ground can't be told apart (they differ by {contrast:.0} grey levels, and the \
         ground by {spread:.0} within itself): take the yarn on a plain, evenly lit ground, with \
         ground on both sides of it"
    )]
    NoGround {
        /// Difference of their medians, of 255 grey levels.
        contrast: f32,
        /// Standard deviation of the ground, of 255 grey levels.
        spread: f32,
    },
    /// A foreground of several components.
    #[error(
        "what stands off from the ground lies in pieces, and the largest is {percent:.0} % of it: \
         take one yarn, with ground on both sides of it, or choose it with --crop"
    )]
    Pieces {
        /// Share of the largest component, percent.
        percent: f32,
    },
    /// A foreground that covers too little or too much of the picture.
    #[error(
        "no yarn was found: {percent:.2} % of the picture stands off from the ground, a yarn takes \
         {least} to {most} %; {remedy}"
    )]
    NoYarn {
        /// Share of the foreground, percent.
        percent: f32,
        /// The lower limit.
        least: f32,
        /// The upper limit.
        most: f32,
        /// What to try.
        remedy: &'static str,
    },
    /// A foreground that is not long enough for its width.
    #[error(
        "no yarn was found: what stands off is {length:.0} pixels long and {width:.0} wide, not a \
         long stretch; lay one yarn straight on a plain ground, or choose it with --crop"
    )]
    NotLong {
        /// Pixels along.
        length: f64,
        /// Pixels across.
        width: f64,
    },
    /// A yarn that isn't straight.
    #[error(
        "the yarn isn't straight: it lies {off:.0} pixels off a line at {width:.0} pixels of \
         width; stretch it lightly, or choose a straight part with --crop"
    )]
    Bent {
        /// Root mean square of its distance from a line, pixels.
        off: f64,
        /// Pixels across.
        width: f64,
    },
    /// A yarn whose flanks leave the photo.
    #[error(
        "the yarn leaves the photo through its side: only {shown:.0} pixels of its length have \
         ground on both sides and {needed:.0} are needed; photograph it with room above and below"
    )]
    LeavesThroughSide {
        /// Pixels along the yarn that have ground on both sides.
        shown: f64,
        /// Pixels that are needed.
        needed: f64,
    },
}
