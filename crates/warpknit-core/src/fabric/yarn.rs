//! What a yarn is: its count, its fibre, its colour; and from these its diameter and its weight.

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
    /// Share of the yarn's section that is fibre: about .45 textured, .6 spun, .65 filament, .9
    /// elastane, 1 monofilament.
    pub packing: f64,
    /// Colour, sRGB.
    pub color: Color,
    /// Single yarns that are wound around each other, where it is said.
    pub plies: Option<u32>,
    /// Turns per metre of the plies, or of the fibres of a single yarn; over 0 is S, under 0 is Z.
    pub twist: Option<f64>,
    /// How much fibres that lie side by side mirror, as filaments do and spun fibres don't, 0 to 1,
    /// where it is said.
    pub sheen: Option<f64>,
    /// The yarn's pictures, a folder or an image for [`crate::photo::read_maps`]; in a file its
    /// path starts from the file's folder.
    pub texture: Option<PathBuf>,
    /// Length of yarn that the pictures show, mm, whatever they say themselves.
    pub texture_length: Option<f64>,
}

impl Yarn {
    /// A plain yarn: nothing is said of its plies, twist, sheen and texture.
    #[must_use]
    pub fn plain(count: Count, density: f64, packing: f64, color: Color) -> Self {
        Self {
            count,
            density,
            packing,
            color,
            plies: None,
            twist: None,
            sheen: None,
            texture: None,
            texture_length: None,
        }
    }

    /// Diameter in mm of the round yarn, `d = 0.03568 sqrt(tex / (density · packing))`.
    ///
    /// ```
    /// use warpknit_core::fabric::yarn::Yarn;
    /// let polyester = Yarn::plain("44 dtex".parse().unwrap(), 1.38, 0.65, "#d8d0c0".parse().unwrap());
    /// assert!((polyester.diameter() - 0.079).abs() < 5e-4);
    /// ```
    #[must_use]
    pub fn diameter(&self) -> f64 {
        0.03568 * (self.count.tex() / (self.density * self.packing)).sqrt()
    }

    /// Slope of its twist against its axis, circumference over the length of a turn, where a twist
    /// is given: the same at any scale.
    ///
    /// ```
    /// # use warpknit_core::fabric::yarn::Yarn;
    /// let mut yarn = Yarn::plain("20 tex".parse().unwrap(), 1.52, 0.6, "#ffffff".parse().unwrap());
    /// yarn.twist = Some(600.0);
    /// assert!((yarn.twist_slope().unwrap() - 0.315).abs() < 1e-3);
    /// ```
    #[must_use]
    pub fn twist_slope(&self) -> Option<f64> {
        self.twist.map(|turns_per_m| std::f64::consts::PI * self.diameter() * turns_per_m / 1000.0)
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
    /// As coarse as that, times a share, held to what yarns can have.
    #[must_use]
    pub fn times(self, share: f64) -> Self {
        Self { value: (share * self.tex()).clamp(LEAST_TEX, MOST_TEX), unit: CountUnit::Tex }
    }

    /// So many tex, held to what yarns can have, to a thousandth.
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
/// The finest yarn: microfibres have some 0.03 tex.
const LEAST_TEX: f64 = 1e-3;
/// The coarsest: ropes.
const MOST_TEX: f64 = 1e5;

/// A yarn count that can't be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "'{0}' is no yarn count: write a positive number and tex, dtex, den or Nm, such as '44 dtex' \
         ({LEAST_TEX} to {MOST_TEX} tex)"
)]
pub struct CountError(String);

impl FromStr for Count {
    type Err = CountError;

    fn from_str(text: &str) -> Result<Self, CountError> {
        let refuse = || CountError(text.to_owned());
        let trimmed = text.trim();
        let split =
            trimmed.find(|c: char| c.is_ascii_alphabetic() && c != 'e').ok_or_else(refuse)?;
        let (number, unit) = trimmed.split_at(split);
        let unit = match unit.to_ascii_lowercase().as_str() {
            "tex" => CountUnit::Tex,
            "dtex" => CountUnit::Dtex,
            "den" => CountUnit::Denier,
            "nm" => CountUnit::Nm,
            _ => return Err(refuse()),
        };
        let value = number
            .trim()
            .parse()
            .ok()
            .filter(|value: &f64| value.is_finite() && *value > 0.0)
            .ok_or_else(refuse)?;
        let count = Self { value, unit };
        if (LEAST_TEX..=MOST_TEX).contains(&count.tex()) { Ok(count) } else { Err(refuse()) }
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
        Self(linear.map(|c| {
            let s = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
            byte(255.0 * s.clamp(0.0, 1.0))
        }))
    }

    /// The colour in linear light, 0..1 (IEC 61966-2-1).
    #[must_use]
    pub fn linear(self) -> [f32; 3] {
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
        let refuse = || ColorError(text.to_owned());
        let digits = text
            .strip_prefix('#')
            .filter(|d| d.len() == 6 && d.bytes().all(|b| b.is_ascii_hexdigit()));
        let digits = digits.ok_or_else(refuse)?;
        let byte =
            |at: usize| u8::from_str_radix(&digits[at..at + 2], 16).map_err(|_not_hex| refuse());
        Ok(Self([byte(0)?, byte(2)?, byte(4)?]))
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
    fn diameters_of_the_specification() {
        let yarn = |count: &str, density, packing| {
            Yarn::plain(count.parse().unwrap(), density, packing, Color([0; 3]))
        };
        assert!((yarn("44 dtex", 1.38, 0.65).diameter() - 0.079).abs() < 5e-4);
        assert!((yarn("78 dtex", 1.38, 0.65).diameter() - 0.105).abs() < 5e-4);
        assert!((yarn("20 tex", 1.52, 0.6).diameter() - 0.167).abs() < 5e-4);
    }

    #[test]
    fn colours_read_and_print() {
        assert_eq!("#0A80ff".parse::<Color>().unwrap().to_string(), "#0a80ff");
        for text in ["0a80ff", "#12345", "#12345g", "#éaa1"] {
            assert!(text.parse::<Color>().is_err(), "{text}");
        }
    }
}
