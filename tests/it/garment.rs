//! Reading garments: each promise of docs/garments.md on small meshes, then every real garment that
//! is at hand.

use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};
use proptest::prelude::*;
use tempfile::TempDir;
use warpknit::garment::{Garment, GarmentError, Panel, ReadOptions, Unit, read};

/// A folder with files in it.
struct Files(TempDir);

impl Files {
    fn new() -> Self {
        Self(TempDir::new().expect("a temporary folder can be made"))
    }

    fn write(&self, name: &str, text: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, text).expect("a temporary file can be written");
        path
    }
}

/// Reads one file with `vt`, in metres.
fn read_one(text: impl AsRef<[u8]>) -> Result<Garment, GarmentError> {
    read_with(text, &metres())
}

fn read_with(text: impl AsRef<[u8]>, options: &ReadOptions) -> Result<Garment, GarmentError> {
    let files = Files::new();
    read(&files.write("garment.obj", text), None, options)
}

fn read_two(flat: &str, draped: &str, options: &ReadOptions) -> Result<Garment, GarmentError> {
    let files = Files::new();
    let flat = files.write("flat.obj", flat);
    read(&flat, Some(&files.write("draped.obj", draped)), options)
}

fn metres() -> ReadOptions {
    ReadOptions { unit: Some(Unit::M), ..Default::default() }
}

/// Metres, and a loss is no error.
fn lossy() -> ReadOptions {
    ReadOptions { allow_loss: true, ..metres() }
}

/// An upright rectangle of two triangles, 1 m by 2 m, `vt` the same; its face looks along +z.
const SHEET: &str =
    "v 0 0 0\nv 1 0 0\nv 1 2 0\nv 0 2 0\nvt 0 0\nvt 1 0\nvt 1 2\nvt 0 2\nf 1/1 2/2 3/3 4/4\n";

/// A flat file: a grid of `n` by `n` squares of side 1 with positions from `place`, and a body
/// after it.
fn grid(n: usize, place: impl Fn(f64, f64) -> DVec3) -> String {
    let mut text = String::new();
    for j in 0..=n {
        for i in 0..=n {
            let p = place(i as f64, j as f64);
            text += &format!("v {} {} {}\n", p.x, p.y, p.z);
        }
    }
    for j in 0..n {
        for i in 0..n {
            let a = j * (n + 1) + i + 1;
            text += &format!("f {a} {} {} {}\n", a + 1, a + n + 2, a + n + 1);
        }
    }
    text
}

fn in_plane(x: f64, y: f64) -> DVec3 {
    DVec3::new(x, y, 0.0)
}

/// A panel's triangles as they come in the file.
fn in_file_order(panel: &Panel) -> impl Iterator<Item = [u32; 3]> {
    let triangles = panel.faces.iter().copied().zip(panel.triangles.iter().copied());
    triangles.collect::<std::collections::BTreeMap<_, _>>().into_values()
}

/// What every panel must be, whatever the file.
fn check_panel(panel: &Panel) {
    assert_eq!(panel.triangles.len(), panel.faces.len());
    let faces: std::collections::HashSet<_> = panel.faces.iter().collect();
    assert_eq!(faces.len(), panel.faces.len(), "a face is one triangle");
    assert_eq!(panel.uv.len(), panel.draped.len());
    assert_eq!(panel.uv.len(), panel.normals.len());
    for &[a, b, c] in &panel.triangles {
        let [a, b, c] = [a, b, c].map(|vertex| panel.uv[vertex as usize]);
        assert!((b - a).perp_dot(c - a) > 0.0, "triangles are counter-clockwise in (u, v)");
    }
    for (i, normal) in panel.normals.iter().enumerate() {
        assert!((normal.length() - 1.0).abs() < 1e-12, "normal {i} is {normal}");
        assert!(panel.uv[i].is_finite() && panel.draped[i].is_finite());
    }
    let axes = panel.flat_from_panel.matrix3;
    assert!((axes.determinant() - 1.0).abs() < 1e-12);
    assert!(panel.area() > 0.0 && panel.area().is_finite());
}

#[test]
fn one_file_with_vt_is_a_garment() {
    let garment = read_one(SHEET).unwrap();
    assert_eq!(garment.panels.len(), 1);
    let panel = &garment.panels[0];
    check_panel(panel);
    assert_eq!(panel.triangles.len(), 2);
    assert_eq!(panel.uv.len(), 4);
    assert!((panel.area() - 2e6).abs() < 1e-3);
    assert!((panel.size() - DVec2::new(1000.0, 2000.0)).length() < 1e-6);
    assert!(panel.normals.iter().all(|normal| normal.distance(DVec3::Z) < 1e-12));
    assert!(!panel.mirrored);
    assert!((garment.summary.uv_scale_mm - 1000.0).abs() < 1e-9);
    assert_eq!(garment.summary.warnings, Vec::<String>::new());
}

