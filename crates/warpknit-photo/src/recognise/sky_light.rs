//! Light of the sky on a repeat: what reaches each place between the yarns around it.
//!
//! In: a [`HeightBuffer`]. Out: a [`SkyLight`] for each of its pixels. Skies that are brighter on
//! one side count by themselves, so that yarns are shaded and shade each other.
//!
//! Method: in some planes upright to the picture, the directions that yarns hide from a place, as
//! the bits of a mask. A yarn hides what lies between its upper and its lower side, and light passes
//! below it (O. Therrien, Y. Levesque and G. Gilet 2023, *Screen space indirect lighting with
//! visibility bitmask*). Loops that were walls down to the ground would hide most of the underlaps
//! behind them. Cost: 80 samples and the light of 256 sectors a pixel. Not promised: light that
//! yarns throw on each other, and yarns that lie below others in the picture. Between far samples of
//! a flat yarn that leads away, light leaks. Samples that stood for the stretches between them hid
//! too much: of the 25 two-bar cloths of the bench as hard photos, 15 were known and not 19.

use std::f32::consts::FRAC_PI_2;

use glam::{DVec2, Vec2};

use super::sketch::{HeightBuffer, NONE, Top};
use crate::plane::{double, float, narrow, whole};
use warpknit_core::ids::index32;

/// Planes through a place. With fewer, the light has steps; more take longer.
const PLANES: usize = 4;
/// Samples in a plane on either side. With fewer, thin yarns fall between them; more take longer.
const SAMPLES: usize = 10;
/// How far a sample may lie, wale spacings: beyond the legs of the next loop. Further samples would
/// lie farther apart.
const REACH: f64 = 1.2;
/// Sectors of directions on either side of a plane, a bit each. As far away as samples lie, a sector
/// of a shallow slope is as high as a yarn that lies flat. More take longer.
const SECTORS: usize = 32;

/// The light that a place has of three skies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SkyLight {
    /// Of a sky of one brightness: 1 where all of it is seen by a level place.
    pub(super) even: f32,
    /// Of a sky that grows brighter to the right, and of one that grows brighter downward in the
    /// picture. On the other side they are negative.
    pub(super) aside: [f32; 2],
}

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

/// The light of a sector for a normal's parts up and along the plane: of the even sky, and of the
/// one that is brighter on this side.
struct Sector {
    even: Vec2,
    aside: Vec2,
}

