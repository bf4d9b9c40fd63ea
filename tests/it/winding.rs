//! Winding mended, folds and lost cloth: sheets whose faces are wound both ways, patterns that lie
//! folded over themselves, strips with one side only.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use glam::{DVec2, DVec3};
use proptest::prelude::*;
use warpknit::chart::Drawing;
use warpknit::fabric::{Fabric, PanelLayout};
use warpknit::garment::{Frames, Garment, GarmentError, Panel, ReadOptions, Unit, read};
use warpknit::pipeline::{read_garment, turn_panels};

/// Cells of a sheet along each side.
const CELLS: usize = 6;

fn options() -> ReadOptions {
    ReadOptions { unit: Some(Unit::Mm), ..ReadOptions::default() }
}

/// A wavy sheet of 50 mm cells in quads. `flat` places a vertex of the pattern, and `reversed` says
/// which faces are wound the other way.
struct Sheet<'a> {
    flat: &'a dyn Fn(f64, f64) -> DVec2,
    reversed: &'a dyn Fn(usize) -> bool,
}

impl Sheet<'_> {
    fn vertices(&self) -> impl Iterator<Item = (DVec3, DVec2)> + '_ {
        let side = CELLS + 1;
        (0..side * side).map(move |i| {
            let [x, y] = [i % side, i / side].map(|at| at as f64);
            let z = if i % 2 == 0 { 0.0 } else { 9.0 };
            (DVec3::new(50.0 * x, 50.0 * y, z), (self.flat)(x, y))
        })
    }

    /// The faces, with one number for `v` and for `vt` where `texture`.
    fn faces(&self, texture: bool) -> String {
        let mut text = String::new();
        for i in 0..CELLS * CELLS {
            let a = i / CELLS * (CELLS + 1) + i % CELLS + 1;
            let mut corners = [a, a + 1, a + CELLS + 2, a + CELLS + 1];
            if (self.reversed)(i) {
                corners.reverse();
            }
            let words = corners.map(|v| if texture { format!("{v}/{v}") } else { v.to_string() });
            writeln!(text, "f {}", words.join(" ")).unwrap();
        }
        text
    }

    /// One file with `vt`.
    fn one(&self) -> String {
        let mut text = String::new();
        for (p, uv) in self.vertices() {
            writeln!(text, "v {} {} {}\nvt {} {}", p.x, p.y, p.z, uv.x, uv.y).unwrap();
        }
        text + &self.faces(true)
    }

    /// The flat and the draped file of a pair.
    fn two(&self) -> [String; 2] {
        let [mut flat, mut draped] = [const { String::new() }; 2];
        for (p, uv) in self.vertices() {
            writeln!(flat, "v {} {} 0", 50.0 * uv.x, 50.0 * uv.y).unwrap();
            writeln!(draped, "v {} {} {}", p.x, p.y, p.z).unwrap();
        }
        [flat + &self.faces(false), draped + &self.faces(false)]
    }
}

fn plain(x: f64, y: f64) -> DVec2 {
    DVec2::new(x, y)
}

fn sheet(reversed: &dyn Fn(usize) -> bool) -> Sheet<'_> {
    Sheet { flat: &plain, reversed }
}

fn read_one(text: &str) -> Result<Garment, GarmentError> {
    Garment::read_obj(text.as_bytes(), &options())
}

fn read_two([flat, draped]: &[String; 2]) -> Garment {
    Garment::read_obj_pair(flat.as_bytes(), draped.as_bytes(), &options()).unwrap()
}

/// The corners of each face, flat in the file's axes and draped, by the face.
fn corners(panel: &Panel) -> BTreeMap<u32, [[DVec3; 2]; 3]> {
    let corner = |v: u32| {
        let flat = panel.flat_from_panel.transform_point3(panel.uv[v as usize].extend(0.0));
        [flat, panel.draped[v as usize]]
    };
    let faces = panel.faces.iter().map(|face| face.0);
    faces.zip(panel.triangles.iter().map(|triangle| triangle.map(corner))).collect()
}

