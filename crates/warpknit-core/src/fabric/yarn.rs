//! Yarns: count, fibre and colour, and the diameter that follows from them.
//!
//! In: a yarn as a designer orders it, in the units of the trade. Out: its linear density in tex,
//! its diameter in mm and the slope of its twist. The diameter is that of a round yarn of which
//! fibres fill a share. Not promised: how far cloth squeezes the yarn.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::number::byte;

/// A yarn as a designer orders it.
#[derive(Clone, Debug, PartialEq)]
pub struct Yarn {
    /// Linear density, such as `44 dtex`, `20 tex`, `40 den` or `50 Nm`.
    pub count: Count,
    /// Density of the fibre, g/cm³.
    pub density: f64,
    /// Share of the yarn's section that is fibre: about 0.45 textured, 0.6 spun, 0.65 filament, 0.9
    /// elastane, 1 monofilament.
    pub packing: f64,
    /// Colour, sRGB.
    pub color: Color,
    /// Stretched length over relaxed length of the yarn in the cloth, where it is given, as for
    /// elastane. Count and twist are those of the relaxed yarn.
    pub draft: Option<f64>,
    /// Single yarns that are wound around each other, one where it is not given.
    pub plies: Option<u32>,
    /// Turns per metre of the plies, or of the fibres of a single yarn; over 0 is S, under 0 is Z.
    pub twist: Option<f64>,
    /// Young's modulus of the fibre, GPa, where it is given.
    pub modulus: Option<f64>,
    /// Share of light that parallel fibres reflect like a mirror, 0 to 1, where it is given:
    /// filaments do, spun fibres hardly.
    pub sheen: Option<f64>,
    /// Length of the fibres that stand off it, mm for each mm of yarn, as Uster's testers measure it,
    /// where it is given: spun yarns have hairs, filaments none.
    pub hairiness: Option<f64>,
    /// The yarn's pictures, a folder or an image for `warpknit::photo::yarn::read_maps`; in a file its
    /// path starts from the file's folder.
    pub texture: Option<PathBuf>,
    /// Length of yarn that the pictures show, mm. It overrides the length that they give
    /// themselves.
    pub texture_length: Option<f64>,
}

impl Yarn {
    /// A plain yarn: its plies, twist, sheen, hairiness and texture are not given.
    #[must_use]
    pub fn plain(count: Count, density: f64, packing: f64, color: Color) -> Self {
        Self {
            count,
            density,
            packing,
            color,
            draft: None,
            plies: None,
            twist: None,
            modulus: None,
            sheen: None,
            hairiness: None,
            texture: None,
            texture_length: None,
        }
    }

    /// Young's modulus of its fibre, GPa: the given one, or that of the fibre whose density is
    /// nearest. Yarn with a draft counts as elastane.
    ///
    /// The values are initial moduli in N/tex (Morton and Hearle, "Physical Properties of Textile
    /// Fibres", chapter 13) times the density: those of a fibre along its axis, at small strains.
    /// They differ by half from make to make, so a simulation should be given its yarn's own.
    #[must_use]
    pub fn modulus_gpa(&self) -> f64 {
        /// Density in g/cm³ and modulus in GPa: polypropylene, polyamide, wool, polyester, cotton.
        const FIBRES: [(f64, f64); 5] =
            [(0.91, 6.4), (1.14, 3.0), (1.31, 3.0), (1.38, 12.0), (1.52, 7.6)];
        const ELASTANE: f64 = 0.008;
        if let Some(modulus) = self.modulus {
            return modulus;
        }
        if self.draft.is_some() {
            return ELASTANE;
        }
        let away = |fibre: &(f64, f64)| (fibre.0 - self.density).abs();
        let nearest = FIBRES.into_iter().min_by(|a, b| away(a).total_cmp(&away(b)));
        nearest.map_or(ELASTANE, |(_, modulus)| modulus)
    }

