//! Tests of finished edges on panels whose drape is known.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec2, DVec3};

use super::*;
use crate::ids::{FaceId, index32};
use crate::number::double;

const SIZES: Sizes = Sizes { face: 0.3, back: 0.2, thread: 0.1 };

/// A panel of cells of 5 mm, `columns` x `rows` of them from `low` on, draped by functions of the flat
/// place to a place and its normal.
fn grid(low: DVec2, [columns, rows]: [usize; 2], drape: impl Fn(DVec2) -> (DVec3, DVec3)) -> Panel {
    let places = (0..=rows).flat_map(|row| {
        (0..=columns).map(move |column| low + 5.0 * DVec2::new(double(column), double(row)))
    });
    let uv: Vec<DVec2> = places.collect();
    let (draped, normals) = uv.iter().copied().map(drape).unzip();
    let mut triangles = Vec::new();
    for cell in (0..rows).flat_map(|row| (0..columns).map(move |at| row * (columns + 1) + at)) {
        let [a, b, c, d] = [cell, cell + 1, cell + columns + 2, cell + columns + 1].map(index32);
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    let faces = (0..).map(FaceId).take(triangles.len()).collect();
    Panel {
        uv,
        draped,
        normals,
        triangles,
        faces,
        flipped: Vec::new(),
        flat_from_panel: DAffine3::IDENTITY,
        mirrored: false,
        turned_in: None,
    }
}

fn flat(p: DVec2) -> (DVec3, DVec3) {
    (p.extend(0.0), DVec3::Z)
}

/// The radius of [`tube`].
const RADIUS: f64 = 300.0 / TAU;

/// A panel 300 mm wide as a tube, whose sides meet.
fn tube(p: DVec2) -> (DVec3, DVec3) {
    let (sin, cos) = (p.x / RADIUS).sin_cos();
    (DVec3::new(RADIUS * sin, p.y, RADIUS * cos), DVec3::new(sin, 0.0, cos))
}

fn garment(panels: Vec<Panel>) -> Garment {
    Garment { panels, ..Garment::rectangle(1.0, 1.0) }
}

fn finish(garment: &Garment, sizes: &Sizes) -> Finished {
    Edges::new(garment, *sizes).finish(garment)
}

/// Width and height of the panels that were added.
fn added(garment: &Garment) -> Vec<[i64; 2]> {
    let panels = garment.panels.iter().filter(|panel| panel.turned_in.is_some());
    #[expect(clippy::cast_possible_truncation, reason = "some hundred millimetres")]
    panels.map(|panel| panel.size().to_array().map(|side| side.round() as i64)).collect()
}

#[test]
fn a_hem_lies_behind_its_panel_and_goes_on_in_its_pattern() {
    let finished = finish(&garment(vec![grid(DVec2::ZERO, [60, 40], flat)]), &SIZES);
    assert_eq!(added(&finished.garment), [[300, 20], [20, 200], [300, 20], [20, 200]]);
    for panel in &finished.garment.panels[1..] {
        assert!(panel.area() > 0.99 * panel.size().x * panel.size().y);
        let vertices = panel.uv.iter().zip(&panel.draped).zip(&panel.normals);
        for ((uv, draped), normal) in vertices {
            // Beyond the border in the pattern, and as far within it on the body.
            let (within, beyond) = (draped.truncate(), *uv);
            let inner = within.clamp(DVec2::ZERO, DVec2::new(300.0, 200.0));
            let border = beyond.clamp(DVec2::ZERO, DVec2::new(300.0, 200.0));
            let depth = beyond.distance(border);
            assert!(within.distance(inner) < 1e-9 && within.distance(border) < depth + 0.3, "{uv}");
            if depth > 0.5 {
                assert!((draped.z + 2.0 * SIZES.back).abs() < 1e-9 && normal.z < -0.99, "{draped}");
            } else {
                assert!((-2.0 * SIZES.back - 1e-9..0.0).contains(&draped.z), "{draped}");
            }
        }
    }
}

#[test]
fn a_tube_has_two_hems_and_one_seam() {
    let finished = finish(&garment(vec![grid(DVec2::ZERO, [60, 40], tube)]), &SIZES);
    let mut sizes = added(&finished.garment);
    sizes.sort_unstable();
    assert_eq!(sizes, [[5, 200], [5, 200], [300, 20], [300, 20]]);
    for place in finished.garment.panels[1..].iter().flat_map(|panel| &panel.draped) {
        let depth = RADIUS - place.x.hypot(place.z);
        // Chords of 2.5 mm lie up to 0.02 mm within the arc.
        assert!((0.0..2.0 * SIZES.back + 0.05).contains(&depth), "{depth}");
    }
    // Three threads on each hem, and one on each allowance.
    assert_eq!(finished.threads.len(), 3 + 3 + 1 + 1);
    for (place, normal) in finished.threads.iter().flatten() {
        let height = place.x.hypot(place.z) - RADIUS;
        assert!((-2.0 * SIZES.back - 0.45..SIZES.face + 0.1).contains(&height), "{height}");
        assert!(normal.dot(*place) > 0.0);
    }
}

#[test]
fn a_hem_stays_a_hem_in_a_drape_where_it_touches_cloth() {
    let [open, closed] = [
        garment(vec![grid(DVec2::ZERO, [60, 40], flat)]),
        garment(vec![grid(DVec2::ZERO, [60, 40], tube)]),
    ];
    let edges = Edges::new(&open, SIZES);
    let [open, closed] = [&open, &closed].map(|garment| edges.finish(garment).garment);
    assert_eq!(added(&closed), [[300, 20], [20, 200], [300, 20], [20, 200]]);
    for (panel, moved) in open.panels.iter().zip(&closed.panels) {
        assert_eq!((&panel.uv, &panel.triangles), (&moved.uv, &moved.triangles));
        assert_ne!(panel.draped, moved.draped);
    }
}

#[test]
fn a_narrow_band_that_is_sewn_on_is_doubled() {
    // Its lower edge lies on the upper edge of the other panel.
    let band = grid(DVec2::new(0.0, 200.0), [60, 5], flat);
    let finished = finish(&garment(vec![grid(DVec2::ZERO, [60, 40], flat), band]), &SIZES);
    let sizes = added(&finished.garment);
    assert!(sizes.contains(&[300, 25]), "{sizes:?}");
    assert!(sizes.iter().filter(|size| **size == [300, 5]).count() >= 2, "{sizes:?}");
}

#[test]
fn needles_lie_on_the_face_and_go_through() {
    let finished = finish(&garment(vec![grid(DVec2::ZERO, [60, 40], flat)]), &SIZES);
    let heights: Vec<f64> = finished.threads[0].iter().map(|(place, _)| place.z).collect();
    let [low, high] =
        [f64::min, f64::max].map(|pick| heights.iter().copied().reduce(pick).unwrap());
    assert!((low + SIZES.back).abs() < 1e-9 && (high - SIZES.face - 0.05).abs() < 1e-9);
    // A stitch of three points every 2.8 mm.
    assert_eq!(finished.threads[0].len(), 3 * 107);
}

/// A sheet of two triangles.
fn sheet(corners: [[f64; 2]; 4]) -> Panel {
    let uv = corners.map(DVec2::from).to_vec();
    let draped = uv.iter().map(|p| p.extend(0.0)).collect();
    Panel { uv, draped, ..Garment::rectangle(1.0, 1.0).panels.remove(0) }
}

#[test]
fn long_edges_are_not_sewn_to_themselves() {
    for side in [60.0, 300.0] {
        let square = sheet([[0.0, 0.0], [side, 0.0], [side, side], [0.0, side]]);
        let finished = finish(&garment(vec![square]), &SIZES);
        assert_eq!((finished.garment.panels.len(), finished.threads.len()), (5, 12), "{side}");
    }
}

#[test]
fn slanted_edges_turn_in_as_much_cloth_as_straight_ones() {
    let (sin, cos) = 0.53_f64.sin_cos();
    let turned = |x: f64, y: f64| [x * cos - y * sin, x * sin + y * cos];
    let corners = [turned(0.0, 0.0), turned(300.0, 0.0), turned(300.0, 200.0), turned(0.0, 200.0)];
    let finished = finish(&garment(vec![sheet(corners)]), &SIZES);
    let areas = finished.garment.panels[1..].iter().map(Panel::area);
    for (area, length) in areas.zip([300.0, 200.0, 300.0, 200.0]) {
        assert!((area / (20.0 * length) - 1.0).abs() < 0.002, "{area} of {length}");
    }
}

#[test]
fn short_runs_between_slanted_borders_keep_their_lengths() {
    // A parallelogram with sides of 30 mm, shorter than the turns at their two ends.
    let tab = sheet([[0.0, 0.0], [30.0, 0.0], [90.0, 150.0], [60.0, 150.0]]);
    let finished = finish(&garment(vec![tab]), &SIZES);
    for panel in &finished.garment.panels[1..] {
        for &[a, b, c] in &panel.triangles {
            let [a, b, c] = [a, b, c].map(|vertex| vertex as usize);
            let area = (panel.uv[b] - panel.uv[a]).perp_dot(panel.uv[c] - panel.uv[a]);
            let [p, q, r] = [a, b, c].map(|vertex| panel.draped[vertex].truncate());
            let draped = (q - p).perp_dot(r - p).abs();
            // At the fold the drape is a quarter turn.
            let is_fold = [a, b, c].iter().any(|&vertex| panel.draped[vertex].z > -0.3);
            assert!(is_fold || (draped / area - 1.0).abs() < 0.01, "{draped} of {area}");
        }
    }
}

#[test]
fn slits_and_small_holes_stay_raw_and_large_ones_are_hemmed() {
    let hole = |cells: std::ops::Range<usize>, drop: fn(usize) -> bool| {
        let mut panel = grid(DVec2::ZERO, [60, 40], flat);
        let is_in = |cell: usize| cells.contains(&(cell % 60)) && cells.contains(&(cell / 60));
        let kept = (0..panel.triangles.len()).filter(|at| !(is_in(at / 2) && drop(*at)));
        panel.triangles = kept.map(|at| panel.triangles[at]).collect();
        panel.faces.truncate(panel.triangles.len());
        finish(&garment(vec![panel]), &SIZES).garment.panels.len() - 1
    };
    assert_eq!(hole(20..22, |_| true), 4);
    assert_eq!(hole(10..30, |_| true), 4 + 4);
    // The border of a flipped triangle at the edge is left out, and the rest is hemmed.
    let mut panel = grid(DVec2::ZERO, [60, 40], flat);
    let lost = panel.triangles.swap_remove(0);
    panel.flipped.push(lost);
    panel.faces.pop();
    let finished = finish(&garment(vec![panel]), &SIZES);
    assert!(finished.garment.panels.len() > 4 && finished.threads.len() >= 12);
}

#[test]
fn wales_go_on_round_the_fold() {
    let fabric = crate::fabric::Fabric::named("tricot").unwrap();
    // Sides that are no whole numbers of wales and courses.
    let panel = sheet([[0.3, 0.1], [200.0, 0.1], [200.0, 150.0], [0.3, 150.0]]);
    let finished = finish(&garment(vec![panel]), &SIZES);
    let cloth = crate::drape::Cloth::cover(&finished.garment, &fabric).unwrap();
    let origins: Vec<DVec2> = cloth.origins().collect();
    let spacing = DVec2::new(fabric.wale_spacing(), fabric.course_spacing());
    for (origin, panel) in origins.iter().zip(&finished.garment.panels) {
        let off = (*origin - origins[0]) / spacing;
        assert!((off - off.round()).abs().max_element() < 1e-9, "{off}");
        // Not right of and above where the first panel's fabric begins.
        let before = origins[0] - finished.garment.panels[0].bounds()[0];
        assert!((*origin - panel.bounds()[0]).cmple(before + 1e-9).all());
    }
}

#[test]
fn cloth_without_shape_has_no_edges_to_finish() {
    let collapsed = grid(DVec2::ZERO, [8, 8], |_| (DVec3::ONE, DVec3::Z));
    let lost = grid(DVec2::ZERO, [8, 8], |_| (DVec3::NAN, DVec3::NAN));
    let mut flipped = grid(DVec2::ZERO, [8, 8], flat);
    flipped.flipped = flipped.triangles.split_off(64);
    let mut empty = grid(DVec2::ZERO, [8, 8], flat);
    empty.triangles.clear();
    let finished = finish(&garment(vec![lost, empty]), &SIZES);
    assert_eq!((finished.garment.panels.len(), finished.threads.len()), (2, 0));
    let finished = finish(&garment(vec![collapsed, flipped]), &SIZES);
    for panel in &finished.garment.panels[2..] {
        assert!(panel.draped.iter().all(|place| place.is_finite()));
    }
}
