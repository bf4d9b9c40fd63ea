//! A sleeve: a rectangle closed by a seam, pushed together a little on an arm, which then bends.

use std::f64::consts::TAU;

use glam::{DQuat, DVec2, DVec3};

use crate::{
    body::{Body, Ring, RoundCone},
    cloth::{Cloth, Fabric, Scene, Stage},
    pattern::{Garment, Panel, Side, line},
    recipe::{Made, spread},
    triangulate::noise,
};

/// Length of the sleeve, cm.
const LENGTH: f64 = 48.0;
/// Girth of the sleeve, cm.
const GIRTH: f64 = 31.0;
/// Length of the mesh's edges, cm.
const SPACING: f64 = 0.55;
/// The elbow. The sleeve's shoulder end is at y = 0.
const ELBOW: DVec3 = DVec3::new(0.0, -25.0, 0.0);
/// Length by which the sleeve is pushed together, cm: about enough for the bend's outer side, and
/// far too much for its inner side, which folds.
const SLACK: f64 = 3.0;
/// Angle of the bend, radians.
const BEND: f64 = 0.8;
/// Duration of the bending, s.
const BEND_SECONDS: f64 = 1.5;

const FABRIC: Fabric = Fabric {
    density: 0.02,
    stretch: 2e5,
    bending: 60.0,
    clearance: 0.2,
    thickness: 0.45,
    friction: 0.35,
};

pub(crate) fn make() -> Made {
    let garment = cut_and_place();
    let scene = Scene { body: &arm, hold: &|_, start| start };
    let mut cloth = Cloth::sewn(&garment, &garment.start, FABRIC);
    let (particle_of, _) = garment.welded();
    cloth.hold(garment.side(0, "top").iter().map(|&vertex| particle_of[vertex as usize]));
    for (seconds, drag) in [(BEND_SECONDS, 8.0), (0.8, 3.0), (1.2, 15.0)] {
        cloth.run(Stage { seconds, gravity: 1.0, drag, self_contact: true }, &scene);
    }
    let body = arm(f64::INFINITY);
    Made {
        name: "tube",
        draped: spread(&cloth, &particle_of),
        speed: cloth.speed(),
        garment,
        one_file: false,
        body,
    }
}

/// The rectangle, placed as a cylinder around the arm.
fn cut_and_place() -> Garment {
    let (half, down) = (DVec2::new(0.5 * GIRTH, 0.0), DVec2::new(0.0, -LENGTH));
    let outline = [
        Side::new("cuff", line(down - half, down + half), SPACING),
        Side::new("right", line(down + half, half), SPACING),
        Side::new("top", line(half, -half), SPACING),
        Side::new("left", line(-half, down - half), SPACING),
    ];
    let mut garment = Garment::default();
    let ring = Ring::circle(GIRTH);
    garment.add(Panel::cut("sleeve", &outline, SPACING, 21), DVec2::ZERO, |point| {
        // The seam lies on the inner side of the arm, at -x.
        let place = ring.at(point.x / GIRTH + 0.25) * (1.0 + ripple(point));
        DVec3::new(place.x, point.y * (1.0 - SLACK / LENGTH), place.y)
    });
    garment.sew((0, "left"), (0, "right"));
    garment
}

/// Irregular waves along the arm that take up about the slack. They vanish at the ends, so that the
/// top is fixed as a circle.
fn ripple(point: DVec2) -> f64 {
    let wave = |number: u32| {
        let along = TAU * f64::from(number) * point.y / LENGTH;
        let around = TAU * point.x / GIRTH;
        (along + 3.0 * noise(5, number.into())).sin()
            * (around + 3.0 * noise(6, number.into())).cos()
    };
    let inner = (-point.y / LENGTH * (1.0 + point.y / LENGTH) * 4.0).clamp(0.0, 1.0);
    0.035 * inner * (4..9).map(wave).sum::<f64>()
}

/// The progress of the bending, 0..1, with smooth ends.
fn progress(time: f64) -> f64 {
    let t = (time / BEND_SECONDS).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The arm at a time.
fn arm(time: f64) -> Body {
    let wrist =
        ELBOW + DQuat::from_rotation_x(-BEND * progress(time)) * DVec3::new(0.0, -27.0, 0.0);
    let shapes = vec![
        RoundCone::new(DVec3::new(0.0, 4.0, 0.0), 4.2, ELBOW, 3.7),
        RoundCone::new(ELBOW, 3.7, wrist, 3.1),
    ];
    Body { shapes, blend: 1.0, table: None }
}
