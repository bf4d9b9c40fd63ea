//! From a photo of a yarn to the maps of one repeat of it.
//!
//! In: one ordinary photo of a straight yarn on a plain ground, and [`YarnPhotoSettings`] that may overrule
//! what is found. Out: [`Developed`], the maps with every number that was decided on the way. The
//! steps, a file each:
//!
//! ```text
//!   photo ─▶ orient ─▶ levels ─▶ binarise ─▶ cutout ─▶ light ─▶ repeat ─▶ seamless ─▶ surface ─▶ maps
//!             level     grey        B        alpha    colours   length      unit      heights …
//!             strip                                  flattened
//! ```
//!
//! `ground` is the light of what lies behind the yarn, `mask` says which pixels belong to
//! something, `files` writes the maps. Cost: 48 megapixels, with a strip of 16, take some six
//! seconds on two cores and 820 MB, reading included; a photo of half a megapixel a few tenths of a
//! second. That is 3 bytes a pixel of the photo and some 40 of the strip. The same photo and
//! settings give the same bytes for any number of threads.
//!
//! Not promised: a scale. A photo doesn't say how large anything is; without [`PixelScale`] the maps
//! have no lengths and the repeat is in pixels.

mod axis;
mod binarise;
mod cutout;
mod error;
mod files;
mod ground;
mod levels;
mod light;
mod mask;
mod orient;
mod repeat;
mod seamless;
mod surface;

use image::{GrayImage, Luma, RgbImage, RgbaImage};

use crate::plane::{byte, side};
use binarise::{Split, binarise, otsu};
use cutout::cut_out;
use levels::ChosenLevels;

pub use error::DevelopError;
pub use files::{FILES, save};
pub use orient::YarnOrientation;
pub use repeat::YarnRepeat;
pub use seamless::{Method, Seam};
pub use surface::SurfaceMaps;

/// Fewest pixels of a photo each way.
pub const LEAST_SIDE: u32 = 32;
/// Most pixels of a photo each way: the maps are no larger, and graphics cards take no more.
pub const MOST_SIDE: u32 = 16_384;
/// Most pixels of a photo, millions.
pub const MOST_MEGAPIXELS: u64 = 64;

/// What overrules the steps' own decisions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct YarnPhotoSettings {
    /// The part of the photo that is looked at: x, y, width, height, pixels.
    pub crop: Option<[u32; 4]>,
    /// Share of white that is added, -1 to 1, in place of the stretch.
    pub brightness: Option<f32>,
    /// Factor around middle grey, over 0, in place of the stretch.
    pub contrast: Option<f32>,
    /// T, a grey of the strip after its levels.
    pub threshold: Option<u8>,
    /// How large a pixel is.
    pub scale: PixelScale,
}

/// What says how large a pixel is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PixelScale {
    /// Nothing.
    #[default]
    Unknown,
    /// Pixels an inch, as of a scanner.
    Dpi(f64),
    /// How wide the yarn is without its fuzz, mm.
    YarnWidth(f64),
}

/// The seven steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The yarn is found and laid level.
    Orient,
    /// Grey values are evened out.
    Levels,
    /// A threshold splits yarn and ground.
    Binarise,
    /// The yarn gets its alpha.
    CutOut,
    /// The repeat is found.
    Repeat,
    /// The repeat is made to follow itself.
    Seamless,
    /// Heights, normals, roughness, occlusion.
    Maps,
}

impl Step {
    /// All of them, in order.
    pub const ALL: [Self; 7] = [
        Self::Orient,
        Self::Levels,
        Self::Binarise,
        Self::CutOut,
        Self::Repeat,
        Self::Seamless,
        Self::Maps,
    ];

    /// Its name in messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Orient => "orient",
            Self::Levels => "levels",
            Self::Binarise => "binarise",
            Self::CutOut => "cut out",
            Self::Repeat => "repeat",
            Self::Seamless => "seamless",
            Self::Maps => "maps",
        }
    }
}

