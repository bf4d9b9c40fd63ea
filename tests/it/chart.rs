//! The lapping diagram: every needle of every course is there, each bar's path passes its needles
//! on the right side, and files are whole.

use std::path::Path;

use assert_cmd::Command;
use glam::DVec2;
use warpknit::chart::{Drawing, DrawingShape, PathSegment, svg};
use warpknit::fabric::Fabric;

/// A fabric file of bars as (chain, threading, further lines).
fn toml(name: &str, bars: &[(&str, &str, &str)]) -> String {
    let mut text = format!("name = \"{name}\"\nwales_per_cm = 14.6\ncourses_per_cm = 21.74\n");
    for (chain, threading, more) in bars {
        text += &format!(
            "[[bars]]\nlapping = \"{chain}\"\nthreading = \"{threading}\"\n{more}\nyarn = {{ count = \"44 dtex\", density = 1.38, \
             packing = 0.65, color = \"#ffffff\" }}\n"
        );
    }
    text
}

fn drawing(bars: &[(&str, &str, &str)]) -> Drawing {
    Drawing::from_fabric(&Fabric::parse(&toml("t", bars)).unwrap())
}

/// The dots of a drawing as rows, lowest first, each from right to left.
fn rows(drawing: &Drawing) -> Vec<Vec<DVec2>> {
    let needles = drawing.layers.iter().find(|layer| layer.name == "needles").unwrap();
    let dots = needles.shapes.iter().map(|shape| match shape {
        DrawingShape::Dot { at, .. } => *at,
        other => panic!("{other:?} is no needle"),
    });
    let mut dots: Vec<_> = dots.collect();
    dots.sort_by(|a, b| (b.y, b.x).partial_cmp(&(a.y, a.x)).unwrap());
    dots.chunk_by(|a, b| a.y == b.y).map(<[DVec2]>::to_vec).collect()
}

/// A bar's strong path as short straight lines.
fn line(drawing: &Drawing, bar: usize) -> Vec<DVec2> {
    let layer = drawing.layers.iter().find(|layer| layer.name == format!("bar-{bar}")).unwrap();
    let [DrawingShape::Path { segments, .. }] = &layer.shapes[..] else { panic!("one yarn a bar") };
    let mut points: Vec<DVec2> = Vec::new();
    for segment in segments {
        match *segment {
            PathSegment::Move(end) | PathSegment::Line(end) => points.push(end),
            PathSegment::Curve(a, b, end) => {
                let start = points[points.len() - 1];
                points.extend((1..=16).map(|step| {
                    let t = f64::from(step) / 16.0;
                    let s = 1.0 - t;
                    s * s * s * start + 3.0 * s * s * t * a + 3.0 * s * t * t * b + t * t * t * end
                }));
            }
        }
    }
    points
}

/// How often a line crosses itself.
fn crossings(points: &[DVec2]) -> usize {
    let side = |a: DVec2, b: DVec2, p: DVec2| (b - a).perp_dot(p - a);
    let cross = |a: &[DVec2], b: &[DVec2]| {
        side(a[0], a[1], b[0]) * side(a[0], a[1], b[1]) < 0.0
            && side(b[0], b[1], a[0]) * side(b[0], b[1], a[1]) < 0.0
    };
    let lines: Vec<_> = points.windows(2).collect();
    (0..lines.len())
        .map(|at| lines[at + 1..].iter().filter(|other| cross(lines[at], other)).count())
        .sum()
}

/// How often a line passes straight above a dot, nearer than half a row: once where the yarn laps
/// it.
fn passes_over(points: &[DVec2], dot: DVec2) -> usize {
    let over = |pair: &&[DVec2]| {
        let (a, b) = (pair[0], pair[1]);
        let between = (a.x < dot.x) != (b.x < dot.x);
        let y = a.y + (b.y - a.y) * (dot.x - a.x) / (b.x - a.x);
        // Overlaps stay within a third of a row, underlaps beyond it.
        between && (0.0..18.0).contains(&(dot.y - y))
    };
    points.windows(2).filter(over).count()
}

#[test]
fn each_lap_goes_over_its_needles_and_no_other() {
    // Chains and, course by course, the needles that they lap; needle 0 lies between gaps 0 and 1.
    let cases: [(&str, &[&[usize]]); 8] = [
        ("1-0", &[&[0], &[0], &[0], &[0]]),
        ("1-0/0-1", &[&[0], &[0], &[0], &[0]]),
        ("1-0/1-2", &[&[0], &[1], &[0], &[1]]),
        ("0-1/2-1", &[&[0], &[1], &[0], &[1]]),
        ("2-3/1-0", &[&[2], &[0], &[2], &[0]]),
        ("1-0/4-5", &[&[0], &[4], &[0], &[4]]),
        ("0-2/2-0", &[&[0, 1], &[0, 1], &[0, 1], &[0, 1]]),
        ("0-0/4-4", &[&[], &[], &[], &[]]),
    ];
    for (chain, lapped) in cases {
        let drawing = drawing(&[(chain, "I", "")]);
        let path = line(&drawing, 1);
        for (row, lapped) in rows(&drawing).iter().zip(lapped) {
            // The first dot belongs to the needle that shows where the pattern goes on.
            for (needle, dot) in row[1..].iter().enumerate() {
                assert_eq!(
                    passes_over(&path, *dot),
                    usize::from(lapped.contains(&needle)),
                    "{chain}, needle {needle}"
                );
                assert!(
                    path.iter().all(|point| point.distance(*dot) > 5.0),
                    "{chain}: the path hits needle {needle}"
                );
            }
        }
    }
}