    /// Linear density in the cloth, tex: that of the count, over the draft.
    ///
    /// ```
    /// # use warpknit_core::fabric::yarn::Yarn;
    /// # let (count, color) = ("44 dtex".parse().unwrap(), "#ffffff".parse().unwrap());
    /// let elastane = Yarn { draft: Some(2.5), ..Yarn::plain(count, 1.2, 0.9, color) };
    /// assert!((elastane.tex_in_cloth() - 1.76).abs() < 1e-12);
    /// ```
    #[must_use]
    pub fn tex_in_cloth(&self) -> f64 {
        self.count.tex() / self.draft.unwrap_or(1.0)
    }

    /// Diameter in mm of the round yarn in the cloth, `d = 0.03568 sqrt(T / (density · packing))`
    /// with T = [`Yarn::tex_in_cloth`].
    ///
    /// A kilometre of yarn of T tex holds T / density cm³ of fibre, so its section is
    /// `1e-3 T / (density · packing)` mm², and `2 sqrt(1e-3 / π)` is 0.03568. A drafted yarn keeps
    /// its volume, so its diameter falls with the square root of the draft.
    ///
    /// ```
    /// use warpknit_core::fabric::yarn::Yarn;
    /// let (count, color) = ("44 dtex".parse().unwrap(), "#d8d0c0".parse().unwrap());
    /// let polyester = Yarn::plain(count, 1.38, 0.65, color);
    /// assert!((polyester.diameter() - 0.079).abs() < 5e-4);
    /// ```
    #[must_use]
    pub fn diameter(&self) -> f64 {
        0.03568 * (self.tex_in_cloth() / (self.density * self.packing)).sqrt()
    }

    /// Largest ratio of the width of its section to its height, where nothing hinders it.
    ///
    /// Filaments without twist spread until the yarn is twice as wide as a round one. Twist holds
    /// fibres together. A single filament does not spread. The numbers were chosen by eye, from
    /// photos of locknits and jerseys.
    ///
    /// ```
    /// # use warpknit_core::fabric::yarn::Yarn;
    /// # let (count, color) = ("44 dtex".parse().unwrap(), "#ffffff".parse().unwrap());
    /// let filaments = Yarn::plain(count, 1.38, 0.65, color);
    /// assert_eq!(filaments.most_flattening(), 4.0);
    /// assert_eq!(Yarn { packing: 1.0, ..filaments }.most_flattening(), 1.0);
    /// ```
    #[must_use]
    pub fn most_flattening(&self) -> f64 {
        /// Ratio of a yarn without twist, and of one that is twisted hard.
        const RATIOS: [f64; 2] = [4.0, 1.3];
        /// Slope of a hard twist.
        const HARD: f64 = 0.3;
        /// Share of fibre from which on a yarn is one filament.
        const ONE_FILAMENT: f64 = 0.9;
        if self.packing >= ONE_FILAMENT || self.draft.is_some() {
            return 1.0;
        }
        // Plies and spun fibres would not hold together without a twist that is not given.
        let is_spun = self.hairiness.is_some() || self.plies.is_some_and(|plies| plies > 1);
        let untold = if is_spun { HARD } else { 0.0 };
        let twist = (self.twist_slope().unwrap_or(untold).abs() / HARD).min(1.0);
        RATIOS[0] + (RATIOS[1] - RATIOS[0]) * twist
    }

    /// Slope of its twist against its axis, circumference over the length of a turn, where a twist
    /// is given: the same at any scale.
    ///
    /// ```
    /// # use warpknit_core::fabric::yarn::Yarn;
    /// # let (count, color) = ("20 tex".parse().unwrap(), "#ffffff".parse().unwrap());
    /// let mut yarn = Yarn::plain(count, 1.52, 0.6, color);
    /// yarn.twist = Some(600.0);
    /// assert!((yarn.twist_slope().unwrap() - 0.315).abs() < 1e-3);
    /// ```
    #[must_use]
    pub fn twist_slope(&self) -> Option<f64> {
        // A drafted yarn has its turns on a greater length.
        let per_turn = std::f64::consts::PI * self.diameter() / self.draft.unwrap_or(1.0);
        self.twist.map(|turns_per_m| per_turn * turns_per_m / 1000.0)
    }
}

