//! Reflection of a yarn's surface: the microfacet model of Cook and Torrance (1982, 'A reflectance
//! model for computer graphics') with Beckmann's distribution and Schlick's approximations of the
//! Fresnel and masking terms.
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
//! The papers on ribbon and tubular yarns give these terms with misprints; `docs/method.md` lists
//! the corrections. F and G1 are those of Schlick (1994, 'An inexpensive BRDF model for
//! physically-based rendering'). `shaders/shade.wgsl` repeats this file line by line, and a test
//! compares the two.
//!
//! The BRDF is reciprocal. It loses a little energy, because light between microfacets is not
//! followed. It gains none for a roughness of 0.55 and more, as fibres have. Smoother white
//! dielectrics gain up to 8 % at grazing angles: the diffuse part is reduced by F at the half
//! vector and not by what the specular part reflects in total.

use super::sheen::Sheen;
use glam::Vec3;
use std::f32::consts::PI;

/// Lower limit of the roughness. At 0 the distribution becomes a delta function and its value
/// overflows.
const MIN_ROUGHNESS: f32 = 0.03;

/// Material and normal at one point.
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
    /// Specular reflection of its fibres, in addition.
    pub sheen: Sheen,
}

impl Surface {
    /// Reflectance at normal incidence. 0.04 is that of a dielectric with an index of refraction of
    /// 1.5.
    #[must_use]
    pub fn f0(&self) -> Vec3 {
        Vec3::splat(0.04).lerp(self.albedo, self.metallic)
    }

    /// The BRDF for unit directions to the light and to the eye; zero where either is below the
    /// surface.
    #[must_use]
    pub fn brdf(&self, light: Vec3, view: Vec3) -> Vec3 {
        let base = self.base_brdf(light, view);
        if self.sheen.share > 0.0 {
            base + self.sheen_color() * self.sheen.lobe(self.normal, light, view)
        } else {
            base
        }
    }

    /// The BRDF without the fibres' sheen. It is scaled down by the energy that the sheen takes.
    #[must_use]
    pub fn base_brdf(&self, light: Vec3, view: Vec3) -> Vec3 {
        let (nl, nv) = (self.normal.dot(light), self.normal.dot(view));
        // The half vector: the normal of the microfacets that mirror `light` to `view`.
        let half = (light + view).normalize_or_zero();
        let nh = self.normal.dot(half);
        // Nothing is reflected through the surface. The test of `nh` also catches opposite
        // directions.
        if nl <= 0.0 || nv <= 0.0 || nh <= 0.0 {
            return Vec3::ZERO;
        }
        let roughness = self.roughness.clamp(MIN_ROUGHNESS, 1.0);
        let fresnel = schlick(self.f0(), view.dot(half));
        // G1(x) / (n.x) instead of G1(x): it cancels the BRDF's 1 / ((n.l)(n.v)), which would
        // overflow at grazing angles.
        let k = (roughness + 1.0) * (roughness + 1.0) / 8.0;
        let specular =
            fresnel * (beckmann(nh, roughness * roughness) * masking(nl, k) * masking(nv, k) / 4.0);
        (self.diffuse(fresnel) / PI + specular) * self.sheen.base_share(nl, nv)
    }

    /// Colour of the sheen. A third of it is reflected at the fibres' surfaces, so it is white. The
    /// rest passes through them and takes on their colour.
    #[must_use]
    pub fn sheen_color(&self) -> Vec3 {
        self.albedo.lerp(Vec3::ONE, 1.0 / 3.0)
    }

    /// Diffuse albedo that is left where the fraction `fresnel` is mirrored. Metals have none.
    #[must_use]
    pub fn diffuse(&self, fresnel: Vec3) -> Vec3 {
        (Vec3::ONE - fresnel) * self.albedo * (1.0 - self.metallic)
    }
}

/// Schlick's approximation of the Fresnel term (1994). `cosine` is that of the angle
/// between a direction and the normal that mirrors it.
#[must_use]
pub fn schlick(f0: Vec3, cosine: f32) -> Vec3 {
    f0 + (Vec3::ONE - f0) * (1.0 - cosine.clamp(0.0, 1.0)).powi(5)
}

