//! Weft knits: loops hang in the loops below them, on flat cloth and on garments.

use std::path::PathBuf;

use glam::DVec3;
use warpknit::drape::{self, Cloth};
use warpknit::fabric::Fabric;
use warpknit::garment::{ReadOptions, read};
use warpknit::knit::mesh::StructureMesh;
use warpknit::knit::weft::POINTS;
use warpknit::knit::{Knitted, Pattern};
use warpknit::render::cloth;
use warpknit::yarn::curve;

use crate::fabrics::WEFT_KNITS;

/// A yarn's path from one data point to another, sixteen places a span.
fn path(points: &[DVec3], from: usize, to: usize) -> Vec<DVec3> {
    let places = (from..to).flat_map(|at| (0..16).map(move |step| (at, f64::from(step) / 16.0)));
    places.map(|(at, t)| curve::span(points, at).at(t)).collect()
}

/// Where two paths cross as seen from the face: how much higher the first one lies, in the order of
/// the first.
fn crossings(one: &[DVec3], other: &[DVec3]) -> Vec<f64> {
    let mut found = Vec::new();
    for a in one.windows(2) {
        for b in other.windows(2) {
            let (d, e, f) =
                ((a[1] - a[0]).truncate(), (b[1] - b[0]).truncate(), (b[0] - a[0]).truncate());
            let volume = d.perp_dot(e);
            let (s, t) = (f.perp_dot(e) / volume, f.perp_dot(d) / volume);
            if (0.0..1.0).contains(&s) && (0.0..1.0).contains(&t) {
                found.push(a[0].lerp(a[1], s).z - b[0].lerp(b[1], t).z);
            }
        }
    }
    found
}

#[test]
fn every_loop_hangs_in_the_one_below() {
    for name in WEFT_KNITS {
        let fabric = Fabric::named(name).unwrap();
        let (pattern, motif) = (Pattern::new(&fabric), &fabric.weft_knit().unwrap().motif);
        let mesh = StructureMesh::anchored_at(&fabric, glam::DVec2::ZERO);
        let (wales, courses) = (motif.wales() as i64, motif.courses() as i64);
        let course = |course: i64| {
            let mut knitted = Knitted::default();
            pattern.lay(0, course, -8..wales + 8, &mesh, &mut knitted);
            knitted.points
        };
        let mut places = 0;
        let point = |wale: i64, at: usize| (wale + 8) as usize * POINTS + at;
        for row in 0..courses {
            let (below, above) = (course(row), course(row + 1));
            for wale in 0..wales {
                let (old, home) =
                    (motif.cell(wale, row), wale + i64::from(motif.cell(wale, row).carried));
                let new = motif.cell(home, row + 1);
                let near = (row - 3..=row + 4)
                    .flat_map(|row| (home - 3..=home + 3).map(move |wale| (wale, row)));
                let leans = near.into_iter().any(|(wale, row)| motif.cell(wale, row).carried != 0);
                if leans {
                    // Loops that lean cross their neighbours too.
                    continue;
                }
                let head = path(&below, point(wale, 2), point(wale, 14));
                let loop_ = path(&above, point(home, 0), point(home + 1, 0));
                let side = if new.reverse { -1.0 } else { 1.0 };
                let higher: Vec<bool> = crossings(&loop_, &head)
                    .into_iter()
                    .map(|height| height * side > 0.0)
                    .collect();
                // Its legs come through the head from behind and its own head and feet lie behind;
                // through a head of the other kind all of it lies in front, as its kind sees it.
                let expected =
                    if old.reverse == new.reverse { [false, true, true, false] } else { [true; 4] };
                assert_eq!(higher, expected, "{name}, wale {wale}, course {row}");
                places += 1;
            }
        }
        // All loops of plain knits, ribs and garter; of the cable those between its crossings,
        // where no wale leans.
        let all = wales * courses;
        let least = if name == "cable" { all / 20 } else { all };
        assert!(places >= least, "{name}: {places} of {all} loops were looked at");
    }
}

#[test]
fn a_cable_covers_a_garment_and_a_rectangle() {
    let fabric = Fabric::named("cable").unwrap();
    let scene = cloth::swatch(&fabric, 32, 36);
    assert_eq!(scene.strands.len(), 36, "a yarn a course");
    assert!(scene.stitches.len() >= 32 * 36);
    assert!(scene.positions.iter().all(|point| point.is_finite()));

    let mesh = |name: &str| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("meshes").join(name);
    let garment =
        read(&mesh("skirt_flat.obj"), Some(&mesh("skirt_draped.obj")), &ReadOptions::default())
            .unwrap();
    let stitches = |fabric: &Fabric| {
        let cloth = Cloth::cover(&garment, fabric).unwrap();
        let mut stitches = 0.0;
        let mut count = |blocks: &[drape::Block]| -> Result<(), std::convert::Infallible> {
            blocks.iter().for_each(|block| stitches += block.strands.pieces.len() as f64);
            Ok(())
        };
        let Ok(_) = drape::run(&cloth, &drape::DrapeOptions::default(), &mut |_, _| {}, &mut count);
        stitches
    };
    // A tricot has two loops on each needle.
    let tricot = Fabric::named("tricot")
        .unwrap()
        .at_densities(fabric.wales_per_cm, fabric.courses_per_cm)
        .unwrap();
    let ratio = 2.0 * stitches(&fabric) / stitches(&tricot);
    assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
}
