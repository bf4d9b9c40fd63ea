//! Clearance on the body: what bending the cloth without stretching it may not change, and what the
//! mapping makes of real folds.

use glam::{DQuat, DVec3};
use warpknit::drape::clearance::ClearanceMeter;
use warpknit::drape::{self, Block, Cloth, DrapeOptions};
use warpknit::fabric::Fabric;
use warpknit::garment::{Garment, ReadOptions, read};
use warpknit::knit::clearance::{self, Clearance};
use warpknit::map::Mapping;

use crate::drape::mesh;
use crate::map::garment as square;

const BOTH: [Mapping; 2] = [Mapping::Frame, Mapping::Smooth];

fn at(wales_per_cm: f64) -> Fabric {
    Fabric::named("tricot").unwrap().at_densities(wales_per_cm, 1.5 * wales_per_cm).unwrap()
}

/// The clearance of a garment's first panel.
fn measure(garment: &Garment, fabric: &Fabric, mapping: Mapping) -> Clearance {
    let cloth = Cloth::cover(garment, fabric).unwrap();
    let mut gauge = ClearanceMeter::new(&cloth, fabric.radius());
    let deliver = &mut |blocks: &[Block]| {
        let others = blocks.iter().position(|block| block.panel > 0).unwrap_or(blocks.len());
        gauge.take(&blocks[..others]);
        Ok::<_, std::io::Error>(())
    };
    drape::run(
        &cloth,
        &DrapeOptions { mapping, ..DrapeOptions::default() },
        &mut |_, _| {},
        deliver,
    )
    .unwrap();
    gauge.finish()
}

fn share_below_95(clearance: Clearance) -> f64 {
    clearance.pairs_below_95 as f64 / clearance.pairs as f64
}

#[test]
fn a_rigid_motion_changes_no_clearance() {
    let fabric = at(0.15);
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.7, -1.1, 2.3);
    let (lying, moved) = (square(|p| p), square(|p| turn * p + DVec3::new(300.0, -50.0, 120.0)));
    let pattern = Cloth::cover(&lying, &fabric).unwrap().pattern().clone();
    let repeat = clearance::measure(&fabric, &pattern, fabric.radius());
    for mapping in BOTH {
        let [flat, draped] = [&lying, &moved].map(|garment| measure(garment, &fabric, mapping));
        assert!(
            flat.pairs > 500_000 && flat.pairs.abs_diff(draped.pairs) * 1000 < flat.pairs,
            "{flat:?} {draped:?}"
        );
        assert!((flat.min_over_2r - draped.min_over_2r).abs() < 1e-6, "{flat:?} {draped:?}");
        assert!(
            flat.pairs_below_95 == 0 && (flat.min_over_2r - repeat.min_over_2r).abs() < 0.05,
            "{flat:?} {repeat:?}"
        );
    }
}

#[test]
fn a_wide_cylinder_changes_hardly_any() {
    let fabric = at(0.15);
    let radius = 6000.0;
    let wound =
        square(|p| DVec3::new(radius * (p.x / radius).sin(), p.y, radius * (p.x / radius).cos()));
    let [flat, draped] =
        [&square(|p| p), &wound].map(|garment| measure(garment, &fabric, Mapping::Smooth));
    assert!((flat.min_over_2r - draped.min_over_2r).abs() < 0.01, "{flat:?} {draped:?}");
    assert!((share_below_95(flat) - share_below_95(draped)).abs() < 1e-4, "{flat:?} {draped:?}");
}

#[test]
fn smooth_yarns_cut_each_other_less_than_framed_ones() {
    for name in ["skirt", "tube"] {
        let (flat, draped) =
            (mesh(&format!("{name}_flat.obj")), mesh(&format!("{name}_draped.obj")));
        let garment = read(&flat, Some(&draped), &ReadOptions::default()).unwrap();
        let [frame, smooth] = BOTH.map(|mapping| measure(&garment, &at(0.5), mapping));
        assert!(share_below_95(smooth) < share_below_95(frame), "{name}: {smooth:?} {frame:?}");
        assert!(smooth.pairs_below_1 < frame.pairs_below_1, "{name}: {smooth:?} {frame:?}");
    }
}
