//! How a yarn's surface reflects light: Cook-Torrance with Beckmann's distribution and Schlick's
//! Fresnel and Smith terms.
//!
//! In: a [`Surface`] (normal and material at a point) and two unit directions. Out: the BRDF
//!
//! ```text
//! f = (1 - F)(1 - metal) albedo / pi + D F G / (4 (n.l)(n.v))
//! F = F0 + (1 - F0)(1 - v.h)^5,     F0 = mix(0.04, albedo, metal)
//! D = exp(-tan^2(t)/a^2) / (pi a^2 cos^4(t)),   t the angle of n and h,   a = roughness^2
//! G = G1(l) G1(v),   G1(x) = n.x / ((n.x)(1-k) + k),   k = (roughness+1)^2/8
//! ```
//!
//! Source: the yarn papers' shading section with its misprints mended (Cook and Torrance 1982;
//! Schlick 1994). A shader is to follow this file line by line. It is reciprocal, and loses a
//! little light between microfacets. It gains none for roughness from 0.55 up, where fibres lie;
//! smoother white dielectrics gain up to 8 % at grazing angles, because the diffuse part gives up F
//! of the half vector and not what the specular part takes.

use super::sheen::Sheen;
use glam::Vec3;
use std::f32::consts::PI;

/// Roughness is held above this: a mirror has no BRDF to evaluate.
const MIN_ROUGHNESS: f32 = 0.03;

/// What light meets at one point.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Unit normal.
    pub normal: Vec3,
    /// Base colour, linear RGB 0..1.
    pub albedo: Vec3,
    /// Perceived roughness, 0..1.
    pub roughness: f32,
    /// 0 for fibres, 1 for metal.
    pub metallic: f32,
    /// What its fibres mirror besides.
    pub sheen: Sheen,
}

impl Surface {
    /// Reflectance at normal incidence.
    #[must_use]
    pub fn f0(&self) -> Vec3 {
        Vec3::splat(0.04).lerp(self.albedo, self.metallic)
    }

    /// The BRDF toward `view` of light from `light`, unit vectors away from the surface; zero where
    /// either is below it.
    #[must_use]
    pub fn brdf(&self, light: Vec3, view: Vec3) -> Vec3 {
        let base = self.base_brdf(light, view);
        if self.sheen.share > 0.0 {
            base + self.sheen_color() * self.sheen.lobe(self.normal, light, view)
        } else {
            base
        }
    }

    /// The BRDF without the fibres' sheen, less what this takes.
    #[must_use]
    pub fn base_brdf(&self, light: Vec3, view: Vec3) -> Vec3 {
        let (nl, nv) = (self.normal.dot(light), self.normal.dot(view));
        let half = (light + view).normalize_or_zero();
        let nh = self.normal.dot(half);
        if nl <= 0.0 || nv <= 0.0 || nh <= 0.0 {
            return Vec3::ZERO;
        }
        let roughness = self.roughness.clamp(MIN_ROUGHNESS, 1.0);
        let fresnel = schlick(self.f0(), view.dot(half));
        // G1(x) / n.x, so that the BRDF's own 1 / (n.l n.v) cancels and grazing angles stay finite.
        let k = (roughness + 1.0) * (roughness + 1.0) / 8.0;
        let masking = |cosine: f32| 1.0 / (cosine * (1.0 - k) + k);
        let specular =
            fresnel * (beckmann(nh, roughness * roughness) * masking(nl) * masking(nv) / 4.0);
        (self.diffuse(fresnel) / PI + specular) * self.sheen.base_share(nl, nv)
    }

    /// The colour of a sheen: a third of it comes off the fibres, white, and the rest through them.
    #[must_use]
    pub fn sheen_color(&self) -> Vec3 {
        self.albedo.lerp(Vec3::ONE, 1.0 / 3.0)
    }

    /// The part of the light that leaves as the base colour where the share `fresnel` is mirrored.
    #[must_use]
    pub fn diffuse(&self, fresnel: Vec3) -> Vec3 {
        (Vec3::ONE - fresnel) * self.albedo * (1.0 - self.metallic)
    }
}

/// Schlick's Fresnel term for the cosine between a direction and the mirroring normal.
#[must_use]
pub fn schlick(f0: Vec3, cosine: f32) -> Vec3 {
    f0 + (Vec3::ONE - f0) * (1.0 - cosine.clamp(0.0, 1.0)).powi(5)
}

/// The mean of Schlick's term over the microfacets of a rough surface (Lagarde 2011): rough cloth
/// does not turn into a mirror at grazing angles. For light from a whole sky, where there is no
/// single half vector.
#[must_use]
pub fn schlick_rough(f0: Vec3, cosine: f32, roughness: f32) -> Vec3 {
    f0 + (f0.max(Vec3::splat(1.0 - roughness)) - f0) * (1.0 - cosine.clamp(0.0, 1.0)).powi(5)
}

/// Cloth is about this thick, radii of its thinnest yarn; what lies deeper is another layer, such
/// as a skirt's other side.
pub(super) const LAYER_RADII: f32 = 12.0;

