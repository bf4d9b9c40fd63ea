//! `inspect` of meshes: what it says of garments whose numbers are known, of files that don't pair,
//! and the sheets that it draws.

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use glam::DVec2;
use roxmltree::Document;
use warpknit::chart::{Drawing, DrawingShape};
use warpknit::fabric::Fabric;
use warpknit::garment::{Garment, ReadOptions, read};
use warpknit::locate::overlap::overlaps;

use crate::drape::mesh;

fn inspect(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::cargo_bin("warpknit").unwrap();
    command.current_dir(folder).arg("inspect").args(arguments);
    command
}

/// What a run prints on stdout and stderr, and the names in its folder when it is over.
fn run(folder: &Path, arguments: &[&str], code: i32) -> (String, String, Vec<String>) {
    let output = inspect(folder, arguments).assert().code(code).get_output().clone();
    let mut names: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap(), names)
}

/// Two squares of side 100 mm, the second on the first but for 40 mm; on the body 1.25 times as
/// high and 0.8 times as wide, side by side. The third one is clockwise, beside them, and draped as
/// it was cut.
const SQUARES: &str = "v 0 0 0\nv 80 0 0\nv 80 125 0\nv 0 125 0\nv 200 0 0\nv 280 0 0\nv 280 125 0\nv 200 125 0\n\
    v 400 0 0\nv 400 100 0\nv 500 100 0\nv 500 0 0\n\
    vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt .4 0\nvt 1.4 0\nvt 1.4 1\nvt .4 1\nvt 2 0\nvt 2 1\nvt 3 1\nvt 3 0\n\
    f 1/1 2/2 3/3 4/4\nf 5/5 6/6 7/7 8/8\nf 9/9 10/10 11/11 12/12\n";
const SCALE: [&str; 4] = ["--unit", "mm", "--uv-scale", "100"];

fn squares(folder: &Path) {
    std::fs::write(folder.join("squares.obj"), SQUARES).unwrap();
}

#[test]
fn known_squares_have_their_numbers() {
    let folder = tempfile::tempdir().unwrap();
    squares(folder.path());
    let (text, errors, _) = run(folder.path(), &[&["squares.obj"], &SCALE[..]].concat(), 0);
    assert_eq!(errors, "");
    for line in [
        "squares.obj",
        "  pairs: yes (6 of 6 triangles)",
        "  stretch 5/50/95 %: warp 1.000 1.250 1.250, weft 0.800 0.800 1.000",
        "  isometry 5/50/95 %: smallest stretch 0.800 0.800 1.000, largest stretch 1.000 1.250 1.250, area 1.000 1.000 1.000",
        "  panels over each other in the flat file: 1 pair, 0 and 1 (60.0 cm²)",
    ] {
        assert!(text.lines().any(|found| found == line), "{line}\n{text}");
    }
    let rows: Vec<Vec<&str>> = text
        .lines()
        .skip_while(|line| !line.contains("panel  "))
        .skip(1)
        .map(|line| line.split_whitespace().collect())
        .collect();
    let row = |number, smallest, largest, mirrored| {
        vec![
            number, "2", "100.0", "100.0", "100.0", "100.0000", smallest, largest, mirrored, "0",
            "0",
        ]
    };
    assert_eq!(
        rows,
        [
            row("0", "0.800", "1.250", "no"),
            row("1", "0.800", "1.250", "no"),
            row("2", "1.000", "1.000", "yes")
        ]
    );
}

#[test]
fn a_named_fabric_turns_panels() {
    let folder = tempfile::tempdir().unwrap();
    squares(folder.path());
    let turned =
        Fabric::named("tricot").unwrap().to_string() + "\n[[panels]]\npanel = 0\ngrain = 90.0\n";
    std::fs::write(folder.path().join("turned.toml"), &turned).unwrap();
    let arguments = [&["squares.obj", "--fabric", "turned.toml"], &SCALE[..]].concat();
    let (text, ..) = run(folder.path(), &arguments, 0);
    let expected = "  stretch 5/50/95 %: warp 0.800 1.000 1.250, weft 0.800 1.000 1.250";
    assert!(text.lines().any(|line| line == expected), "{text}");
    std::fs::write(folder.path().join("turned.toml"), turned.replace("panel = 0", "panel = 7"))
        .unwrap();
    let (_, message, _) = run(folder.path(), &arguments, 1);
    assert!(message.contains("a [[panels]] table for panel 7"), "{message}");
}

