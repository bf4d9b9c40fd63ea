//! Procedural plies and fibres on a smooth tube: the appearance of yarns without textures.
//!
//! In: a point's coordinates on the tube (around and along) and the size of a pixel there. Out: a
//! perturbed normal (bump mapping, Blinn 1978, 'Simulation of wrinkled surfaces') and a factor on
//! the albedo. The tube's silhouette stays round. Detail finer than a pixel fades out, because it
//! would alias.
//!
//! Not promised: the appearance of any particular yarn. Textures from a photo ([`super::maps`])
//! take the place of this file where there are any. `shaders/ply.wgsl` repeats it line by line, and
//! a test compares the two.

use glam::Vec3;
use std::f32::consts::TAU;
use warpknit_core::yarn::fibres::MIDDLING_SLOPE;

/// Largest tilt of the normal, radians, in the groove between plies. The tilt of truly round plies
/// would be 90 degrees and looks like rope at this size. With 0, plies show as stripes of colour
/// only.
const PLY_TILT: f32 = 0.42;
/// Fraction of the light that is lost in the groove between plies.
const GROOVE: f32 = 0.30;
/// Mean depth of the grooves over a yarn's surface: the mean of |2 x|^3 for x in -0.5..0.5.
const MEAN_GROOVE: f32 = 0.25;
/// Visible fibres around the yarn. Real yarns have more, but those would be finer than a pixel in
/// most pictures.
const FIBRES: i32 = 26;
/// Slope of the fibres. Single yarns are twisted against their plying, so that fibres lie almost
/// along the axis.
const FIBRE_SLOPE: f32 = -0.12;
/// Length of a fibre on the surface, radii. Shorter ones look like grain, longer ones like grooves.
const FIBRE_LENGTH: f32 = 5.0;
/// Largest tilt of the normal between fibres, radians.
const FIBRE_TILT: f32 = 0.30;
/// Largest change of the albedo from fibre to fibre.
const FIBRE_SHADE: f32 = 0.16;
/// Smallest cosine between a shaded normal and the direction to the eye.
const MIN_COSINE: f32 = 0.05;

/// A point on a yarn's surface, for procedural detail.
#[derive(Clone, Copy, Debug)]
pub struct YarnPoint {
    /// Unit normal of the tube.
    pub normal: Vec3,
    /// Unit vector to the eye.
    pub toward_eye: Vec3,
    /// Unit tangent of the yarn.
    pub tangent: Vec3,
    /// Angle around the axis in the yarn's tangent frame, radians.
    pub around: f32,
    /// Arc length along the yarn, mm.
    pub along: f32,
    /// Radius, mm.
    pub radius: f32,
    /// Size of a pixel at this point, mm.
    pub footprint: f32,
    /// Number of yarns that are twisted around each other.
    pub plies: f32,
    /// Slope of the twist; see [`crate::scene::YarnLook::twist_slope`].
    pub twist_slope: Option<f32>,
}

/// The normal and the factor on the albedo at a point of the yarn.
#[must_use]
pub fn detail(point: &YarnPoint) -> (Vec3, f32) {
    let turn = TAU * point.radius;
    let around = point.tangent.cross(point.normal);
    let (ply_tilt, groove) =
        if point.plies > 1.0 { plies(point, turn, around) } else { (Vec3::ZERO, 0.0) };
    let fibre_share = fade(point.footprint, 2.0 * turn / small(FIBRES));
    if fibre_share <= 0.0 && ply_tilt == Vec3::ZERO {
        return (face_eye(point.normal, point.toward_eye), 1.0 - GROOVE * groove);
    }
    let (tilt, fibre) = fibres(point, turn);
    let normal = point.normal + ply_tilt + around * (tilt * FIBRE_TILT * fibre_share);
    let shade = (1.0 - GROOVE * groove) * (1.0 + FIBRE_SHADE * fibre * fibre_share);
    (face_eye(normal.normalize_or(point.normal), point.toward_eye), shade)
}