#[test]
fn a_flat_file_draped_as_it_was_cut_is_the_identity() {
    let flat = grid(4, |x, y| in_plane(x + 7.0, y - 3.0) / 10.0);
    let garment = read_two(&flat, &flat, &metres()).unwrap();
    assert_eq!(garment.summary.uv_scale_mm, 1000.0);
    for (uv, draped) in garment.panels[0].uv.iter().zip(&garment.panels[0].draped) {
        assert!(
            garment.panels[0].flat_from_panel.transform_point3(uv.extend(0.0)).distance(*draped)
                < 1e-9
        );
    }
}

#[test]
fn corners_pair_by_order_though_v_and_vt_are_numbered_apart() {
    let text = "v 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 1\nvt 0 0\nvt 1 0\nf 2/2 3/3 4/1\n";
    let panel = &read_one(text).unwrap().panels[0];
    for (uv, draped) in panel.uv.iter().zip(&panel.draped) {
        assert!(panel.flat_from_panel.transform_point3(uv.extend(0.0)).distance(*draped) < 1e-9);
    }
}

#[test]
fn quads_and_polygons_are_fans_from_the_first_corner() {
    let text = "v 0 0 0\nv 2 0 0\nv 3 1 0\nv 1 3 0\nv 0 2 0\nvt 0 0\nvt 2 0\nvt 3 1\nvt 1 3\nvt 0 2\nf 1/1 2/2 3/3 4/4 5/5\n";
    let panel = &read_one(text).unwrap().panels[0];
    let corners = [(0.0, 0.0), (2.0, 0.0), (3.0, 1.0), (1.0, 3.0), (0.0, 2.0)]
        .map(|(x, y)| DVec3::new(x, y, 0.0) * 1000.0);
    let expected =
        [[0, 1, 2], [0, 2, 3], [0, 3, 4]].map(|fan| fan.map(|corner: usize| corners[corner]));
    let found = in_file_order(panel).map(|triangle| triangle.map(|v| panel.draped[v as usize]));
    assert_eq!(found.collect::<Vec<_>>(), expected);
}

#[test]
fn a_draped_file_with_the_body_pairs_by_name() {
    let flat = format!("o shirt\n{}", grid(2, in_plane));
    let body = "o body\nv 0 0 5\nv 1 0 5\nv 0 1 5\nf -3 -2 -1\n";
    let shirt = |shift: usize| {
        let text = grid(2, |x, y| DVec3::new(x, 0.0, y));
        let shifted = |line: &str| match line.strip_prefix("f ") {
            Some(corners) => {
                let corners: Vec<_> = corners
                    .split(' ')
                    .map(|c| (c.parse::<usize>().unwrap() + shift).to_string())
                    .collect();
                format!("f {}\n", corners.join(" "))
            }
            None => format!("{line}\n"),
        };
        format!("o shirt\n{}", text.lines().map(shifted).collect::<String>())
    };
    let after = read_two(&flat, &format!("{}{body}", shirt(0)), &metres()).unwrap();
    let before = read_two(&flat, &format!("{body}{}", shirt(3)), &metres()).unwrap();
    for garment in [&after, &before] {
        assert_eq!(garment.panels[0].triangles.len(), 8);
        assert!(
            garment.panels[0].draped.iter().all(|p| p.y == 0.0),
            "the body is at z = 5, the shirt at y = 0"
        );
        assert_eq!(garment.summary.warnings, Vec::<String>::new());
    }
    let grouped = |text: &str| text.replace("o ", "g ");
    let groups =
        read_two(&grouped(&flat), &grouped(&format!("{body}{}", shirt(3))), &metres()).unwrap();
    assert_eq!(groups.panels[0].draped, before.panels[0].draped);
}

#[test]
fn pieces_in_another_order_pair_by_name() {
    let piece = |name: &str, x: i32, first: usize| {
        format!(
            "o {name}\nv {x} 0 0\nv {} 0 0\nv {x} 1 0\nf {first} {} {}\n",
            x + 1,
            first + 1,
            first + 2
        )
    };
    let flat = piece("front", 0, 1) + &piece("back", 5, 4);
    let draped = piece("back", 5, 1) + &piece("front", 0, 4);
    let garment = read_two(&flat, &draped, &metres()).unwrap();
    assert_eq!(garment.panels.len(), 2);
    assert!(garment.panels[0].draped.iter().all(|p| p.x < 2000.0), "front on front");
    assert!(garment.panels[1].draped.iter().all(|p| p.x > 2000.0), "back on back");
}

