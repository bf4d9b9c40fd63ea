//! The split of an environment into one sun and a linear sky.
//!
//! In: the environment's pixels. Out: a [`Light`]. The sun is the cone of [`CONE`] that has most light
//! above that of the ring around it. The sky has the rest of the picture's mean and of its first
//! moments. These alone decide the light on a surface up to spherical harmonics of first order
//! (Ramamoorthi and Hanrahan 2001, 'An efficient representation for irradiance environment maps'). The
//! orders above them are small once the sun is apart.
//!
//! Cost: a pass over the pixels, which become at most [`MOST_CELLS`] cells, and some passes over these.
//!
//! Not promised: the light of rooms with several lamps. In eight pictures of rooms, streets and skies
//! the light on surfaces was off by 2 to 11 % of the brightest surface's on average, by 28 % at worst.

use std::f32::consts::{PI, SQRT_2, TAU};
use std::ops::Range;

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use warpknit_core::ids::index32;

use super::{direction_of, place_of};
use crate::light::{Light, LightAxes, luminance};
use crate::maps::whole;

/// Cells across and down at most. Finer ones tell a sun's place no better than its shadow can show.
const MOST_CELLS: [usize; 2] = [1024, 512];
/// Cells across and down among which the sun is looked for at first. Coarser ones miss a sun between
/// two cones. The time grows with the square of their number: these take 10 ms.
pub(super) const COARSE: [usize; 2] = [32, 16];
/// Half angle of the cone that is the sun's, radians. A smaller one leaves a part of a soft box to the
/// sky. A larger one takes a bright sky for a sun.
const CONE: f32 = 0.4;
/// Half angle to which the ring around the sun reaches. Its mean is what the sky has there.
const RING: f32 = 0.6;
/// Rounds that move the cone to the middle of its light.
const ROUNDS: usize = 6;
/// Least half angle of a sun, about half a cell: smaller ones can't be measured. The real one's is
/// 0.0047.
const SMALLEST: f32 = 0.004;
/// Solid angle of everything around, sr.
const SPHERE: f32 = 2.0 * TAU;

/// Parts of the sphere with their mean radiance.
pub(super) struct Cells {
    cells: Vec<SkyCell>,
}

