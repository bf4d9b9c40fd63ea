//! Tone mapping: from light to pixels.
//!
//! In: linear RGB light with the pixel's coverage, by yarns and by the set behind them. Out: 8-bit
//! sRGB with straight alpha.
//! The tone curve is the identity up to [`SHOULDER`], so that a yarn's colour in the picture is its
//! colour. Brighter values approach white without clipping. A background colour is not light: it
//! appears exactly as given. `shaders/tone.wgsl` repeats this file, and a test compares the two.

use glam::{Vec3, Vec4};
use image::RgbaImage;
use std::str::FromStr;

/// Linear value above which highlights are compressed. Lower values change the yarns' colours;
/// higher ones leave less room for highlights, until they clip.
pub const SHOULDER: f32 = 0.6;

/// Colour of pixels without yarn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Background {
    /// A colour, sRGB 0..=255.
    Color([u8; 3]),
    /// Alpha 0.
    Transparent,
}

impl Default for Background {
    fn default() -> Self {
        Self::Color([255; 3])
    }
}

/// A text that is not a background.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no background: give #rrggbb, #rgb, white, black, grey or transparent")]
pub struct BackgroundError(String);

impl FromStr for Background {
    type Err = BackgroundError;

    /// ```
    /// use warpknit_render::Background;
    /// assert_eq!("#ff8000".parse(), Ok(Background::Color([255, 128, 0])));
    /// assert!("#ff80".parse::<Background>().is_err());
    /// ```
    fn from_str(text: &str) -> Result<Self, BackgroundError> {
        let color = match text.trim().to_ascii_lowercase().as_str() {
            "transparent" | "none" => return Ok(Self::Transparent),
            "white" => Some([255; 3]),
            "black" => Some([0; 3]),
            "grey" | "gray" => Some([128; 3]),
            other => other.strip_prefix('#').and_then(hex),
        };
        color.map(Self::Color).ok_or_else(|| BackgroundError(text.to_owned()))
    }
}

/// A colour from the digits `rrggbb` or `rgb`.
fn hex(digits: &str) -> Option<[u8; 3]> {
    let values: Vec<u8> = digits
        .chars()
        .map(|c| c.to_digit(16).and_then(|d| u8::try_from(d).ok()))
        .collect::<Option<_>>()?;
    match values[..] {
        [r, g, b] => Some([r * 17, g * 17, b * 17]),
        [r1, r0, g1, g0, b1, b0] => Some([r1 * 16 + r0, g1 * 16 + g0, b1 * 16 + b0]),
        _ => None,
    }
}

/// The pixel for the light of yarns and for that of the set behind them. Each is linear RGB times
/// coverage in xyz, coverage 0..1 in w.
#[must_use]
pub fn pixel(light: Vec4, behind: Vec4, exposure: f32, background: Background) -> [u8; 4] {
    over(toned(light, exposure), toned(behind, exposure), background)
}

/// Light after the tone curve, and its coverage.
fn toned(light: Vec4, exposure: f32) -> (Vec3, f32) {
    // Undo the multiplication by coverage before the tone curve, which is not linear.
    let color =
        if light.w > 0.0 { shoulder(light.truncate() / light.w * exposure) } else { Vec3::ZERO };
    (color, light.w.clamp(0.0, 1.0))
}

/// Two layers over a background.
fn over(
    (yarn, coverage): (Vec3, f32),
    (behind, covered): (Vec3, f32),
    background: Background,
) -> [u8; 4] {
    match background {
        Background::Transparent => {
            let alpha = coverage + (1.0 - coverage) * covered;
            let share = if alpha > 0.0 { coverage / alpha } else { 1.0 };
            let [r, g, b] = encode(behind.lerp(yarn, share));
            [r, g, b, byte(alpha)]
        }
        // Without yarn the bytes pass through, without a round trip to linear light.
        Background::Color(color) if coverage == 0.0 && covered == 0.0 => {
            [color[0], color[1], color[2], 255]
        }
        Background::Color(color) => {
            // Blending happens in linear light. In sRGB codes, edges against a bright background
            // would look too dark.
            let color = Vec3::from_array(color.map(|c| linear(f32::from(c) / 255.0)));
            let [r, g, b] = encode(color.lerp(behind, covered).lerp(yarn, coverage));
            [r, g, b, 255]
        }
    }
}

/// A pixel of yarns with straight alpha over the set behind them.
#[must_use]
pub fn blend(pixel: [u8; 4], behind: Vec4, exposure: f32, background: Background) -> [u8; 4] {
    let [r, g, b, alpha] = pixel.map(|code| f32::from(code) / 255.0);
    let yarn = Vec3::from_array([r, g, b].map(linear));
    over((yarn, alpha), toned(behind, exposure), background)
}

/// Mixes a picture with a share, 0 to 1, of another one of the same size. Both have straight alpha,
/// so colours count as far as they cover.
pub fn mix(picture: &mut RgbaImage, other: &RgbaImage, share: f32) {
    for (own, other) in picture.pixels_mut().zip(other.pixels()) {
        let [one, two] = [(own.0[3], 1.0 - share), (other.0[3], share)]
            .map(|(alpha, share)| f32::from(alpha) / 255.0 * share);
        let alpha = one + two;
        for (own, other) in own.0.iter_mut().zip(other.0).take(3) {
            let sum = f32::from(*own) * one + f32::from(other) * two;
            *own = byte(if alpha > 0.0 { sum / alpha / 255.0 } else { 0.0 });
        }
        own.0[3] = byte(alpha);
    }
}

