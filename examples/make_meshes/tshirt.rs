//! A T-shirt: front, back and two sleeves on a torso whose arms are held a little away.
//!
//! The panels start around the body, and their seams are pulled together as in a pattern tool. Then
//! the shirt drapes under gravity.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use crate::{
    body::{Body, RoundCone},
    cloth::{Cloth, Fabric, Scene, Stage},
    pattern::{Curve, Garment, Panel, Side, bezier, length, line, mirrored, segments},
    recipe::{Made, spread},
    triangulate::noise,
};

/// Length of the mesh's edges, cm.
const SPACING: f64 = 0.85;
/// Half the width of front and back, cm. The hem is at y = 0.
const HALF_WIDTH: f64 = 26.0;
/// The underarm point.
const UNDERARM: DVec2 = DVec2::new(HALF_WIDTH, 40.5);
/// The shoulder seam's end at the neck.
const NECK: DVec2 = DVec2::new(8.4, 69.0);
/// The shoulder seam's end at the arm.
const TIP: DVec2 = DVec2::new(21.5, 65.8);
/// Half the sleeve's width at its hem, cm.
const SLEEVE_HEM: f64 = 17.5;
/// Height of the sleeve's cap, cm.
const CAP: f64 = 12.5;
/// Length of the sleeve below the cap, cm.
const BELOW_CAP: f64 = 11.0;

/// Time after sewing in which the arms rest, s. Then they sink, which gathers the cloth under them.
const ARMS_REST: f64 = 0.4;
/// Time in which the arms sink, s.
const ARMS_SECONDS: f64 = 1.2;

const FABRIC: Fabric = Fabric {
    density: 0.02,
    stretch: 2e5,
    bending: 20.0,
    clearance: 0.3,
    thickness: 0.64,
    friction: 0.35,
};

pub(crate) fn make() -> Made {
    let garment = cut_and_place();
    let mut cloth = Cloth::unsewn(&garment, FABRIC);
    let sewing = Scene { body: &|_| body(0.0), hold: &|_, start| start };
    cloth.run(Stage { seconds: 0.8, gravity: 0.0, drag: 10.0, self_contact: false }, &sewing);
    let mut cloth = Cloth::sewn(&garment, &cloth.position, FABRIC);
    let (particle_of, _) = garment.welded();
    let scene = Scene { body: &body, hold: &|_, start| start };
    for (seconds, drag) in [(ARMS_REST, 10.0), (ARMS_SECONDS, 4.0), (1.0, 3.0), (1.0, 15.0)] {
        cloth.run(Stage { seconds, gravity: 1.0, drag, self_contact: true }, &scene);
    }
    let mut body = body(f64::INFINITY);
    // The cloth spans the gap between the halves of the chest, but the body's mesh would show it.
    body.shapes.push(sternum());
    Made {
        name: "tshirt",
        draped: spread(&cloth, &particle_of),
        speed: cloth.speed(),
        garment,
        one_file: true,
        body,
    }
}

/// From the underarm up to the shoulder's tip, scooped inwards.
fn armhole() -> Curve {
    bezier([UNDERARM, DVec2::new(20.0, 41.5), DVec2::new(19.0, 54.0), TIP])
}

/// The right half of the sleeve's cap, from the underarm to the top. Its width is found by
/// bisection so that it is as long as the armhole.
fn cap() -> Curve {
    let curve = |half: f64| {
        bezier([
            DVec2::new(half, -CAP),
            DVec2::new(0.55 * half, -CAP),
            DVec2::new(0.45 * half, 0.0),
            DVec2::ZERO,
        ])
    };
    // The cap's length grows with its width, so bisection finds the width.
    let (mut low, mut high) = (5.0, 40.0);
    for _ in 0..60 {
        let half = 0.5 * (low + high);
        if length(&curve(half)) < length(&armhole()) { low = half } else { high = half }
    }
    curve(0.5 * (low + high))
}

/// Segments of the armhole and of the cap, which are sewn together.
fn armhole_segments() -> u32 {
    segments(length(&armhole()), SPACING)
}

/// A side along the armhole: of the trunk, or of a sleeve's cap.
fn armhole_side(name: &'static str, curve: Curve) -> Side {
    Side { name, curve, segments: armhole_segments() }
}

/// The mirrored point on the panel's left half.
fn left(point: DVec2) -> DVec2 {
    DVec2::new(-point.x, point.y)
}

/// Front or back, which differ in the depth of the neckline only.
fn trunk(name: &str, neck_depth: f64, seed: u64) -> Panel {
    let hem = DVec2::new(HALF_WIDTH, 0.0);
    let bottom = NECK.y - neck_depth;
    let neck_right = bezier([
        NECK,
        DVec2::new(NECK.x - 0.5, NECK.y - 0.6 * neck_depth),
        DVec2::new(0.6 * NECK.x, bottom),
        DVec2::new(0.0, bottom),
    ]);
    let neck: Curve =
        neck_right.iter().copied().chain(mirrored(&neck_right).into_iter().skip(1)).collect();
    let outline = [
        Side::new("hem", line(left(hem), hem), SPACING),
        Side::new("right", line(hem, UNDERARM), SPACING),
        armhole_side("right_armhole", armhole()),
        Side::new("right_shoulder", line(TIP, NECK), SPACING),
        Side::new("neck", neck, SPACING),
        Side::new("left_shoulder", line(left(NECK), left(TIP)), SPACING),
        armhole_side("left_armhole", mirrored(&armhole())),
        Side::new("left", line(left(UNDERARM), left(hem)), SPACING),
    ];
    Panel::cut(name, &outline, SPACING, seed)
}