/// A photo's yarn, developed.
#[derive(Clone, Debug, PartialEq)]
pub struct Developed {
    /// Where the strip lies on the photo (on all of it, crop or not).
    pub orientation: YarnOrientation,
    /// The yarn, laid level, as photographed.
    pub strip: RgbImage,
    /// Its alpha.
    pub mask: GrayImage,
    /// T.
    pub threshold: f32,
    /// Width of the yarn without its fuzz, pixels.
    pub yarn_width: f64,
    /// The repeat, pixels.
    pub repeat: YarnRepeat,
    /// How the unit was closed.
    pub seam: Seam,
    /// The unit: sRGB and straight alpha.
    pub base: RgbaImage,
    /// The unit's other maps.
    pub surface: SurfaceMaps,
    /// What a pixel is large, mm, where the settings say it.
    pub mm_per_pixel: Option<f64>,
}

impl Developed {
    /// Length of the unit, mm: the repeat.
    #[must_use]
    pub fn length(&self) -> Option<f64> {
        self.mm_per_pixel.map(|scale| scale * self.repeat.length)
    }

    /// Width of the maps, fuzz included, mm.
    #[must_use]
    pub fn width(&self) -> Option<f64> {
        self.mm_per_pixel.map(|scale| scale * f64::from(self.base.height()))
    }

    /// e: repeats of the texture a mm of yarn.
    #[must_use]
    pub fn mapping_coefficient(&self) -> Option<f64> {
        self.length().map(|length| 1.0 / length)
    }
}

/// Develops a photo. `decided` hears after each step what it decided, in words.
///
/// ```
/// use image::{Rgb, RgbImage};
/// use warpknit::photo::develop::{YarnPhotoSettings, develop};
/// let slanted = |x: u32, y: u32| if (40..80).contains(&y) { 150 + 90 * u8::from((x + y) % 30 < 15) } else { 20 };
/// let photo = RgbImage::from_fn(300, 120, |x, y| Rgb([slanted(x, y); 3]));
/// let yarn = develop(&photo, &YarnPhotoSettings::default(), &mut |_, _| ())?;
/// assert!((yarn.repeat.length - 30.0).abs() < 0.3 && (yarn.yarn_width - 40.0).abs() < 1.0);
/// # Ok::<(), warpknit::photo::develop::DevelopError>(())
/// ```
///
/// # Errors
/// [`DevelopError`] where the photo shows no yarn of which maps can be made.
pub fn develop(
    photo: &RgbImage,
    settings: &YarnPhotoSettings,
    decided: &mut dyn FnMut(Step, &str),
) -> Result<Developed, DevelopError> {
    check_size(photo.width(), photo.height())?;
    let cropped = settings.crop.map(|crop| cropped(photo, crop)).transpose()?;
    let photo = cropped.as_ref().unwrap_or(photo);
    let (mut orientation, ground) = orient::orient(photo)?;
    decided(Step::Orient, &orientation.to_string());
    let mut strip = orient::strip(photo, &orientation);

    let (grey, range) =
        levels::levels(&mut strip, &orientation, photo.dimensions(), &ground, settings.levels());
    decided(
        Step::Levels,
        &format!("grey {:.0} becomes black, {:.0} white", range.black, range.white),
    );

    let threshold = settings.threshold.map_or_else(|| otsu(&grey), f32::from);
    let yarn = binarise(&grey, threshold, orientation.light_ground);
    orient::check_share(yarn.share(), "choose another --threshold, or leave it out")?;
    let kind = if orientation.light_ground { "light" } else { "dark" };
    let percent = 100.0 * yarn.share();
    decided(
        Step::Binarise,
        &format!(
            "threshold {threshold:.1} before a {kind} ground, {percent:.1} % of the strip is yarn"
        ),
    );

    let split = Split::at(threshold, &grey);
    let cut = cut_out(&grey, &yarn, &split, orientation.light_ground, settings.threshold.is_some());
    drop((grey, yarn));
    let soft = cut.alpha.values.iter().filter(|&&alpha| alpha > 0.0 && alpha < 1.0).count();
    decided(
        Step::CutOut,
        &format!(
            "the yarn is {:.1} pixels wide, {soft} pixels of its edge and fuzz are soft",
            cut.width
        ),
    );

    let flat = light::flattened(&strip, &cut);
    let repeat = repeat::repeat(&flat, cut.middle, cut.width);
    let mm_per_pixel = settings.scale.mm_per_pixel(cut.width);
    decided(Step::Repeat, &repeat.to_string());

    let (base, seam) = seamless::seamless(&flat, repeat.length);
    decided(Step::Seamless, &seam.to_string());
    let surface = surface::surface(&base, cut.middle, cut.width);
    decided(Step::Maps, &format!("{} x {} texels", base.width(), base.height()));

    if let Some([x, y, ..]) = settings.crop {
        orientation.origin[0] += f64::from(x);
        orientation.origin[1] += f64::from(y);
    }
    let (alpha, yarn_width) = (&cut.alpha, cut.width);
    let mask = GrayImage::from_fn(side(alpha.width), side(alpha.height), |x, y| {
        Luma([byte(255.0 * alpha.at(x as usize, y as usize))])
    });
    Ok(Developed {
        orientation,
        strip,
        mask,
        threshold,
        yarn_width,
        repeat,
        seam,
        base,
        surface,
        mm_per_pixel,
    })
}