#[test]
fn scripts_read_the_same_facts() {
    let folder = tempfile::tempdir().unwrap();
    squares(folder.path());
    let name = std::fs::read_dir(folder.path()).unwrap().next().unwrap().unwrap().file_name();
    let arguments = [&[name.to_str().unwrap(), "-o", "facts.json"], &SCALE[..]].concat();
    run(folder.path(), &arguments, 0);
    let text = std::fs::read(folder.path().join("facts.json")).unwrap();
    let facts: serde_json::Value = serde_json::from_slice(&text).unwrap();
    assert_eq!((&facts["unit"], facts["panels"].as_array().unwrap().len()), (&"mm".into(), 3));
    assert_eq!(facts["panels"][0]["width_mm"], 100.0);
    let (_, message, _) = run(folder.path(), &["--fabric", "locknit", "-o", "l.json"], 1);
    assert!(message.contains("name .svg or .png"), "{message}");
}

#[test]
fn a_file_that_does_not_pair_says_why_and_hides_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let [flat, draped, other] = ["pinch_flat.obj", "pinch_draped.obj", "tube_draped.obj"]
        .map(|name| mesh(name).display().to_string());
    let (text, errors, names) =
        run(folder.path(), &[&flat, &other, &draped, "absent.obj", "-o", "sheet.svg"], 1);
    let sections: Vec<_> = text.lines().filter(|line| !line.starts_with(' ')).collect();
    assert_eq!(
        sections,
        [format!("{flat} + {other}"), format!("{flat} + {draped}"), format!("{flat} + absent.obj")]
    );
    let pairs: Vec<_> = text.lines().filter_map(|line| line.strip_prefix("  pairs: ")).collect();
    assert!(
        pairs[0].starts_with("no: ")
            && pairs[0].contains(&other)
            && pairs[0].contains("export both from the same mesh"),
        "{text}"
    );
    assert!(
        pairs[1].starts_with("yes (") && pairs[2].starts_with("no: absent.obj: cannot be opened"),
        "{text}"
    );
    assert!(
        errors.starts_with("error: ") && errors.lines().count() == 1 && errors.contains(&other),
        "{errors}"
    );
    assert!(errors.contains("1 more of 3"), "{errors}");
    assert_eq!(names, Vec::<String>::new(), "no sheet of a run that failed");

    let (text, errors, _) = run(folder.path(), &["absent.obj"], 1);
    assert!(text.starts_with("absent.obj\n  pairs: no: absent.obj: cannot be opened"), "{text}");
    assert!(
        errors.starts_with("error: absent.obj: cannot be opened") && errors.lines().count() == 1,
        "{errors}"
    );
}

#[test]
fn sheets_go_over_no_input_and_only_where_they_can_be_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    squares(path);
    for name in ["squares.svg", "s-001.svg", "flat.obj"] {
        std::fs::copy(path.join("squares.obj"), path.join(name)).unwrap();
    }
    for (arguments, part) in [
        (&["squares.svg", "-o", "./squares.svg"][..], "squares.svg: this file is an input"),
        (
            &["flat.obj", "s-001.svg", "squares.obj", "-o", "s.svg"],
            "s-001.svg: this file is an input",
        ),
        (
            &["squares.obj", "-o", "a.png", "-o", "a.png"],
            "a.png: this file is an input or another output",
        ),
        (&["squares.obj", "-o", "a.png", "-o", "no/a.svg"], "there is no folder no"),
    ] {
        let (text, errors, names) = run(path, arguments, 1);
        assert!(
            errors.starts_with("error: ") && errors.contains(part) && errors.lines().count() == 1,
            "{errors}"
        );
        assert_eq!((text.as_str(), names.len()), ("", 4), "{arguments:?}");
    }
    assert_eq!(std::fs::read_to_string(path.join("squares.svg")).unwrap(), SQUARES);
}