#[test]
fn a_draped_file_that_continues_pairs_its_first_faces_and_warns() {
    let flat = grid(2, in_plane);
    let draped = format!("{flat}v 0 0 5\nv 1 0 5\nv 0 1 5\nf -3 -2 -1\n");
    let garment = read_two(&flat, &draped, &metres()).unwrap();
    assert_eq!(garment.panels[0].triangles.len(), 8);
    assert_eq!(garment.summary.warnings.len(), 1);
    assert!(
        garment.summary.warnings[0].contains("5 faces")
            && garment.summary.warnings[0].contains("first 4")
    );
}

#[test]
fn other_faces_are_an_error_with_both_counts_and_the_first_that_differs() {
    let flat = grid(2, in_plane);
    let cut = flat.trim_end().rsplit_once('\n').unwrap().0;
    let error = read_two(&flat, cut, &metres()).unwrap_err().to_string();
    assert!(
        error.contains("4 faces") && error.contains("has 3") && error.contains("face 4"),
        "{error}"
    );
    let triangle_second = flat.replacen("f 2 3 6 5", "f 2 3 6", 1);
    let error = read_two(&flat, &triangle_second, &metres()).unwrap_err().to_string();
    assert!(
        error.contains("4 faces") && error.contains("face 2 ") && error.contains("4 corners at"),
        "{error}"
    );
    assert!(error.contains("flat.obj:11") && error.contains("draped.obj:11"), "{error}");
}

#[test]
fn corners_that_disagree_are_an_error_and_one_torn_vertex_a_warning() {
    let flat = grid(20, in_plane);
    let turned = flat.replace("f 24 25 46 45", "f 25 46 45 24");
    let torn = read_two(&flat, &turned, &metres()).unwrap();
    assert!(
        torn.summary.warnings[0].contains("4 of 441 flat vertices"),
        "{:?}",
        torn.summary.warnings
    );
    let small = grid(2, in_plane);
    let error = read_two(&small, &small.replace("f 2 3 6 5", "f 3 6 5 2"), &metres())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("4 faces")
            && error.contains("disagree")
            && error.contains("face 2 (lines 11 and 11)"),
        "{error}"
    );
}

#[test]
fn an_unwelded_draped_file_pairs() {
    let flat = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n";
    let soup = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv -0 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 4 5 6\n";
    let garment = read_two(flat, soup, &metres()).unwrap();
    assert_eq!(garment.panels.len(), 1);
    assert_eq!(garment.panels[0].uv.len(), 4);
    assert_eq!(garment.summary.warnings, Vec::<String>::new());
}

#[test]
fn the_unit_is_guessed_or_given() {
    let scaled = |k: f64| {
        SHEET
            .replace("v 1 2 0", &format!("v {k} {} 0", 2.0 * k))
            .replace("v 1 0 0", &format!("v {k} 0 0"))
    };
    for (size, unit) in [(1.0, "m"), (10.0, "dm"), (100.0, "cm"), (1000.0, "mm")] {
        let text = scaled(size).replace("v 0 2 0", &format!("v 0 {} 0", 2.0 * size));
        let facts = read_with(&text, &ReadOptions::default()).unwrap().summary;
        assert_eq!((facts.unit, facts.unit_guessed), (unit, true));
        assert!((facts.uv_scale_mm - 1000.0).abs() < 1e-6);
    }
    let inches = ReadOptions { unit: Some(Unit::Inch), ..Default::default() };
    let garment = read_with(SHEET, &inches).unwrap();
    assert_eq!((garment.summary.unit, garment.summary.unit_guessed), ("in", false));
    assert!(garment.panels[0].draped.contains(&DVec3::new(25.4, 50.8, 0.0)));
    let tiny = read_with(
        SHEET.replace("v 1 ", "v 0.01 ").replace(" 2 0", " 0.02 0"),
        &ReadOptions::default(),
    );
    assert!(tiny.unwrap().summary.warnings[0].contains("in no unit"));
}

#[test]
fn a_stray_vertex_has_no_say_in_the_unit() {
    let facts = read_with(
        format!("v 9000 0 0\n{}", SHEET.replace("f 1/1 2/2 3/3 4/4", "f 2/1 3/2 4/3 5/4")),
        &ReadOptions::default(),
    );
    assert_eq!(facts.unwrap().summary.unit, "m");
}

#[test]
fn the_scale_is_the_median_and_a_plain_unit_for_a_flat_file() {
    let flat = grid(4, in_plane);
    let stretched = grid(4, |x, y| DVec3::new(1.04 * x, y, 0.0) / 10.0);
    let file = read_two(&flat, &stretched, &metres()).unwrap();
    assert_eq!(
        file.summary.uv_scale_mm, 100.0,
        "a flat unit is a decimetre, and the rest is stretch"
    );
    let texture = read_one(SHEET.replace("v 1 ", "v 1.04 ")).unwrap();
    assert!((texture.summary.uv_scale_mm - 1000.0 * 1.04_f64.sqrt()).abs() < 1e-6);
    let given = read_with(SHEET, &ReadOptions { uv_scale: Some(123.0), ..metres() }).unwrap();
    assert_eq!(given.summary.uv_scale_mm, 123.0);
    assert!((given.panels[0].area() - 2.0 * 123.0 * 123.0).abs() < 1e-6);
}

