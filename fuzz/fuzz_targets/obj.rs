//! OBJ files: a garment with its `vt`, or, with a NUL between each two, a flat and a draped file,
//! and one more frame. What is read is inspected and, coarsely, knitted onto; the frame is taken or
//! refused.

#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use warpknit::fabric::Fabric;
use warpknit::garment::stretch::{isometry, stretch};
use warpknit::garment::{Frames, Garment, Panel, ReadOptions, read};
use warpknit::locate::overlap::overlaps;
use warpknit_fuzz::{Desk, knit, one_line, parts};

static DESK: LazyLock<Desk> = LazyLock::new(Desk::new);
static TRICOT: LazyLock<Fabric> = LazyLock::new(|| Fabric::named("tricot").expect("a built-in fabric"));

fuzz_target!(|data: &[u8]| {
    let files = parts(data, b"\0");
    let flat = DESK.file("flat.obj", files[0]);
    let draped = files.get(1).map(|draped| DESK.file("draped.obj", draped));
    let options = [
        ReadOptions::default(),
        ReadOptions { unit: Some("cm".parse().expect("a unit")), uv_scale: Some(10.0), grain: 0.7, turn: true, allow_loss: true },
    ];
    for options in options {
        match read(&flat, draped.as_deref(), &options) {
            Ok(garment) => use_it(&garment),
            Err(error) => one_line(&error),
        }
        if let Some(frame) = files.get(2).map(|frame| DESK.file("frame.obj", frame))
            && let Ok((mut garment, frames)) = Frames::read(&flat, draped.as_deref(), &options)
        {
            match frames.pose(&mut garment, &frame) {
                Ok(odd) => odd.iter().for_each(one_line),
                Err(error) => one_line(&error),
            }
            garment.panels.iter().for_each(check);
        }
    }
});

fn use_it(garment: &Garment) {
    assert!(!garment.panels.is_empty());
    let (warp, weft) = stretch(&garment.panels);
    assert!(warp.into_iter().chain(weft).all(|share| !share.is_nan()), "{warp:?} {weft:?}");
    for panel in &garment.panels {
        check(panel);
    }
    garment.summary.warnings.iter().for_each(one_line);
    let _inspected = (isometry(&garment.panels), overlaps(garment));
    // Some ten wales and courses of the largest panel.
    let side = garment.panels.iter().map(|panel| panel.size().max_element()).fold(0.0, f64::max);
    if let Ok(fabric) = TRICOT.clone().at_densities(100.0 / side, 100.0 / side)
        && let Err(error) = knit(garment, &fabric)
    {
        one_line(&error);
    }
}

fn check(panel: &Panel) {
    let count = panel.uv.len();
    assert_eq!([panel.draped.len(), panel.normals.len()], [count; 2]);
    assert_eq!(panel.faces.len(), panel.triangles.len());
    assert!(panel.triangles.iter().chain(&panel.flipped).flatten().all(|&vertex| (vertex as usize) < count));
    assert!(panel.uv.iter().all(|p| p.is_finite()) && panel.draped.iter().all(|p| p.is_finite()));
    assert!(panel.normals.iter().all(|n| n.is_finite()));
    assert!(panel.area() > 0.0, "{}", panel.area());
    let _counted = panel.non_manifold_edges();
}
