//! Sky visibility (ambient occlusion) of a repeat: how much of the sky each place sees between the yarns
//! around it.
//!
//! In: a [`HeightBuffer`]. Out: a share for each of its pixels, weighted by the cosine of the angle to
//! the surface. A sky of one brightness lights the place by this share.
//!
//! Method: in some planes upright to the picture, the horizon on both sides of a place. Between both
//! horizons the sky's light has a closed form (Jimenez et al. 2016, *Practical real-time strategies for
//! accurate indirect occlusion*, eq. 7). Cost: 80 samples a pixel. Not promised: light that yarns throw
//! on each other.

use std::f32::consts::FRAC_PI_2;

use glam::{DVec2, Vec2};

use super::sketch::{HeightBuffer, NONE, Top};
use crate::plane::{double, narrow, whole};

/// Planes through a place. With fewer, the share has steps; more take longer.
const PLANES: usize = 4;
/// Samples in a plane on either side. With fewer, thin yarns fall between them; more take longer.
const SAMPLES: usize = 10;
/// How far a sample may lie, wale spacings: beyond the legs of the next loop. Further samples would lie
/// farther apart.
const REACH: f64 = 1.2;

/// A pixel at a place's side.
struct SidePixel {
    /// Pixels to the right and down, wrapped.
    offset: [usize; 2],
    /// One over the distance, 1/mm.
    inverse_distance: f32,
}

/// The pixels on one side of any place in a plane.
struct SidePixels {
    /// The direction away from the place.
    direction: Vec2,
    pixels: Vec<SidePixel>,
}

/// The share of the sky above each pixel of a buffer; 0 where there is no yarn.
pub(super) fn sky_visibility(buffer: &HeightBuffer, wale: f64) -> Vec<f32> {
    let sides = sides(buffer, REACH * wale);
    let [width, height] = buffer.size;
    let share = |at: usize| {
        let top = &buffer.tops[at];
        if top.system == NONE {
            return 0.0;
        }
        let place = [at % width, at / width];
        let of_side = |side: &SidePixels| {
            let rises = side.pixels.iter().map(|sample| {
                let [x, y] = [0, 1].map(|axis| {
                    let moved = place[axis] + sample.offset[axis];
                    if moved < buffer.size[axis] { moved } else { moved - buffer.size[axis] }
                });
                (buffer.tops[y * width + x].height - top.height) * sample.inverse_distance
            });
            half_plane_visibility(top, side.direction, rises.fold(0.0, f32::max))
        };
        sides.iter().map(of_side).sum::<f32>() / narrow(double(PLANES))
    };
    (0..width * height).map(share).collect()
}

/// Both sides of all planes, with pixels up to some mm away.
fn sides(buffer: &HeightBuffer, reach: f64) -> Vec<SidePixels> {
    (0..2 * PLANES)
        .map(|number| {
            let angle = (double(number) + 0.5) * std::f64::consts::PI / double(PLANES);
            let direction = DVec2::from_angle(angle);
            let pixels = (1..=SAMPLES).filter_map(|step| {
                // Near yarns hide most: samples lie closer there.
                let distance = reach * (double(step) / double(SAMPLES)).powi(2);
                let pixels = (direction * distance * buffer.scale).round();
                let distance = (pixels / buffer.scale).length();
                let offset = [0, 1]
                    .map(|axis| whole(narrow(pixels[axis].rem_euclid(double(buffer.size[axis])))));
                (distance > 0.0)
                    .then(|| SidePixel { offset, inverse_distance: narrow(distance.recip()) })
            });
            SidePixels { direction: direction.as_vec2(), pixels: pixels.collect() }
        })
        .collect()
}

