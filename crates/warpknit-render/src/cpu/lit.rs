//! Shading that both CPU methods share.
//!
//! In: a point on a yarn ([`ShadingPoint`]), its texture if it has one, and the light that arrives
//! from the sky. Out: the surface's material there and the light that it reflects toward the eye.

use std::f32::consts::TAU;

use glam::{Vec3, Vec4};

use super::to_f32;
use crate::light::Rig;
use crate::maps::Maps;
use crate::ply;
use crate::scene::{Shape, YarnLook};
use crate::shade::{Surface, schlick_rough};
use crate::sheen::Sheen;

/// A point on a yarn, before its material is known.
pub(super) struct ShadingPoint {
    pub(super) position: Vec3,
    pub(super) normal: Vec3,
    pub(super) tangent: Vec3,
    /// Unit vector across the yarn, toward the top of its texture.
    pub(super) top: Vec3,
    /// Angle around a tube, radians; on a ribbon 0..TAU from edge to edge.
    pub(super) around: f32,
    /// Arc length along the yarn, mm.
    pub(super) along: f32,
}

/// A film sample that meets yarn: its light, and a coverage of 1 in w. Light that is not finite
/// becomes black, because a single NaN would otherwise spread to nine pixels of the film.
pub(super) fn opaque_sample(light: Vec3) -> Vec4 {
    if light.is_finite() { light.extend(1.0) } else { Vec4::W }
}

/// The sun's light that the surface reflects toward the eye, for a sun in direction `toward_sun`.
pub(crate) fn sun_reflection(
    rig: &Rig,
    surface: &Surface,
    toward_sun: Vec3,
    toward_eye: Vec3,
) -> Vec3 {
    surface.brdf(toward_sun, toward_eye) * rig.sun() * surface.normal.dot(toward_sun).max(0.0)
}

/// Light from the sky, and from yarns that hide part of it, at one point.
#[derive(Clone, Copy)]
pub(crate) struct SkyLight {
    /// Cosine-weighted mean radiance over the hemisphere.
    pub(crate) light: Vec3,
    /// Visibility of the sky: the fraction of the hemisphere that no yarn occludes.
    pub(crate) open: f32,
}

impl SkyLight {
    /// Reflection of the sky: a diffuse part, and a mirror part that is scaled by the sky's
    /// visibility.
    pub(crate) fn reflected(&self, rig: &Rig, surface: &Surface, toward_eye: Vec3) -> Vec3 {
        let normal = surface.normal;
        // Split into a diffuse and a specular integral. The specular one is approximated by the
        // radiance in the mirror direction times the mean Fresnel term, instead of by more rays.
        let mirrored = schlick_rough(surface.f0(), normal.dot(toward_eye), surface.roughness);
        let mirror = (normal * (2.0 * normal.dot(toward_eye)) - toward_eye).normalize_or(normal);
        let base = surface.diffuse(mirrored) * self.light + mirrored * rig.sky(mirror) * self.open;
        let sheen = &surface.sheen;
        if sheen.share <= 0.0 {
            return base;
        }
        // Fibres reflect light into a whole cone, so the sky's mean stands for what they mirror.
        let of_fibres =
            surface.sheen_color() * self.light * sheen.sky_reflectance(normal, toward_eye);
        base * sheen.base_share_under_sky(normal.dot(toward_eye)) + of_fibres
    }
}

/// The sheen of a yarn of this look, which runs along `tangent`.
pub(super) fn yarn_sheen(look: &YarnLook, tangent: Vec3) -> Sheen {
    let [_, slope] = ply::slopes(to_f32(f64::from(look.plies)), look.twist_slope);
    Sheen { share: look.sheen, slope, tangent }
}

/// The surface and the occlusion of a textured yarn at a point, without its sheen.
///
/// `footprint` is the size of a pixel as fractions of the texture's height and length. It selects
/// the mip level.
pub(super) fn textured_surface(
    maps: &Maps,
    point: &ShadingPoint,
    footprint: [f32; 2],
    shape: Shape,
) -> (Surface, f32) {
    let (u, v) = (point.around / TAU, point.along / maps.length);
    let texel = maps.sample(u, v, footprint[0], footprint[1], shape);
    let tilt = texel.normal;
    // Normal mapping: x along the yarn, y toward the texture's top, z outward.
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