/// The groups of a sheet by their names.
fn group<'a>(sheet: &'a Document<'_>, name: &str) -> roxmltree::Node<'a, 'a> {
    sheet
        .descendants()
        .find(|node| node.attribute("id") == Some(name))
        .unwrap_or_else(|| panic!("no group {name}"))
}

fn groups(sheet: &Document<'_>, stem: &str) -> Vec<String> {
    let names = sheet
        .descendants()
        .filter_map(|node| node.attribute("id"))
        .filter(|name| name.starts_with(stem));
    let mut names: Vec<_> = names.map(str::to_owned).collect();
    names.sort();
    names
}

/// Where the paths of a group pass.
fn points(group: roxmltree::Node<'_, '_>) -> Vec<DVec2> {
    let paths = group.children().filter_map(|node| node.attribute("d"));
    let numbers: Vec<f64> = paths
        .flat_map(|path| path.split([' ', 'M', 'L']))
        .filter_map(|number| number.parse().ok())
        .collect();
    numbers.chunks_exact(2).map(|pair| DVec2::new(pair[0], pair[1])).collect()
}

fn bounds(points: &[DVec2]) -> [DVec2; 2] {
    points
        .iter()
        .fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[low, high], p| [low.min(*p), high.max(*p)])
}

fn words(group: roxmltree::Node<'_, '_>) -> Vec<String> {
    group
        .children()
        .filter_map(|node| node.text())
        .map(str::to_owned)
        .filter(|text| text != "\n")
        .collect()
}

#[test]
fn a_sheet_shows_every_panel_with_its_grain_and_how_the_garment_is_stretched() {
    let folder = tempfile::tempdir().unwrap();
    squares(folder.path());
    let (_, errors, names) = run(
        folder.path(),
        &[&["squares.obj", "-o", "s.svg", "-o", "s.png"], &SCALE[..]].concat(),
        0,
    );
    assert_eq!(
        (errors.as_str(), names),
        ("", ["s.png", "s.svg", "squares.obj"].map(str::to_owned).to_vec())
    );
    let text = std::fs::read_to_string(folder.path().join("s.svg")).unwrap();
    let sheet = Document::parse(&text).unwrap();
    assert_eq!(groups(&sheet, "panel-"), ["panel-0", "panel-1", "panel-2"]);
    assert_eq!(groups(&sheet, "grain-"), ["grain-0", "grain-1", "grain-2"]);
    assert!(words(group(&sheet, "title")).contains(&"squares.obj".to_owned()));
    assert!(words(group(&sheet, "facts"))[0].contains("unit mm, flat unit 100.000 mm"));
    let labels = words(group(&sheet, "labels"));
    assert_eq!(
        labels,
        ["panel 0", "100 × 100 mm", "panel 1", "100 × 100 mm", "panel 2, mirrored", "100 × 100 mm"]
    );

    let panels: Vec<_> =
        (0..3).map(|panel| bounds(&points(group(&sheet, &format!("panel-{panel}"))))).collect();
    for (number, [low, high]) in panels.iter().enumerate() {
        assert!(
            (high.x - low.x - (high.y - low.y)).abs() < 0.05,
            "squares of one scale: {panels:?}"
        );
        assert!((high.x - low.x - (panels[0][1].x - panels[0][0].x)).abs() < 0.05, "{panels:?}");
        assert!(
            panels[..number]
                .iter()
                .all(|[l, h]| high.x < l.x || h.x < low.x || high.y < l.y || h.y < low.y),
            "{panels:?}"
        );
        let arrow = points(group(&sheet, &format!("grain-{number}")));
        let (tail, tip) = (arrow[0], arrow[1]);
        assert!((tail.x - tip.x).abs() < 0.02 && tail.y > tip.y + 15.0, "up the sheet: {arrow:?}");
        assert!(
            arrow.iter().all(|p| p.cmpgt(*low).all() && p.cmplt(*high).all()),
            "on its panel: {arrow:?}"
        );
    }
    // The scale bar is as long as it says: a square has 100 mm.
    let bar = bounds(&points(group(&sheet, "scale-bar")));
    let said = words(group(&sheet, "scale"));
    let said: f64 = said.iter().find_map(|text| text.strip_suffix(" mm")).unwrap().parse().unwrap();
    assert!(
        ((bar[1].x - bar[0].x) / said - (panels[0][1].x - panels[0][0].x) / 100.0).abs() < 0.01
    );

    for name in ["warp-front", "warp-back", "weft-front", "weft-back"] {
        let image = group(&sheet, name).children().find(|node| node.has_tag_name("image")).unwrap();
        let address = image.attribute(("http://www.w3.org/1999/xlink", "href")).unwrap();
        assert!(address.starts_with("data:image/png;base64,iVBOR"), "{name}");
    }
    let legend = words(group(&sheet, "legend"));
    assert!(
        ["0.667", "1.000", "1.500"].iter().all(|mark| legend.iter().any(|text| text == mark)),
        "{legend:?}"
    );

    let picture = image::open(folder.path().join("s.png")).unwrap().into_rgb8();
    let size = |name| sheet.root_element().attribute(name).unwrap().parse::<f64>().unwrap();
    assert_eq!(
        (f64::from(picture.width()), f64::from(picture.height())),
        (2.0 * size("width"), 2.0 * size("height"))
    );
}