/// Nothing lost, nothing flipped, as many faces turned round.
fn check_whole(garment: &Garment, reversed: usize) {
    let facts = &garment.summary;
    assert_eq!((facts.reversed, facts.flipped, facts.degenerate), (reversed, 0, 0));
    assert_eq!((facts.loss.total(), &facts.warnings), (0.0, &Vec::new()));
    let laid: usize = garment.panels.iter().map(|panel| panel.triangles.len()).sum();
    assert_eq!(laid, facts.triangles);
}

#[test]
fn faces_wound_both_ways_are_the_sheet_that_they_were_cut_from() {
    let whole = sheet(&|_| false);
    let half = CELLS * CELLS / 2;
    type Reversed<'a> = &'a dyn Fn(usize) -> bool;
    let cases: [(&str, Reversed<'_>, usize); 4] = [
        ("a third", &|i| i % 3 == 0, CELLS * CELLS / 3),
        ("the last half", &|i| i >= half, half),
        ("the first half", &|i| i < half, half),
        ("one", &|i| i == 8, 1),
    ];
    let (one, two) = (read_one(&whole.one()).unwrap(), read_two(&whole.two()));
    check_whole(&one, 0);
    assert_eq!(one.summary.notes, Vec::<String>::new());
    for (what, reversed, count) in cases {
        let mixed = sheet(reversed);
        for (garment, whole) in
            [(read_one(&mixed.one()).unwrap(), &one), (read_two(&mixed.two()), &two)]
        {
            check_whole(&garment, count);
            assert_eq!(corners(&garment.panels[0]), corners(&whole.panels[0]), "{what}");
            assert_eq!(garment.panels[0].normals, whole.panels[0].normals, "{what}");
            assert!(garment.summary.notes[0].starts_with(&format!("{count} of 36 faces")));
        }
    }
}

#[test]
fn most_faces_decide_where_the_technical_face_is() {
    let inside_out = read_one(&sheet(&|i| i % 3 > 0).one()).unwrap();
    check_whole(&inside_out, CELLS * CELLS / 3);
    assert!(inside_out.panels[0].mirrored);
    assert!(inside_out.panels[0].normals.iter().all(|normal| normal.z < 0.0));
}

#[test]
fn a_frame_with_other_numbers_is_mended_like_the_first() {
    let folder = tempfile::tempdir().unwrap();
    let mixed = sheet(&|i| i % 3 == 0);
    let [flat, draped] = mixed.two();
    // Two vertices more, so that the frame's connectivity is another one.
    let renumbered = |line: &str| match line.strip_prefix("f ") {
        Some(face) => {
            let face = face.split(' ').map(|v| (v.parse::<usize>().unwrap() + 2).to_string());
            format!("f {}\n", face.collect::<Vec<_>>().join(" "))
        }
        None => format!("{line}\n"),
    };
    let frame: String = draped.lines().map(renumbered).collect();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let (flat, first) = (write("flat.obj", &flat), write("1.obj", &draped));
    let second = write("2.obj", &format!("v 9 9 9\nv 9 9 9\n{frame}"));
    let (garment, frames) = Frames::read(&flat, Some(&first), &options()).unwrap();
    let mut posed = garment.clone();
    assert_eq!(frames.pose(&mut posed, &second).unwrap(), Vec::<String>::new());
    assert_eq!(posed.panels[0].draped, garment.panels[0].draped);
    let alone = read(&flat, Some(&second), &options()).unwrap();
    assert_eq!(corners(&alone.panels[0]), corners(&garment.panels[0]));
}

#[test]
fn each_side_of_a_fold_is_a_panel() {
    // Folded once in the middle, and like a fan in three.
    let once = |x: f64, y: f64| DVec2::new((x - 3.0).abs(), y);
    let fan = |x: f64, y: f64| {
        DVec2::new(
            if x < 2.0 {
                x
            } else if x < 4.0 {
                4.0 - x
            } else {
                x - 4.0
            },
            y,
        )
    };
    type Flat<'a> = &'a dyn Fn(f64, f64) -> DVec2;
    let cases: [(Flat<'_>, &[bool]); 2] = [(&once, &[true, false]), (&fan, &[false, true, false])];
    for (flat, mirrored) in cases {
        for reversed in [&(|_| false) as &dyn Fn(usize) -> bool, &|i| i % 5 == 1] {
            let sheet = Sheet { flat, reversed };
            for garment in [read_one(&sheet.one()).unwrap(), read_two(&sheet.two())] {
                check_whole(&garment, (0..CELLS * CELLS).filter(|&i| reversed(i)).count());
                let found: Vec<_> = garment.panels.iter().map(|panel| panel.mirrored).collect();
                assert_eq!(found, mirrored);
                // The cloth shows the same side everywhere, and each panel knows the others.
                for (number, panel) in garment.panels.iter().enumerate() {
                    assert!(panel.normals.iter().all(|normal| normal.z > 0.0));
                    let others = (0..mirrored.len()).filter(|&other| other != number);
                    assert_eq!(garment.summary.panels[number].folds, others.collect::<Vec<_>>());
                }
                let scales = garment.summary.panels.iter().map(|panel| panel.scale_mm);
                assert!(scales.clone().all(|scale| scale == scales.clone().next().unwrap()));
                assert!(garment.summary.notes.last().unwrap().contains("folded over itself"));
            }
        }
    }
}

/// A Möbius strip of 24 quads, cut once in the pattern. `reversed` says which faces are wound the
/// other way.
fn moebius(reversed: impl Fn(usize) -> bool) -> String {
    let mut text = String::new();
    let count = 24;
    for i in 0..count {
        let angle = i as f64 / count as f64 * std::f64::consts::TAU;
        for side in [-30.0, 30.0] {
            let radius = 200.0 + side * (angle / 2.0).cos();
            let (sin, cos) = angle.sin_cos();
            writeln!(text, "v {} {} {}", radius * cos, radius * sin, side * (angle / 2.0).sin())
                .unwrap();
        }
    }
    for i in 0..=count {
        writeln!(text, "vt {} 0\nvt {0} 60", 52.0 * i as f64).unwrap();
    }
    for i in 0..count {
        let (a, b) = (2 * i + 1, 2 * i + 2);
        let (c, d) = if i + 1 < count { (a + 2, b + 2) } else { (2, 1) };
        let mut corners = [(a, a), (c, a + 2), (d, b + 2), (b, b)];
        if reversed(i) {
            corners.reverse();
        }
        let words = corners.map(|(v, vt)| format!("{v}/{vt}"));
        writeln!(text, "f {}", words.join(" ")).unwrap();
    }
    text
}

#[test]
fn a_moebius_strip_cut_in_the_pattern_is_one_panel() {
    for (reversed, count) in [(&(|_| false) as &dyn Fn(usize) -> bool, 0), (&|i| i % 4 == 2, 6)] {
        let garment = read_one(&moebius(reversed)).unwrap();
        check_whole(&garment, count);
        assert_eq!(garment.panels.len(), 1);
        assert!(!garment.panels[0].mirrored);
    }
}

#[test]
fn a_ring_that_no_cut_opens_is_read() {
    // The pattern's end is its beginning, so the last quad goes back over all others.
    let text = moebius(|_| false);
    let mut closed = String::new();
    for line in text.lines() {
        writeln!(closed, "{}", line.replace("/49", "/2").replace("/50", "/1")).unwrap();
    }
    let garment =
        Garment::read_obj(closed.as_bytes(), &ReadOptions { allow_loss: true, ..options() })
            .unwrap();
    let facts = &garment.summary;
    let laid: usize = garment.panels.iter().map(|panel| panel.triangles.len()).sum();
    assert_eq!(laid + facts.flipped + facts.degenerate, 48, "{facts:?}");
}

#[test]
fn pages_of_a_book_spread_nothing_over_their_spine() {
    // Three pages of two cells at one spine: no two of them need agree.
    let mut text = String::from("v 0 0 0\nv 0 100 0\nvt 0 0\nvt 0 100\n");
    for (x, z, u) in [(1.0, 0.0, 1.0), (-1.0, 0.0, -1.0), (0.0, 1.0, 1.3)] {
        for far in [80.0, 160.0] {
            for y in [0, 100] {
                writeln!(text, "v {} {y} {}\nvt {} {y}", x * far, z * far, u * far).unwrap();
            }
        }
    }
    for page in 0..3 {
        let [a, b, c, d] = [3, 4, 5, 6].map(|vertex| vertex + 4 * page);
        // Outer cells are wound against the inner ones.
        writeln!(text, "f 1/1 {a}/{a} {b}/{b} 2/2").unwrap();
        writeln!(text, "f {b}/{b} {d}/{d} {c}/{c} {a}/{a}").unwrap();
    }
    let garment = read_one(&text).unwrap();
    assert_eq!(garment.panels.iter().map(Panel::non_manifold_edges).max(), Some(1));
    check_whole(&garment, 3);
}

/// A tube of two panels of 12 quads, sewn at two seams. `reversed` says which panels are wound
/// inward, and `twisted` swaps the ends of the second one at its last seam.
fn tube(reversed: [bool; 2], twisted: bool) -> String {
    let count = 12;
    let mut text = String::new();
    for i in 0..2 * count {
        let (sin, cos) = (i as f64 / count as f64 * std::f64::consts::PI).sin_cos();
        for height in [0.0, 40.0] {
            writeln!(text, "v {} {} {height}", 150.0 * cos, 150.0 * sin).unwrap();
        }
    }
    for (panel, reversed) in reversed.into_iter().enumerate() {
        for i in 0..=count {
            let u = 39.2 * i as f64 + 600.0 * panel as f64;
            writeln!(text, "vt {u} 0\nvt {u} 40").unwrap();
        }
        let place = |i: usize| {
            let number = (i + panel * count) % (2 * count);
            let low = 2 * number + 1;
            if twisted && number == 0 && panel == 1 { [low + 1, low] } else { [low, low + 1] }
        };
        for i in 0..count {
            let texture = 2 * (i + panel * (count + 1)) + 1;
            let ([a, b], [c, d]) = (place(i), place(i + 1));
            let mut corners = [(a, texture), (c, texture + 2), (d, texture + 3), (b, texture + 1)];
            if reversed {
                corners.reverse();
            }
            let words = corners.map(|(v, vt)| format!("{v}/{vt}"));
            writeln!(text, "f {}", words.join(" ")).unwrap();
        }
    }
    text
}

/// Whether each panel's technical face looks away from the tube's axis.
fn outward(garment: &Garment) -> Vec<bool> {
    let looks_outward = |panel: &Panel| {
        let all = panel.draped.iter().zip(&panel.normals);
        all.map(|(p, normal)| p.truncate().dot(normal.truncate())).all(|dot| dot > 0.0)
    };
    garment.panels.iter().map(looks_outward).collect()
}

#[test]
fn a_panel_wound_against_those_that_it_is_sewn_to_stays_and_is_named() {
    for (reversed, told) in [([false; 2], None), ([false, true], Some(1)), ([true, false], Some(0))]
    {
        let mut garment = read_one(&tube(reversed, false)).unwrap();
        check_whole(&garment, 0);
        assert_eq!(outward(&garment), reversed.map(|reversed| !reversed));
        let notes = garment.summary.all_notes();
        assert_eq!(notes.len(), usize::from(told.is_some()), "{notes:?}");
        if let Some(panel) = told {
            let start = format!("wound against the panels that they are sewn to: panel {panel};");
            assert!(notes[0].starts_with(&start), "{notes:?}");
            let before = corners(&garment.panels[panel]);
            turn_panels(&mut garment, &turning(panel, 0.0));
            assert_eq!(garment.summary.all_notes(), Vec::<String>::new());
            assert_eq!(outward(&garment), [true; 2]);
            // It is the same cloth: only two corners of each triangle have changed places.
            let turned = corners(&garment.panels[panel]);
            assert!(turned.iter().all(|(face, &[a, b, c])| before[face] == [a, c, b]));
            assert!(garment.panels[panel].area() > 0.0);
        }
    }
    // A tube with a twist has no outside.
    let twisted = read_one(&tube([false; 2], true)).unwrap();
    assert_eq!(twisted.summary.all_notes(), Vec::<String>::new());
}

/// A fabric that turns a panel over, and then its wales.
fn turning(panel: usize, grain_degrees: f64) -> Fabric {
    let layout = PanelLayout { panel, turn: true, grain_degrees, origin: DVec2::ZERO };
    Fabric { panels: vec![layout], ..Fabric::named("tricot").unwrap() }
}

#[test]
fn a_ring_of_three_panels_with_a_twist_has_no_side() {
    // Three strips of two quads, each sewn to the next one's start. In a twisted ring the last one is
    // sewn to the first with its ends exchanged.
    let ring = |reversed: usize, twisted: bool| {
        let mut text = String::new();
        for i in 0..6 {
            let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 6.0).sin_cos();
            writeln!(text, "v {} {} 0\nv {0} {1} 40", 90.0 * cos, 90.0 * sin).unwrap();
        }
        for panel in 0..3 {
            for i in 0..3 {
                writeln!(text, "vt {} 0\nvt {0} 40", 90 * i + 300 * panel).unwrap();
            }
            for i in 0..2 {
                let from = 2 * panel + i;
                let [a, b] = [2 * from + 1, 2 * from + 2];
                let [c, d] = if from < 5 {
                    [a + 2, b + 2]
                } else if twisted {
                    [2, 1]
                } else {
                    [1, 2]
                };
                let at = 6 * panel + 2 * i + 1;
                let mut corners = [(a, at), (c, at + 2), (d, at + 3), (b, at + 1)];
                if panel == reversed {
                    corners.reverse();
                }
                let words = corners.map(|(v, vt)| format!("{v}/{vt}"));
                writeln!(text, "f {}", words.join(" ")).unwrap();
            }
        }
        read_one(&text).unwrap().summary
    };
    for panel in 0..3 {
        assert_eq!(ring(panel, false).against_seams, [panel]);
        assert!(ring(panel, true).against_seams.is_empty());
    }
    assert!(ring(9, false).against_seams.is_empty());
}

#[test]
fn a_panel_turned_over_stays_so_in_the_frames_of_a_sequence() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["1.obj", "2.obj"].map(|name| folder.path().join(name));
    let text = tube([false, true], false);
    std::fs::write(&first, &text).unwrap();
    std::fs::write(&second, text.replace(" 40\nv", " 41\nv")).unwrap();
    let (mut garment, frames) = Frames::read(&first, None, &options()).unwrap();
    let plain = garment.clone();
    turn_panels(&mut garment, &turning(1, 30.0));
    frames.pose(&mut garment, &second).unwrap();
    assert_eq!(outward(&garment), [true; 2]);
    let wales = |garment: &Garment| garment.panels[1].flat_from_panel.matrix3.y_axis;
    let turned = wales(&garment).angle_between(wales(&plain)).to_degrees();
    assert!((turned - 30.0).abs() < 1e-9, "{turned}");
    // Seen from the technical face, which looks to -z, counter-clockwise is clockwise in the file.
    let mirrored = garment.panels[1].flat_from_panel.matrix3.z_axis.z;
    assert!(mirrored * wales(&plain).cross(wales(&garment)).z > 0.0);
}

#[test]
fn lost_cloth_is_told_and_much_of_it_refused() {
    // Faces from `first` on lose their vt.
    let without = |first: usize| {
        let text = sheet(&|_| false).one();
        let mut faces = 0;
        let mut lines = String::new();
        for line in text.lines() {
            faces += usize::from(line.starts_with('f'));
            let bare = line.split(' ').map(|word| word.split('/').next().unwrap());
            let bare = bare.collect::<Vec<_>>().join(" ");
            writeln!(lines, "{}", if faces > first { bare.as_str() } else { line }).unwrap();
        }
        lines
    };
    let some = read_one(&without(33)).unwrap().summary;
    assert!((some.lost_percent() - 100.0 * 3.0 / 36.0).abs() < 1e-9, "{}", some.lost_percent());
    let warning = some.warnings.last().unwrap();
    assert!(warning.contains("cm² (8.333 % of the draped area) take no stitches"), "{warning}");
    let error = read_one(&without(30)).unwrap_err();
    assert!(matches!(error, GarmentError::Loss { .. }));
    let error = error.to_string();
    assert!(error.contains("16.667 %") && error.contains("--allow-loss"), "{error}");
    let allowed = ReadOptions { allow_loss: true, ..options() };
    let rest = Garment::read_obj(without(30).as_bytes(), &allowed).unwrap();
    assert_eq!(rest.panels[0].triangles.len(), 60);
}

#[test]
fn a_loss_says_what_to_do_for_its_own_reasons() {
    // The last face of 36 has no `vt`, or no flat area.
    let sheet = sheet(&|_| false).one();
    let (others, last) = sheet.trim_end().rsplit_once('\n').unwrap();
    let corners = last.split(' ').skip(1).map(|corner| corner.split('/').next().unwrap());
    let untextured = format!("{others}\nf {}\n", corners.collect::<Vec<_>>().join(" "));
    let warning_of = |text: &str| {
        let warnings = read_one(text).unwrap().summary.warnings;
        warnings.into_iter().find(|warning| warning.contains("% of the draped area")).unwrap()
    };
    let warning = warning_of(&untextured);
    let has = |text: &str| warning.contains(text);
    assert!(has("with texture coordinates for all faces") && !has("sheet.svg"), "{warning}");
    let warning = warning_of(&sheet.replace("vt 6 6", "vt 5 5"));
    let has = |text: &str| warning.contains(text);
    assert!(!has("texture coordinates") && has("flat and apart"), "{warning}");
}

#[test]
fn a_csv_of_mended_faces_is_that_of_faces_wound_one_way() {
    let folder = tempfile::tempdir().unwrap();
    let rows = |name: &str, reversed: &dyn Fn(usize) -> bool| {
        std::fs::write(folder.path().join(format!("{name}.obj")), sheet(reversed).one()).unwrap();
        let (file, csv) = (format!("{name}.obj"), format!("{name}.csv"));
        let arguments = ["drape", &file, "--unit", "mm", "--wales-per-cm", "0.5", "-o", &csv];
        crate::cli::warpknit(folder.path()).args(arguments).assert().success();
        let text = std::fs::read_to_string(folder.path().join(csv)).unwrap();
        let mut rows: Vec<_> = text.lines().map(str::to_owned).collect();
        rows.sort_unstable();
        rows
    };
    let (whole, half) = (rows("whole", &|_| false), rows("half", &|face| face % 5 < 2));
    assert!(whole.len() > 1000, "{} rows", whole.len());
    assert!(whole == half, "rows differ");
}

#[test]
fn cloth_under_its_own_panel_is_lost() {
    // A strip around a centre, whose last sixth lies on its first.
    let spiral =
        |x: f64, y: f64| DVec2::from_angle(x * std::f64::consts::TAU / 5.0) * (3.0 + 0.4 * y);
    let text = Sheet { flat: &spiral, reversed: &|_| false }.one();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("spiral.obj");
    std::fs::write(&path, text).unwrap();
    let refused = read_garment(&path, None, &options()).unwrap_err();
    assert!(matches!(refused, GarmentError::Loss { .. }));
    let refused = refused.to_string();
    assert!(
        refused.contains("16.667 % of the draped area")
            && refused.contains("lay these faces apart")
    );
    assert!(refused.contains("sheet.svg` marks them"), "{refused}");
    let allowed = ReadOptions { allow_loss: true, ..options() };
    let garment = read_garment(&path, None, &allowed).unwrap();
    let sheet = Drawing::from_garment("spiral", &garment);
    let marked: Vec<_> = sheet.layers.iter().filter(|l| l.name.starts_with("covered")).collect();
    assert_eq!((marked.len(), marked[0].shapes.len()), (1, 12), "a strip of six squares");
    let summary = garment.summary;
    assert!((summary.lost_percent() - 100.0 / 6.0).abs() < 1e-6, "{}", summary.lost_percent());
    assert_eq!(summary.loss.total(), summary.loss.covered);
    let told = summary.warnings.last().unwrap();
    assert!(told.contains("(16.7 % of the draped area) lie under other cloth"), "{told}");
}

proptest! {
    /// Whatever part of a sheet is reversed, the whole sheet is knitted, on one side.
    #[test]
    fn any_winding_is_mended(reversed in prop::collection::vec(any::<bool>(), CELLS * CELLS)) {
        let garment = read_one(&sheet(&|i| reversed[i]).one()).unwrap();
        let turned = reversed.iter().filter(|&&reversed| reversed).count();
        check_whole(&garment, turned.min(CELLS * CELLS - turned));
        prop_assert_eq!(garment.panels.len(), 1);
    }
}