/// The unit of a yarn count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CountUnit {
    Tex,
    Dtex,
    Denier,
    /// Metric number, m/g: the higher, the finer.
    Nm,
}

/// A yarn count as written, kept in its own unit so that it prints as it was given.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Count {
    value: f64,
    unit: CountUnit,
}

impl Count {
    /// A number of tex, rounded to a thousandth and limited to the finest and the coarsest yarn.
    #[must_use]
    pub fn from_tex(tex: f64) -> Self {
        Self {
            value: ((1000.0 * tex).round() / 1000.0).clamp(LEAST_TEX, MOST_TEX),
            unit: CountUnit::Tex,
        }
    }

    /// Linear density in tex (g per 1000 m).
    #[must_use]
    pub fn tex(self) -> f64 {
        match self.unit {
            CountUnit::Tex => self.value,
            CountUnit::Dtex => self.value / 10.0,
            CountUnit::Denier => self.value / 9.0,
            CountUnit::Nm => 1000.0 / self.value,
        }
    }
}

/// The most turns per metre either way.
pub const MOST_TWIST: f64 = 5000.0;
/// The finest count; microfibres have some 0.03 tex.
const LEAST_TEX: f64 = 1e-3;
/// The coarsest count: ropes.
const MOST_TEX: f64 = 1e5;

/// A yarn count that can't be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "'{0}' is no yarn count: write a positive number and tex, dtex, den or Nm, such as '44 dtex' \
         ({LEAST_TEX} to {MOST_TEX} tex)"
)]
pub struct CountError(String);

impl Count {
    /// Reads a number and a unit, if the text is a count.
    fn read(text: &str) -> Option<Self> {
        let trimmed = text.trim();
        // The unit starts at the first letter. An 'e' may be the exponent of the number.
        let split = trimmed.find(|c: char| c.is_ascii_alphabetic() && c != 'e')?;
        let (number, unit) = trimmed.split_at(split);
        let unit = match unit.to_ascii_lowercase().as_str() {
            "tex" => CountUnit::Tex,
            "dtex" => CountUnit::Dtex,
            "den" => CountUnit::Denier,
            "nm" => CountUnit::Nm,
            _ => return None,
        };
        let value =
            number.trim().parse().ok().filter(|value: &f64| value.is_finite() && *value > 0.0)?;
        let count = Self { value, unit };
        (LEAST_TEX..=MOST_TEX).contains(&count.tex()).then_some(count)
    }
}

impl FromStr for Count {
    type Err = CountError;

    fn from_str(text: &str) -> Result<Self, CountError> {
        Self::read(text).ok_or_else(|| CountError(text.to_owned()))
    }
}

impl fmt::Display for Count {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = match self.unit {
            CountUnit::Tex => "tex",
            CountUnit::Dtex => "dtex",
            CountUnit::Denier => "den",
            CountUnit::Nm => "Nm",
        };
        write!(f, "{} {unit}", self.value)
    }
}

impl TryFrom<String> for Count {
    type Error = CountError;

    fn try_from(text: String) -> Result<Self, CountError> {
        text.parse()
    }
}

impl From<Count> for String {
    fn from(count: Count) -> Self {
        count.to_string()
    }
}

/// An sRGB colour, written `#rrggbb`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Color(pub [u8; 3]);

impl Color {
    /// The nearest colour to one in linear light.
    #[must_use]
    pub fn from_linear(linear: [f32; 3]) -> Self {
        // The transfer function of sRGB (IEC 61966-2-1): a straight piece near black, where a power
        // alone would be infinitely steep.
        Self(linear.map(|c| {
            let s = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
            byte(255.0 * s.clamp(0.0, 1.0))
        }))
    }

