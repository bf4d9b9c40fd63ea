//! Clearance on the body: what bending the cloth without stretching it may not change, what the
//! mapping makes of real folds, and yarns that a drape pushes together by a known amount.

use glam::{DQuat, DVec3};
use rayon::ThreadPoolBuilder;
use warpknit::drape::clearance::{BodyClearance, measure as measure_cloth, run};
use warpknit::drape::strands::Edge;
use warpknit::drape::{self, Block, Cloth, DrapeOptions};
use warpknit::fabric::Fabric;
use warpknit::garment::{Garment, ReadOptions, read};
use warpknit::knit::clearance;
use warpknit::map::Mapping;
use warpknit::yarn::curve;

use crate::drape::mesh;
use crate::laid::GRID;
use crate::map::garment as square;

const BOTH: [Mapping; 2] = [Mapping::Frame, Mapping::Smooth];

fn at(wales_per_cm: f64) -> Fabric {
    coarse("tricot", wales_per_cm)
}

/// A fabric with loops one and a half times as dense along the wales as across.
pub(crate) fn coarse(name: &str, wales_per_cm: f64) -> Fabric {
    Fabric::named(name).unwrap().at_densities(wales_per_cm, 1.5 * wales_per_cm).unwrap()
}

fn measure(garment: &Garment, fabric: &Fabric, mapping: Mapping) -> BodyClearance {
    measure_drawn(garment, fabric, mapping, fabric.radius())
}

/// The clearance of yarns that are drawn with a radius.
fn measure_drawn(
    garment: &Garment,
    fabric: &Fabric,
    mapping: Mapping,
    radius: f64,
) -> BodyClearance {
    let options = DrapeOptions { mapping, ..DrapeOptions::default() };
    let cloth = Cloth::cover(garment, fabric).unwrap();
    measure_cloth(&cloth, &options, radius, &mut |_done| ())
}

pub(crate) fn skirt() -> Garment {
    read(&mesh("skirt_flat.obj"), Some(&mesh("skirt_draped.obj")), &ReadOptions::default()).unwrap()
}

#[test]
fn a_rigid_motion_changes_no_clearance() {
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.7, -1.1, 2.3);
    let (lying, moved) = (square(|p| p), square(|p| turn * p + DVec3::new(300.0, -50.0, 120.0)));
    // Yarns along the wales, yarns across them, and both.
    for name in ["tricot", "jersey", "weft-inserted"] {
        let fabric = coarse(name, 0.3);
        let pattern = Cloth::cover(&lying, &fabric).unwrap().pattern().clone();
        // A tenth too thick, so that the yarns cut each other flat.
        let radius = 1.1 * fabric.radius();
        let repeat = clearance::measure(&fabric, &pattern, radius);
        for mapping in BOTH {
            let [flat, draped] =
                [&lying, &moved].map(|garment| measure_drawn(garment, &fabric, mapping, radius));
            let context = format!("{name}: {flat:?} {draped:?} {repeat:?}");
            assert!((flat.min_over_2r - draped.min_over_2r).abs() < 1e-5, "{context}");
            // Segments of other lengths lie a little beside each other.
            assert!((flat.min_over_2r - repeat.min_over_2r).abs() < 0.02, "{context}");
            assert!(flat.pairs_below_1 > 1000, "{context}");
            assert!(flat.pairs.abs_diff(draped.pairs) * 1000 < flat.pairs, "{context}");
            assert!((flat.yarn_length / draped.yarn_length - 1.0).abs() < 1e-6, "{context}");
            assert!((flat.near_flat / draped.near_flat - 1.0).abs() < 1e-3, "{context}");
            // Whatever is near was so flat, and is left out.
            assert!(flat.below_95 == 0.0 && draped.below_95 == 0.0, "{context}");
        }
        let found = measure(&moved, &fabric, Mapping::Smooth);
        assert!(found.pairs_below_1 == 0 && found.near_flat == 0.0, "{name}: {found:?}");
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
    assert!(draped.share_below_95() == 0.0, "{flat:?} {draped:?}");
}

#[test]
fn smooth_yarns_cut_each_other_less_than_framed_ones() {
    for name in ["skirt", "tube"] {
        let (flat, draped) =
            (mesh(&format!("{name}_flat.obj")), mesh(&format!("{name}_draped.obj")));
        let garment = read(&flat, Some(&draped), &ReadOptions::default()).unwrap();
        let [frame, smooth] = BOTH.map(|mapping| measure(&garment, &at(0.5), mapping));
        assert!(smooth.share_below_95() < frame.share_below_95(), "{name}: {smooth:?} {frame:?}");
        assert!(smooth.pairs_below_1 < frame.pairs_below_1, "{name}: {smooth:?} {frame:?}");
    }
}