/// A big square and a small one, whose `vt` are larger by `factor`.
fn two_scales(factor: f64) -> String {
    let second = |x: f64| 10.0 + x * factor;
    format!(
        "{SHEET}v 5 0 0\nv 5.5 0 0\nv 5 0.5 0\nvt 10 0\nvt {} 0\nvt 10 {}\nf 5/5 6/6 7/7\n",
        second(0.5),
        0.5 * factor
    )
}

#[test]
fn panels_that_disagree_take_their_own_scale_and_are_named() {
    let facts = read_one(two_scales(1.03)).unwrap().summary;
    assert_eq!(facts.warnings, Vec::<String>::new());
    assert_eq!(facts.panels[0].scale_mm, facts.panels[1].scale_mm);
    let facts = read_one(two_scales(2.0)).unwrap().summary;
    assert!((facts.panels[0].scale_mm - 1000.0).abs() < 1e-6);
    assert!((facts.panels[1].scale_mm - 500.0).abs() < 1e-6);
    assert!(facts.warnings[0].contains("panel 1 500.0000"), "{:?}", facts.warnings);
    let given =
        read_with(two_scales(2.0), &ReadOptions { uv_scale: Some(1000.0), ..metres() }).unwrap();
    assert_eq!(given.summary.panels[1].scale_mm, 1000.0);
}

#[test]
fn panels_are_components_over_flat_vertices() {
    // One draped sheet, cut in two in the flat: the seam's vt are numbered apart.
    let seam = "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nv 1 1 0\nv 2 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvt 1 1\nvt 4 0\nvt 5 0\nvt 4 1\nvt 5 1\n\
                f 1/1 2/2 5/4 4/3\nf 2/5 3/6 6/8 5/7\n";
    let garment = read_one(seam).unwrap();
    assert_eq!(garment.panels.len(), 2);
    assert_eq!(
        garment.panels[1].faces.iter().min().unwrap().0,
        2,
        "faces are counted through the file"
    );
    // The same flat numbers for both: two sleeves lie on one another in the plane, apart on the
    // body.
    let sleeves = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 0 0\nv 4 0 0\nv 5 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\nf 4/1 6/3 5/2\n";
    let garment = read_one(sleeves).unwrap();
    assert_eq!(garment.panels.len(), 2);
    assert_eq!([garment.panels[0].mirrored, garment.panels[1].mirrored], [false, true]);
    assert_eq!(garment.summary.flipped, 0);
}

#[test]
fn a_mirrored_panel_still_shows_its_face_outward() {
    let mirrored = SHEET.replace("vt 1", "vt -1");
    let panel = &read_one(mirrored).unwrap().panels[0];
    check_panel(panel);
    assert!(panel.mirrored);
    assert!(panel.normals.iter().all(|normal| normal.distance(DVec3::Z) < 1e-12));
    // u points right as seen from the face: from u = low to u = high the draped x grows.
    for (uv, draped) in panel.uv.iter().zip(&panel.draped) {
        assert!((uv.x + 500.0 - draped.x).abs() < 1e-6 && (uv.y + 1000.0 - draped.y).abs() < 1e-6);
    }
}

#[test]
fn turn_shows_the_other_side() {
    let panel = &read_with(SHEET, &ReadOptions { turn: true, ..metres() }).unwrap().panels[0];
    check_panel(panel);
    assert!(panel.normals.iter().all(|normal| normal.distance(-DVec3::Z) < 1e-12));
    assert!(!panel.mirrored, "the piece lies in the file as before");
    for (uv, draped) in panel.uv.iter().zip(&panel.draped) {
        assert!((500.0 - uv.x - draped.x).abs() < 1e-6 && (uv.y + 1000.0 - draped.y).abs() < 1e-6);
    }
}

#[test]
fn grain_turns_the_wales_counter_clockwise_seen_from_the_face() {
    for turn in [false, true] {
        let straight = read_with(SHEET, &ReadOptions { turn, ..metres() }).unwrap().panels[0]
            .flat_from_panel
            .matrix3;
        let options = ReadOptions { grain: std::f64::consts::FRAC_PI_2, turn, ..metres() };
        let garment = read_with(SHEET, &options).unwrap();
        check_panel(&garment.panels[0]);
        let axes = garment.panels[0].flat_from_panel.matrix3;
        assert!(axes.y_axis.distance(-straight.x_axis) < 1e-12, "a quarter turn takes up to left");
        assert!(axes.x_axis.distance(straight.y_axis) < 1e-12);
    }
}

