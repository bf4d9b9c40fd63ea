//! The pinched fabric of Liu, Kyosev and Jiang 2022: a square on a table, lifted at its middle
//! until it hangs in folds.

use glam::{DVec2, DVec3};

use crate::{
    body::Body,
    cloth::{Cloth, Fabric, Scene, Stage},
    pattern::{Garment, Panel, Side, line},
    recipe::Made,
    triangulate::noise,
};

/// Side of the square, cm.
const SIZE: f64 = 40.0;
/// Length of the mesh's edges, cm.
const SPACING: f64 = 0.55;
/// Height of the lift, cm.
const LIFT: f64 = 14.0;
/// Duration of the lift, s.
const LIFT_SECONDS: f64 = 1.5;
/// Radius of the part that is held, cm.
const FINGERS: f64 = 0.65;

const FABRIC: Fabric = Fabric {
    density: 0.02,
    stretch: 2e5,
    bending: 35.0,
    clearance: 0.1,
    thickness: 0.42,
    friction: 0.15,
};

pub(crate) fn make() -> Made {
    let garment = cut_and_place();
    let body = Body { shapes: Vec::new(), blend: 1.0, table: Some(0.0) };
    let scene = Scene {
        body: &|_| body.clone(),
        hold: &|time, start| start + LIFT * progress(time) * DVec3::Y,
    };
    let mut cloth = Cloth::unsewn(&garment, FABRIC);
    // The particles between the fingers follow the lift.
    let middle = |&vertex: &u32| garment.flat[vertex as usize].length() < FINGERS;
    cloth.hold((0..u32::try_from(garment.flat.len()).expect("few vertices")).filter(middle));
    for (seconds, drag) in [(LIFT_SECONDS, 2.0), (1.5, 2.0), (1.5, 12.0)] {
        cloth.run(Stage { seconds, gravity: 1.0, drag, self_contact: true }, &scene);
    }
    Made {
        name: "pinch",
        speed: cloth.speed(),
        draped: cloth.position,
        garment,
        one_file: false,
        body,
    }
}

/// The progress of the lift, 0..1, with smooth ends.
fn progress(time: f64) -> f64 {
    let t = (time / LIFT_SECONDS).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The square lies on the table face up, its grain away from the viewer, on slight waves.
fn cut_and_place() -> Garment {
    let corners =
        [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(|(x, y)| SIZE * DVec2::new(x, y));
    let side =
        |index: usize| Side::new("edge", line(corners[index], corners[(index + 1) % 4]), SPACING);
    let panel = Panel::cut("square", &[side(0), side(1), side(2), side(3)], SPACING, 31);
    let mut garment = Garment::default();
    garment.add(panel, DVec2::ZERO, |point| {
        DVec3::new(point.x, FABRIC.clearance + bump(point), -point.y)
    });
    garment
}

/// Irregular waves of a few millimetres. They break the symmetry and decide where the folds begin.
fn bump(point: DVec2) -> f64 {
    let wave = |index: u64| {
        let direction = DVec2::new(noise(41, index), noise(42, index));
        0.12 * (1.0 + (0.5 * direction.dot(point) + 3.0 * noise(43, index)).sin())
    };
    (0..6).map(wave).sum()
}
