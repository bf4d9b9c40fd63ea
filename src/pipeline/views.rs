//! What the pictures of a garment see of it, found before its yarns are knitted.
//!
//! In: a garment, its cloth, and the cameras of pictures. Out: the points that cameras frame, and
//! [`InView`], by which only what is seen is knitted.

use std::ops::Range;

use glam::{DVec3, Vec3};

use crate::drape::seen::{LEAD_POINTS, Seen, Sight, Stretches, Surroundings};
use crate::drape::{Block, Cloth, DrapeOptions};
use crate::edges::Thread;
use crate::garment::Garment;
use crate::render::light::SKY_REACH_RADII;
use crate::render::scene::{Bounds, Scene};
use crate::render::{Camera, RenderOptions, cloth};

/// What pictures see of a garment.
#[derive(Debug)]
pub struct InView {
    seen: Seen,
    stretches: Stretches,
    sights: Vec<Sight>,
    /// How far around the view yarns matter for its light, mm.
    reach: f64,
}

/// The draped points of a garment's own panels, which cameras frame.
#[must_use]
pub fn draped_points(garment: &Garment) -> Vec<Vec3> {
    let mut points = Vec::new();
    for panel in garment.panels.iter().filter(|panel| panel.turned_in.is_none()) {
        let mut used = vec![false; panel.draped.len()];
        panel.triangles.iter().flatten().for_each(|&vertex| used[vertex as usize] = true);
        let places = panel.draped.iter().zip(used).filter(|(_, used)| *used);
        points.extend(places.map(|(place, _)| place.as_vec3()));
    }
    points
}

/// The box around a garment's yarns.
#[must_use]
pub fn extent(points: &[Vec3], cloth: &Cloth<'_>) -> Option<Bounds> {
    #[expect(clippy::cast_possible_truncation, reason = "a length in mm needs no more")]
    let depth = depth(cloth) as f32;
    Bounds::around(points).map(|Bounds { min, max }| Bounds { min: min - depth, max: max + depth })
}

/// Distance of a cloth's yarns from the draped surface at most, mm.
fn depth(cloth: &Cloth<'_>) -> f64 {
    let thickness = cloth.pattern().depths().into_iter().map(f64::abs).fold(0.0, f64::max);
    // Strained loops move within the cloth by a part of a stitch.
    thickness + cloth.pattern().spacing().max_element()
}

impl InView {
    /// What cameras see of a cloth whose yarns go into `scene`. `None` if they see all of it. With
    /// fibres, yarns in view begin where they begin in the whole.
    #[must_use]
    pub fn of_cameras(
        cloth: &Cloth<'_>,
        scene: &Scene,
        cameras: &[Camera],
        options: &RenderOptions,
        has_fibres: bool,
    ) -> Option<Self> {
        let sights: Vec<_> = cameras.iter().map(|camera| sight(camera, options)).collect();
        let thickest = scene.looks.iter().map(|look| f64::from(look.radius)).fold(0.0, f64::max);
        let stitch = cloth.pattern().spacing().max_element();
        let around = Surroundings {
            stitch,
            depth: depth(cloth) + thickest,
            sky_reach: f64::from(SKY_REACH_RADII) * thickest + stitch,
        };
        let seen = Seen::find(cloth.garment(), &sights, &around)?;
        let near = has_fibres || scene.shows_turns(seen.pixel());
        let stretches = if near { Stretches::FromStart } else { Stretches::AsSeen };
        Some(Self { seen, stretches, sights, reach: around.sky_reach })
    }

    /// The yarns of a cloth that are needed. `options` are those with which it is laid.
    #[must_use]
    pub fn cloth<'a>(&self, whole: &Cloth<'a>, options: &DrapeOptions) -> Cloth<'a> {
        whole.seen(&self.seen, options, self.stretches)
    }

    /// The points of a thread from the first to the last that is in view, and some around them.
    /// `None` if none is.
    #[must_use]
    pub fn of_thread(&self, thread: &Thread) -> Option<Range<usize>> {
        let is_seen = |(place, _): &(DVec3, DVec3)| {
            self.sights.iter().any(|sight| sight.is_near(*place, self.reach))
        };
        let (first, last) = (thread.iter().position(is_seen)?, thread.iter().rposition(is_seen)?);
        Some(first.saturating_sub(LEAD_POINTS)..thread.len().min(last + 1 + LEAD_POINTS))
    }

    /// Adds what is needed of a block to a scene.
    pub fn add_to(&self, scene: &mut Scene, block: &Block) {
        cloth::add_seen(scene, block, &self.seen, self.stretches);
    }
}

/// What decides what a camera sees.
fn sight(camera: &Camera, options: &RenderOptions) -> Sight {
    let rig = options.light.around(camera);
    Sight {
        sides: camera.sides(options.aspect()).to_vec(),
        eye: camera.eye(),
        pixel: camera.pixel_size(1.0, options.height),
        toward_sun: rig.toward_sun.as_dvec3(),
        sun_spread: f64::from(options.light.sun_half_angle).tan(),
    }
}
