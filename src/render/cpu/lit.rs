//! Light from a place on a yarn, however it was found.
//!
//! In: a [`ShadingPoint`] or a surface, and what it sees of the sky. Out: its material, where a yarn has
//! maps, and what it reflects of the sky.

use std::f32::consts::TAU;

use glam::{Vec3, Vec4};

use super::to_f32;
use crate::render::light::Rig;
use crate::render::maps::Maps;
use crate::render::ply;
use crate::render::shade::{Surface, schlick_rough};
use crate::render::sheen::Sheen;
use crate::scene::{Shape, YarnLook};

/// A place on a yarn, before anything is known of its colour.
pub(super) struct ShadingPoint {
    pub(super) position: Vec3,
    pub(super) normal: Vec3,
    pub(super) tangent: Vec3,
    /// Across the yarn to where its picture has its top.
    pub(super) top: Vec3,
    /// Angle around a tube, radians; on a ribbon 0..TAU from edge to edge.
    pub(super) around: f32,
    pub(super) along: f32,
}

/// What a sample that meets yarn adds to the film: light, and in w that yarn is there. What is no
/// number is black.
pub(super) fn opaque_sample(light: Vec3) -> Vec4 {
    if light.is_finite() { light.extend(1.0) } else { Vec4::W }
}

/// The sun's light toward the eye, where it shines from a unit direction.
pub(super) fn sun_reflection(
    rig: &Rig,
    surface: &Surface,
    toward_sun: Vec3,
    toward_eye: Vec3,
) -> Vec3 {
    surface.brdf(toward_sun, toward_eye) * rig.sun() * surface.normal.dot(toward_sun).max(0.0)
}

/// What a place sees above it.
#[derive(Clone, Copy)]
pub(super) struct SkyLight {
    /// Mean radiance, by the cosine.
    pub(super) light: Vec3,
    /// Share that no yarn stops.
    pub(super) open: f32,
}

impl SkyLight {
    /// The sky's diffuse light toward the eye, and its mirror image dimmed by how much of it is to
    /// be seen.
    pub(super) fn reflected(&self, rig: &Rig, surface: &Surface, toward_eye: Vec3) -> Vec3 {
        let normal = surface.normal;
        let mirrored = schlick_rough(surface.f0(), normal.dot(toward_eye), surface.roughness);
        let mirror = (normal * (2.0 * normal.dot(toward_eye)) - toward_eye).normalize_or(normal);
        let base = surface.diffuse(mirrored) * self.light + mirrored * rig.sky(mirror) * self.open;
        let sheen = &surface.sheen;
        if sheen.share <= 0.0 {
            return base;
        }
        // Fibres mirror a whole cone of the sky: its mean is not far from that of all.
        let of_fibres =
            surface.sheen_color() * self.light * sheen.sky_reflectance(normal, toward_eye);
        base * sheen.base_share_under_sky(normal.dot(toward_eye)) + of_fibres
    }
}

/// The sheen of a yarn that runs along `tangent`.
pub(super) fn yarn_sheen(look: &YarnLook, tangent: Vec3) -> Sheen {
    let [_, slope] = ply::slopes(to_f32(f64::from(look.plies)), look.twist_slope);
    Sheen { share: look.sheen, slope, tangent }
}

/// The surface of a yarn, without its sheen, at a place of its photo, and its occlusion.
///
/// `footprint` is what a pixel shows of the photo's height and length, as shares of these.
pub(super) fn textured_surface(
    maps: &Maps,
    point: &ShadingPoint,
    footprint: [f32; 2],
    shape: Shape,
) -> (Surface, f32) {
    let (u, v) = (point.around / TAU, point.along / maps.length);
    let texel = maps.sample(u, v, footprint[0], footprint[1], shape);
    let tilt = texel.normal;
    let normal = (point.tangent * tilt.x + point.top * tilt.y + point.normal * tilt.z)
        .normalize_or(point.normal);
    (
        Surface {
            normal,
            albedo: texel.albedo,
            roughness: texel.roughness,
            metallic: texel.metallic,
            sheen: Sheen::NONE,
        },
        texel.occlusion,
    )
}