#[test]
fn maps_have_the_colours_of_the_legend() {
    let folder = tempfile::tempdir().unwrap();
    squares(folder.path());
    run(folder.path(), &[&["squares.obj", "-o", "s.png"], &SCALE[..]].concat(), 0);
    let picture = image::open(folder.path().join("s.png")).unwrap().into_rgb8();
    // The garment faces the eye, so its colours are the scale's own: stretched, compressed, as it
    // was.
    let count = |wanted: [u8; 3]| picture.pixels().filter(|pixel| pixel.0 == wanted).count();
    let colour = |stretch: f64| {
        let garment = read(
            &folder.path().join("squares.obj"),
            None,
            &ReadOptions { uv_scale: Some(100.0), ..Default::default() },
        );
        let mut garment = garment.unwrap();
        garment.panels.truncate(1);
        let panel = &mut garment.panels[0];
        panel.draped =
            panel.uv.iter().map(|uv| glam::DVec3::new(uv.x, uv.y * stretch, 0.0)).collect();
        let drawing = Drawing::from_garment("one", &garment);
        let layer = drawing.layers.iter().find(|layer| layer.name == "warp-front").unwrap();
        let [DrawingShape::Picture { picture, .. }] = &layer.shapes[..] else {
            panic!("one picture")
        };
        picture.get_pixel(picture.width() / 2, picture.height() / 2).0
    };
    let [red, blue, grey] = [1.19, 1.0 / 1.19, 1.0].map(colour);
    assert!(
        red[0] > 170
            && red[2] < 50
            && blue[2] > 180
            && blue[0] < 70
            && grey[0] == grey[1]
            && grey[1] == grey[2]
    );
    assert_eq!([red, blue, grey].map(|pixel| pixel[3]), [255; 3]);
    assert!(count([grey[0]; 3]) > 1000, "the third square is as it was");
    let (warm, cold) = picture.pixels().fold((0, 0), |(warm, cold), pixel| {
        let [r, _, b] = pixel.0.map(i32::from);
        (warm + i32::from(r > b + 50), cold + i32::from(b > r + 50))
    });
    assert!(warm > 10_000 && cold > 10_000, "{warm} {cold}");
}

#[test]
fn every_drape_has_a_sheet_of_its_own_the_same_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let [flat, draped] =
        ["pinch_flat.obj", "pinch_draped.obj"].map(|name| mesh(name).display().to_string());
    let sheets = |threads: &str, out: &str| {
        let arguments = [&flat[..], &flat, &draped, "-o", out];
        inspect(folder.path(), &arguments).env("RAYON_NUM_THREADS", threads).assert().success();
        let read = |number| {
            std::fs::read(folder.path().join(out.replace(".svg", &format!("-00{number}.svg"))))
                .unwrap()
        };
        [read(1), read(2)]
    };
    let (one, three) = (sheets("1", "a.svg"), sheets("3", "b.svg"));
    assert!(one == three && one[0] != one[1]);
    assert!(!folder.path().join("a.svg").exists());
    assert!(one[1].len() < 2_000_000, "{} bytes", one[1].len());
}