    /// The colour in linear light, 0..1 (IEC 61966-2-1).
    #[must_use]
    pub fn linear(self) -> [f32; 3] {
        // The inverse of the transfer function; the bounds of its straight piece are its own.
        self.0.map(|byte| {
            let s = f32::from(byte) / 255.0;
            if s <= 0.040_45 { s / 12.92 } else { ((s + 0.055) / 1.055).powf(2.4) }
        })
    }
}

/// A colour that can't be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is no colour: write it as #rrggbb")]
pub struct ColorError(String);

impl FromStr for Color {
    type Err = ColorError;

    fn from_str(text: &str) -> Result<Self, ColorError> {
        let digits = text
            .strip_prefix('#')
            .filter(|d| d.len() == 6 && d.bytes().all(|b| b.is_ascii_hexdigit()));
        let rgb = digits.and_then(|digits| u32::from_str_radix(digits, 16).ok());
        let [_, r, g, b] = rgb.ok_or_else(|| ColorError(text.to_owned()))?.to_be_bytes();
        Ok(Self([r, g, b]))
    }
}

impl fmt::Display for Color {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [r, g, b] = self.0;
        write!(f, "#{r:02x}{g:02x}{b:02x}")
    }
}

impl TryFrom<String> for Color {
    type Error = ColorError;

    fn try_from(text: String) -> Result<Self, ColorError> {
        text.parse()
    }
}

impl From<Color> for String {
    fn from(color: Color) -> Self {
        color.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_convert_to_tex() {
        for (text, tex) in [
            ("44 dtex", 4.4),
            ("20tex", 20.0),
            ("40 DEN", 40.0 / 9.0),
            ("50 Nm", 20.0),
            ("1e1 tex", 10.0),
        ] {
            assert!((text.parse::<Count>().unwrap().tex() - tex).abs() < 1e-12, "{text}");
        }
        for text in [
            "",
            "44",
            "dtex",
            "-3 tex",
            "0 tex",
            "inf tex",
            "4 stone",
            "nan tex",
            "1e300 tex",
            "1e-9 dtex",
        ] {
            assert!(text.parse::<Count>().is_err(), "{text}");
        }
    }

    #[test]
    fn diameters_of_common_yarns() {
        let yarn = |count: &str, density, packing| {
            Yarn::plain(count.parse().unwrap(), density, packing, Color([0; 3]))
        };
        assert!((yarn("44 dtex", 1.38, 0.65).diameter() - 0.079).abs() < 5e-4);
        assert!((yarn("78 dtex", 1.38, 0.65).diameter() - 0.105).abs() < 5e-4);
        assert!((yarn("20 tex", 1.52, 0.6).diameter() - 0.167).abs() < 5e-4);
    }

    #[test]
    fn a_drafted_yarn_keeps_its_volume_and_its_turns() {
        let relaxed = Yarn {
            twist: Some(200.0),
            ..Yarn::plain("44 dtex".parse().unwrap(), 1.2, 0.9, Color([0; 3]))
        };
        let drafted = Yarn { draft: Some(2.5), ..relaxed.clone() };
        let volume = |yarn: &Yarn| yarn.diameter().powi(2) * yarn.draft.unwrap_or(1.0);
        assert!((volume(&drafted) - volume(&relaxed)).abs() < 1e-12);
        assert!((drafted.tex_in_cloth() * 2.5 - relaxed.tex_in_cloth()).abs() < 1e-12);
        let slope = relaxed.twist_slope().unwrap() / 2.5_f64.powf(1.5);
        assert!((drafted.twist_slope().unwrap() - slope).abs() < 1e-12);
    }

    #[test]
    fn colours_read_and_print() {
        assert_eq!("#0A80ff".parse::<Color>().unwrap().to_string(), "#0a80ff");
        for text in ["0a80ff", "#12345", "#12345g", "#éaa1"] {
            assert!(text.parse::<Color>().is_err(), "{text}");
        }
    }
}
