//! An environment: light from all around, as a picture of a whole sphere holds it.
//!
//! In: an equirectangular picture in linear RGB, y upward. Out: [`Environment`], which is the background
//! of pictures, and a [`Light`] in the world's axes. The middle of the picture's upper edge is the
//! zenith, and its columns run around the vertical as in Blender and three.js: the one at the middle is
//! at +x, and the one at three quarters at +z.
//!
//! Renderers know one sun and a sky that is linear in height above some direction ([`light`]), so
//! the picture is split into these two (`split`). The radiance's unit is arbitrary in most files. So it
//! is scaled until a ball gets as much light from it as from the studio's lamps.
//!
//! Cost: three passes over the pixels, and 12 bytes each.
//!
//! Not promised: the shadows of a second lamp, and reflections of what the picture shows. Yarns are too
//! rough for mirrors. At the poles, the row beyond the last one is that one again.
//!
//! [`light`]: crate::light

mod split;

use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::fmt;

use glam::{Quat, Vec2, Vec3};
use rayon::prelude::*;
use warpknit_core::ids::index32;

use crate::light::Light;
use crate::maps::whole;
use split::{COARSE, Cells};

/// Largest radiance that is believed. Half floats end below it, and a sun of this radiance in one pixel
/// of a common picture is as bright as the real one. It also keeps sums finite.
const BRIGHTEST: f32 = 1e6;

/// A picture of everything around, linear RGB.
pub struct Environment {
    /// Pixels across and down.
    size: [usize; 2],
    /// Radiance in the unit of [`Light`], row after row from the zenith.
    pixels: Vec<Vec3>,
    /// From the world's axes to those of the picture.
    picture_from_world: Quat,
    light: Light,
}

/// The reason why a picture is no environment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EnvironmentError {
    /// It is no picture of a whole sphere.
    #[error(
        "it has {width} x {height} pixels, and a picture of everything around is twice as wide as high, \
         and at least {} pixels high", COARSE[1]
    )]
    Shape {
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
    },
    /// There is no light in it.
    #[error("it is black: no light comes from it")]
    Black,
}

impl Environment {
    /// An environment of these pixels, row after row from the zenith, linear RGB in any unit. It is
    /// turned by so many radians around the vertical: what is at +x goes towards -z. Pixels that are
    /// no number, or below 0, are black.
    ///
    /// ```
    /// use glam::Vec3;
    /// use warpknit_render::environment::Environment;
    /// let mut pixels = vec![Vec3::splat(0.1); 32 * 16];
    /// pixels[4 * 32 + 24] = Vec3::splat(500.0);
    /// let environment = Environment::new([32, 16], pixels, 0.0).unwrap();
    /// let toward_sun = environment.light().sun_direction;
    /// assert!(toward_sun.y > 0.6 && toward_sun.z > 0.7);
    /// ```
    ///
    /// # Errors
    /// A picture that is not twice as wide as high, a tiny one, and one without light.
    ///
    /// # Panics
    /// If there are not as many pixels as the size says.
    pub fn new(
        size: [usize; 2],
        mut pixels: Vec<Vec3>,
        turn: f32,
    ) -> Result<Self, EnvironmentError> {
        let [width, height] = size;
        // An odd row more or less does not matter. In fewer pixels there is no ring around a sun.
        if width < COARSE[0] || height < COARSE[1] || width.abs_diff(2 * height) > 2 {
            return Err(EnvironmentError::Shape { width, height });
        }
        assert_eq!(pixels.len(), width * height, "as many pixels as the size says");
        let believed = |channel: f32| if channel > 0.0 { channel.min(BRIGHTEST) } else { 0.0 };
        pixels.par_iter_mut().for_each(|pixel| *pixel = pixel.map(believed));
        let cells = Cells::of(size, &pixels);
        let scale = Light::default().mean_irradiance() / cells.mean_irradiance();
        // So it is where the light is 0, and where it is too little to be a number.
        if !scale.is_finite() {
            return Err(EnvironmentError::Black);
        }
        pixels.par_iter_mut().for_each(|pixel| *pixel *= scale);
        let world_from_picture = Quat::from_rotation_y(turn);
        let light = cells.split().scaled(scale).turned(world_from_picture);
        Ok(Self { size, pixels, picture_from_world: world_from_picture.inverse(), light })
    }