/// Share of the sky that yarns nearby leave open for a yarn that lies `before` the mean depth of
/// the nearest layer around it, radii; none for one of another layer. `cover` is the share of the
/// surroundings that are yarn, `cosine` that of its surface with the direction to the eye.
///
/// A logistic curve, fitted to what traced rays see on tricot and locknit from three sides, to .13
/// root mean square of a share that varies by .26. Another layer, seen through a hole, has the sky
/// of a cloth's middle.
pub(super) fn sky_visibility(before: Option<f32>, cover: f32, cosine: f32, is_ribbon: bool) -> f32 {
    let middle = if is_ribbon { -0.35 } else { 0.065 };
    let level = before.map_or(0.5, |before| 1.0 / (1.0 + (middle - 0.427 * before).exp()));
    ((1.0 + cover * (level - 1.0)) * (0.51 + (1.2 - 0.51) * cosine)).clamp(0.0, 1.0)
}

/// Beckmann's distribution of microfacet normals.
fn beckmann(cosine: f32, a: f32) -> f32 {
    let cos2 = (cosine * cosine).min(1.0);
    let a2 = a * a;
    // cos^4 underflows only where the exponential is zero long before.
    (-(1.0 - cos2) / (cos2 * a2)).exp() / (PI * a2 * cos2 * cos2).max(f32::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn direction(cosine: f32, angle: f32) -> Vec3 {
        let sine = (1.0 - cosine * cosine).sqrt();
        Vec3::new(sine * angle.cos(), sine * angle.sin(), cosine)
    }

    fn materials() -> impl Iterator<Item = Surface> {
        let of = |roughness: f32, metallic: f32, albedo: f32| Surface {
            normal: Vec3::Z,
            albedo: Vec3::splat(albedo),
            roughness,
            metallic,
            sheen: Sheen::NONE,
        };
        [0.25, 0.55, 0.7, 1.0].into_iter().flat_map(move |roughness| {
            [(0.0, 1.0), (0.0, 0.5), (0.5, 1.0), (1.0, 1.0)]
                .map(|(metallic, albedo)| of(roughness, metallic, albedo))
        })
    }

    /// The integral of f (n.l) over the hemisphere, by the midpoint rule in the cosine and the
    /// angle.
    fn furnace(surface: &Surface, view: Vec3) -> f32 {
        let (rings, spokes) = (400_u16, 160_u16);
        let mut sum = 0.0_f64;
        for ring in 0..rings {
            let cosine = (f32::from(ring) + 0.5) / f32::from(rings);
            for spoke in 0..spokes {
                let light =
                    direction(cosine, (f32::from(spoke) + 0.5) / f32::from(spokes) * 2.0 * PI);
                sum += f64::from(surface.brdf(light, view).x * cosine);
            }
        }
        let cell = 2.0 * std::f64::consts::PI / f64::from(rings) / f64::from(spokes);
        #[expect(clippy::cast_possible_truncation, reason = "a share near 1")]
        let total = (sum * cell) as f32;
        total
    }

    #[test]
    fn a_white_furnace_gains_no_energy_on_fibres_and_little_on_gloss() {
        for surface in materials() {
            let most =
                if surface.roughness >= 0.55 || surface.metallic == 1.0 { 1.0 } else { 1.09 };
            for cosine in [1.0, 0.8, 0.5, 0.2, 0.05] {
                let total = furnace(&surface, direction(cosine, 0.3));
                assert!(total <= most && total > 0.05, "{total} at {cosine} for {surface:?}");
            }
        }
    }

    /// The materials with sheens of several shares and slopes.
    fn shining() -> impl Iterator<Item = Surface> {
        let sheens = [(0.3, 0.0), (0.6, -0.4), (1.0, 0.0), (1.0, 0.7)];
        let of = |(share, slope)| Sheen { share, slope, tangent: Vec3::X };
        materials()
            .flat_map(move |surface| sheens.map(|sheen| Surface { sheen: of(sheen), ..surface }))
    }

    #[test]
    fn a_sheen_gains_no_energy_that_the_rest_does_not() {
        for surface in shining() {
            let dull = Surface { sheen: Sheen::NONE, ..surface };
            for cosine in [1.0, 0.5, 0.05] {
                for angle in [0.3, 1.5] {
                    let view = direction(cosine, angle);
                    let (total, without) = (furnace(&surface, view), furnace(&dull, view));
                    assert!(
                        total <= without.max(1.0),
                        "{total} {without} at {cosine} for {surface:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn light_and_view_may_be_exchanged() {
        for surface in materials().chain(shining()) {
            for (a, b) in [(0.9, 0.2), (0.5, 0.6), (0.05, 1.0)] {
                let (l, v) = (direction(a, 0.4), direction(b, 2.0));
                assert!((surface.brdf(l, v) - surface.brdf(v, l)).abs().max_element() < 1e-5);
            }
        }
    }

    #[test]
    fn head_on_the_terms_have_closed_forms() {
        let surface = Surface {
            normal: Vec3::Z,
            albedo: Vec3::splat(0.6),
            roughness: 0.5,
            metallic: 0.0,
            sheen: Sheen::NONE,
        };
        // n = l = v: F = 0.04, G = 1, D = 1 / (pi a^2), a = 1/4.
        let expected = 0.96 * 0.6 / PI + 16.0 / PI * 0.04 / 4.0;
        assert!((surface.brdf(Vec3::Z, Vec3::Z).x - expected).abs() < 1e-6);
    }

    #[test]
    fn nothing_comes_from_below_and_nothing_is_nan() {
        for surface in materials().chain(shining()) {
            assert_eq!(surface.brdf(Vec3::NEG_Z, Vec3::Z), Vec3::ZERO);
            assert_eq!(surface.brdf(direction(0.1, 0.0), -direction(0.1, 0.0)), Vec3::ZERO);
            assert!(surface.brdf(direction(1e-6, 0.0), direction(1e-6, PI)).is_finite());
        }
    }
}