/// Factor on the albedo of a yarn too thin for its plies to be visible.
pub(super) fn mean_shade(plies: u32) -> f32 {
    if plies > 1 { 1.0 - GROOVE * MEAN_GROOVE } else { 1.0 }
}

/// Size of a pixel from which on a yarn of this radius shows neither plies nor fibres, mm: what
/// [`fade`] leaves of them changes no colour by one of 255.
pub(super) fn coarsest_detail(plies: u32, radius: f32) -> f32 {
    let turn = TAU * radius;
    let fibres = 2.0 * turn / small(FIBRES);
    0.95 * if plies > 1 { fibres.max(turn / plies as f32) } else { fibres }
}

/// Slopes of plies and of fibres against the axis. In a single yarn, the twist is that of its
/// fibres.
pub(super) fn slopes(plies: f32, twist_slope: Option<f32>) -> [f32; 2] {
    let fibre = if plies > 1.0 { FIBRE_SLOPE } else { twist_slope.unwrap_or(FIBRE_SLOPE) };
    [twist_slope.unwrap_or(MIDDLING_SLOPE), fibre]
}

/// Tilt of the normal by the plies, and the depth in the groove between them, 0..1.
fn plies(point: &YarnPoint, turn: f32, around: Vec3) -> (Vec3, f32) {
    let share = fade(point.footprint, turn / point.plies);
    let [slope, _] = slopes(point.plies, point.twist_slope);
    // Helical coordinate: the ply's number at this angle and length. It is an integer on a ply's
    // crown.
    let ply = point.plies * (point.around / TAU + slope * point.along / turn);
    // -0.5..0.5 across one ply. The normal tilts outward on both sides of the crown.
    let offset = ply - ply.round();
    let groove = (2.0 * offset.abs()).powi(3);
    // A groove that is finer than a pixel still darkens the yarn by its mean, so the colour does
    // not change with distance.
    (
        (around + point.tangent * slope) * (2.0 * offset * PLY_TILT * share),
        groove * share + MEAN_GROOVE * (1.0 - share),
    )
}

/// `normal`, bent toward the eye if it faces away. Interpolated and perturbed normals may do so
/// near the silhouette, where the BRDF would return black.
pub(super) fn face_eye(normal: Vec3, toward_eye: Vec3) -> Vec3 {
    let cosine = normal.dot(toward_eye);
    if cosine >= MIN_COSINE {
        normal
    } else {
        (normal + toward_eye * (MIN_COSINE - cosine)).normalize_or(toward_eye)
    }
}

/// Slope and height of the fibres' noise, both about -1..1: value noise, stretched along the
/// fibres.
fn fibres(point: &YarnPoint, turn: f32) -> (f32, f32) {
    let [_, slope] = slopes(point.plies, point.twist_slope);
    let q = small(FIBRES) * (point.around / TAU + slope * point.along / turn);
    let v = point.along / (FIBRE_LENGTH * point.radius);
    let (column, row) = (q.floor(), v.floor());
    let (x, y) = (q - column, v - row);
    // Heights at the four corners of the noise's cell.
    let [a, b] = [noise(column, row), noise(column, row + 1.0)];
    let [c, d] = [noise(column + 1.0, row), noise(column + 1.0, row + 1.0)];
    // Smoothstep along the fibre, and across it with its derivative: continuous slopes show no
    // grid.
    let ease = y * y * (3.0 - 2.0 * y);
    let left = a * (1.0 - ease) + b * ease;
    let right = c * (1.0 - ease) + d * ease;
    let smooth = x * x * (3.0 - 2.0 * x);
    ((left - right) * 3.0 * x * (1.0 - x), left + (right - left) * smooth)
}

/// Value noise on a grid that wraps around the yarn, -1..1.
fn noise(column: f32, row: f32) -> f32 {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "whole numbers; far rows may saturate, which only repeats the pattern"
    )]
    let (column, row) = ((column as i32).rem_euclid(FIBRES), row as i32);
    let bits = hash(
        column.cast_unsigned().wrapping_mul(0x9E37_79B9)
            ^ row.cast_unsigned().wrapping_mul(0x85EB_CA6B),
    );
    f32::from(u16::try_from(bits >> 16).unwrap_or(0)) / 32_767.5 - 1.0
}

