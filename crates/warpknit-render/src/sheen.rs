//! The sheen of satin and silk: specular reflection of parallel fibres, which lie along a yarn or
//! wind around it at the angle of their twist.
//!
//! In: a [`Sheen`] and unit directions. Out: its contribution to the BRDF, and the scale of the
//! rest of the BRDF. The model is that of Irawan and Marschner (2012, 'Specular reflection from
//! woven cloth'). Their curved cylinders are left out, because here the yarns' geometry is given:
//!
//! ```text
//! f = share e^(40 (cos d - 1)) P / (n.l + n.v),   sin d = t.h
//! P = 0.6 + 0.4 e^(-3 (1 + l.v))
//! ```
//!
//! A fibre along t mirrors light where the half vector h is perpendicular to it. Fibres are not
//! quite parallel, so the angle d is spread by a von Mises distribution. P is their phase function:
//! an isotropic part and a forward lobe. The divisor is the Lommel-Seeliger law for fibres that
//! shadow and mask each other. `shaders/sheen.wgsl` repeats this file line by line, and a test
//! compares the two.
//!
//! The sheen is reciprocal. With these constants it reflects at most 1 / (1 + n.v) of the light
//! toward v. The rest of the surface is scaled down by the same fraction, so that the sum gains no
//! energy that the rest alone does not gain. Not modelled: a change of colour with the angle.

use glam::Vec3;

/// Concentration of the von Mises distribution of fibre directions: a standard deviation of 9
/// degrees, as filaments with little crimp have. Higher values make highlights narrower, until
/// samples miss them and they flicker. Lower ones turn satin dull. The energy bound above holds for
/// this value.
const CONCENTRATION: f32 = 40.0;
/// Isotropic part of the phase function; the rest is the forward lobe.
const ISOTROPIC: f32 = 0.6;
/// Concentration of the forward lobe.
const FORWARD_CONCENTRATION: f32 = 3.0;
/// Loss of a fibre's visible width when it is seen along its length. Fibres vary by some degrees,
/// so it is less than 1.
const END_ON_LOSS: f32 = 0.95;
/// Nodes across a yarn's width, in radii, and weights of Gauss-Legendre quadrature with four
/// points.
const GAUSS_NODES: [(f32, f32); 4] = [
    (-0.861_136, 0.173_927),
    (-0.339_981, 0.326_073),
    (0.339_981, 0.326_073),
    (0.861_136, 0.173_927),
];

/// Specular reflection of the fibres in a yarn's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheen {
    /// Strength, 0..1 of the largest that conserves energy.
    pub share: f32,
    /// Slope of the fibres against the yarn's axis: positive for S twist, negative for Z twist.
    pub slope: f32,
    /// Unit tangent of the yarn.
    pub tangent: Vec3,
}

impl Sheen {
    /// No sheen: dull fibres.
    pub const NONE: Self = Self { share: 0.0, slope: 0.0, tangent: Vec3::X };

    /// Unit direction of the fibres where the yarn's normal is `normal`.
    #[must_use]
    pub fn fibre(&self, normal: Vec3) -> Vec3 {
        // Turned by the twist about the normal, then projected into the tangent plane.
        let turned = self.tangent - self.tangent.cross(normal) * self.slope;
        (turned - normal * turned.dot(normal)).normalize_or(self.tangent)
    }

    /// The sheen's contribution to the BRDF; zero where either direction is below the surface.
    #[must_use]
    pub fn lobe(&self, normal: Vec3, light: Vec3, view: Vec3) -> f32 {
        let (nl, nv) = (normal.dot(light), normal.dot(view));
        if nl <= 0.0 || nv <= 0.0 {
            return 0.0;
        }
        // sin d: the cosine between fibre and half vector.
        let sine = self.fibre(normal).dot((light + view).normalize_or_zero());
        // cos d from sin d; the von Mises distribution is largest where the half vector is
        // perpendicular to the fibre.
        let spread = (CONCENTRATION * ((1.0 - sine * sine).max(0.0).sqrt() - 1.0)).exp();
        let phase = ISOTROPIC
            + (1.0 - ISOTROPIC) * (-FORWARD_CONCENTRATION * (1.0 + light.dot(view))).exp();
        // Fibres at grazing angles show more of themselves: the divisor is n.l + n.v and not their
        // product.
        self.share * spread * phase / (nl + nv)
    }