#[derive(Clone, Copy)]
struct SkyCell {
    /// Unit vector to its middle.
    toward: Vec3,
    /// Solid angle, sr.
    solid_angle: f32,
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
        Self::grid(count, size, |[columns, rows]| {
            let area = index32(columns.len() * rows.len()) as f32;
            let rows = rows.map(|row| &pixels[row * size[0]..][columns.clone()]);
            rows.flatten().sum::<Vec3>() / area
        })
    }

    /// A grid of so many cells across and down over a picture of so many pixels. Each cell is made of
    /// whole pixels, so that none has more light than it has, and some cells are a pixel wider.
    fn grid(
        count: [usize; 2],
        size: [usize; 2],
        radiance: impl Fn([Range<usize>; 2]) -> Vec3 + Sync,
    ) -> Self {
        let cells = (0..count[0] * count[1]).into_par_iter().map(|at| {
            let pixels =
                [(0, at % count[0]), (1, at / count[0])].map(|(axis, index): (usize, _)| {
                    index * size[axis] / count[axis]..(index + 1) * size[axis] / count[axis]
                });
            let share =
                |axis: usize, pixel: usize| index32(pixel) as f32 / index32(size[axis]) as f32;
            let [left, right] = [pixels[0].start, pixels[0].end].map(|pixel| share(0, pixel));
            let [top, bottom] = [pixels[1].start, pixels[1].end].map(|pixel| share(1, pixel));
            let toward = direction_of(Vec2::new(0.5 * (left + right), 0.5 * (top + bottom)));
            // Between two circles of latitude, by Archimedes.
            let solid_angle = TAU * (right - left) * ((top * PI).cos() - (bottom * PI).cos());
            SkyCell { toward, solid_angle, radiance: radiance(pixels) }
        });
        Self { cells: cells.collect() }
    }

    /// The irradiance of a ball, on average over its surface, as luminance.
    pub(super) fn mean_irradiance(&self) -> f32 {
        0.25 * luminance(self.sum(|cell| cell.radiance))
    }

    /// The sun and the sky that light surfaces most nearly as they do.
    pub(super) fn split(&self) -> Light {
        let sun = self.sun();
        let mean = (self.sum(|cell| cell.radiance) - sun.irradiance) / SPHERE;
        // First moments, a row of three for each channel.
        let moments = [0, 1, 2].map(|channel: usize| {
            let all = self.sum(|cell| cell.toward * cell.radiance[channel]);
            (all - sun.toward * sun.irradiance[channel]) * (3.0 / SPHERE)
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
    fn sum(&self, of: impl Fn(&SkyCell) -> Vec3) -> Vec3 {
        let parts = self.cells.iter().map(|cell| of(cell).as_dvec3() * f64::from(cell.solid_angle));
        parts.sum::<glam::DVec3>().as_vec3()
    }

    /// Sum over the cells in the cone around a direction, weighted by their size.
    fn in_cone(&self, toward: Vec3, of: impl Fn(&SkyCell) -> Vec3) -> Vec3 {
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
        let is_in = |cell: &SkyCell| edges.contains(&cell.toward.dot(toward));
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
        let irradiance = self.excess(toward, base).max(Vec3::ZERO);
        Sun { toward, irradiance, half_angle: self.half_angle(toward, luminance(base)) }
    }

    /// Half angle of the disc of even radiance that has half of its light within the same angle as the
    /// cone has. The light's second moment would be that of the aureole around a real sun.
    fn half_angle(&self, toward: Vec3, base: f32) -> f32 {
        let edge = CONE.cos();
        let in_cone = self.cells.iter().filter(|cell| cell.toward.dot(toward) > edge);
        let mut light: Vec<(f32, f64)> = in_cone
            .map(|cell| {
                let excess = (luminance(cell.radiance) - base).max(0.0) * cell.solid_angle;
                (cell.toward.angle_between(toward), f64::from(excess))
            })
            .collect();
        light.sort_by(|one, other| one.0.total_cmp(&other.0));
        let half = 0.5 * light.iter().map(|(_, excess)| excess).sum::<f64>();
        let mut within = 0.0;
        let angle = light.iter().find_map(|&(angle, excess)| {
            within += excess;
            (within >= half).then_some(angle)
        });
        (angle.unwrap_or(CONE) * SQRT_2).clamp(SMALLEST, CONE)
    }

    /// The same light in fewer cells.
    fn coarse(&self) -> Self {
        let mut coarse = Self::grid(COARSE, COARSE, |_| Vec3::ZERO);
        for cell in &self.cells {
            let place = place_of(cell.toward);
            let [x, y] = [0, 1].map(|axis: usize| {
                whole(place[axis] * index32(COARSE[axis]) as f32).min(COARSE[axis] - 1)
            });
            let into = &mut coarse.cells[y * COARSE[0] + x];
            into.radiance += cell.radiance * (cell.solid_angle / into.solid_angle);
        }
        coarse
    }

    /// The direction of the cone with the highest [`score`](Self::score).
    fn brightest(&self) -> Vec3 {
        let cones = self.cells.par_iter().map(|middle| (self.score(middle.toward), middle.toward));
        // The first of equal ones, whatever the number of threads.
        let all: Vec<_> = cones.collect();
        all.into_iter()
            .reduce(|best, next| if next.0 > best.0 { next } else { best })
            .map_or(Vec3::Y, |best| best.1)
    }

    /// How much light of a cone is above that of its ring. Light in its middle counts most: a small sun
    /// gives the same sum wherever it is in the cone, and a cone that has it at its edge may lose it
    /// among finer cells.
    fn score(&self, toward: Vec3) -> f32 {
        let (base, edge) = (self.ring(toward), CONE.cos());
        let weighted = |cell: &SkyCell| (cell.radiance - base) * (cell.toward.dot(toward) - edge);
        luminance(self.in_cone(toward, weighted))
    }
}
