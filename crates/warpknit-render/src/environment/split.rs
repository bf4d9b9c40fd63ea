//! The split of an environment into one sun and a linear sky.
//!
//! In: the environment's pixels. Out: a [`Light`]. The sun is the cone of [`CONE`] that has most light
//! above that of the ring around it. The sky has the rest of the picture's mean and of its first
//! moments. These alone decide the light on a surface up to spherical harmonics of first order
//! (Ramamoorthi and Hanrahan 2001, 'An efficient representation for irradiance environment maps'). The
//! orders above them are small once the sun is apart.
//!
//! Cost: a pass over the pixels, which become at most [`MOST_CELLS`] cells, and some passes over these.

use std::f32::consts::{PI, TAU};

use glam::{Quat, Vec2, Vec3};
use rayon::prelude::*;
use warpknit_core::ids::index32;

use super::direction_of;
use crate::light::{Light, LightAxes, luminance};

/// Cells across and down at most. Finer ones tell a sun's place no better than its shadow can show.
const MOST_CELLS: [usize; 2] = [1024, 512];
/// Cells across and down among which the sun is looked for at first.
const COARSE: [usize; 2] = [32, 16];
/// Half angle of the cone that is the sun's, radians. A smaller one leaves a part of a soft box to the
/// sky. A larger one takes a bright sky for a sun.
const CONE: f32 = 0.4;
/// Half angle to which the ring around the sun reaches. Its mean is what the sky has there.
const RING: f32 = 0.6;
/// Rounds that move the cone to the middle of its light.
const ROUNDS: usize = 6;
/// Least half angle of a sun. The real one's is 0.0047; a smaller one is all noise in a picture's pixels.
const SMALLEST: f32 = 0.004;

/// Parts of the sphere with their mean radiance.
pub(super) struct Cells {
    cells: Vec<Cell>,
}

#[derive(Clone, Copy)]
struct Cell {
    /// Unit vector to its middle.
    toward: Vec3,
    /// Solid angle, sr.
    size: f32,
    radiance: Vec3,
}

/// A sun's cone.
struct Sun {
    toward: Vec3,
    irradiance: Vec3,
    half_angle: f32,
}

impl Cells {
    /// The cells of a picture.
    pub(super) fn of(size: [usize; 2], pixels: &[Vec3]) -> Self {
        let count = [0, 1].map(|axis: usize| size[axis].min(MOST_CELLS[axis]));
        let middle = |[x, y]: [usize; 2]| {
            let place = [x * size[0] / count[0], y * size[1] / count[1]];
            let end = [(x + 1) * size[0] / count[0], (y + 1) * size[1] / count[1]];
            let rows = (place[1]..end[1]).map(|row| &pixels[row * size[0]..][place[0]..end[0]]);
            let sum: Vec3 = rows.flatten().sum();
            sum / index32((end[0] - place[0]) * (end[1] - place[1])) as f32
        };
        Self::grid(count, middle)
    }

    /// A grid of so many cells across and down.
    fn grid(count: [usize; 2], radiance: impl Fn([usize; 2]) -> Vec3 + Sync) -> Self {
        let [across, down] = count.map(|count| index32(count) as f32);
        let cells = (0..count[0] * count[1]).into_par_iter().map(|at| {
            let place = [at % count[0], at / count[0]];
            let [x, y] = place.map(|index| index32(index) as f32);
            let toward = direction_of(Vec2::new((x + 0.5) / across, (y + 0.5) / down));
            // Between two circles of latitude, by Archimedes.
            let heights = [y, y + 1.0].map(|row| (row / down * PI).cos());
            let size = TAU / across * (heights[0] - heights[1]);
            Cell { toward, size, radiance: radiance(place) }
        });
        Self { cells: cells.collect() }
    }

    /// The light that a ball gets from them, on average over its surface, as luminance.
    pub(super) fn light_on_a_ball(&self) -> f32 {
        0.25 * luminance(self.sum(|cell| cell.radiance))
    }

    /// The sun and the sky that light surfaces most nearly as they do.
    pub(super) fn split(&self) -> Light {
        let sun = self.sun();
        let mean = (self.sum(|cell| cell.radiance) - sun.irradiance) / (2.0 * TAU);
        // First moments, a row of three for each channel.
        let moments = [0, 1, 2].map(|channel: usize| {
            let all = self.sum(|cell| cell.toward * cell.radiance[channel]);
            (all - sun.toward * sun.irradiance[channel]) * (3.0 / (2.0 * TAU))
        });
        let [red, green, blue] = moments;
        let weighted = Vec3::new(
            luminance(Vec3::new(red.x, green.x, blue.x)),
            luminance(Vec3::new(red.y, green.y, blue.y)),
            luminance(Vec3::new(red.z, green.z, blue.z)),
        );
        let sky_direction = weighted.try_normalize().unwrap_or(Vec3::Y);
        let mean = mean.max(Vec3::ZERO);
        // No sky is darker than black.
        let slope = Vec3::from(moments.map(|row| row.dot(sky_direction))).clamp(-mean, mean);
        Light {
            sun_direction: sun.toward,
            sun: sun.irradiance,
            sun_half_angle: sun.half_angle,
            sky_direction,
            sky_above: mean + slope,
            sky_below: mean - slope,
            axes: LightAxes::World,
        }
    }

