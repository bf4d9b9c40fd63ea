//! From a photo of a yarn to the maps of one repeat of it.
//!
//! In: one ordinary photo of a straight yarn on a plain ground, and [`YarnPhotoSettings`], which
//! may overrule what the steps find. Out: [`Developed`]: the maps, and every number that was
//! decided on the way. Each step is a file:
//!
//! ```text
//!   photo ─▶ orient ─▶ levels ─▶ binarise ─▶ cutout ─▶ light
//!             strip     grey       mask       alpha    flat colours
//!
//!         ─▶ repeat ─▶ seamless ─▶ surface ─▶ maps
//!             length    unit        heights …
//! ```
//!
//! Beside them, `axis` fits the yarn's axis, `ground` the light of the ground behind the yarn,
//! `mask` has morphology and connected components, and `description` writes yarn.toml. The *ground*
//! is the background of the photo, the *strip* the part that shows the yarn level, the *unit* one
//! repeat of the yarn.
//!
//! Cost: 48 megapixels, with a strip of 16, take some six seconds on two cores and 820 MB, reading
//! included; a photo of half a megapixel takes a few tenths of a second. That is 3 bytes a pixel of
//! the photo and some 40 of the strip. The same photo and settings give the same bytes for any
//! number of threads.
//!
//! Not promised: a scale. A photo doesn't say how large anything is; without a [`PixelScale`] the
//! maps have no lengths and the repeat is in pixels.

mod axis;
mod binarise;
mod cutout;
mod description;
mod error;
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
use cutout::{CutOut, cut_out};
use ground::Ground;
use levels::ChosenLevels;

pub use description::toml;
pub use error::DevelopError;
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

/// Settings that overrule the steps' own decisions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct YarnPhotoSettings {
    /// The part of the photo that is used: x, y, width, height, pixels.
    pub crop: Option<[u32; 4]>,
    /// Share of white that is added, -1 to 1, in place of the stretch.
    pub brightness: Option<f32>,
    /// Factor around middle grey, over 0, in place of the stretch.
    pub contrast: Option<f32>,
    /// The threshold between yarn and ground, a grey of the strip after its levels.
    pub threshold: Option<u8>,
    /// The size of a pixel.
    pub scale: PixelScale,
}

/// The source of the size of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PixelScale {
    /// The size is not known.
    #[default]
    Unknown,
    /// Pixels an inch, as a scanner states them.
    Dpi(f64),
    /// Width of the yarn without its fuzz, mm.
    YarnWidth(f64),
}

/// The seven steps that report a decision.
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
    /// The repeat is made to tile.
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

/// The result: the maps of a yarn, and how they came about.
#[derive(Clone, Debug, PartialEq)]
pub struct Developed {
    /// Where the strip lies on the whole photo, whether it was cropped or not.
    pub orientation: YarnOrientation,
    /// The yarn, laid level, as photographed.
    pub strip: RgbImage,
    /// The alpha of the strip.
    pub mask: GrayImage,
    /// The threshold between yarn and ground, a grey of the strip after its levels.
    pub threshold: f32,
    /// Width of the yarn without its fuzz, pixels.
    pub yarn_width: f64,
    /// The repeat, pixels.
    pub repeat: YarnRepeat,
    /// How the unit's ends were joined.
    pub seam: Seam,
    /// The unit's colours: sRGB with straight alpha.
    pub base: RgbaImage,
    /// The unit's other maps.
    pub surface: SurfaceMaps,
    /// Size of a pixel, mm, where the settings say it.
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

    /// The mapping coefficient e: repeats of the texture for each mm of yarn.
    #[must_use]
    pub fn mapping_coefficient(&self) -> Option<f64> {
        self.length().map(|length| 1.0 / length)
    }
}

/// Develops a photo. `decided` is called after each step with its decision in words.
///
/// ```
/// use image::{Rgb, RgbImage};
/// use warpknit_photo::yarn::develop::{YarnPhotoSettings, develop};
/// let photo = RgbImage::from_fn(300, 120, |x, y| {
///     let yarn = 150 + 90 * u8::from((x + y) % 30 < 15);
///     Rgb([if (40..80).contains(&y) { yarn } else { 20 }; 3])
/// });
/// let yarn = develop(&photo, &YarnPhotoSettings::default(), &mut |_, _| ())?;
/// assert!((yarn.repeat.length - 30.0).abs() < 0.3 && (yarn.yarn_width - 40.0).abs() < 1.0);
/// # Ok::<(), warpknit_photo::yarn::develop::DevelopError>(())
/// ```
///
/// # Errors
/// [`DevelopError`] where the photo shows no yarn that maps can be made of.
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

    let size = photo.dimensions();
    let (threshold, cut) =
        cut_out_yarn(&mut strip, &orientation, size, &ground, settings, decided)?;

    let flat = light::flattened(&strip, &cut);
    let repeat = repeat::repeat(&flat, cut.middle, cut.width);
    let mm_per_pixel = settings.scale.mm_per_pixel(cut.width);
    decided(Step::Repeat, &repeat.to_string());

    let (base, seam) = seamless::seamless(&flat, repeat.length);
    decided(Step::Seamless, &seam.to_string());
    let surface = surface::surface(&base, cut.middle, cut.width);
    decided(Step::Maps, &format!("{} x {} texels", base.width(), base.height()));

    // The steps saw the cropped photo; the caller knows the whole one.
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

/// Steps 2 to 4 on the strip: levels, threshold, alpha. `photo` is the size of the photo in pixels.
fn cut_out_yarn(
    strip: &mut RgbImage,
    orientation: &YarnOrientation,
    photo: (u32, u32),
    ground: &Ground,
    settings: &YarnPhotoSettings,
    decided: &mut dyn FnMut(Step, &str),
) -> Result<(f32, CutOut), DevelopError> {
    let (grey, range) = levels::levels(strip, orientation, photo, ground, settings.levels());
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
    let soft = cut.alpha.values.iter().filter(|&&alpha| alpha > 0.0 && alpha < 1.0).count();
    decided(
        Step::CutOut,
        &format!(
            "the yarn is {:.1} pixels wide, {soft} pixels of its edge and fuzz are soft",
            cut.width
        ),
    );
    Ok((threshold, cut))
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

/// A rectangle of a photo.
fn cropped(photo: &RgbImage, crop: [u32; 4]) -> Result<RgbImage, DevelopError> {
    let [x, y, width, height] = crop;
    // The sums may exceed 32 bits.
    let (right, bottom) = (u64::from(x) + u64::from(width), u64::from(y) + u64::from(height));
    if right > u64::from(photo.width()) || bottom > u64::from(photo.height()) {
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
    /// The user's levels, if at least one of the two was chosen.
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
            // 25.4 mm an inch.
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
            "turned by {degrees:.2} degrees, a strip of {width} x {height} pixels; \
             {percent:.1} % of the photo is yarn"
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