    /// Radiance of the sheen under a light of irradiance 1, as the mean over a yarn's visible
    /// width. For yarns whose whole width lies in a pixel. The highlight of a twisted yarn is a
    /// narrow line, which a single sample would hit or miss. Four nodes suffice, because the spread
    /// of the fibres is wider than their distance.
    #[must_use]
    pub fn mean_over_width(&self, light: Vec3, view: Vec3) -> f32 {
        // The visible half of the yarn, from one outline (-1) to the other (1).
        let width = self.tangent.cross(view).normalize_or_zero();
        let front = width.cross(self.tangent);
        GAUSS_NODES
            .into_iter()
            .map(|(side, weight)| {
                let normal = width * side + front * (1.0 - side * side).sqrt();
                weight * self.lobe(normal, light, view) * normal.dot(light).max(0.0)
            })
            .sum()
    }

    /// The normal at the brightest line of a yarn. A shadow that matters falls there.
    #[must_use]
    pub fn highlight_normal(&self, light: Vec3, view: Vec3) -> Vec3 {
        let sum = light + view;
        (sum - self.tangent * sum.dot(self.tangent)).normalize_or(view)
    }

    /// Fraction of the rest of the BRDF that is left, for light that arrives and leaves at these
    /// cosines.
    #[must_use]
    pub fn base_share(&self, light_cosine: f32, view_cosine: f32) -> f32 {
        1.0 - self.share / (1.0 + light_cosine.min(view_cosine).clamp(0.0, 1.0))
    }

    /// The same for light from a whole sky: the cosine-weighted mean of [`Self::base_share`].
    #[must_use]
    pub fn base_share_under_sky(&self, view_cosine: f32) -> f32 {
        let cosine = view_cosine.clamp(0.0, 1.0);
        1.0 - self.share * (1.0 + cosine - 2.0 * cosine.ln_1p())
    }