/// Mean of Schlick's term over the microfacets of a rough surface (Lagarde 2011, 'Adopting a
/// physically based shading model'). Rough cloth does not become a mirror at grazing angles. It
/// serves light from a whole sky, for which there is no single half vector.
#[must_use]
pub fn schlick_rough(f0: Vec3, cosine: f32, roughness: f32) -> Vec3 {
    f0 + (f0.max(Vec3::splat(1.0 - roughness)) - f0) * (1.0 - cosine.clamp(0.0, 1.0)).powi(5)
}

/// Thickness of a layer of cloth, radii of its thinnest yarn. Deeper yarns belong to another layer,
/// such as the other side of a skirt. Smaller values cut a cloth's own yarns off. Larger ones mix
/// layers that touch.
pub(super) const LAYER_RADII: f32 = 12.0;

/// How a place lies among the yarns of the nearest layer. Depths are those along the layer's mean
/// normal, in radii of the place's yarn.
#[cfg(all(test, feature = "gpu"))]
pub(super) struct LayerRelief {
    /// How far before the layer's mean depth it lies. `None` if it belongs to another layer.
    pub(super) before: Option<f32>,
    /// Standard deviation of the layer's depths.
    pub(super) deviation: f32,
    /// Fraction of the surroundings that yarn covers.
    pub(super) cover: f32,
}

/// Visibility of the sky among neighbouring yarns: a cheap approximation of ambient occlusion.
/// `cosine` is that of the angle between the yarn's normal and the direction to the eye.
///
/// It is a logistic curve, fitted to traced rays on twelve warp and weft knits from the front, from
/// the back and obliquely. The fit has a root mean square error of 0.07 to 0.14 from the front and
/// the back, and up to 0.19 obliquely. Without the deviation these are 0.08 to 0.22, and up to 0.23.
/// Yarn of another layer, seen through a hole, has the visibility of a cloth's middle, 0.5.
///
/// The shader draws with it. The test that compares both needs its twin.
#[cfg(all(test, feature = "gpu"))]
pub(super) fn sky_visibility(relief: &LayerRelief, cosine: f32) -> f32 {
    let LayerRelief { before, deviation, cover } = *relief;
    let slope = 3.722 / (deviation + 2.607);
    let curve = |before: f32| 1.0 / (1.0 + (0.412 * deviation - 1.038 - slope * before).exp());
    let level = before.map_or(0.5, curve);
    ((1.0 + cover * (level - 1.0)) * (0.545 + 0.525 * cosine)).clamp(0.0, 1.0)
}

/// The same among ribbons, which have no relief of their own.
#[cfg(all(test, feature = "gpu"))]
pub(super) fn sky_visibility_of_ribbon(before: Option<f32>, cover: f32, cosine: f32) -> f32 {
    let [across, facing] = SKY_FACING;
    (curve(-0.35, before, cover) * (across + facing * cosine)).clamp(0.0, 1.0)
}

/// Visibility of the sky among neighbouring yarns, for a normal that is not known, from the mean
/// depth alone. The processor's renderer fits the rest to each picture (`cpu/splat/fit.rs`).
pub(super) fn sky_level(before: Option<f32>, cover: f32) -> f32 {
    curve(0.065, before, cover)
}

/// A logistic curve of the depth, of which `middle` tells where half of the sky is visible.
fn curve(middle: f32, before: Option<f32>, cover: f32) -> f32 {
    let level = before.map_or(0.5, |before| 1.0 / (1.0 + (middle - 0.427 * before).exp()));
    1.0 + cover * (level - 1.0)
}

/// Weights of the level, and of the level times the cosine of a normal and the direction to the eye,
/// in the visibility of the sky.
pub(super) const SKY_FACING: [f32; 2] = [0.51, 0.69];

/// Beckmann's distribution of microfacet normals. `cosine` is that of the angle between normal and
/// half vector.
fn beckmann(cosine: f32, a: f32) -> f32 {
    let cos2 = (cosine * cosine).min(1.0);
    let a2 = a * a;
    // The exponential underflows to zero long before cos^4 does, so the lower limit only prevents 0
    // / 0.
    (-(1.0 - cos2) / (cos2 * a2)).exp() / (PI * a2 * cos2 * cos2).max(f32::MIN_POSITIVE)
}

/// Schlick's approximation of Smith's masking term G1, divided by its cosine.
fn masking(cosine: f32, k: f32) -> f32 {
    1.0 / (cosine * (1.0 - k) + k)
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