/// The grid of laid yarns on a square that is `share` as wide on the body as flat, where warps are
/// `apart` of touching.
fn pushed_together(apart: f64) -> BodyClearance {
    let fabric = Fabric::parse(GRID).unwrap().at_densities(0.5, 0.625).unwrap();
    let share = apart * 2.0 * fabric.radius() / fabric.wale_spacing();
    measure(&square(|p| p * DVec3::new(share, 1.0, 1.0)), &fabric, Mapping::Smooth)
}

#[test]
fn yarns_pushed_together_have_the_clearance_of_their_spacing() {
    let (near, nearer) = (pushed_together(0.96), pushed_together(0.9));
    assert!((near.min_over_2r - 0.96).abs() < 1e-4 && near.pairs_below_1 > 0, "{near:?}");
    assert!(near.below_95 == 0.0, "{near:?}");
    assert!((nearer.min_over_2r - 0.9).abs() < 1e-4, "{nearer:?}");
    // 50 warps and 63 wefts of a metre. Warps are nearer than 0.95 of touching, wefts are not.
    assert!((nearer.yarn_length - 113e3).abs() < 1.0, "{nearer:?}");
    assert!((nearer.below_95 - 50e3).abs() < 1.0, "{nearer:?}");
    assert!((nearer.share_below_95() - 50.0 / 113.0).abs() < 1e-4, "{nearer:?}");
}

#[test]
fn what_is_near_in_the_flat_cloth_is_left_out() {
    // Warps of 0.17 mm lie 0.06 mm under wefts. They are pushed apart until they are squeezed.
    let text = GRID.replace("0.2]", "0.03]").replace("-0.2]", "-0.03]");
    let fabric = Fabric::parse(&text).unwrap().at_densities(0.5, 0.625).unwrap();
    let found = measure(&square(|p| p), &fabric, Mapping::Smooth);
    assert!(found.min_over_2r < 0.9 && found.below_95 == 0.0, "{found:?}");
    assert!(found.share_near_flat() > 0.02 && found.share_near_flat() < 0.5, "{found:?}");
}

#[test]
fn cloth_that_lies_on_cloth_is_left_out() {
    // Folded in half, so that each place lies in the same place as another.
    let folded = square(|p| DVec3::new(p.x.min(1000.0 - p.x), p.y, p.z));
    let found = measure(&folded, &at(0.3), Mapping::Smooth);
    // Only the yarns at the crease are neighbours of those that they meet.
    assert!(found.below_95 > 0.0 && found.share_below_95() < 0.1, "{found:?}");
}

#[test]
fn no_yarn_is_lost_over_many_stitches() {
    let garment = skirt();
    let fabric = at(1.7);
    let cloth = Cloth::cover(&garment, &fabric).unwrap();
    let options = DrapeOptions { edge: Edge::Drop, ..DrapeOptions::default() };
    // With dropped edges all stitches are whole, so the yarns are those that are drawn.
    let mut length = 0.0;
    let mut deliver = |blocks: &[Block]| -> Result<(), std::convert::Infallible> {
        for block in blocks {
            for strand in &block.strands.strands {
                let points = &block.strands.flat[strand.range()];
                let spans = 0..points.len() - 1;
                length += spans.map(|at| curve::span(points, at).precise_length()).sum::<f64>();
            }
        }
        Ok(())
    };
    let Ok(totals) = drape::run(&cloth, &options, &mut |_, _| {}, &mut deliver);
    assert!(totals.losses.stitches > 50_000);
    let found = measure_cloth(&cloth, &options, fabric.radius(), &mut |_done| ());
    assert!((found.yarn_length / length - 1.0).abs() < 5e-3, "{found:?} {length}");
}

#[test]
fn any_number_of_threads_gives_the_same() {
    let garment = skirt();
    let fabric = at(0.8);
    let [one, three] = [1, 3].map(|count| {
        let threads = ThreadPoolBuilder::new().num_threads(count).build().unwrap();
        threads.install(|| measure(&garment, &fabric, Mapping::Smooth))
    });
    assert!(one.pairs_below_1 > 0 && one.below_95 > 0.0);
    assert_eq!(one, three);
}