    /// Its sun and its sky, fixed in the world.
    #[must_use]
    pub fn light(&self) -> Light {
        self.light
    }

    /// Radiance in a direction of the world, between the four nearest pixels.
    #[must_use]
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        let [width, height] = self.size;
        let place = place_of(self.picture_from_world * direction);
        let at = place * Vec2::new(index32(width) as f32, index32(height) as f32) - 0.5;
        let (low, share) = (at.floor(), at - at.floor());
        let row = |below: f32| {
            // Above the zenith's row, and below the last one, there is no other.
            let y = whole((low.y + below).clamp(0.0, index32(height - 1) as f32));
            let pixel = |right: usize| {
                // Across its edges the picture goes on.
                let x = (whole(low.x + index32(width) as f32) + right) % width;
                self.pixels[y * width + x]
            };
            pixel(0).lerp(pixel(1), share.x)
        };
        row(0.0).lerp(row(1.0), share.y)
    }
}

impl fmt::Debug for Environment {
    /// Without its pixels, which are millions.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { size, light, picture_from_world, pixels: _ } = self;
        let mut fields = formatter.debug_struct("Environment");
        fields.field("size", size).field("light", light);
        fields.field("picture_from_world", picture_from_world).finish_non_exhaustive()
    }
}

/// The place of a direction in the picture, 0..1 across and down.
fn place_of(direction: Vec3) -> Vec2 {
    let around = direction.z.atan2(direction.x) / TAU + 0.5;
    let down = direction.y.atan2(direction.x.hypot(direction.z)) / PI;
    Vec2::new(around, 0.5 - down)
}