    /// Sum over the cells, weighted by their size. In 64 bits: 32 would lose what is dim beside a sun.
    fn sum(&self, of: impl Fn(&Cell) -> Vec3) -> Vec3 {
        let parts = self.cells.iter().map(|cell| of(cell).as_dvec3() * f64::from(cell.size));
        parts.sum::<glam::DVec3>().as_vec3()
    }

    /// Sum over the cells in the cone around a direction, weighted by their size.
    fn in_cone(&self, toward: Vec3, of: impl Fn(&Cell) -> Vec3) -> Vec3 {
        let edge = CONE.cos();
        self.sum(|cell| if cell.toward.dot(toward) > edge { of(cell) } else { Vec3::ZERO })
    }

    /// Light of the cone above that of a sky of this radiance.
    fn excess(&self, toward: Vec3, base: Vec3) -> Vec3 {
        self.in_cone(toward, |cell| cell.radiance - base)
    }

    /// Mean radiance of the ring around the cone.
    fn ring(&self, toward: Vec3) -> Vec3 {
        let edges = RING.cos()..CONE.cos();
        let is_in = |cell: &Cell| edges.contains(&cell.toward.dot(toward));
        let light = self.sum(|cell| if is_in(cell) { cell.radiance } else { Vec3::ZERO });
        let size = self.sum(|cell| if is_in(cell) { Vec3::ONE } else { Vec3::ZERO }).x;
        light / size.max(f32::MIN_POSITIVE)
    }

    fn sun(&self) -> Sun {
        let mut toward = self.coarse().brightest();
        for _ in 0..ROUNDS {
            let base = self.ring(toward);
            let pull =
                self.in_cone(toward, |cell| cell.toward * luminance(cell.radiance - base).max(0.0));
            toward = pull.try_normalize().unwrap_or(toward);
        }
        let base = self.ring(toward);
        // The sum of squared angles, weighted by brightness, and that of the weights.
        let spread = self.in_cone(toward, |cell| {
            let (more, angle) =
                (luminance(cell.radiance - base), cell.toward.angle_between(toward));
            Vec3::new(more * angle * angle, more, 0.0)
        });
        // A disc's mean squared angle is half the square of its radius.
        let square = if spread.y > 0.0 { 2.0 * spread.x / spread.y } else { CONE * CONE };
        let half_angle = square.clamp(SMALLEST * SMALLEST, CONE * CONE).sqrt();
        Sun { toward, irradiance: self.excess(toward, base).max(Vec3::ZERO), half_angle }
    }

    /// The same light in fewer cells.
    fn coarse(&self) -> Self {
        let mut coarse = Self::grid(COARSE, |_| Vec3::ZERO);
        for cell in &self.cells {
            let place = super::place_of(cell.toward);
            let [x, y] = [0, 1].map(|axis: usize| {
                super::whole(place[axis] * index32(COARSE[axis]) as f32).min(COARSE[axis] - 1)
            });
            let into = &mut coarse.cells[y * COARSE[0] + x];
            into.radiance += cell.radiance * (cell.size / into.size);
        }
        coarse
    }

    /// The direction of the cone that has most light above that of its ring.
    fn brightest(&self) -> Vec3 {
        let cones = self.cells.par_iter().map(|middle| {
            let more = self.excess(middle.toward, self.ring(middle.toward));
            (luminance(more), middle.toward)
        });
        // The first of equal ones, whatever the number of threads.
        let all: Vec<_> = cones.collect();
        all.into_iter()
            .reduce(|best, next| if next.0 > best.0 { next } else { best })
            .map_or(Vec3::Y, |best| best.1)
    }
}

impl Light {
    /// So many times as bright.
    pub(super) fn scaled(self, scale: f32) -> Self {
        let [sun, sky_above, sky_below] =
            [self.sun, self.sky_above, self.sky_below].map(|color| color * scale);
        Self { sun, sky_above, sky_below, ..self }
    }

    /// Turned.
    pub(super) fn turned(self, rotation: Quat) -> Self {
        let [sun_direction, sky_direction] =
            [self.sun_direction, self.sky_direction].map(|axis| (rotation * axis).normalize());
        Self { sun_direction, sky_direction, ..self }
    }
}
