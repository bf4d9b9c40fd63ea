//! A sleeve: one rectangle closed by a seam, pushed up an arm that then bends.

use std::f64::consts::TAU;

use glam::{DQuat, DVec2, DVec3};

use crate::{
    body::{Body, Ring, RoundCone},
    cloth::{Cloth, Fabric, Scene, Stage},
    pattern::{Garment, Panel, Side, line},
    recipe::{Made, spread},
    triangulate::noise,
};

const LENGTH: f64 = 48.0;
const GIRTH: f64 = 31.0;
const SPACING: f64 = 0.55;
/// Below the shoulder end, which is at y = 0.
const ELBOW: DVec3 = DVec3::new(0.0, -25.0, 0.0);
/// The arm hangs for a moment, then bends by so much (radians) and meanwhile the cuff is pushed up by so much (cm).
const BEND: f64 = 0.7;
const PUSH: f64 = 5.0;
const BEND_SECONDS: f64 = 1.5;

const FABRIC: Fabric = Fabric { density: 0.02, stretch: 2e5, bending: 60.0, clearance: 0.2, thickness: 0.42, friction: 0.15 };

pub(crate) fn make() -> Made {
    let garment = cut_and_place();
    let scene = Scene { body: &arm, hold: &held };
    let mut cloth = Cloth::unsewn(&garment, FABRIC);
    cloth.run(Stage { seconds: 0.1, gravity: 0.0, drag: 20.0, self_contact: false }, &still(&scene));
    let mut cloth = Cloth::sewn(&garment, &cloth.position, FABRIC);
    let (particle_of, _) = garment.welded();
    cloth.hold(["top", "cuff"].iter().flat_map(|side| garment.side(0, side)).map(|&vertex| particle_of[vertex as usize]));
    for (seconds, drag) in [(BEND_SECONDS, 4.0), (1.0, 3.0), (1.5, 12.0)] {
        cloth.run(Stage { seconds, gravity: 1.0, drag, self_contact: true }, &scene);
    }
    let body = arm(f64::INFINITY);
    Made { name: "tube", draped: spread(&cloth, &particle_of), speed: cloth.speed(), garment, one_file: false, body }
}

/// The scene before the arm moves.
fn still<'a>(_: &Scene) -> Scene<'a> {
    Scene { body: &|_| arm(0.0), hold: &|_, start| start }
}

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
        DVec3::new(place.x, point.y, place.y)
    });
    garment.sew((0, "left"), (0, "right"));
    garment
}

/// A per cent of unevenness, none of it at the ends, which are held.
fn ripple(point: DVec2) -> f64 {
    let wave = |number: u32| {
        let along = TAU * f64::from(number) * point.y / LENGTH;
        let around = TAU * point.x / GIRTH;
        (along + 4.0 * noise(5, number.into())).sin() * (2.0 * around + 4.0 * noise(6, number.into())).cos()
    };
    let inner = (-point.y / LENGTH * (1.0 + point.y / LENGTH) * 4.0).clamp(0.0, 1.0);
    0.008 * inner * (2..7).map(wave).sum::<f64>()
}

/// How much of the bending is done, from 0 to 1, without a jerk.
fn progress(time: f64) -> f64 {
    let t = (time / BEND_SECONDS).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn forearm_turn(time: f64) -> DQuat {
    DQuat::from_rotation_x(-BEND * progress(time))
}

fn arm(time: f64) -> Body {
    let wrist = ELBOW + forearm_turn(time) * DVec3::new(0.0, -27.0, 0.0);
    let shapes = vec![RoundCone::new(DVec3::new(0.0, 4.0, 0.0), 4.2, ELBOW, 3.7), RoundCone::new(ELBOW, 3.7, wrist, 3.1)];
    Body { shapes, blend: 1.0, table: None }
}

/// The cuff goes with the forearm and is pushed up it; the top stays.
fn held(time: f64, start: DVec3) -> DVec3 {
    if start.y > ELBOW.y {
        return start;
    }
    let on_forearm = start - ELBOW + PUSH * progress(time) * DVec3::Y;
    ELBOW + forearm_turn(time) * on_forearm
}