    /// Fraction of a uniform sky's light that the sheen reflects toward `view`. It is a fit to the
    /// integral of the lobe: fibres seen along their length show less of themselves.
    #[must_use]
    pub fn sky_reflectance(&self, normal: Vec3, view: Vec3) -> f32 {
        let along = self.fibre(normal).dot(view);
        self.share * (1.0 - END_ON_LOSS * along * along).sqrt()
            / (1.0 + normal.dot(view).clamp(0.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::{PI, TAU};

    fn sheen(slope: f32) -> Sheen {
        Sheen { share: 1.0, slope, tangent: Vec3::X }
    }

    fn direction(cosine: f32, angle: f32) -> Vec3 {
        let sine = (1.0 - cosine * cosine).sqrt();
        Vec3::new(sine * angle.cos(), sine * angle.sin(), cosine)
    }

    /// Share of a white sky's light that the lobe sends to `view`.
    fn mirrored(view: Vec3) -> f32 {
        let (rings, spokes) = (300_u16, 300_u16);
        let cell = TAU / f32::from(rings) / f32::from(spokes);
        let of_ring = |ring: u16| {
            let cosine = (f32::from(ring) + 0.5) / f32::from(rings);
            let lights = (0..spokes)
                .map(|spoke| direction(cosine, (f32::from(spoke) + 0.5) / f32::from(spokes) * TAU));
            lights.map(|light| sheen(0.0).lobe(Vec3::Z, light, view) * cosine * cell).sum::<f32>()
        };
        (0..rings).map(of_ring).sum()
    }

    #[test]
    fn it_mirrors_no_more_than_the_rest_is_denied_and_as_much_of_the_sky_as_it_says() {
        for cosine in [1.0, 0.8, 0.6, 0.4, 0.2, 0.05, 0.01] {
            for angle in [0.0, 0.4, 0.8, 1.2, PI / 2.0] {
                let view = direction(cosine, angle);
                let total = mirrored(view);
                assert!(total <= 1.0 / (1.0 + cosine), "{total} at {cosine} {angle}");
                let said = sheen(0.0).sky_reflectance(Vec3::Z, view);
                assert!((said - total).abs() < 0.09, "{said} for {total} at {cosine} {angle}");
            }
        }
    }

    #[test]
    fn light_and_view_may_be_exchanged() {
        for (a, b) in [(0.9, 0.2), (0.5, 0.6), (0.05, 1.0)] {
            let (l, v) = (direction(a, 0.4), direction(b, 2.0));
            let [one, other] = [(l, v), (v, l)].map(|(l, v)| sheen(0.3).lobe(Vec3::Z, l, v));
            assert!((one - other).abs() < 1e-6);
        }
    }

    #[test]
    fn it_is_brightest_where_the_half_vector_is_across_the_fibre() {
        let view = direction(0.8, 0.0);
        let lobe =
            |angle: f32| sheen(0.0).lobe(Vec3::Z, Vec3::new(angle.sin(), 0.0, angle.cos()), view);
        let mirror = -0.8_f32.acos();
        // There the closed form has no exponential but that of its phase.
        let phase = 0.6 + 0.4 * (-3.0 * (1.0 + (2.0 * mirror).cos())).exp();
        assert!((lobe(mirror) - phase / 1.6).abs() < 1e-5);
        // A change of the light's angle moves the half vector by half of it: at 2 * 9 degrees by
        // one standard deviation.
        let share = lobe(mirror + 2.0 / CONCENTRATION.sqrt()) / lobe(mirror);
        assert!((share - (-0.5_f32).exp()).abs() < 0.1, "{share}");
        // Across the fibre all directions are as bright but for the shadows.
        let beside = Vec3::new(mirror.sin(), 0.6 * mirror.cos(), 0.8 * mirror.cos());
        assert!(sheen(0.0).lobe(Vec3::Z, beside, view) > 0.9 * lobe(mirror));
    }

    /// A twisted yarn along x, seen from +z and lit from a little aside along it: where around the
    /// yarn is it brightest?
    fn brightest(slope: f32, tilt: f32) -> f32 {
        let light = Vec3::new(tilt.sin(), 0.0, tilt.cos());
        let seen = |angle: f32| {
            let normal = Vec3::new(0.0, angle.sin(), angle.cos());
            sheen(slope).lobe(normal, light, Vec3::Z) * normal.dot(light)
        };
        let angles = (-700_i16..=700).map(|step| f32::from(step) / 1000.0);
        angles.max_by(|one, other| seen(*one).total_cmp(&seen(*other))).unwrap()
    }

    #[test]
    fn twist_moves_the_highlight_off_the_middle_line_and_the_other_twist_to_the_other_side() {
        let tilt = 0.2_f32;
        // At angle a around the yarn fibres run along (1, s cos a, -s sin a), across (sin b, 0, cos
        // b) with b half the tilt.
        let expected = |slope: f32| ((tilt / 2.0).tan() / slope).asin();
        for slope in [0.3, -0.3, 0.5] {
            let found = brightest(slope, tilt);
            assert!(
                (found - expected(slope)).abs() < 0.002,
                "{found} {} for {slope}",
                expected(slope)
            );
        }
        assert!(
            brightest(0.3, 0.0).abs() < 0.01,
            "with the light behind the eye it is in the middle"
        );
        // The fibre itself turns by the slope's angle, S to the left of one who looks along it.
        assert!((sheen(0.5).fibre(Vec3::Z) - Vec3::new(1.0, 0.5, 0.0).normalize()).length() < 1e-6);
    }

    #[test]
    fn the_mean_over_the_width_is_that_of_many_places() {
        for slope in [0.0, -0.12, 0.3, 0.6] {
            for (light, view) in [
                (direction(0.7, 0.3), direction(0.8, 4.0)),
                (direction(0.9, 1.5), direction(0.95, 3.0)),
            ] {
                let width = Vec3::X.cross(view).normalize();
                let front = width.cross(Vec3::X);
                let at = |step: u16| {
                    let side = (f32::from(step) + 0.5) / 500.0 - 1.0;
                    let normal = width * side + front * (1.0 - side * side).sqrt();
                    sheen(slope).lobe(normal, light, view) * normal.dot(light).max(0.0)
                };
                let exact = (0..1000).map(at).sum::<f32>() / 1000.0;
                let found = sheen(slope).mean_over_width(light, view);
                assert!((found - exact).abs() < 0.1 * exact + 0.005, "{found} {exact} for {slope}");
            }
        }
    }

    #[test]
    fn what_a_sky_leaves_is_the_mean_of_what_lights_leave() {
        for view in [0.0, 0.3, 0.7, 1.0] {
            let light = |step: u16| (f32::from(step) + 0.5) / 1000.0;
            let mean = (0..1000)
                .map(|step| sheen(0.0).base_share(light(step), view) * 2.0 * light(step))
                .sum::<f32>()
                / 1000.0;
            assert!((mean - sheen(0.0).base_share_under_sky(view)).abs() < 1e-3);
        }
    }
}