#[test]
fn closed_laps_cross_themselves_once_and_open_ones_never() {
    for (chain, expected) in [
        ("1-0/1-0", 4),
        ("1-0/0-1", 0),
        ("1-0/1-2", 4),
        ("0-1/2-1", 0),
        ("2-3/1-0", 4),
        ("0-2/2-0", 0),
        ("0-0/3-3", 0),
    ] {
        assert_eq!(crossings(&line(&drawing(&[(chain, "I", "")]), 1)), expected, "{chain}");
    }
    // In an atlas only the laps at which it turns are closed; each repeat of this one has two.
    assert_eq!(crossings(&line(&drawing(&[("1-0/1-2/2-3/2-1", "I", "")]), 1)), 4);
}

#[test]
fn gap_0_lies_at_the_drive() {
    let place = |drawing: &Drawing, gap: &str| {
        let layer = drawing.layers.iter().find(|layer| layer.name == "gaps").unwrap();
        let at = layer.shapes.iter().find_map(|shape| match shape {
            DrawingShape::Text { at, text, .. } if text == gap => Some(at.x),
            _ => None,
        });
        at.unwrap()
    };
    let (right, left) =
        (drawing(&[("1-0/2-3", "I", "")]), drawing(&[("1-0/2-3", "I", "drive = \"left\"")]));
    assert!(place(&right, "0") > place(&right, "1") && place(&right, "1") > place(&right, "3"));
    assert!(place(&left, "0") < place(&left, "1") && place(&left, "1") < place(&left, "3"));
    let overlap = |drawing: &Drawing| {
        line(drawing, 1).iter().map(|p| p.x).sum::<f64>() / line(drawing, 1).len() as f64
    };
    let centre = |drawing: &Drawing| (place(drawing, "1") + place(drawing, "2")) / 2.0;
    assert!(
        (overlap(&right) - centre(&right) + overlap(&left) - centre(&left)).abs() < 1e-6,
        "one is the other's mirror image"
    );
}

#[test]
fn the_svg_is_xml_with_a_dot_a_needle_and_a_path_a_bar() {
    let drawing = drawing(&[("2-3/1-0", "I", ""), ("1-0/1-2", "I", "")]);
    let text = svg::text(&drawing);
    let tree = roxmltree::Document::parse(&text).unwrap();
    let count = |tag: &str| tree.descendants().filter(|node| node.has_tag_name(tag)).count();
    // Gaps 0 to 3 and one on each side hold 5 needles; two repeats have 4 courses.
    assert_eq!((count("circle"), rows(&drawing).len()), (5 * 4, 4));
    for bar in ["bar-1", "bar-2"] {
        let group = tree.descendants().find(|node| node.attribute("id") == Some(bar)).unwrap();
        assert_eq!(group.children().filter(roxmltree::Node::is_element).count(), 1);
    }
    let words: Vec<_> = tree
        .descendants()
        .filter(|node| node.has_tag_name("text"))
        .filter_map(|node| node.text())
        .collect();
    assert!(
        words.contains(&"bar 1  2-3/1-0//  I") && words.contains(&"3") && words.contains(&"t"),
        "{words:?}"
    );
    assert!(text.len() < 20_000);
}

#[test]
fn no_name_breaks_the_xml() {
    let name = r#"<b> & \"]]>\u0001 \u0085 日本"#;
    let fabric = Fabric::parse(&toml(name, &[("1-0", "I", "")])).unwrap();
    let text = svg::text(&Drawing::from_fabric(&fabric));
    let tree = roxmltree::Document::parse(&text).unwrap();
    assert!(
        tree.descendants()
            .filter_map(|node| node.text())
            .any(|text| text.starts_with("<b> & \"]]>"))
    );
}