/// Refuses photos that are too small or too large.
///
/// # Errors
/// [`DevelopError::TooSmall`], [`DevelopError::TooLarge`].
pub fn check_size(width: u32, height: u32) -> Result<(), DevelopError> {
    if width.min(height) < LEAST_SIDE {
        return Err(DevelopError::TooSmall { width, height, least: LEAST_SIDE });
    }
    if width.max(height) > MOST_SIDE
        || u64::from(width) * u64::from(height) > 1_000_000 * MOST_MEGAPIXELS
    {
        return Err(DevelopError::TooLarge {
            width,
            height,
            most_side: MOST_SIDE,
            most_megapixels: MOST_MEGAPIXELS,
        });
    }
    Ok(())
}

fn cropped(photo: &RgbImage, crop: [u32; 4]) -> Result<RgbImage, DevelopError> {
    let [x, y, width, height] = crop;
    let is_on = |from: u32, length: u32, whole: u32| {
        u64::from(from) + u64::from(length) <= u64::from(whole)
    };
    if !is_on(x, width, photo.width()) || !is_on(y, height, photo.height()) {
        return Err(DevelopError::CropOutside {
            crop,
            width: photo.width(),
            height: photo.height(),
        });
    }
    check_size(width, height)?;
    Ok(image::imageops::crop_imm(photo, x, y, width, height).to_image())
}

impl YarnPhotoSettings {
    fn levels(&self) -> Option<ChosenLevels> {
        let chosen = self.brightness.is_some() || self.contrast.is_some();
        chosen.then(|| ChosenLevels {
            brightness: self.brightness.unwrap_or(0.0),
            contrast: self.contrast.unwrap_or(1.0),
        })
    }
}

impl PixelScale {
    fn mm_per_pixel(self, yarn_width: f64) -> Option<f64> {
        match self {
            Self::Unknown => None,
            Self::Dpi(dpi) => Some(25.4 / dpi),
            Self::YarnWidth(width) => Some(width / yarn_width),
        }
    }
}

impl std::fmt::Display for YarnOrientation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (width, height) = self.size;
        let (degrees, percent) = (self.angle.to_degrees(), 100.0 * self.share);
        write!(
            f,
            "turned by {degrees:.2} degrees, a strip of {width} x {height} pixels; {percent:.1} % of the photo is yarn"
        )
    }
}

impl std::fmt::Display for YarnRepeat {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let found =
            if self.is_found { "each" } else { "no repeat was found; the best stretch has" };
        write!(f, "{found} {:.2} pixels, correlation {:.2}", self.length, self.correlation)
    }
}

impl std::fmt::Display for Seam {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let method = match self.method {
            Method::Cut => "cut",
            Method::Blend => "cross-blend",
        };
        let [cut, blend] = self.errors;
        write!(f, "{method}, seam error {:.3} (cut {cut:.3}, cross-blend {blend:.3})", self.error)
    }
}