#[test]
fn the_flat_mesh_may_lie_in_any_plane() {
    let tilted = glam::DMat3::from_rotation_x(0.7) * glam::DMat3::from_rotation_y(0.3);
    let planes: [&dyn Fn(f64, f64) -> DVec3; 4] =
        [&in_plane, &|x, y| DVec3::new(x, 4.0, -y), &|x, y| DVec3::new(-2.0, y, -x), &|x, y| {
            tilted * DVec3::new(x, y, 0.0) + DVec3::new(9.0, 8.0, 7.0)
        }];
    let draped = grid(3, in_plane);
    for (i, place) in planes.iter().enumerate() {
        let garment = read_two(&grid(3, place), &draped, &metres()).unwrap();
        let panel = &garment.panels[0];
        check_panel(panel);
        for (uv, draped) in panel.uv.iter().zip(&panel.draped) {
            let flat = place(draped.x / 1000.0, draped.y / 1000.0) * garment.summary.uv_scale_mm;
            let back = panel.flat_from_panel.transform_point3(uv.extend(0.0));
            assert!(back.distance(flat) < 1e-9, "plane {i}: {back} is not {flat}");
        }
    }
    let ground = read_two(&grid(3, planes[1]), &draped, &metres()).unwrap().panels[0]
        .flat_from_panel
        .matrix3;
    assert!(
        ground.y_axis.distance(DVec3::Z) < 1e-12,
        "y stands on the ground, so the wales run along z"
    );
}

#[test]
fn a_panel_that_leaves_its_plane_is_refused() {
    let bent =
        |height: f64| grid(4, move |x, y| DVec3::new(x, y, if x == 2.0 { height } else { 0.0 }));
    assert_eq!(read_two(&bent(0.1), &grid(4, in_plane), &metres()).unwrap().panels.len(), 1);
    let error = read_two(&bent(1.0), &grid(4, in_plane), &metres()).unwrap_err();
    assert!(matches!(error, GarmentError::NoPanel { .. }));
    assert!(error.to_string().contains("leaves its plane by 12."), "{error}");
    // Beside a good panel it is left out and counted.
    let good = "v 20 0 0\nv 21 0 0\nv 20 1 0\nf -3 -2 -1\n";
    let garment = read_two(&(bent(1.0) + good), &(grid(4, in_plane) + good), &lossy()).unwrap();
    assert_eq!((garment.panels.len(), garment.summary.refused), (1, 1));
    assert!(garment.summary.warnings[0].contains("left out: the piece of 32 triangles at face 1"));
}

#[test]
fn flipped_triangles_are_counted_and_take_no_stitches() {
    // The middle vertex of the flat is pulled over an edge.
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 0.5 -0.2\n\
                f 1/1 2/2 5/5\nf 2/2 3/3 5/5\nf 3/3 4/4 5/5\nf 4/4 1/1 5/5\n";
    let garment = read_with(text, &lossy()).unwrap();
    check_panel(&garment.panels[0]);
    assert_eq!(garment.panels[0].triangles.len(), 3);
    assert_eq!(garment.panels[0].flipped.len(), 1);
    let mut faces: Vec<_> = garment.panels[0].faces.iter().map(|face| face.0).collect();
    faces.sort_unstable();
    assert_eq!(faces, [1, 2, 3]);
    assert_eq!(garment.summary.flipped, 1);
    assert!(garment.summary.warnings[0].contains("1 in panel 0"));
}

#[test]
fn degenerate_and_untextured_triangles_are_counted_and_left_out() {
    let text = format!("{SHEET}f 1/1 2/2 2/2\nf 1/1 3/3 2//\nf 1 2 3\nf 4/4 3/3 2/2 1\n");
    let garment = read_with(text, &lossy()).unwrap();
    let facts = &garment.summary;
    assert_eq!((facts.triangles, facts.degenerate, facts.untextured), (7, 1, 4));
    assert_eq!(garment.panels[0].triangles.len(), 2);
    assert_eq!(facts.panels[0].degenerate, 1);
    let needle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 3 0 0\nv 4 0 0\nv 3 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvt 3 3\nvt 4 4\nvt 5 5.0000000001\n\
                  f 1/1 2/2 3/3\nf 4/4 5/5 6/6\n";
    let garment = read_with(needle, &lossy()).unwrap();
    assert_eq!(
        (garment.panels.len(), garment.summary.refused, garment.summary.degenerate),
        (1, 1, 1)
    );
}