#[test]
fn swept_yarns_are_measured_within_the_run() {
    let (garment, fabric) = (skirt(), at(0.8));
    let cloth = Cloth::cover(&garment, &fabric).unwrap();
    let options = DrapeOptions { sweeps: Some(true), ..DrapeOptions::default() };
    let mut points = 0;
    let mut stages = Vec::new();
    let deliver = &mut |blocks: &[Block]| {
        points += blocks.iter().map(|block| block.draped.positions.len()).sum::<usize>();
        Ok::<_, std::convert::Infallible>(())
    };
    let announce = &mut |stage, _| stages.push(stage);
    let Ok((totals, within)) = run(&cloth, &options, fabric.radius(), announce, deliver);
    assert!(totals.data_points > 0 && points >= totals.data_points);
    assert!(stages.contains(&drape::Stage::Clearance));
    let pool = ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    let again = pool.install(|| measure_cloth(&cloth, &options, fabric.radius(), &mut |_| ()));
    assert_eq!(within, again);
    let unswept = DrapeOptions { sweeps: Some(false), ..options };
    let before = measure_cloth(&cloth, &unswept, fabric.radius(), &mut |_| ());
    // The same yarns, which sweeps have moved apart. An arc's share of its span's flat length is that
    // of its draped length, so lengths differ by a ten-thousandth.
    assert!((within.yarn_length / before.yarn_length - 1.0).abs() < 5e-4, "{within:?} {before:?}");
    assert!(within.below_95 < 0.2 * before.below_95, "{within:?} {before:?}");
}

/// A square folded in half with a radius on the body.
fn folded(radius: f64) -> Garment {
    let half = std::f64::consts::FRAC_PI_2 * radius;
    square(move |p| {
        let along = p.x - 500.0;
        let beyond = (along.abs() - half).max(0.0) * along.signum();
        let angle = (along - beyond) / radius;
        let [sine, cosine] = [angle.sin(), angle.cos()];
        DVec3::new(radius * cosine - beyond.abs(), p.y, radius * sine)
    })
}

#[test]
fn yarns_that_a_fold_brings_together_are_moved_apart() {
    // Loops reach some five radii to either side, so the inner side of the fold has no room.
    let fabric = coarse("locknit", 0.3);
    let garment = folded(5.0 * fabric.radius());
    let cloth = Cloth::cover(&garment, &fabric).unwrap();
    let [before, swept] = [false, true].map(|sweeps| {
        let options = DrapeOptions { sweeps: Some(sweeps), ..DrapeOptions::default() };
        measure_cloth(&cloth, &options, fabric.radius(), &mut |_| ())
    });
    assert!(before.share_below_95() > 0.05 && before.min_over_2r < 0.2, "{before:?}");
    assert!(swept.share_below_95() < 0.005 && swept.min_over_2r > 0.6, "{swept:?}");
}

#[test]
fn no_yarn_passes_through_another_in_a_fold_as_sharp_as_its_radius() {
    // Short spans across the fold are mapped three times too long, and are mended and not torn.
    let fabric = coarse("locknit", 0.3);
    let garment = folded(fabric.radius());
    let cloth = Cloth::cover(&garment, &fabric).unwrap();
    let swept = measure_cloth(&cloth, &DrapeOptions::default(), fabric.radius(), &mut |_| ());
    assert!(swept.share_below_95() < 0.005 && swept.min_over_2r > 0.6, "{swept:?}");
}

/// Where the data points of a locknit lie on a garment, with or without sweeps.
fn positions(garment: &Garment, sweeps: bool) -> Vec<DVec3> {
    let fabric = coarse("locknit", 0.3);
    let cloth = Cloth::cover(garment, &fabric).unwrap();
    let options = DrapeOptions { sweeps: Some(sweeps), ..DrapeOptions::default() };
    let mut all = Vec::new();
    let Ok(_) = drape::run(&cloth, &options, &mut |_, _| {}, &mut |blocks| {
        all.extend(blocks.iter().flat_map(|block| block.draped.positions.iter().copied()));
        Ok::<_, std::convert::Infallible>(())
    });
    all
}

#[test]
fn only_yarn_that_is_wrong_is_moved() {
    let flat = square(|p| p);
    assert!(positions(&flat, false) == positions(&flat, true));
    let folded = folded(5.0 * coarse("locknit", 0.3).radius());
    let [mapped, swept] = [false, true].map(|sweeps| positions(&folded, sweeps));
    let moved: Vec<_> =
        mapped.iter().zip(&swept).filter(|(a, b)| a != b).map(|(a, _)| *a).collect();
    assert!(moved.len() > mapped.len() / 100, "{} of {}", moved.len(), mapped.len());
    // The fold lies at the right, and flat cloth at the left. Some stitches beside the fold move along.
    let farthest = moved.iter().map(|place| place.x).fold(f64::INFINITY, f64::min);
    assert!(farthest > -200.0, "{farthest}");
}