/// What a place sees of the sky in half a plane, from the zenith down to a horizon of some slope.
fn half_plane_visibility(top: &Top, direction: Vec2, slope: f32) -> f32 {
    let (along, up) = (Vec2::from(top.lean).dot(direction), top.up());
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
    use warpknit_core::fabric::Fabric;

    /// A surface of one normal.
    fn leaning(x: f32) -> Top {
        Top { height: 0.0, lean: [x, 0.0], system: 0 }
    }

    #[test]
    fn open_places_see_all_of_the_sky_and_slopes_hide_a_part_of_it() {
        let angles = [0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5].map(|number| number * FRAC_PI_4);
        let both = |top: &Top, slope: f32| -> f32 {
            angles
                .map(|angle| half_plane_visibility(top, Vec2::from_angle(angle), slope))
                .iter()
                .sum::<f32>()
                / 4.0
        };
        assert!((both(&leaning(0.0), 0.0) - 1.0).abs() < 1e-6);
        // A horizon of 45 degrees all around leaves sin(45)^2 of a level surface's light.
        assert!((both(&leaning(0.0), 1.0) - 0.5).abs() < 1e-6);
        // A surface that stands upright sees half of the sky.
        assert!((both(&leaning(1.0), 0.0) - 0.5).abs() < 0.02);
        assert!(both(&leaning(0.0), 1e9) < 1e-6);
    }

    /// Heights in mm on a small repeat. Its pixels are not square.
    fn buffer(height: impl Fn(usize, usize) -> Option<f32>) -> HeightBuffer {
        let mut buffer = HeightBuffer::new(&Fabric::named("locknit").unwrap(), [2, 3]);
        let width = buffer.size[0];
        for (at, top) in buffer.tops.iter_mut().enumerate() {
            if let Some(height) = height(at % width, at / width) {
                *top = Top { height, ..leaning(0.0) };
            }
        }
        buffer
    }

    #[test]
    fn level_cloth_is_open_and_holes_have_no_share() {
        assert!(sky_visibility(&buffer(|_, _| Some(0.3)), 1.0).iter().all(|share| *share > 0.999));
        let holes = buffer(|x, _| (x % 2 == 0).then_some(0.3));
        let shares = sky_visibility(&holes, 1.0);
        assert!(
            holes
                .tops
                .iter()
                .zip(&shares)
                .all(|(top, share)| (*share == 0.0) == (top.system == NONE))
        );
    }

    #[test]
    fn shares_go_with_the_cloth_around_the_repeats_sides() {
        let hill = |x: usize, y: usize| Some(0.1 * ((x * x + 3 * y) % 7) as f32);
        let [width, height] = buffer(hill).size;
        let (moved_x, moved_y) = (5, 11);
        let shares = sky_visibility(&buffer(hill), 0.7);
        let moved = buffer(|x, y| hill((x + moved_x) % width, (y + moved_y) % height));
        for (at, share) in sky_visibility(&moved, 0.7).into_iter().enumerate() {
            let [x, y] = [(at % width + moved_x) % width, (at / width + moved_y) % height];
            assert_eq!(share, shares[y * width + x], "{at}");
        }
    }

    #[test]
    fn a_long_wall_hides_the_sky_below_its_top() {
        for axis in [0, 1] {
            let level = buffer(|_, _| Some(0.0));
            let (middle, far) = (level.size[axis] / 2, level.size[axis] / 4);
            // As high as it is far.
            let height = far as f32 / level.scale.as_vec2()[axis];
            let walled =
                buffer(|x, y| Some(if [x, y][axis] >= middle + far { height } else { 0.0 }));
            // The wall of the next repeat stands out of reach on the other side.
            let shares = sky_visibility(&walled, f64::from(height) * 1.5 / REACH);
            let share = shares[level.size[1] / 2 * level.size[0] + level.size[0] / 2];
            // 45 degrees of horizon on one side leave (1 + cos 45) / 2.
            let expected = f32::midpoint(1.0, FRAC_PI_4.cos());
            assert!((share - expected).abs() < 0.05, "{axis} {share}");
        }
    }
}
