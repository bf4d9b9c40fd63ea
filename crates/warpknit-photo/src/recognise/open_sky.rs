//! How much of the sky each place of a repeat sees between the yarns around it.
//!
//! In: a [`HeightBuffer`]. Out: a share for each of its pixels, weighted by the cosine of the angle to
//! the surface: light that comes from everywhere falls on the place by this share.
//!
//! Method: in some planes across the picture, the horizon on both sides of a place; between them the
//! sky's light is known in closed form (Jimenez et al. 2016, *Practical real-time strategies for accurate
//! indirect occlusion*, eq. 7). Cost: 0.1 ms a course of a wale. Not promised: light that yarns
//! throw on each other.

use std::f32::consts::FRAC_PI_2;

use glam::{DVec2, Vec2};

use super::sketch::{HeightBuffer, NONE, Top};
use crate::plane::{double, narrow, whole};

/// Planes across a place, and samples in each on either side. With fewer, the share has steps.
const PLANES: usize = 4;
const SAMPLES: usize = 10;
/// How far a sample may lie, wale spacings. Yarns further away hide little of the sky.
const REACH: f64 = 1.2;

/// A pixel beside another one.
struct Beside {
    /// Pixels to the right and down, wrapped.
    offset: [usize; 2],
    /// One over the distance, 1/mm.
    nearness: f32,
}

/// The pixels on one side of any place in a plane.
struct Side {
    /// The direction away from the place.
    ahead: Vec2,
    pixels: Vec<Beside>,
}

/// The share of the sky above each pixel of a buffer; 0 where there is no yarn.
pub(super) fn open_sky(buffer: &HeightBuffer, wale: f64) -> Vec<f32> {
    let sides = sides(buffer, REACH * wale);
    let [width, height] = buffer.size;
    let share = |at: usize| {
        let top = &buffer.tops[at];
        if top.system == NONE {
            return 0.0;
        }
        let place = [at % width, at / width];
        let of_side = |side: &Side| {
            let rises = side.pixels.iter().map(|beside| {
                let [x, y] = [0, 1].map(|axis| {
                    let moved = place[axis] + beside.offset[axis];
                    if moved < buffer.size[axis] { moved } else { moved - buffer.size[axis] }
                });
                (buffer.tops[y * width + x].height - top.height) * beside.nearness
            });
            seen(top, side.ahead, rises.fold(0.0, f32::max))
        };
        sides.iter().map(of_side).sum::<f32>() / narrow(double(PLANES))
    };
    (0..width * height).map(share).collect()
}

/// Both sides of all planes, with pixels up to some mm away.
fn sides(buffer: &HeightBuffer, reach: f64) -> Vec<Side> {
    (0..2 * PLANES)
        .map(|number| {
            let angle = (double(number) + 0.5) * std::f64::consts::PI / double(PLANES);
            let ahead = DVec2::from_angle(angle);
            let pixels = (1..=SAMPLES).filter_map(|step| {
                // Near yarns hide most: samples lie closer there.
                let distance = reach * (double(step) / double(SAMPLES)).powi(2);
                let pixels = (ahead * distance * buffer.scale).round();
                let distance = (pixels / buffer.scale).length();
                let offset = [0, 1].map(|axis| {
                    whole(narrow(pixels[axis].rem_euclid(double(buffer.size[axis]))))
                        .min(buffer.size[axis] - 1)
                });
                (distance > 0.0).then(|| Beside { offset, nearness: narrow(distance.recip()) })
            });
            Side { ahead: ahead.as_vec2(), pixels: pixels.collect() }
        })
        .collect()
}

/// The share of the sky in half a plane, from the zenith down to a horizon of some slope.
fn seen(top: &Top, ahead: Vec2, slope: f32) -> f32 {
    let (along, up) = (Vec2::from(top.lean).dot(ahead), top.up());
    // The surface's normal in the plane: its length, and its angle from the zenith.
    let (length, normal) = (along.hypot(up), along.atan2(up));
    let horizon = FRAC_PI_2 - slope.atan();
    // Nothing below the surface itself is seen.
    let lowest = normal + (horizon - normal).min(FRAC_PI_2);
    let turned = 2.0 * lowest - normal;
    0.25 * length * (normal.cos() + 2.0 * lowest * normal.sin() - turned.cos())
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_PI_4;

    use super::*;

    /// A surface of one normal.
    fn leaning(x: f32) -> Top {
        Top { height: 0.0, lean: [x, 0.0], system: 0 }
    }

    #[test]
    fn open_places_see_all_of_the_sky_and_slopes_hide_a_part_of_it() {
        let angles = [0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5].map(|number| number * FRAC_PI_4);
        let both = |top: &Top, slope: f32| -> f32 {
            angles.map(|angle| seen(top, Vec2::from_angle(angle), slope)).iter().sum::<f32>() / 4.0
        };
        assert!((both(&leaning(0.0), 0.0) - 1.0).abs() < 1e-6);
        // A horizon of 45 degrees all around leaves sin(45)^2 of a level surface's light.
        assert!((both(&leaning(0.0), 1.0) - 0.5).abs() < 1e-6);
        // A surface that stands upright sees half of the sky.
        assert!((both(&leaning(1.0), 0.0) - 0.5).abs() < 0.02);
        assert!(both(&leaning(0.0), 1e9) < 1e-6);
    }
}