#[test]
fn huge_fabrics_are_cut_to_a_sheet_and_say_so() {
    let long = "1-0/1-2/".repeat(80);
    let marks = format!("{}I", ".".repeat(900));
    let bars: Vec<_> = std::iter::once(("0-0/4096-4096", "I", ""))
        .chain([(long.as_str(), "I", ""), ("4000-4001", marks.as_str(), "")])
        .chain(std::iter::repeat_n(("1-0/2-3", "I", "drive = \"left\""), 60))
        .collect();
    let drawing = drawing(&bars);
    assert!(
        drawing.layers.iter().flat_map(|layer| &layer.shapes).any(
            |shape| matches!(shape, DrawingShape::Text { text, .. } if text.ends_with("...  I"))
        )
    );
    assert!(drawing.size.max_element() < 4000.0, "{}", drawing.size);
    assert_eq!(drawing.notes.len(), 3, "{:?}", drawing.notes);
    assert!(svg::text(&drawing).len() < 1_000_000);
    let sheet = drawing.layers.iter().flat_map(|layer| &layer.shapes).all(|shape| match shape {
        DrawingShape::Path { segments, .. } => {
            segments.iter().all(|segment| (0.0..=drawing.size.x).contains(&segment.end().x))
        }
        DrawingShape::Area { segments } => {
            segments.iter().all(|segment| segment.end().cmpge(DVec2::ZERO).all())
        }
        DrawingShape::Dot { at, .. }
        | DrawingShape::Text { at, .. }
        | DrawingShape::Picture { at, .. } => {
            at.cmpge(DVec2::ZERO).all() && at.cmple(drawing.size).all()
        }
        DrawingShape::Title { .. } => true,
    });
    assert!(sheet, "everything lies on the sheet");
}

fn inspect(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::cargo_bin("warpknit").unwrap();
    command.current_dir(folder).arg("inspect").args(arguments);
    command
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn inspect_prints_the_fabric_and_writes_both_formats() {
    let folder = tempfile::tempdir().unwrap();
    let run = inspect(folder.path(), &["--fabric", "locknit", "-o", "l.svg", "-o", "l.png"])
        .assert()
        .success()
        .stderr("");
    let text = String::from_utf8(run.get_output().stdout.clone()).unwrap();
    for part in [
        "locknit: ",
        "W 0.685 mm, C 0.460 mm",
        "2-3  closed  2 \u{2192}       3",
        "diameter 0.079 mm",
        "needle: 2\n",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert_eq!(names(folder.path()), ["l.png", "l.svg"]);
    roxmltree::Document::parse(&std::fs::read_to_string(folder.path().join("l.svg")).unwrap())
        .unwrap();
    let picture = image::open(folder.path().join("l.png")).unwrap().into_rgb8();
    for color in [[0xc6, 0x1f, 0x32], [0x12, 0x5d, 0xa8]] {
        assert!(picture.pixels().any(|pixel| pixel.0 == color), "{color:?}");
    }
}

#[test]
fn inspect_takes_a_fabric_and_meshes_together() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = crate::drape::mesh("tshirt.obj");
    let run = inspect(folder.path(), &["--fabric", "tricot"]).arg(mesh).assert().success();
    let text = String::from_utf8(run.get_output().stdout.clone()).unwrap();
    assert!(text.starts_with("tricot: ") && text.contains("unit cm (guessed)"), "{text}");
}

#[test]
fn a_warning_is_data_and_a_note_is_not() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("wide.toml"),
        toml("wide", &[("0-0/90-90", "I", ""), ("1-0/1-2", "I", "")]),
    )
    .unwrap();
    let run = inspect(folder.path(), &["--fabric", "wide.toml", "-o", "w.svg"]).assert().success();
    let (out, err) = (&run.get_output().stdout, &run.get_output().stderr);
    let (out, err) = (String::from_utf8_lossy(out), String::from_utf8_lossy(err));
    assert!(out.contains("  warning: bar 1 lays in yarns in front of all knitting bars"), "{out}");
    assert!(
        err.starts_with("note: wide.toml: the lapping reaches over 91 gaps")
            && err.lines().count() == 1,
        "{err}"
    );
}

#[test]
fn wrong_usage_and_failures_leave_nothing_behind() {
    for (code, arguments) in [
        (2, &[][..]),
        (2, &["-o", "a.svg"]),
        (2, &["--fabric", "tricot", "-o", "a.svg", "m.obj"]),
        (2, &["--lapping", "1-0/1-2//", "-o", "a.svg", "m.obj"]),
        (2, &["-o", "a.pdf", "m.obj"]),
        (2, &["--fabric", "tricot", "-o", "a.pdf"]),
        (2, &["--fabric", "tricot", "-o", "a"]),
        (1, &["--fabric", "tweed", "-o", "a.svg"]),
        (1, &["--fabric", "none.toml", "-o", "a.svg"]),
        (1, &["--fabric", "tricot", "-o", "a.svg", "-o", "no/b.png"]),
        (1, &["--fabric", "tricot", "-o", "a.svg", "-o", "./a.svg"]),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let run = inspect(folder.path(), arguments).assert().code(code).stdout("");
        assert!(run.get_output().stderr.starts_with(b"error:"), "{arguments:?}");
        assert_eq!(names(folder.path()), Vec::<String>::new(), "{arguments:?}");
    }
    let folder = tempfile::tempdir().unwrap();
    inspect(folder.path(), &["-o", "a.svg", "missing.obj"]).assert().code(1);
    assert_eq!(
        names(folder.path()),
        Vec::<String>::new(),
        "the mesh failed, so there is no picture either"
    );
}