#[test]
fn a_panel_without_draped_area_is_refused() {
    let error = read_one(SHEET.replace("v 1 2 0", "v 0 0 0").replace("v 1 0 0", "v 0 0 0"))
        .unwrap_err()
        .to_string();
    assert!(error.contains("no draped area"), "{error}");
}

#[test]
fn normals_are_weighted_by_angle() {
    // A corner of a cube whose sides are cut into one, one and two triangles: the count of
    // triangles must not show.
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt -1 1\nvt -1 0\n\
                f 1/1 2/2 5/3\nf 1/1 5/3 3/4\nf 1/1 3/4 4/5\nf 1/1 4/5 2/6\n";
    let panel = &read_one(text).unwrap().panels[0];
    let corner = panel.draped.iter().position(|p| *p == DVec3::ZERO).unwrap();
    assert!(panel.normals[corner].distance(DVec3::ONE.normalize()) < 1e-12);
}

#[test]
fn edges_with_three_faces_and_a_moebius_strip_are_read() {
    let book = "v 0 0 0\nv 0 1 0\nv 1 0 0\nv -1 0 0\nv 0 0 1\nvt 0 0\nvt 0 1\nvt 1 0\nvt -1 0\nvt 2 0\n\
                f 2/2 1/1 3/3\nf 1/1 2/2 4/4\nf 2/2 1/1 5/5\n";
    assert_eq!(read_one(book).unwrap().panels[0].non_manifold_edges(), 1);
    let mut strip = String::new();
    let count = 12;
    for i in 0..count {
        let angle = f64::from(i) / f64::from(count) * std::f64::consts::TAU;
        for side in [-0.2, 0.2] {
            let radius = 1.0 + side * (angle / 2.0).cos();
            strip += &format!(
                "v {} {} {}\n",
                radius * angle.cos(),
                radius * angle.sin(),
                side * (angle / 2.0).sin()
            );
        }
    }
    for i in 0..=count {
        strip += &format!("vt {i} 0\nvt {i} 1\n");
    }
    for i in 0..count {
        let (a, b) = (2 * i + 1, 2 * i + 2);
        let (c, d) = if i + 1 < count { (a + 2, b + 2) } else { (2, 1) };
        strip += &format!("f {a}/{a} {c}/{} {d}/{} {b}/{b}\n", a + 2, b + 2);
    }
    let garment = read_one(strip).unwrap();
    check_panel(&garment.panels[0]);
    assert_eq!(garment.panels[0].triangles.len(), 24);
}

#[test]
fn what_real_files_hold_changes_nothing() {
    let plain = read_one(SHEET).unwrap().panels[0].clone();
    let with = |text: String| read_one(text).unwrap_or_else(|error| panic!("{error}"));
    let same: Vec<(&str, String)> = vec![
        ("CRLF", SHEET.replace('\n', "\r\n")),
        ("lone carriage returns", SHEET.replace('\n', "\r")),
        ("three-digit exponents", SHEET.replace("v 1 2 0", "v 1.0e+000 2.000e+000 0.0e-002")),
        ("three-component vt", SHEET.replace("vt 1 2", "vt 1 2 0.5")),
        ("colours", SHEET.replace("v 1 2 0", "v 1 2 0 0.1 0.2 0.3")),
        ("a weight", SHEET.replace("v 1 2 0", "v 1 2 0 0.5")),
        (
            "unknown records",
            format!("e 1 2\nt 1 2 3\nl 1 2 3\nnl 1\nseam 1 2 3\np 1\n{SHEET}l 1 2 3\n"),
        ),
        ("a banner", format!("File Generated by Meshlab\n\nOBJ\n{SHEET}")),
        ("a missing mtllib", format!("mtllib C:\\nowhere\\\n{SHEET}usemtl x\ns off\n")),
        ("comments everywhere", SHEET.replace('\n', " # a comment\n")),
        ("comments that aren't UTF-8", SHEET.replace("v 1 2 0", "# \u{1}\nv 1 2 0")),
        ("a comment that ends in a backslash", format!("# C:\\meshes\\\n{SHEET}")),
        ("an isolated vertex", SHEET.replace("vt 0 0", "v 99 99 99\nvt 0 0")),
        ("negative indices", SHEET.replace("f 1/1 2/2 3/3 4/4", "f -4/-4 -3/-3 -2/-2 -1/-1")),
        (
            "continuations",
            SHEET
                .replace("f 1/1 2/2 3/3 4/4", "f 1/1 \\\n2/2\\  \r\n 3/3 \\\n\\\n4/4")
                .replace("v 1 2 0", "v 1 \\\n2 0"),
        ),
        ("a continuation after the keyword", SHEET.replace("f 1/1", "f\\\n1/1")),
        ("a continuation at the end", format!("{}\\", SHEET.trim_end())),
        ("a byte order mark", format!("\u{feff}{SHEET}")),
        (
            "normals between",
            SHEET
                .replace("\nvt", "\nvn 0 0 1\nvt")
                .replace("1/1 2/2 3/3 4/4", "1/1/1 2/2/2 3/3/1 4/4/99"),
        ),
        ("tabs and blanks", SHEET.replace(' ', " \t  ").replace('\n', "  \n\n \t\n   ")),
        ("no line end", SHEET.trim_end().to_owned()),
        (
            "groups",
            SHEET.replace("vt 0 0", "g one two\nvt 0 0").replace("f ", "g three #4\no x\nf "),
        ),
    ];
    for (what, text) in same {
        let panel = &with(text).panels[0];
        assert_eq!(panel.draped, plain.draped, "{what}");
        assert_eq!(panel.uv, plain.uv, "{what}");
        assert_eq!(panel.triangles, plain.triangles, "{what}");
    }
    let vt_first: String = SHEET.lines().rev().map(|line| format!("{line}\n")).collect();
    assert_eq!(with(vt_first).panels[0].triangles.len(), 2, "faces and vt before v");
    let latin = [b"# caf\xE9\no caf\xE9\n".as_slice(), SHEET.as_bytes()].concat();
    assert_eq!(read_one(latin).unwrap().panels[0].draped, plain.draped);
}

