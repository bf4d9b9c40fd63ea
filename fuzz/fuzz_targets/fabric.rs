//! Fabric files. What is read is checked, printed, read back, drawn and, where its repeat is small,
//! knitted as a swatch.

#![no_main]

use std::convert::Infallible;

use libfuzzer_sys::fuzz_target;
use warpknit::chart::{Drawing, svg};
use warpknit::drape::{self, Cloth};
use warpknit::fabric::{Fabric, FabricError};
use warpknit_fuzz::one_line;

/// The largest repeat that is knitted, laps: larger ones take seconds by design.
const MOST_LAPS: usize = 60;

fuzz_target!(|text: &str| {
    match Fabric::parse(text) {
        Ok(fabric) => use_it(&fabric),
        Err(error) => check(&error),
    }
});

fn check(error: &FabricError) {
    one_line(error);
    if let Some(place) = &error.place {
        assert_eq!(place.to_string().lines().count(), 2, "{place}");
    }
}

fn use_it(fabric: &Fabric) {
    fabric.warnings().iter().for_each(one_line);
    let printed = fabric.to_string();
    assert_eq!(
        &Fabric::parse(&printed).expect("what is printed is read back"),
        fabric,
        "{printed}"
    );
    let _drawn = svg::text(&Drawing::from_fabric(fabric));
    if fabric.repeat() * fabric.threading_repeat() * fabric.yarn_systems() > MOST_LAPS {
        return;
    }
    let panel = drape::swatch_panel(fabric, 3, 3);
    let cloth = Cloth::swatch(&panel, fabric, 3, 3);
    let finite = &mut |blocks: &[drape::Block]| {
        assert!(blocks.iter().all(|block| block.knitted.points.iter().all(|point| point.is_finite())));
        Ok::<_, Infallible>(())
    };
    let Ok(_totals) = drape::run(&cloth, &drape::DrapeOptions::default(), &mut |_, _| {}, finite);
}