/// The light of the sky on each pixel of a buffer; none where there is no yarn.
pub(super) fn sky_light(buffer: &HeightBuffer, wale: f64) -> Vec<SkyLight> {
    let sides = sides(buffer, REACH * wale);
    let sectors: [Sector; SECTORS] = std::array::from_fn(Sector::new);
    let width = buffer.size[0];
    let light = |(at, top): (usize, &Top)| {
        if top.system == NONE {
            return SkyLight::default();
        }
        let place = [at % width, at / width];
        let each = sides.iter().map(|side| (side.direction, hidden(buffer, top, place, side)));
        light_of_sides(&sectors, top, each)
    };
    buffer.tops.iter().enumerate().map(light).collect()
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

/// The sectors that yarns on one side hide from a place.
fn hidden(buffer: &HeightBuffer, top: &Top, place: [usize; 2], side: &SidePixels) -> u32 {
    let width = buffer.size[0];
    let each = side.pixels.iter().map(|pixel| {
        let [x, y] = [0, 1].map(|axis| {
            let moved = place[axis] + pixel.offset[axis];
            if moved < buffer.size[axis] { moved } else { moved - buffer.size[axis] }
        });
        let other = &buffer.tops[y * width + x];
        let rise = other.height - top.height;
        if rise <= 0.0 {
            return 0;
        }
        let [upper, lower] =
            [rise, rise - other.thickness].map(|rise| below(rise * pixel.inverse_distance));
        upper & !lower
    });
    each.fold(0, |hidden, own| hidden | own)
}

/// The sectors below a direction of some slope. They are even steps of slope / (1 + slope), which is
/// 0 at the horizon and 1 at the zenith.
fn below(slope: f32) -> u32 {
    let step = 1.0 - (1.0 + slope.max(0.0)).recip();
    let count = whole((step * float(SECTORS)).round());
    u32::MAX.checked_shr(u32::BITS - index32(count)).unwrap_or(0)
}

impl Sector {
    /// The sector of a number, counted from the horizon.
    fn new(number: usize) -> Self {
        // The slope at a step is step / (1 - step), so that this is its angle from the zenith.
        let angle = |step: usize| {
            let step = float(step) / float(SECTORS);
            FRAC_PI_2 - step.atan2(1.0 - step)
        };
        // The light from the zenith down to an angle: the integral of the cosine between direction and
        // normal, times the sine of the angle, and times its square.
        let down_to = |angle: f32| {
            let (sin, cos) = angle.sin_cos();
            let even = Vec2::new(sin * sin, angle - sin * cos) / 2.0;
            let aside = Vec2::new(sin.powi(3), cos.powi(3) - 3.0 * cos + 2.0) / 3.0;
            [even, aside]
        };
        let [low, high] = [number, number + 1].map(|step| down_to(angle(step)));
        let share = float(PLANES).recip();
        Self { even: share * (low[0] - high[0]), aside: share * (low[1] - high[1]) }
    }
}

/// The light in half planes of some directions, in each some sectors hidden.
fn light_of_sides(
    sectors: &[Sector; SECTORS],
    top: &Top,
    sides: impl Iterator<Item = (Vec2, u32)>,
) -> SkyLight {
    let mut light = SkyLight::default();
    for (direction, hidden) in sides {
        let [even, aside] = half_plane_light(sectors, top, direction, hidden);
        light.even += even;
        light.aside[0] += aside * direction.x;
        light.aside[1] += aside * direction.y;
    }
    light
}

/// The light in half a plane, some sectors hidden: of the even sky, and of the one that is brighter
/// on this side.
fn half_plane_light(
    sectors: &[Sector; SECTORS],
    top: &Top,
    direction: Vec2,
    hidden: u32,
) -> [f32; 2] {
    let normal = Vec2::new(top.up(), Vec2::from(top.lean).dot(direction));
    let mut light = [0.0; 2];
    for (number, sector) in sectors.iter().enumerate() {
        if hidden >> number & 1 == 0 {
            // Nothing below the surface itself is seen, to within a sector.
            light[0] += normal.dot(sector.even).max(0.0);
            light[1] += normal.dot(sector.aside).max(0.0);
        }
    }
    light
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_PI_4;

    use super::*;
    use warpknit_core::fabric::Fabric;

    /// A surface of one normal.
    fn leaning(x: f32) -> Top {
        Top { height: 0.0, lean: [x, 0.0], thickness: f32::INFINITY, system: 0 }
    }

    /// The light on a surface, the same sectors hidden all around.
    fn light(top: &Top, hidden: u32) -> SkyLight {
        let sides = sides(&buffer(|_, _| None), 1.0);
        let each = sides.iter().map(|side| (side.direction, hidden));
        light_of_sides(&std::array::from_fn(Sector::new), top, each)
    }

    #[test]
    fn open_places_see_all_of_the_sky_and_slopes_hide_a_part_of_it() {
        assert!((light(&leaning(0.0), 0).even - 1.0).abs() < 1e-6);
        // A horizon of 45 degrees all around leaves sin(45)^2 of a level surface's light, and what
        // lies above it alone the other half.
        assert!((light(&leaning(0.0), below(1.0)).even - 0.5).abs() < 1e-6);
        assert!((light(&leaning(0.0), !below(1.0)).even - 0.5).abs() < 1e-6);
        // A surface that stands upright sees half of the sky.
        assert!((light(&leaning(1.0), 0).even - 0.5).abs() < 0.02);
        assert_eq!(light(&leaning(0.0), below(f32::INFINITY)), SkyLight::default());
        assert_eq!(below(-1.0), 0);
    }

    #[test]
    fn surfaces_have_the_light_of_the_side_that_they_lean_to() {
        let level = light(&leaning(0.0), 0).aside;
        assert!(level.iter().all(|aside| aside.abs() < 1e-6), "{level:?}");
        // An upright surface has a third of such a sky's light.
        for lean in [-1.0, 1.0] {
            let [right, below] = light(&leaning(lean), 0).aside;
            assert!((right - lean / 3.0).abs() < 1e-3 && below.abs() < 1e-6, "{right} {below}");
        }
    }

    /// Places in mm on a small repeat. Its pixels are not square.
    fn buffer(top: impl Fn(usize, usize) -> Option<Top>) -> HeightBuffer {
        let mut buffer = HeightBuffer::new(&Fabric::named("locknit").unwrap(), [2, 3]);
        let width = buffer.size[0];
        for (at, own) in buffer.tops.iter_mut().enumerate() {
            if let Some(top) = top(at % width, at / width) {
                *own = top;
            }
        }
        buffer
    }

    /// A level place of some height, all of it solid below.
    fn solid(height: f32) -> Top {
        Top { height, ..leaning(0.0) }
    }

    #[test]
    fn level_cloth_is_open_and_holes_have_no_light() {
        let level = sky_light(&buffer(|_, _| Some(solid(0.3))), 1.0);
        assert!(level.iter().all(|light| light.even > 0.999));
        let holes = buffer(|x, _| (x % 2 == 0).then_some(solid(0.3)));
        let lights = sky_light(&holes, 1.0);
        let mut both = holes.tops.iter().zip(&lights);
        assert!(both.all(|(top, light)| (*light == SkyLight::default()) == (top.system == NONE)));
    }

    #[test]
    fn light_goes_with_the_cloth_around_the_repeats_sides() {
        let hill = |x: usize, y: usize| Some(solid(0.1 * ((x * x + 3 * y) % 7) as f32));
        let [width, height] = buffer(hill).size;
        let (moved_x, moved_y) = (5, 11);
        let lights = sky_light(&buffer(hill), 0.7);
        let moved = buffer(|x, y| hill((x + moved_x) % width, (y + moved_y) % height));
        for (at, light) in sky_light(&moved, 0.7).into_iter().enumerate() {
            let [x, y] = [(at % width + moved_x) % width, (at / width + moved_y) % height];
            assert_eq!(light, lights[y * width + x], "{at}");
        }
    }

    /// The light in the middle of a buffer, from whose pixel `far` away a wall of some thickness
    /// stands in the higher pixels of an axis, as high as it is far.
    fn beside_wall(axis: usize, thickness: impl Fn(f32) -> f32) -> SkyLight {
        let level = buffer(|_, _| Some(solid(0.0)));
        let (middle, far) = (level.size[axis] / 2, level.size[axis] / 4);
        let height = far as f32 / level.scale.as_vec2()[axis];
        let wall = Top { thickness: thickness(height), ..solid(height) };
        let is_wall = |x: usize, y: usize| [x, y][axis] >= middle + far;
        let walled = buffer(|x, y| Some(if is_wall(x, y) { wall } else { solid(0.0) }));
        // A sample lies where the wall begins. That of the next repeat is out of reach.
        let lights = sky_light(&walled, f64::from(height) * 1.34 / REACH);
        lights[level.size[1] / 2 * level.size[0] + level.size[0] / 2]
    }

    #[test]
    fn a_long_wall_hides_the_sky_below_its_top() {
        for axis in [0, 1] {
            let light = beside_wall(axis, |height| height);
            // 45 degrees of horizon on one side leave (1 + cos 45) / 2.
            let expected = f32::midpoint(1.0, FRAC_PI_4.cos());
            assert!((light.even - expected).abs() < 0.05, "{axis} {light:?}");
            assert!(light.aside[axis] < -0.05, "{axis} {light:?}");
        }
    }

    #[test]
    fn light_passes_below_a_bridge() {
        for axis in [0, 1] {
            let [wall, bridge] =
                [1.0, 0.25].map(|share| beside_wall(axis, |height| share * height).even);
            assert!(bridge > wall + 0.05, "{axis} {bridge} {wall}");
        }
    }
}
