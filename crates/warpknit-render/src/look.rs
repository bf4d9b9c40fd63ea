//! How yarns look: colour, gloss, thickness, section and plies.
//!
//! In: numbers of a yarn. Out: [`YarnLook`], one for each guide bar of a scene, and the thinnest and the
//! thickest of some looks.

use glam::Vec3;

use crate::limits::is_drawable_radius;

/// The least and the largest drawable radius of looks, mm; infinity and 0 if there is none.
pub(crate) fn radii<'a>(looks: impl Iterator<Item = &'a YarnLook>) -> (f32, f32) {
    let drawable = looks.map(|look| look.radius).filter(|radius| is_drawable_radius(*radius));
    drawable.fold((f32::INFINITY, 0.0), |(thinnest, thickest), radius| {
        (radius.min(thinnest), radius.max(thickest))
    })
}

/// As [`radii`], without sewing thread. Where there is nothing else, it counts.
pub(crate) fn cloth_radii<'a>(looks: impl Iterator<Item = &'a YarnLook> + Clone) -> (f32, f32) {
    let cloth = radii(looks.clone().filter(|look| look.kind != YarnKind::SewingThread));
    if cloth.1 > 0.0 { cloth } else { radii(looks) }
}

/// How a yarn looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct YarnLook {
    /// Base colour, linear RGB 0..1.
    pub albedo: Vec3,
    /// Perceived roughness 0..1 (Beckmann's `a` is its square).
    pub roughness: f32,
    /// 0 for fibres, 1 for metal.
    pub metallic: f32,
    /// Radius, mm. For a flattened yarn it is that of the circle of the same area.
    pub radius: f32,
    /// Ratio of the section's width to its height, from 0.1 to 10. 1 is round; over 1 it lies flat
    /// in the fabric's plane. Ribbons have none.
    pub flatten: f32,
    /// Number of single yarns that are twisted around each other.
    pub plies: u32,
    /// Twist as a slope: circumference over the length of one turn, of the plies, or of the fibres
    /// in a single yarn. S twist is positive, Z twist negative. `None` stands for a medium twist of plies, and
    /// for hardly any in a single yarn.
    pub twist_slope: Option<f32>,
    /// Specular strength of the fibres, from 0 for dull ones to 1. See [`crate::sheen`].
    pub sheen: f32,
    /// Index of its textures in [`crate::scene::Scene::maps`]. A yarn without textures gets procedural plies and
    /// fibres.
    pub maps: Option<u16>,
    /// What kind of strand has it.
    pub kind: YarnKind,
}

/// What a strand is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum YarnKind {
    /// A yarn of the cloth.
    Yarn,
    /// A single fibre or hair of a yarn, which has no thick and thin places.
    Fibre,
    /// The thread with which edges are sewn. There is little of it, so it does not decide how cloth
    /// is drawn.
    SewingThread,
}

impl YarnLook {
    /// A yarn of one colour without textures, with three plies of a medium twist.
    #[must_use]
    pub const fn plain(albedo: Vec3, roughness: f32, radius: f32) -> Self {
        Self {
            albedo,
            roughness,
            metallic: 0.0,
            radius,
            flatten: 1.0,
            plies: 3,
            twist_slope: None,
            sheen: 0.0,
            maps: None,
            kind: YarnKind::Yarn,
        }
    }
}