/// Hash of an integer: the finaliser of MurmurHash3 (Appleby 2011).
#[must_use]
pub fn hash(mut bits: u32) -> u32 {
    bits = (bits ^ (bits >> 16)).wrapping_mul(0x85EB_CA6B);
    bits = (bits ^ (bits >> 13)).wrapping_mul(0xC2B2_AE35);
    bits ^ (bits >> 16)
}

/// Fades detail out: 1 where a pixel is smaller than 0.3 of a feature, 0 where it is as large or
/// larger.
fn fade(footprint: f32, feature: f32) -> f32 {
    let share = ((feature - footprint) / (0.7 * feature).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}

/// A small integer as a float.
fn small(count: i32) -> f32 {
    f32::from(u8::try_from(count).unwrap_or(u8::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::PI;

    fn place(around: f32, along: f32, footprint: f32) -> YarnPoint {
        let normal = Vec3::new(around.cos(), around.sin(), 0.0);
        let (plies, twist_slope) = (3.0, None);
        YarnPoint {
            normal,
            toward_eye: normal,
            tangent: Vec3::Z,
            around,
            along,
            radius: 0.05,
            footprint,
            plies,
            twist_slope,
        }
    }

    #[test]
    fn the_pattern_closes_around_the_yarn() {
        for along in [0.04, 0.13, 7.72] {
            let (a, b) = (detail(&place(-PI, along, 1e-3)), detail(&place(PI, along, 1e-3)));
            assert!(a.0.distance(b.0) < 2e-2 && (a.1 - b.1).abs() < 2e-2);
        }
    }

    #[test]
    fn normals_stay_unit_and_outward_and_far_yarn_is_a_plain_tube() {
        for step in 0_u8..200 {
            let angle = f32::from(step) * 0.1 - 3.0;
            let here = place(angle, f32::from(step) * 0.037, 1e-3);
            let (normal, shade) = detail(&here);
            assert!((normal.length() - 1.0).abs() < 1e-5 && normal.dot(here.normal) > 0.6);
            assert!((0.4..1.2).contains(&shade));
            assert_eq!(detail(&place(angle, 0.0, 1.0)).0, here.normal);
        }
    }

    #[test]
    fn plies_and_twist_are_seen() {
        let grooves = |plies: f32, twist_slope: Option<f32>, along: f32| {
            let shade = |step: u16| {
                let here = place(f32::from(step) * TAU / 720.0 - PI, along, 1e-4);
                detail(&YarnPoint { plies, twist_slope, ..here }).1
            };
            let shades: Vec<_> = (0..720).map(shade).collect();
            let darkest =
                shades.iter().copied().enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
            // A groove takes 30 % of the light, fibres 16 %.
            let dark = |step: usize| shades[step % 720] < 0.8;
            (
                (0..720)
                    .filter(|&step| dark(step) && (1..20).all(|next| !dark(step + next)))
                    .count(),
                darkest.0,
            )
        };
        assert_eq!(grooves(1.0, None, 0.0).0, 0, "a single yarn has no grooves");
        for plies in [2_u8, 3, 5] {
            assert_eq!(grooves(f32::from(plies), None, 0.0).0, usize::from(plies));
        }
        // A sixth of a turn: two plies' grooves move by a third of their distance, one way or the
        // other.
        let sixth = |slope: f32| {
            (grooves(2.0, Some(slope), 0.0).1, grooves(2.0, Some(slope), TAU * 0.05 / 6.0).1)
        };
        let moved = |(before, after): (usize, usize)| (after + 720 - before) % 360;
        assert!(moved(sixth(1.0)).abs_diff(240) < 50 && moved(sixth(-1.0)).abs_diff(120) < 50);
    }
}