/// The direction of a place in the picture, 0..1 across and down.
fn direction_of(place: Vec2) -> Vec3 {
    let (sine, cosine) = ((place.x - 0.5) * TAU).sin_cos();
    let (height, level) = (FRAC_PI_2 - place.y * PI).sin_cos();
    Vec3::new(cosine * level, height, sine * level)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Camera;
    use glam::DVec3;
    use proptest::prelude::*;

    const SIZE: [usize; 2] = [256, 128];

    /// A picture of a radiance.
    fn drawn(radiance: impl Fn(Vec3) -> Vec3) -> Vec<Vec3> {
        let [width, height] = SIZE;
        let places = (0..width * height).map(|at| {
            Vec2::new(index32(at % width) as f32 + 0.5, index32(at / width) as f32 + 0.5)
                / Vec2::new(index32(width) as f32, index32(height) as f32)
        });
        places.map(|place| radiance(direction_of(place))).collect()
    }

    fn environment(radiance: impl Fn(Vec3) -> Vec3) -> Environment {
        Environment::new(SIZE, drawn(radiance), 0.0).unwrap()
    }

    /// The light on a surface without anything around it, by brute force over the picture.
    fn irradiance(environment: &Environment, normal: Vec3) -> Vec3 {
        let [width, height] = SIZE;
        let pixel = TAU / index32(width) as f32 * PI / index32(height) as f32;
        let light = drawn(|toward| {
            let level = toward.x.hypot(toward.z);
            environment.radiance(toward) * normal.dot(toward).max(0.0) * level * pixel
        });
        light.into_iter().sum()
    }

    /// The same from its sun and its sky.
    fn lit(light: &Light, normal: Vec3) -> Vec3 {
        let rig = light.around(&Camera::look_at(DVec3::ONE * 9.0, DVec3::ZERO, 0.5, 1.0));
        light.sun * normal.dot(rig.toward_sun).max(0.0) + rig.sky(normal * (2.0 / 3.0)) * PI
    }

    const NORMALS: [Vec3; 7] = [
        Vec3::X,
        Vec3::NEG_X,
        Vec3::Y,
        Vec3::NEG_Y,
        Vec3::Z,
        Vec3::NEG_Z,
        Vec3::new(0.6, 0.48, 0.64),
    ];

    #[test]
    fn a_sun_over_a_linear_sky_is_found_again() {
        for toward in
            [Vec3::new(-0.5, 0.6, 0.62), Vec3::new(0.1, 0.99, 0.05), Vec3::new(-1.0, 0.2, 0.01)]
        {
            let (toward, up) = (toward.normalize(), Vec3::new(0.3, 0.9, -0.1).normalize());
            let half_angle = 0.07_f32;
            let world = environment(|direction| {
                let sky = Vec3::new(0.3, 0.4, 0.6) * (1.0 + 0.7 * direction.dot(up));
                let is_sun = direction.dot(toward) > half_angle.cos();
                sky + if is_sun { Vec3::new(90.0, 80.0, 60.0) } else { Vec3::ZERO }
            });
            let light = world.light();
            assert!(light.sun_direction.angle_between(toward) < 0.01, "{light:?}");
            assert!((light.sun_half_angle / half_angle - 1.0).abs() < 0.15, "{light:?}");
            assert!(light.sky_direction.angle_between(up) < 0.03, "{light:?}");
            for normal in NORMALS {
                let (expected, found) = (irradiance(&world, normal), lit(&light, normal));
                assert!(expected.distance(found) < 0.02 * expected.length(), "{expected} {found}");
            }
        }
    }

    #[test]
    fn a_room_with_windows_lights_surfaces_nearly_as_its_picture_does() {
        // Dark walls, and two windows of different size and colour.
        let windows =
            [(Vec3::new(0.8, 0.3, 0.5), 0.93, 30.0), (Vec3::new(-0.7, 0.1, -0.7), 0.85, 6.0)];
        let world = environment(|direction| {
            let shines = |(toward, cosine, radiance): (Vec3, f32, f32)| {
                if direction.dot(toward.normalize()) > cosine { radiance } else { 0.0 }
            };
            Vec3::new(0.5, 0.4, 0.3) + Vec3::splat(windows.map(shines).iter().sum())
        });
        let brightest = NORMALS
            .map(|normal| irradiance(&world, normal).length())
            .into_iter()
            .fold(0.0, f32::max);
        for normal in NORMALS {
            let (expected, found) = (irradiance(&world, normal), lit(&world.light(), normal));
            assert!(expected.distance(found) < 0.12 * brightest, "{normal}: {expected} {found}");
        }
        assert!(world.light().sun_direction.angle_between(windows[0].0) < 0.05, "the larger one");
    }

    #[test]
    fn its_unit_does_not_matter_and_its_colour_stays() {
        let radiance = |direction: Vec3| Vec3::new(0.2, 0.3, 0.4) * (1.1 + direction.y);
        let [dim, bright] = [1.0, 300.0].map(|unit| environment(|at| radiance(at) * unit));
        let up = dim.radiance(Vec3::Y);
        assert!(up.distance(bright.radiance(Vec3::Y)) < 1e-4);
        assert!((up.z / up.x - 2.0).abs() < 1e-3);
        let ball = dim.light().mean_irradiance();
        assert!((ball / Light::default().mean_irradiance() - 1.0).abs() < 1e-3);
    }

    #[test]
    fn an_even_sky_has_no_sun() {
        let light = environment(|_| Vec3::ONE).light();
        assert!(light.sun.max_element() < 1e-3, "{light:?}");
        assert!(light.sky_above.distance(light.sky_below) < 1e-3, "{light:?}");
    }

    #[test]
    fn columns_run_as_in_blender_and_turns_are_to_the_left() {
        let red = |toward: Vec3| {
            move |at: Vec3| if at.dot(toward) > 0.97 { Vec3::X } else { Vec3::splat(0.01) }
        };
        let [width, height] = SIZE;
        let pixels = drawn(red(Vec3::Z));
        assert!(pixels[height / 2 * width + width * 3 / 4].x > 0.5, "three quarters across is +z");
        let turned = Environment::new(SIZE, pixels, FRAC_PI_2).unwrap();
        let redness = |at: Vec3| turned.radiance(at).x - turned.radiance(at).y;
        assert!(redness(Vec3::X) > 0.1 && redness(Vec3::Z) < 0.01);
        assert!(turned.light().sun_direction.angle_between(Vec3::X) < 0.02);
    }

    #[test]
    fn what_is_no_environment_is_refused() {
        let flat =
            |size: [usize; 2]| Environment::new(size, vec![Vec3::ONE; size[0] * size[1]], 0.0);
        for [width, height] in [[0, 0], [1, 1], [16, 8], [64, 64], [64, 30], [70, 32]] {
            let error = flat([width, height]).unwrap_err();
            assert_eq!(error, EnvironmentError::Shape { width, height });
        }
        assert!(flat([32, 16]).is_ok() && flat([65, 32]).is_ok());
        for dark in [0.0, f32::NAN, -1.0, 1e-41] {
            let none = Environment::new([32, 16], vec![Vec3::splat(dark); 512], 0.0);
            assert_eq!(none.unwrap_err(), EnvironmentError::Black, "{dark}");
        }
    }

    #[test]
    fn a_sun_of_one_pixel_has_its_light_wherever_it_is_in_pictures_of_any_size() {
        for size in [[1024, 512], [1500, 750], [2000, 1000], [2100, 1050]] {
            let [width, height] = size;
            for step in 0..5 {
                let [x, y] = [width / 5 * step + step + 7, height / 3 + 19 * step];
                let mut pixels = vec![Vec3::splat(0.3); width * height];
                let middle =
                    |index: usize, of: usize| (index32(index) as f32 + 0.5) / index32(of) as f32;
                let toward = direction_of(Vec2::new(middle(x, width), middle(y, height)));
                let solid_angle =
                    TAU * PI * toward.x.hypot(toward.z) / index32(width * height) as f32;
                pixels[y * width + x] = Vec3::splat(3.0 / solid_angle);
                let light = Environment::new(size, pixels, 0.0).unwrap().light();
                assert!(
                    light.sun_direction.angle_between(toward) < 0.01,
                    "{size:?} {step} {light:?}"
                );
                let share = light.sun.x / light.sky_above.x;
                assert!((share / 10.0 - 1.0).abs() < 0.02, "{size:?} {step}: {share}");
            }
        }
    }

    #[test]
    fn an_aureole_does_not_widen_the_sun() {
        let toward = Vec3::new(0.6, 0.5, -0.62).normalize();
        let light = environment(|direction| {
            let angle = direction.angle_between(toward);
            let sun = if angle < 0.05 { 400.0 } else { 0.0 };
            Vec3::splat(0.5 + sun + 0.5 * (-angle / 0.1).exp())
        })
        .light();
        assert!((0.04..0.06).contains(&light.sun_half_angle), "{light:?}");
    }

    proptest! {
        #[test]
        fn a_small_sun_is_found_wherever_it_is(
            at in (0.0..1.0_f32, 0.1..0.9_f32), half_angle in 0.001..0.1_f32, tilt in 0.0..0.8_f32,
        ) {
            let toward = direction_of(Vec2::from(at));
            // A smaller one than a pixel has the light of one.
            let is_sun = |direction: Vec3| direction.angle_between(toward) < half_angle.max(0.02);
            let light = environment(|direction| {
                let sun = if is_sun(direction) { 3000.0 } else { 0.0 };
                Vec3::splat(0.3 * (1.0 + tilt * direction.y) + sun)
            })
            .light();
            prop_assert!(light.sun_direction.angle_between(toward) < 0.03, "{:?}", light);
            prop_assert!(light.sun.x > 0.5 * light.sky_above.x, "{:?}", light);
        }

        #[test]
        fn any_pixels_give_a_light_of_numbers(
            numbers in prop::collection::vec(prop::array::uniform3(prop::num::f32::ANY), 512),
            turn in -10.0..10.0_f32,
            at in prop::array::uniform3(-1.0..1.0_f32),
        ) {
            let pixels = numbers.into_iter().map(Vec3::from).collect();
            let Ok(world) = Environment::new([32, 16], pixels, turn) else { return Ok(()) };
            let light = world.light();
            let all = [light.sun, light.sky_above, light.sky_below, world.radiance(Vec3::from(at))];
            prop_assert!(all.iter().all(|color| color.is_finite() && color.min_element() >= 0.0), "{:?}", light);
            prop_assert!(light.sun_direction.is_normalized() && light.sky_direction.is_normalized());
            prop_assert!(light.sun_half_angle > 0.0 && light.sun_half_angle < 0.5);
        }
    }
}
