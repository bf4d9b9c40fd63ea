//! Sewing threads along finished edges.
//!
//! In: a [`Sheet`] and the [`Rail`] of a run. Out: [`Thread`]s, as points in space.
//!
//! Method: a thread is a row of places along the rail, each at a depth from the edge and a height over
//! the cloth. A hem has a coverstitch (ISO 4915, stitch type 406): two needle threads that lie on the
//! face from hole to hole, and a looper thread behind that goes from one row to the other. The
//! allowance of a seam has the looper thread of an overlock around its edge.
//!
//! Cost: some 0.3 µs a point. Not promised: that threads interlace with each other or with yarns.

use glam::DVec3;

use super::rail::{Rail, Sheet};

/// Length of a stitch, mm.
const STITCH: f64 = 2.8;
/// Part of a stitch within which a needle thread comes up from its hole, or goes down.
const RISE: f64 = 0.14;

/// A sewing thread: its points, mm, and the unit normal of the cloth at each.
pub type Thread = Vec<(DVec3, DVec3)>;

/// A place of a thread: its share of a stitch, depth from the edge, and height over the cloth's middle,
/// both mm.
type Step = [f64; 3];

/// A needle thread at a depth, which lies `above` the cloth's middle and goes down to `below`.
pub(super) fn needle(
    sheet: &Sheet<'_>,
    rail: &Rail,
    depth: f64,
    [below, above]: [f64; 2],
) -> Vec<Thread> {
    sewn(sheet, rail, &[[0.0, depth, below], [RISE, depth, above], [1.0 - RISE, depth, above]])
}

/// A looper thread that goes to and fro between two depths at a height.
pub(super) fn looper(
    sheet: &Sheet<'_>,
    rail: &Rail,
    [near, far]: [f64; 2],
    height: f64,
) -> Vec<Thread> {
    sewn(
        sheet,
        rail,
        &[[0.0, near, height], [0.1, near, height], [0.5, far, height], [0.6, far, height]],
    )
}

/// The thread of a row of stitches. It is cut where there is no cloth.
fn sewn(sheet: &Sheet<'_>, rail: &Rail, stitch: &[Step]) -> Vec<Thread> {
    // Whole stitches fill the rail.
    let count = (rail.length() / STITCH).round().max(1.0);
    let length = rail.length() / count;
    let mut threads = vec![Thread::new()];
    let mut number = 0.0;
    while number < count {
        for &[share, depth, height] in stitch {
            let along = length * (number + share);
            match place(sheet, rail, [along, depth, height]) {
                Some(point) => threads.last_mut().expect("never empty").push(point),
                None => threads.push(Thread::new()),
            }
        }
        number += 1.0;
    }
    threads.retain(|thread| thread.len() > 2 * stitch.len());
    threads
}

/// A place at a length of border, a depth and a height, with the cloth's normal.
fn place(sheet: &Sheet<'_>, rail: &Rail, [along, depth, height]: Step) -> Option<(DVec3, DVec3)> {
    let station = rail.at(along)?;
    if station.reach < depth {
        return None;
    }
    let place = sheet.at(station.flat + station.inward * depth, rail.triangle)?;
    Some((place.draped + place.normal * height, place.normal))
}
