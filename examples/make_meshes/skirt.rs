//! A flared skirt of six gores, 55 cm long and 70 cm around the waist, which hangs from waist and
//! hips.
//!
//! Each gore is a sector of a ring, so the sewn skirt is a cone that is wider than the body and
//! must fold.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use crate::{
    body::{Body, Ring, RoundCone},
    cloth::{Cloth, Fabric, Scene, Stage},
    pattern::{Garment, Panel, Side, arc, line},
    recipe::{Made, spread},
    triangulate::noise,
};

/// Number of gores.
const GORES: u32 = 6;
/// Girth of the waist, cm.
const WAIST: f64 = 70.0;
/// Girth of the hem, cm.
const HEM: f64 = 215.0;
/// Length from waist to hem, cm.
const LENGTH: f64 = 55.0;
/// Length of the mesh's edges, cm.
const SPACING: f64 = 0.8;

const FABRIC: Fabric = Fabric {
    density: 0.02,
    stretch: 2e5,
    bending: 60.0,
    clearance: 0.25,
    thickness: 0.6,
    friction: 0.3,
};

pub(crate) fn make() -> Made {
    let garment = cut_and_place();
    let body = body();
    let scene = Scene { body: &|_| body.clone(), hold: &|_, start| start };
    // The gores meet in their first positions already, so the seams need not be pulled together.
    let mut cloth = Cloth::sewn(&garment, &garment.start, FABRIC);
    let (particle_of, _) = garment.welded();
    cloth.hold(
        (0..garment.pieces.len())
            .flat_map(|gore| garment.side(gore, "waist"))
            .map(|&v| particle_of[v as usize]),
    );
    for (seconds, drag) in [(2.0, 1.0), (1.0, 4.0), (1.0, 12.0)] {
        cloth.run(Stage { seconds, gravity: 1.0, drag, self_contact: true }, &scene);
    }
    Made {
        name: "skirt",
        draped: spread(&cloth, &particle_of),
        speed: cloth.speed(),
        garment,
        one_file: false,
        body,
    }
}

/// Distance of the cone's apex above the waist, by similar triangles.
fn apex_distance() -> f64 {
    WAIST * LENGTH / (HEM - WAIST)
}

/// One gore: the sector of a ring around the apex.
fn gore(name: &str, seed: u64) -> Panel {
    let waist_radius = apex_distance();
    let apex = DVec2::new(0.0, waist_radius);
    // Half the angle of the gore: half its share of the waist over the radius there.
    let half = 0.5 * WAIST / f64::from(GORES) / waist_radius;
    let at = |radius: f64, angle: f64| apex + radius * DVec2::new(angle.sin(), -angle.cos());
    let hem_radius = waist_radius + LENGTH;
    let outline = [
        Side::new("hem", arc(apex, hem_radius, -half, half), SPACING),
        Side::new("right", line(at(hem_radius, half), at(waist_radius, half)), SPACING),
        Side::new("waist", arc(apex, waist_radius, half, -half), SPACING),
        Side::new("left", line(at(waist_radius, -half), at(hem_radius, -half)), SPACING),
    ];
    Panel::cut(name, &outline, SPACING, seed)
}

/// Six gores in a row in the plane, and in space each on its sixth of a cone around the body.
fn cut_and_place() -> Garment {
    let mut garment = Garment::default();
    let waist_radius = apex_distance();
    let total = WAIST / waist_radius;
    let rings = Rings::new(&body());
    for index in 0..GORES {
        let number = f64::from(index);
        let panel = gore(&format!("gore_{}", index + 1), u64::from(index));
        garment.add(panel, DVec2::new(39.0 * number, 0.0), |point| {
            let from_apex = DVec2::new(point.x, waist_radius - point.y);
            let angle = from_apex.x.atan2(from_apex.y);
            rings.at(angle / total + number / f64::from(GORES), from_apex.length() - waist_radius)
        });
    }
    for index in 0..GORES as usize {
        garment.sew((index, "right"), ((index + 1) % GORES as usize, "left"));
    }
    garment
}

/// The first positions: rings around the body, one every centimetre down, each with the skirt's
/// girth there.
struct Rings(Vec<Ring>);

impl Rings {
    /// Height of one centimetre along the cone.
    const FALL: f64 = 0.92;

    fn new(body: &Body) -> Self {
        let rings =
            (0..=56).map(|down| body.ring(-Self::FALL * f64::from(down), girth(f64::from(down))));
        Self(rings.collect())
    }

    fn at(&self, turn: f64, down: f64) -> DVec3 {
        let down = down.clamp(0.0, LENGTH);
        let above = DVec2::splat(down).as_uvec2().x as usize;
        let place = self.0[above].at(turn).lerp(self.0[above + 1].at(turn), down.fract());
        let place = place * (1.0 + ripple(turn) * down / LENGTH);
        DVec3::new(place.x, -Self::FALL * down, place.y)
    }
}

/// The skirt's girth at a distance below the waist.
fn girth(down: f64) -> f64 {
    WAIST + (HEM - WAIST) * down / LENGTH
}

/// Irregular waves of a few per cent, so that chance and not the mesh decides where folds form.
fn ripple(turn: f64) -> f64 {
    (5..12_u32)
        .map(|wave| 0.012 * (f64::from(wave) * TAU * turn + 3.0 * noise(11, wave.into())).sin())
        .sum()
}

/// Waist and hips of two blended columns, and legs.
fn body() -> Body {
    let [waist, hip, knee] =
        [DVec3::new(3.4, 0.0, 0.0), DVec3::new(5.6, -20.0, -0.5), DVec3::new(7.5, -55.0, 0.0)];
    let ankle = DVec3::new(7.0, -85.0, -2.0);
    let left = [
        RoundCone::new(waist + 6.0 * DVec3::Y, 8.2, waist, 8.0),
        RoundCone::new(waist, 8.0, hip, 10.2),
        RoundCone::new(hip, 10.2, knee, 6.0),
        RoundCone::new(knee, 6.0, ankle, 4.0),
    ];
    Body {
        shapes: left.iter().flat_map(|shape| [*shape, shape.mirrored()]).collect(),
        blend: 3.0,
        table: None,
    }
}