/// A sleeve.
fn sleeve(name: &str, seed: u64) -> Panel {
    let hem = DVec2::new(SLEEVE_HEM, -CAP - BELOW_CAP);
    let underarm = cap()[0];
    let outline = [
        Side::new("hem", line(left(hem), hem), SPACING),
        Side::new("right", line(hem, underarm), SPACING),
        armhole_side("right_cap", cap()),
        armhole_side("left_cap", mirrored(&cap())),
        Side::new("left", line(left(underarm), left(hem)), SPACING),
    ];
    Panel::cut(name, &outline, SPACING, seed)
}

/// The panels are seen from outside, so the front's right is the wearer's left, at +x.
fn cut_and_place() -> Garment {
    let mut garment = Garment::default();
    let ring = trunk_only().ring(CHEST, 4.0 * HALF_WIDTH);
    let around = |turn: f64, point: DVec2| {
        let turn = point.x / (4.0 * HALF_WIDTH) + turn;
        let place = ring.at(turn) * (1.0 + ripple(turn));
        DVec3::new(place.x, point.y + HEM, place.y)
    };
    // Panels lie apart in the plane; in space front and back take half of the ring each.
    let front = garment.add(trunk("front", 8.5, 51), DVec2::ZERO, |point| around(0.0, point));
    let back =
        garment.add(trunk("back", 2.5, 52), DVec2::new(58.0, 0.0), |point| around(0.5, point));
    let left =
        garment.add(sleeve("left_sleeve", 53), DVec2::new(110.0, 30.0), |point| on_arm(point, 1.0));
    let right = garment
        .add(sleeve("right_sleeve", 54), DVec2::new(110.0, 60.0), |point| on_arm(point, -1.0));
    garment.sew((front, "right"), (back, "left"));
    garment.sew((front, "left"), (back, "right"));
    garment.sew((front, "right_shoulder"), (back, "left_shoulder"));
    garment.sew((front, "left_shoulder"), (back, "right_shoulder"));
    garment.sew((front, "right_armhole"), (left, "left_cap"));
    garment.sew((back, "left_armhole"), (left, "right_cap"));
    garment.sew((front, "left_armhole"), (right, "right_cap"));
    garment.sew((back, "right_armhole"), (right, "left_cap"));
    garment.sew((left, "left"), (left, "right"));
    garment.sew((right, "left"), (right, "right"));
    garment
}

/// The sleeve around the arm, its top up and its seam below; `side` is 1 for the wearer's left.
fn on_arm(point: DVec2, side: f64) -> DVec3 {
    let down_arm = arm_direction(0.0);
    let up = DVec3::new(-down_arm.y, down_arm.x, 0.0);
    let angle = point.x / cap()[0].x * 0.5 * TAU;
    let radius = cap()[0].x / (0.5 * TAU);
    // On the wearer's left, the sleeve's right half lies behind the arm.
    let across = radius * (angle.cos() * up - side * angle.sin() * DVec3::Z);
    let place = SHOULDER + (0.5 - point.y) * down_arm + across;
    DVec3::new(side * place.x, place.y, place.z)
}

/// Irregular waves of a few millimetres, so that folds don't begin symmetrically.
fn ripple(turn: f64) -> f64 {
    (3..9_u32)
        .map(|wave| 0.008 * noise(61, wave.into()) * (f64::from(wave) * TAU * turn).cos())
        .sum()
}

/// Height of the hem in space, cm; y = 0 is the height of the crotch.
const HEM: f64 = 3.0;
/// Height of the chest, cm.
const CHEST: f64 = 44.0;
/// The left shoulder.
const SHOULDER: DVec3 = DVec3::new(17.0, 59.5, -1.0);

/// The direction of the left arm: from 49 to 33 degrees off the vertical, with smooth ends.
fn arm_direction(time: f64) -> DVec3 {
    let t = ((time - ARMS_REST) / ARMS_SECONDS).clamp(0.0, 1.0);
    let angle = 0.85 - 0.27 * t * t * (3.0 - 2.0 * t);
    DVec3::new(angle.sin(), -angle.cos(), 0.0)
}

/// The body without shoulders, arms and head.
fn trunk_only() -> Body {
    let [hip, waist, chest] =
        [DVec3::new(6.5, 4.0, -0.5), DVec3::new(5.5, 24.0, 0.0), DVec3::new(7.0, 46.0, 0.5)];
    let left = [
        RoundCone::new(hip - 8.0 * DVec3::Y, 9.8, hip, 10.0),
        RoundCone::new(hip, 10.0, waist, 9.0),
        RoundCone::new(waist, 9.0, chest, 9.7),
    ];
    Body {
        shapes: left.iter().flat_map(|shape| [*shape, shape.mirrored()]).collect(),
        blend: 2.5,
        table: None,
    }
}

/// What lies between the halves of the chest and the neck.
fn sternum() -> RoundCone {
    RoundCone::new(DVec3::new(0.0, 46.0, 0.0), 7.0, DVec3::new(0.0, 60.0, -1.2), 5.6)
}

/// The body at a time.
fn body(time: f64) -> Body {
    let mut body = trunk_only();
    let [chest, neck] = [DVec3::new(7.0, 46.0, 0.5), DVec3::new(0.0, 63.0, -1.5)];
    let left = [
        RoundCone::new(chest, 9.7, DVec3::new(13.0, 58.0, -1.0), 5.0),
        RoundCone::new(neck, 5.0, SHOULDER, 4.6),
        RoundCone::new(SHOULDER, 4.7, SHOULDER + 32.0 * arm_direction(time), 3.9),
    ];
    body.shapes.extend(left.iter().flat_map(|shape| [*shape, shape.mirrored()]));
    body.shapes.push(RoundCone::new(neck, 6.4, DVec3::new(0.0, 78.0, 1.0), 5.6));
    body
}