#[test]
fn megabytes_of_blanks_and_comments_are_skipped() {
    let mut text = "  \n\t\r\n".repeat(1 << 19);
    text += &" ".repeat(4 << 20);
    text += &format!("\n#{}\n{SHEET}", "#".repeat(4 << 20));
    assert_eq!(read_one(text).unwrap().panels[0].triangles.len(), 2);
}

#[test]
fn panels_touching_at_no_vertex_overlap_freely() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 3 0 0\nv 4 0 0\nv 3 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\nf 4/4 5/5 6/6\n";
    let garment = read_one(text).unwrap();
    assert_eq!(garment.panels.len(), 2);
    assert_eq!(garment.panels[0].uv, garment.panels[1].uv);
}

/// The folder of real garments, which is no part of the repository.
fn garments() -> Option<PathBuf> {
    let folder = match std::env::var_os("WARPKNIT_GARMENTS") {
        Some(folder) => PathBuf::from(folder),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/garments"),
    };
    if !folder.is_dir() {
        println!("skipped: no real garments at {}", folder.display());
        return None;
    }
    Some(folder)
}

/// Every OBJ under a folder, in the order of their names.
fn all_objs(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).expect("the folder can be listed") {
        let path = entry.expect("the folder can be listed").path();
        if path.is_dir() {
            found.extend(all_objs(&path));
        } else if path.extension().is_some_and(|ending| ending == "obj") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// Name, panels, triangles, unit, mm per flat unit, flipped, degenerate, mirrored panels.
type Expected = (&'static str, usize, usize, &'static str, f64, usize, usize, usize);

const REAL: [Expected; 17] = [
    ("da_dress/initial.obj", 13, 21099, "cm", 1964.213, 0, 0, 0),
    ("da_dress/ours.obj", 13, 21099, "cm", 1319.603, 0, 0, 0),
    ("da_longsleeve/artist.obj", 6, 31772, "cm", 1228.929, 0, 0, 0),
    ("da_longsleeve/initial.obj", 6, 7898, "cm", 1289.707, 0, 0, 0),
    ("da_longsleeve/longsleeve.obj", 12, 10501, "dm", 2619.598, 0, 0, 0),
    ("da_polo_clo/polo.obj", 7, 6508, "cm", 1254.337, 0, 0, 0),
    ("da_polo_clo/polo_artist.obj", 7, 34842, "cm", 1284.143, 0, 0, 0),
    ("da_tshirt/tshirt.obj", 4, 5483, "cm", 1148.985, 0, 0, 1),
    ("madypg_seq/rib_stretchX/frame_0000.obj", 1, 5168, "m", 1000.0, 0, 0, 0),
    ("madypg_sock/cloth.obj", 3, 4772, "m", 1046.489, 0, 0, 0),
    ("makehuman_quads/male_casualsuit06.obj", 6, 7168, "dm", 1823.548, 0, 0, 0),
    ("makehuman_quads/male_elegantsuit01.obj", 23, 14956, "dm", 2046.594, 0, 0, 0),
    ("makehuman_quads/male_worksuit01.obj", 11, 6986, "dm", 1560.357, 16, 0, 0),
    ("ncs_flag/arbitrary_surface.obj", 1, 512, "m", 1980.548, 0, 0, 0),
    ("ncs_flag/flag_uniform_grid.obj", 1, 1682, "m", 1315.253, 0, 0, 0),
    ("sheencloth_115k/sheencloth.obj", 1, 115200, "m", 98.085, 0, 0, 0),
    ("xrtailor_square/square_bottom.obj", 1, 1046, "m", 1.0074, 0, 0, 0),
];

#[test]
fn the_real_garments_read_as_their_sources_say() {
    let Some(folder) = garments() else { return };
    for (name, panels, triangles, unit, scale, flipped, degenerate, mirrored) in REAL {
        let garment = read(&folder.join(name), None, &ReadOptions::default())
            .unwrap_or_else(|error| panic!("{error}"));
        let facts = &garment.summary;
        assert_eq!(
            (garment.panels.len(), facts.triangles, facts.unit),
            (panels, triangles, unit),
            "{name}"
        );
        assert!(
            (facts.uv_scale_mm / scale - 1.0).abs() < 1e-4,
            "{name}: {} mm per flat unit",
            facts.uv_scale_mm
        );
        assert_eq!((facts.flipped, facts.degenerate), (flipped, degenerate), "{name}");
        assert_eq!(
            garment.panels.iter().filter(|panel| panel.mirrored).count(),
            mirrored,
            "{name}"
        );
    }
}

#[test]
fn every_real_garment_reads_or_says_why_not() {
    let Some(folder) = garments() else { return };
    for path in all_objs(&folder) {
        let name = path.strip_prefix(&folder).unwrap().display().to_string();
        match read(&path, None, &ReadOptions::default()) {
            Ok(Garment { panels, summary: facts }) => {
                panels.iter().for_each(check_panel);
                let held: usize =
                    panels.iter().map(|panel| panel.triangles.len() + panel.flipped.len()).sum();
                assert!(held + facts.degenerate + facts.untextured <= facts.triangles, "{name}");
                assert!(facts.warnings.iter().all(|warning| !warning.contains('\n')), "{name}");
                println!("{name}: {} panels, {facts:?}", panels.len());
            }
            Err(error) => {
                println!("{error}");
                assert!(name.starts_with("diffcloth_nasty"), "{error}");
                let no_pattern =
                    matches!(error, GarmentError::NoTexture { .. } | GarmentError::NoPanel { .. });
                // A hat of which two thirds have no pattern.
                let no_pattern = no_pattern || matches!(error, GarmentError::Loss { .. });
                assert!(no_pattern && !error.to_string().contains('\n'), "{error}");
            }
        }
    }
}

#[test]
fn a_frame_of_a_sequence_pairs_with_the_first() {
    let Some(folder) = garments() else { return };
    let frame = |number: &str| folder.join(format!("madypg_seq/rib_stretchX/frame_{number}.obj"));
    let garment = read(&frame("0000"), Some(&frame("0059")), &ReadOptions::default()).unwrap();
    assert_eq!((garment.panels.len(), garment.summary.triangles), (1, 5168));
    check_panel(&garment.panels[0]);
}

proptest! {
    /// A random height field over a random grid comes back with its positions, its topology and its
    /// flat pattern.
    #[test]
    fn random_meshes_round_trip(n in 1_usize..8, heights in prop::collection::vec(-0.3_f64..0.3, 81), quads: bool) {
        let mut text = String::new();
        let at = |i: usize, j: usize| DVec3::new(i as f64, j as f64, heights[j * 9 + i]);
        for (i, j) in (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j))) {
            let p = at(i, j);
            text += &format!("v {} {} {}\nvt {} {}\n", p.x, p.y, p.z, p.x, p.y);
        }
        let mut expected = Vec::new();
        for (i, j) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
            let [a, b, c, d] = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
            let number = |(i, j): (usize, usize)| { let k = j * (n + 1) + i + 1; format!("{k}/{k}") };
            let [na, nb, nc, nd] = [a, b, c, d].map(number);
            text += &if quads { format!("f {na} {nb} {nc} {nd}\n") } else { format!("f {na} {nb} {nc}\nf {na} {nc} {nd}\n") };
            expected.extend([[a, b, c], [a, c, d]]);
        }
        let garment = read_one(&text).unwrap();
        prop_assert_eq!(garment.panels.len(), 1);
        let panel = &garment.panels[0];
        check_panel(panel);
        prop_assert_eq!(panel.triangles.len(), expected.len());
        for (triangle, corners) in in_file_order(panel).zip(&expected) {
            for (&vertex, &(i, j)) in triangle.iter().zip(corners) {
                prop_assert_eq!(panel.draped[vertex as usize], at(i, j) * 1000.0);
                let flat = panel.flat_from_panel.transform_point3(panel.uv[vertex as usize].extend(0.0));
                let scale = garment.summary.uv_scale_mm;
                prop_assert!(flat.distance(DVec3::new(i as f64, j as f64, 0.0) * scale) < 1e-9);
            }
        }
        prop_assert_eq!(panel.uv.len(), (n + 1) * (n + 1));
    }
}