#[test]
fn an_atlas_of_many_scraps_is_cut_with_a_word() {
    let panel = |number: u32| {
        let mut panel = Garment::rectangle(10.0 + f64::from(number), 10.0).panels.remove(0);
        panel.draped.iter_mut().for_each(|p| p.x += 100.0 * f64::from(number));
        panel
    };
    let mut garment = Garment::rectangle(1.0, 1.0);
    garment.panels = (0..100).map(panel).collect();
    let drawing = Drawing::from_garment("atlas", &garment);
    let drawn: Vec<_> =
        drawing.layers.iter().filter(|layer| layer.name.starts_with("panel-")).collect();
    assert!(
        drawn.len() == 40
            && drawn.iter().all(|layer| layer.name[6..].parse::<u32>().unwrap() >= 60),
        "the largest ones"
    );
    let says = |shape: &DrawingShape| matches!(shape, DrawingShape::Text { text, .. } if text == "60 smaller panels are left out");
    assert!(drawing.layers.iter().flat_map(|layer| &layer.shapes).any(says));
}

/// The folder of real garments, which is no part of the repository.
fn real_garments() -> Option<PathBuf> {
    let folder = std::env::var_os("WARPKNIT_GARMENTS").map(PathBuf::from);
    let folder =
        folder.unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/garments"));
    folder.is_dir().then_some(folder)
}

#[test]
fn real_garments_have_sheets() {
    let Some(folder) = real_garments() else {
        println!("skipped: no folder ../shared/garments and no WARPKNIT_GARMENTS");
        return;
    };
    // Panels, pairs over each other, panels over themselves (folded buttons), panels with flipped
    // triangles, mirrored ones.
    let expected = [
        ("da_tshirt/tshirt.obj", 4, 0, vec![], vec![], vec!["panel 1, mirrored"]),
        ("da_polo_clo/polo.obj", 7, 0, vec![], vec![], vec![]),
        ("da_longsleeve/longsleeve.obj", 12, 1, vec![], vec![], vec![]),
        ("madypg_sock/cloth.obj", 3, 0, vec![], vec![], vec![]),
        (
            "makehuman_quads/male_worksuit01.obj",
            11,
            3,
            vec![0, 8, 9, 10],
            vec!["0", "10", "8", "9"],
            vec![],
        ),
        ("sheencloth_115k/sheencloth.obj", 1, 0, vec![], vec![], vec![]),
    ];
    for (name, panels, between, within, flipped, mirrored) in expected {
        let garment = read(&folder.join(name), None, &ReadOptions::default()).unwrap();
        let found = overlaps(&garment);
        assert!(found.complete && found.between.len() == between, "{name}: {found:?}");
        assert_eq!(
            found.within.iter().map(|(panel, _)| *panel).collect::<Vec<_>>(),
            within,
            "{name}"
        );
        let drawing = Drawing::from_garment(name, &garment);
        let text = warpknit::chart::svg::text(&drawing);
        assert!(text.len() < 3_000_000, "{name}: {} bytes", text.len());
        let sheet = Document::parse(&text).unwrap();
        assert_eq!(
            (groups(&sheet, "panel-").len(), groups(&sheet, "grain-").len()),
            (panels, panels),
            "{name}"
        );
        assert_eq!(
            groups(&sheet, "flipped-"),
            flipped.iter().map(|panel| format!("flipped-{panel}")).collect::<Vec<_>>(),
            "{name}"
        );
        let labels = words(group(&sheet, "labels"));
        assert_eq!(
            labels.iter().filter(|label| label.contains("mirrored")).collect::<Vec<_>>(),
            mirrored,
            "{name}"
        );
    }
}