/// The tone curve: identity up to [`SHOULDER`], then 1 - e^-x, which joins it with the same slope.
fn shoulder(light: Vec3) -> Vec3 {
    let room = 1.0 - SHOULDER;
    Vec3::from_array(light.to_array().map(|c| match c {
        // The slope at the shoulder is 1 on both sides, so gradients show no edge there.
        c if c > SHOULDER => 1.0 - room * (-(c - SHOULDER) / room).exp(),
        c if c > 0.0 => c,
        // Also NaN: a pixel without a number is black.
        _ => 0.0,
    }))
}

/// sRGB decoding (IEC 61966-2-1): the linear light of a code from 0 to 1.
#[must_use]
pub fn linear(c: f32) -> f32 {
    if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// The sRGB code of a colour in linear light, each channel from 0 to 1.
#[must_use]
pub fn encode(color: Vec3) -> [u8; 3] {
    color
        .to_array()
        .map(|c| byte(if c <= 0.003_130_8 { c * 12.92 } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }))
}

/// 0..1 as a byte, rounded.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to 0..=255")]
#[must_use]
pub fn byte(share: f32) -> u8 {
    (share.clamp(0.0, 1.0) * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backgrounds_parse() {
        assert_eq!("White".parse(), Ok(Background::Color([255; 3])));
        assert_eq!("#0a0".parse(), Ok(Background::Color([0, 170, 0])));
        assert_eq!("transparent".parse(), Ok(Background::Transparent));
        for bad in ["", "#", "#12345", "#gg0000", "#éab", "reddish"] {
            assert!(
                bad.parse::<Background>().unwrap_err().to_string().contains("#rrggbb"),
                "{bad}"
            );
        }
    }

    #[test]
    fn every_srgb_byte_survives_a_round_trip() {
        for value in 0..=255_u8 {
            let color = Background::Color([value; 3]);
            assert_eq!(pixel(Vec4::ZERO, Vec4::ZERO, 1.0, color), [value, value, value, 255]);
            assert_eq!(encode(Vec3::splat(linear(f32::from(value) / 255.0))), [value; 3]);
        }
    }

    #[test]
    fn the_shoulder_is_smooth_and_never_reaches_white() {
        let at = |c: f32| shoulder(Vec3::splat(c)).x;
        assert_eq!(at(0.3), 0.3);
        assert!((at(SHOULDER + 1e-3) - SHOULDER - 1e-3).abs() < 1e-5);
        assert!(at(2.0) > at(1.0) && at(3.0) < 1.0);
        assert_eq!(at(f32::NAN), 0.0);
    }

    #[test]
    fn transparent_keeps_the_yarns_own_colour() {
        let half =
            pixel(Vec4::new(0.25, 0.25, 0.25, 0.5), Vec4::ZERO, 1.0, Background::Transparent);
        let full = pixel(Vec4::new(0.5, 0.5, 0.5, 1.0), Vec4::ZERO, 1.0, Background::Transparent);
        assert_eq!((half[0], half[3], full[0], full[3]), (full[0], 128, full[0], 255));
        assert_eq!(pixel(Vec4::ZERO, Vec4::ZERO, 1.0, Background::Transparent), [0; 4]);
    }

    #[test]
    fn yarns_lie_over_the_set_and_the_set_over_the_background() {
        let (half, red) = (Vec4::new(0.0, 0.25, 0.0, 0.5), Vec4::new(0.4, 0.0, 0.0, 1.0));
        let blue = Background::Color([0, 0, 255]);
        let at = |light, behind, background| pixel(light, behind, 1.0, background);
        assert_eq!(at(Vec4::ZERO, red, blue), at(red, Vec4::ZERO, blue));
        let [r, g, b] = encode(Vec3::new(0.2, 0.25, 0.0));
        assert_eq!(at(half, red, blue), [r, g, b, 255]);
        assert_eq!(at(half, red, Background::Transparent), [r, g, b, 255]);
        let yarns = at(half, Vec4::ZERO, Background::Transparent);
        for (one, other) in blend(yarns, red, 1.0, blue).into_iter().zip([r, g, b, 255]) {
            assert!(one.abs_diff(other) <= 1);
        }
    }

    #[test]
    fn pictures_mix_by_what_they_cover() {
        let picture = |pixel: [u8; 4]| RgbaImage::from_pixel(1, 1, image::Rgba(pixel));
        for (one, other, share, mixed) in [
            ([200, 100, 0, 255], [100, 200, 50, 255], 0.5, [150, 150, 25, 255]),
            ([200, 100, 0, 255], [0, 0, 0, 0], 0.5, [200, 100, 0, 128]),
            ([200, 100, 0, 255], [9, 9, 9, 255], 0.0, [200, 100, 0, 255]),
            ([0, 0, 0, 0], [0, 0, 0, 0], 0.3, [0, 0, 0, 0]),
        ] {
            let mut found = picture(one);
            mix(&mut found, &picture(other), share);
            assert_eq!(found.get_pixel(0, 0).0, mixed);
        }
    }
}
