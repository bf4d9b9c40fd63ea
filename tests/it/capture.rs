//! A photo of a cloth to its yarns: known cloth found again, what is no cloth refused, and a
//! person's layout taken.

use std::path::Path;
use std::process::Output;

use glam::{DMat2, DVec2};
use image::RgbImage;
use image::imageops::FilterType;
use warpknit::fabric::{Fabric, StrandDirection};
use warpknit::photo::capture::{
    CERTAIN, CaptureError, CaptureSettings, Captured, GivenLayout, Hypothesis, Layout, Segment,
    capture,
};

use warpknit::photo::recognise::{ClothKey, Face, RecogniseError, RecogniseSettings, recognise};

use crate::aperiodic::{bricks, face, fur, noise};
use crate::cloth::{Disturbance, Kind, Random, Sample, Stretch, between, fibrous, layout, sample};
use crate::knit_photo::{FAIR, ON_PAPER, taken, varied};

fn found(image: &RgbImage) -> Captured {
    capture(image, &CaptureSettings::default()).unwrap()
}

/// Whether both span the same lattice, vectors being off by no more than a share of their length.
fn same_lattice(found: &Captured, truth: [DVec2; 2], share: f64) -> bool {
    let matrix = found.unit.lattice.matrix();
    let counts = truth.map(|vector| matrix.inverse() * vector);
    let near = |(count, vector): (&DVec2, &DVec2)| {
        (matrix * count.round()).distance(*vector) < share * vector.length()
    };
    DMat2::from_cols(counts[0].round(), counts[1].round()).determinant().abs() == 1.0
        && counts.iter().zip(&truth).all(near)
}

/// How far each stretch of yarn is from the segment nearest to it: widths off across it, radians,
/// and the share by which it is too wide.
fn errors(found: &Captured, truth: &Sample) -> Vec<[f64; 3]> {
    let error = |stretch: &Stretch| {
        let of = |segment: &Segment| {
            let off = found.unit.lattice.nearest(segment.centre - stretch.centre);
            let across = DVec2::from_angle(stretch.angle).perp_dot(off).abs() / stretch.width;
            let along = off.length() / stretch.length;
            (
                along,
                [
                    across,
                    between(segment.angle, stretch.angle),
                    (segment.width / stretch.width - 1.0).abs(),
                ],
            )
        };
        let nearest = found
            .layout
            .visible
            .iter()
            .map(of)
            .min_by(|p, q| (p.0 + p.1[1]).total_cmp(&(q.0 + q.1[1])));
        nearest.unwrap().1
    };
    truth.in_cell(found).iter().filter(|stretch| stretch.is_long()).map(error).collect()
}

#[test]
fn weaves_are_found_again() {
    let photo = Disturbance { distortion: 2.0, noise: 0.02, light: 0.2 };
    for (kind, seed, disturbance) in [
        (Kind::Plain, 103, Disturbance::default()),
        (Kind::Plain, 110, photo),
        (Kind::Twill(2, 1), 101, photo),
        (Kind::Colored, 104, photo),
    ] {
        let truth = sample(kind, seed, 320, disturbance);
        let found = found(&truth.image);
        assert!(
            same_lattice(&found, truth.lattice, 0.025),
            "{kind:?} {seed}: {:?} is not {:?}",
            found.unit,
            truth.lattice
        );
        let errors = errors(&found, &truth);
        assert!(
            errors.len() >= 2 && found.layout.visible.len() >= 2,
            "{kind:?} {seed}: {:?}",
            truth.stretches
        );
        for [off, turn, wider] in errors {
            assert!(
                off < 0.1 && turn < 0.06 && wider < 0.1,
                "{kind:?} {seed}: off by {off} widths, {turn} rad, {wider}: {:?}",
                found.layout
            );
        }
    }
}

#[test]
fn a_plain_weave_of_two_colours_is_believed() {
    let truth = sample(Kind::Colored, 1008, 480, Disturbance::default());
    let found = found(&truth.image);
    assert!(
        same_lattice(&found, truth.lattice, 0.025),
        "{:?} is not {:?}",
        found.unit,
        truth.lattice
    );
}

#[test]
fn yarns_of_a_loose_twill_are_its_floats_and_what_gaps_show_of_them() {
    let truth = sample(
        Kind::Twill(2, 2),
        5001,
        480,
        Disturbance { distortion: 1.3, noise: 0.01, light: 0.1 },
    );
    let found = found(&truth.image);
    let stretches = truth.in_cell(&found);
    let is_float = |segment: &&Segment| segment.length > segment.width;
    assert_eq!(found.layout.visible.iter().filter(is_float).count(), 2, "{:?}", found.layout);
    for segment in &found.layout.visible {
        let lies_on = |stretch: &Stretch| {
            let off = found.unit.lattice.nearest(segment.centre - stretch.centre);
            let off = DVec2::from_angle(-stretch.angle).rotate(off).abs();
            off.x < 0.5 * stretch.length
                && off.y < 0.1 * stretch.width
                && between(segment.angle, stretch.angle) < 0.15
        };
        assert!(stretches.iter().any(lies_on), "{segment:?} lies on none of {stretches:?}");
    }
}

#[test]
fn a_jersey_has_its_cell_and_a_leg_on_either_side() {
    let truth =
        sample(Kind::Jersey, 133, 320, Disturbance { distortion: 2.0, noise: 0.02, light: 0.1 });
    let found = found(&truth.image);
    assert!(
        same_lattice(&found, truth.lattice, 0.025),
        "{:?} is not {:?}",
        found.unit,
        truth.lattice
    );
    let wale = truth.lattice[1].to_angle();
    let lean = |segment: &Segment| {
        (segment.angle - wale + 0.5 * std::f64::consts::PI).rem_euclid(std::f64::consts::PI)
            - 0.5 * std::f64::consts::PI
    };
    let leans: Vec<f64> = found
        .layout
        .visible
        .iter()
        .filter(|segment| segment.length > 1.5 * segment.width)
        .map(lean)
        .collect();
    for side in [-1.0, 1.0] {
        assert!(
            leans.iter().any(|lean| (0.1..0.7).contains(&(side * lean))),
            "legs lean by {leans:?}"
        );
    }
}

#[test]
fn fibres_tell_their_twist_and_say_so_where_they_are_too_narrow() {
    let photo = Disturbance { distortion: 2.0, noise: 0.02, light: 0.2 };
    for (seed, fibre, disturbance) in
        [(101, 4.0, photo), (102, 4.0, Disturbance::default()), (105, 2.0, photo)]
    {
        let (truth, degrees) = fibrous(seed, (100.0 * fibre) as u32, fibre, disturbance);
        let found = capture(
            &truth.image,
            &CaptureSettings { layout: Some(layout(&truth)), ..CaptureSettings::default() },
        )
        .unwrap();
        assert!(
            found.twists.len() == found.layout.visible.len() && found.twists.len() >= 2,
            "{seed}: {:?}",
            found.layout
        );
        for twist in &found.twists {
            assert_eq!(twist.is_guess, fibre < 3.0, "{seed}: {twist:?}");
            let is_near =
                (twist.degrees - degrees).abs() < 4.0 && (twist.fibre_px / fibre - 1.0).abs() < 0.3;
            assert!(twist.is_guess || is_near, "{seed}: {twist:?} is not {degrees}");
        }
    }
}

#[test]
fn what_does_not_repeat_is_refused() {
    let noise = noise(&mut Random::new(7), 300);
    let grain = image::imageops::fast_blur(&noise, 3.0);
    let pictures = [
        ("noise", noise),
        ("grain", grain),
        ("fur", fur(3, 300)),
        ("a face", face(5, 400)),
        ("an old wall", bricks(5, 480)),
        ("another", bricks(27, 480)),
    ];
    for (what, image) in pictures {
        match capture(&image, &CaptureSettings::default()) {
            Err(CaptureError::NoRepeat { confidence, least }) => {
                assert!(confidence < least && least == CERTAIN, "{what}");
            }
            other => panic!("{what}: {other:?}"),
        }
    }
    let grey = RgbImage::from_pixel(200, 200, image::Rgb([90, 100, 110]));
    assert_eq!(capture(&grey, &CaptureSettings::default()).unwrap_err(), CaptureError::Blank);
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = assert_cmd::Command::cargo_bin("warpknit").unwrap();
    command.current_dir(folder).arg("capture").args(arguments).output().unwrap()
}

#[test]
fn the_command_fills_a_folder_and_takes_its_layout_back() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    sample(Kind::Plain, 103, 320, Disturbance::default())
        .image
        .save(folder.join("cloth.png"))
        .unwrap();
    let output = run(folder, &["cloth.png", "-o", "first", "--threads", "1"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(
        run(folder, &["cloth.png", "-o", "second", "--threads", "3", "--quiet"]).status.success()
    );
    let read = |path: &str| std::fs::read(folder.join(path)).unwrap();
    for file in warpknit::folder::captured::FILES {
        assert!(
            read(&format!("first/{file}")) == read(&format!("second/{file}")),
            "{file} depends on the number of threads"
        );
    }
    let text = String::from_utf8(read("first/layout.toml")).unwrap();
    let layout = GivenLayout::parse(&text).unwrap();
    assert_eq!(layout.segments.len(), 2);

    // The same layout given back explains as much; moved segments, less; one left out leaves a
    // blank, and is taken; ten times as wide ones are none.
    let unexplained = |name: &str| {
        let output = run(folder, &["cloth.png", "--layout", name, "-o", "given"]);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        let report: Option<serde_json::Value> = output
            .status
            .success()
            .then(|| serde_json::from_slice(&read("given/report.json")).unwrap());
        report.map(|report| report["unexplained"].as_f64().unwrap()).ok_or(message)
    };
    let error: serde_json::Value = serde_json::from_slice(&read("first/report.json")).unwrap();
    let segments = error["segments"].as_array().unwrap();
    let guesses =
        segments.iter().filter(|segment| segment["twist_is_guess"].as_bool().unwrap()).count();
    assert_eq!(error["warnings"].as_array().unwrap().len(), usize::from(guesses > 0), "{error}");
    let numbers: Vec<u64> =
        segments.iter().map(|segment| segment["segment_number"].as_u64().unwrap()).collect();
    assert_eq!(numbers, [1, 2]);
    assert_eq!(error["yarns"].as_array().unwrap().len(), segments.len());
    let error = error["unexplained"].as_f64().unwrap();
    assert!((unexplained("first/layout.toml").unwrap() - error).abs() < 1e-9);
    let edited = |from: &str, to: &str| {
        std::fs::write(folder.join("edited.toml"), text.replace(from, to)).unwrap();
        unexplained("edited.toml")
    };
    let second = text.rfind("[[segments]]").unwrap();
    assert!(edited(&text[second..], "").unwrap() > error + 0.1, "one is deleted");
    let wide = edited("width = ", "width = 1").unwrap_err();
    assert!(
        wide.starts_with("error: edited.toml: the layout does not cover its cell: ")
            && wide.contains("% lie under two"),
        "{wide}"
    );
    let broken = edited("length", "lenght").unwrap_err();
    assert!(
        broken.starts_with("error: edited.toml:")
            && broken.contains("lenght")
            && broken.lines().count() == 1,
        "{broken}"
    );
    // Nothing is seen of what is no lighter than the ground, however wide it is.
    let darker = |line: &str| match line.split_once(" = ") {
        Some((name @ ("top" | "tilt"), _)) => format!("{name} = 0\n"),
        _ => format!("{line}\n"),
    };
    let dark: String = text.lines().map(darker).collect();
    std::fs::write(folder.join("dark.toml"), &dark).unwrap();
    let unseen = unexplained("dark.toml").unwrap_err();
    assert!(
        unseen.starts_with("error: dark.toml: nothing is seen of any of the layout's segments"),
        "{unseen}"
    );
    std::fs::write(folder.join("dark.toml"), dark.replace("width = ", "width = 1")).unwrap();
    assert_eq!(unexplained("dark.toml").unwrap_err(), unseen);
    let bright = edited("ground = ", "ground = 9e99 #").unwrap_err();
    assert!(
        bright.starts_with("error: edited.toml:3: ") && bright.contains("ground is to be a share"),
        "{bright}"
    );
    // One segment as large as a file may say, bent as far, on a cell that is all length: some
    // hundred thousand copies of it, none of which is drawn.
    let crowd = "[cell]\na = [4, 0]\nb = [0, 100]\nground = -1\n[[segments]]\ncenter = [0, 0]\nangle_deg = 45\nwidth = 900\nlength = 900\ntop = 1\nround = 0.5\nsag = 0.3\nbow = 900\n";
    std::fs::write(folder.join("crowd.toml"), crowd).unwrap();
    let crowded = unexplained("crowd.toml").unwrap_err();
    assert!(
        crowded.starts_with("error: crowd.toml: ") && crowded.contains("copies touch each cell"),
        "{crowded}"
    );
    // No fabric file holds cloth of a thousand wales a mm.
    let fine = run(
        folder,
        &["cloth.png", "--layout", "first/layout.toml", "-o", "fine", "--pixels-per-mm", "1e9"],
    );
    let message = String::from_utf8(fine.stderr).unwrap();
    assert!(
        message.contains("wales_per_cm")
            && message.lines().count() == 1
            && !folder.join("fine").exists(),
        "{message}"
    );
    // What is read is not written over.
    let over = run(folder, &["cloth.png", "--layout", "first/layout.toml", "-o", "first"]);
    assert!(!over.status.success() && read("first/layout.toml") == text.as_bytes());
}

/// Pixels by which the line between the ends of what is seen of a yarn may leave that of all of it,
/// where it bends.
const BENT: f64 = 1.0;

#[test]
fn a_layout_is_corrected_by_hand() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    sample(Kind::Plain, 103, 320, Disturbance::default())
        .image
        .save(folder.join("cloth.png"))
        .unwrap();
    assert!(run(folder, &["cloth.png", "-o", "found"]).status.success());
    let read = |path: &str| std::fs::read_to_string(folder.join(path)).unwrap();
    let report = |name: &str| -> serde_json::Value {
        serde_json::from_str(&read(&format!("{name}/report.json"))).unwrap()
    };
    let unexplained = |report: &serde_json::Value| report["unexplained"].as_f64().unwrap();
    let (text, found) = (read("found/layout.toml"), report("found"));
    let [first, second] = GivenLayout::parse(&text).unwrap().segments[..] else { panic!("{text}") };
    let taken = |name: &str, text: &str| {
        std::fs::write(folder.join("edited.toml"), text).unwrap();
        let output = run(folder, &["cloth.png", "--layout", "edited.toml", "-o", name]);
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
        let report = report(name);
        assert_eq!(report["hypothesis"], "given");
        report
    };
    // How far a seen segment is from the axis of another one: what lies over it may take some of
    // its length.
    let off_axis = |report: &serde_json::Value, number: usize, axis: &Segment| {
        let centre = &report["segments"][number]["center"];
        let centre = DVec2::new(centre[0].as_f64().unwrap(), centre[1].as_f64().unwrap());
        DVec2::from_angle(axis.angle).perp_dot(centre - axis.centre).abs()
    };
    let count = |report: &serde_json::Value| report["segments"].as_array().unwrap().len();

    // Deleted: the other one stays where it was, and what the deleted one explained is unexplained.
    let (head, _) = text.rsplit_once("[[segments]]").unwrap();
    let deleted = taken("deleted", head);
    assert!(count(&deleted) == 1 && off_axis(&deleted, 0, &first) < BENT, "{deleted}");
    assert_eq!(GivenLayout::parse(&read("deleted/layout.toml")).unwrap().segments, [first]);
    assert!(unexplained(&deleted) > unexplained(&found) + 0.1, "{deleted}");

    // Added by eye, to the nearest pixel: explains as much as the one that was found.
    let table = |segment: &Segment| {
        let Segment { centre, angle, width, length, top, round, sag, .. } = segment;
        let [x, y, width, length] = [centre.x, centre.y, *width, *length].map(f64::round);
        let degrees = angle.to_degrees().round();
        format!(
            "\n[[segments]]\ncenter = [{x:.1}, {y:.1}]\nangle_deg = {degrees:.1}\nwidth = {width:.1}\nlength = {length:.1}\n\
             top = {top:.1}\nround = {round:.1}\nsag = {sag:.1}\n"
        )
    };
    let added = taken("added", &(head.to_owned() + &table(&second)));
    assert!(count(&added) == 2 && off_axis(&added, 1, &second) < 1.0, "{added}");
    assert!(unexplained(&added) < unexplained(&found) + 0.06, "{added}");

    // Moved across itself by a third of its width: it is there, and explains less.
    let way = DVec2::from_angle(second.angle).perp();
    let moved = Segment { centre: second.centre + way * (second.width / 3.0), ..second };
    let center =
        |segment: &Segment| format!("center = [{:?}, {:?}]", segment.centre.x, segment.centre.y);
    let edited = text.replace(&center(&second), &center(&moved));
    assert_ne!(edited, text, "{} isn't in {text}", center(&second));
    let moved_report = taken("moved", &edited);
    assert!(
        count(&moved_report) == 2 && off_axis(&moved_report, 1, &moved) < BENT,
        "{moved_report}"
    );
    assert!(unexplained(&moved_report) > unexplained(&found) + 0.01, "{moved_report}");
    assert_eq!(GivenLayout::parse(&read("moved/layout.toml")).unwrap().segments, [first, moved]);

    // One more than there are, small and on top: it is taken, and explains nothing; the one below
    // is seen on both sides of it.
    let small = Segment { width: 4.0, length: 6.0, top: 2.0 * second.top, ..second };
    let more = taken("more", &(text.clone() + &table(&small)));
    let numbers: Vec<u64> = more["segments"]
        .as_array()
        .unwrap()
        .iter()
        .map(|row| row["segment_number"].as_u64().unwrap())
        .collect();
    assert!(numbers == [1, 2, 2, 3] && off_axis(&more, 3, &second) < 1.0, "{more}");
    assert!(unexplained(&more) > unexplained(&found), "{more}");
}

#[test]
fn the_drawing_numbers_segments_as_the_layout_does_and_the_texture_tiles() {
    let truth = sample(
        Kind::Twill(2, 1),
        101,
        320,
        Disturbance { distortion: 2.0, noise: 0.02, light: 0.2 },
    );
    let folder = tempfile::tempdir().unwrap();
    truth.image.save(folder.path().join("cloth.png")).unwrap();
    assert!(run(folder.path(), &["cloth.png", "-o", "out"]).status.success());
    let read = |name: &str| std::fs::read_to_string(folder.path().join("out").join(name)).unwrap();
    let layout = GivenLayout::parse(&read("layout.toml")).unwrap();
    let text = read("layout.svg");
    let svg = roxmltree::Document::parse(&text).unwrap();
    let groups = svg
        .descendants()
        .filter(|node| node.attribute("id").is_some_and(|id| id.starts_with("segment-")));
    let groups: Vec<_> = groups.collect();
    assert_eq!(groups.len(), layout.segments.len());
    for ((number, segment), group) in (1..).zip(&layout.segments).zip(groups) {
        assert_eq!(group.attribute("id"), Some(format!("segment-{number}").as_str()));
        let title = group.first_element_child().unwrap();
        assert_eq!(title.tag_name().name(), "title");
        let expected = format!(
            "{number}: center {:.2}, {:.2}; angle_deg ",
            segment.centre.x, segment.centre.y
        );
        assert!(
            title.text().unwrap().starts_with(&expected),
            "{:?} is not {expected}",
            title.text()
        );
        assert_eq!(
            group
                .children()
                .filter(|node| node.has_tag_name(("http://www.w3.org/2000/svg", "path")))
                .count(),
            9
        );
    }
    let picture = svg.descendants().find(|node| node.tag_name().name() == "image").unwrap();
    assert!(
        picture
            .attributes()
            .any(|attribute| attribute.value().starts_with("data:image/png;base64,iVBOR"))
    );
    assert!(text.len() < 1 << 20, "{} bytes", text.len());

    // Whole cells each way, of neighbours that differ no more where the texture meets itself than
    // elsewhere.
    let texture = image::open(folder.path().join("out/texture.png")).unwrap().into_rgb8();
    let (width, height) = texture.dimensions();
    let [a, b] = layout.cell.map(|vector| vector.length());
    for cells in [f64::from(width) / a, f64::from(height) / b] {
        assert!(
            (cells - cells.round()).abs() < 0.1 && (3.0..=6.0).contains(&cells.round()),
            "{width} x {height}"
        );
    }
    let step = |x: u32, y: u32, [next_x, next_y]: [u32; 2]| {
        f64::from(
            texture.get_pixel(x, y).0[0]
                .abs_diff(texture.get_pixel(next_x % width, next_y % height).0[0]),
        )
    };
    let mean = |columns: std::ops::Range<u32>, rows: std::ops::Range<u32>, way: [u32; 2]| {
        let count = f64::from((columns.end - columns.start) * (rows.end - rows.start));
        let places = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
        places.map(|(x, y)| step(x, y, [x + way[0], y + way[1]])).sum::<f64>() / count
    };
    let across = (mean(width - 1..width, 0..height, [1, 0]), mean(0..width - 1, 0..height, [1, 0]));
    let down = (mean(0..width, height - 1..height, [0, 1]), mean(0..width, 0..height - 1, [0, 1]));
    assert!(across.0 < 1.5 * across.1 && down.0 < 1.5 * down.1, "{across:?} {down:?}");
}

#[test]
fn a_captured_weave_goes_over_and_under_and_drapes() {
    let truth = sample(Kind::Colored, 104, 320, Disturbance::default());
    let settings = CaptureSettings { pixels_per_mm: Some(20.0), ..CaptureSettings::default() };
    let Captured { fabric, shapes, layout, .. } = capture(&truth.image, &settings).unwrap();
    // A cell of two warps and two wefts, each over one and under one, and as far apart as in the
    // picture.
    let area = fabric.wale_spacing() * fabric.course_spacing() * 400.0;
    let cell = (truth.lattice[0].perp_dot(truth.lattice[1]) * 2.0).abs();
    assert!((area / cell - 1.0).abs() < 0.05, "{area} {cell}");
    let strands = &fabric.laid_cloth().unwrap().strands;
    let run = |direction: StrandDirection| {
        strands.iter().filter(move |strand| strand.direction == direction)
    };
    let (along, across) = (StrandDirection::Along, StrandDirection::Across);
    assert_eq!((run(along).count(), run(across).count()), (2, 2));
    for strand in strands {
        let heights: Vec<f64> = strand.path.iter().map(|point| point.z).collect();
        assert!(
            heights.iter().any(|z| *z > 0.05) && heights.iter().any(|z| *z < -0.05),
            "{heights:?}"
        );
    }
    let width = truth.stretches[0].width / 20.0;
    for yarn in fabric.yarns() {
        assert!((yarn.diameter() / width - 1.0).abs() < 0.1, "{} {width}", yarn.diameter());
    }
    // Warps of one colour, wefts of another.
    let color = |direction| run(direction).next().unwrap().yarn.color;
    assert_ne!(color(along), color(across));
    assert!(strands.iter().all(|strand| strand.yarn.color == color(strand.direction)));
    for (shape, segment) in shapes.iter().zip(&layout.visible) {
        assert!(
            (shape.width - segment.width / 20.0).abs() < 1e-9
                && shape.semi_axis <= shape.width / 2.0
                && shape.steepest > 0.0
        );
    }

    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("cloth.toml"), fabric.to_string()).unwrap();
    let shirt = Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes/tshirt.obj");
    let mut command = assert_cmd::Command::cargo_bin("warpknit").unwrap();
    command.env("XDG_CACHE_HOME", crate::cache_home());
    let arguments = [
        "--fabric",
        "cloth.toml",
        "-o",
        "shirt.png",
        "-o",
        "shirt.json",
        "--size",
        "160x160",
        "--enlarge",
        "auto",
        "--quiet",
    ];
    let output = command
        .current_dir(folder.path())
        .arg("drape")
        .arg(shirt)
        .args(arguments)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("shirt.json")).unwrap()).unwrap();
    assert!(report["stitches"].as_u64().unwrap() > 8_000, "{report}");
    // It covers the shirt: the middle of the picture is cloth.
    let picture = image::open(folder.path().join("shirt.png")).unwrap().to_rgba8();
    let opaque = (60..100)
        .flat_map(|y| (60..100).map(move |x| (x, y)))
        .filter(|&(x, y)| picture.get_pixel(x, y).0[3] > 128);
    assert!(opaque.count() > 1500, "of 1600 pixels");
}

#[test]
fn what_is_no_photo_of_cloth_is_named_and_leaves_no_folder() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    RgbImage::new(8, 8).save(folder.join("tiny.png")).unwrap();
    RgbImage::new(100, 100).save(folder.join("blank.png")).unwrap();
    std::fs::write(
        folder.join("moving.gif"),
        b"GIF89a\x01\x00\x01\x00\x80\x00\x00\x00\x00\x00\xff\xff\xff!\xf9\x04\x00\x00\x00\x00\x00,\x00",
    )
    .unwrap();
    let whole = std::fs::read(folder.join("blank.png")).unwrap();
    std::fs::write(folder.join("cut.png"), &whole[..whole.len() / 2]).unwrap();
    // A header alone says that it is 20000 x 10000 pixels.
    let mut huge = whole;
    huge[16..24].copy_from_slice(&[0, 0, 0x4E, 0x20, 0, 0, 0x27, 0x10]);
    std::fs::write(folder.join("huge.png"), huge).unwrap();
    for (name, part) in [
        ("tiny.png", "too few"),
        ("blank.png", "blank"),
        ("moving.gif", "PNG or JPEG"),
        ("cut.png", "cut.png"),
        ("huge.png", "huge.png"),
        ("none.png", "can't be read"),
    ] {
        let output = run(folder, &[name, "-o", "out"]);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{name}: {message}");
        assert!(
            message.starts_with("error: ")
                && message.contains(name)
                && message.contains(part)
                && message.lines().count() == 1,
            "{message}"
        );
        assert!(!folder.join("out").exists());
    }
    let output = run(folder, &["blank.png", "-o", "out", "--cell", "1,2,3"]);
    assert_eq!(output.status.code(), Some(2));
}

/// Loops of four pixels give strands, but which ones is chance.
#[test]
fn strands_of_a_repeat_too_small_to_see_are_a_guess_that_one_asks_for() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let photo = Disturbance { distortion: 0.0, noise: 0.02, light: 0.1 };
    let near = sample(Kind::Jersey, 133, 640, photo);
    let side = (640.0 * 4.5 / near.lattice[0].length()).round();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some 100 pixels")]
    let side = side as u32;
    let far = image::imageops::resize(&near.image, side, side, FilterType::Triangle);
    far.save(folder.join("far.png")).unwrap();
    let refused = run(folder, &["far.png", "--structure", "free", "-o", "out"]);
    let message = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1), "{message}");
    assert!(message.contains("too small to see yarns in"), "{message}");
    assert!(message.lines().count() == 1 && !folder.join("out").exists(), "{message}");
    let guessed = run(folder, &["far.png", "--structure", "free", "--anyway", "-o", "out"]);
    assert!(guessed.status.success(), "{}", String::from_utf8_lossy(&guessed.stderr));
}

/// A solver that stopped early or went astray took this plain weave for strands of no structure.
#[test]
fn a_scan_of_linen_is_a_weave_in_its_cell_and_in_cells_beside_it() {
    let photo = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../shared/cloth-photos/rough_linen_diff_2k.jpg");
    if !photo.is_file() {
        println!("skipped: no photo {}", photo.display());
        return;
    }
    let photo = image::open(photo).unwrap().into_rgb8();
    for [ax, ay, bx, by] in [[4.19, -5.49, 4.18, 5.67], [4.15, -5.5, 4.2, 5.7]] {
        let cell = Some([DVec2::new(ax, ay), DVec2::new(bx, by)]);
        let found =
            capture(&photo, &CaptureSettings { cell, ..CaptureSettings::default() }).unwrap();
        let Layout { hypothesis, error, visible_error, .. } = found.layout;
        assert_eq!(hypothesis, Hypothesis::Woven, "{ax}");
        assert!(error < 0.08 && visible_error < 0.12, "{ax}: {error} {visible_error}");
    }
}

/// A photo of a face of a built-in fabric, as another mill makes it.
fn knit_photo(name: &str, face: Face, seed: u64) -> RgbImage {
    taken(&varied(&Fabric::named(name).unwrap(), seed), face, FAIR, seed)
}

#[test]
fn both_faces_of_a_locknit_give_its_chains_and_so_do_their_mirror_images() {
    let [back, front] = [Face::Back, Face::Front].map(|face| knit_photo("locknit", face, 101));
    let flipped = [&back, &front].map(image::imageops::flip_horizontal);
    // A locknit begun a course later is its own mirror image.
    let key = |fabric: &Fabric| {
        let knit = fabric.warp_knit().unwrap();
        ClothKey::new(knit, fabric.repeat(), fabric.threading_repeat())
    };
    for [back, front] in [[&back, &front], [&flipped[0], &flipped[1]]] {
        let photos = [(back, Face::Back), (front, Face::Front)];
        let found = recognise(&photos, &RecogniseSettings::default()).unwrap();
        assert!(found.unexplained() < 0.3, "{}", found.unexplained());
        assert_eq!(key(&found.fabric), key(&Fabric::named("locknit").unwrap()), "{}", found.fabric);
    }
}

/// The photo shows the repeat of ten courses two and a half times.
#[test]
fn a_repeat_of_two_fifths_of_the_photo_is_recognised() {
    let photos = [Face::Back, Face::Front].map(|face| (knit_photo("tulle-5", face, 30_031), face));
    let photos = photos.each_ref().map(|(photo, face)| (photo, *face));
    let found = recognise(&photos, &RecogniseSettings::default()).unwrap();
    assert_eq!(found.ranked[0].fabric.name, "tulle-5");
    assert!(found.unexplained() < 0.3, "{}", found.unexplained());
}

/// White paper between the yarns, lighter than they are.
#[test]
fn a_locknit_on_paper_is_recognised() {
    let fabric = varied(&Fabric::named("locknit").unwrap(), 104);
    let [back, front] = [Face::Back, Face::Front].map(|face| taken(&fabric, face, ON_PAPER, 104));
    let found =
        recognise(&[(&back, Face::Back), (&front, Face::Front)], &RecogniseSettings::default());
    let found = found.unwrap();
    assert_eq!(found.ranked[0].fabric.name, "locknit");
    assert!(found.unexplained() < 0.3, "{}", found.unexplained());
}

/// Waves down, and across them waves of a twentieth of their height; and stripes that are
/// bent by a pixel.
#[test]
fn stripes_are_no_knit() {
    let wave = |at: f64, length: f64| (std::f64::consts::TAU * at / length).cos();
    let straight = |x: f64, y: f64| 60.0 * wave(y, 11.3) + 3.0 * wave(x, 16.7);
    let wavy = |x: f64, y: f64| 70.0 * wave(y + wave(x, 25.0), 14.0);
    let pictures: [&dyn Fn(f64, f64) -> f64; 2] = [&straight, &wavy];
    for stripes in pictures {
        let photo = RgbImage::from_fn(300, 300, |x, y| {
            image::Rgb([(128.0 + stripes(x.into(), y.into())).round() as u8; 3])
        });
        let found = recognise(&[(&photo, Face::Back)], &RecogniseSettings::default());
        assert_eq!(found.unwrap_err(), RecogniseError::Stripes { photo: 0 });
    }
}

#[test]
fn strands_take_one_photo_and_no_lapping() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    knit_photo("tricot", Face::Back, 101).save(folder.join("back.png")).unwrap();
    for more in [["--front", "back.png"], ["--lapping", "1-0/1-2//"]] {
        let arguments = [&["back.png", "--structure", "free", "-o", "knit"][..], &more].concat();
        let output = run(folder, &arguments);
        let error = String::from_utf8(output.stderr).unwrap();
        assert!(error.starts_with("error: --structure free takes one photo"), "{error}");
        assert!(!folder.join("knit").exists());
    }
}

/// Beside a clear weave a search through all lappings would take most of the time.
#[test]
fn lappings_that_no_catalogue_holds_are_left_out_if_one_asks_for_that() {
    let chains = ["0-1/1-2//", "2-3/0-1//"].map(str::to_owned);
    let fabric = Fabric::named("locknit").unwrap().with_chains(&chains, &[]).unwrap();
    let [back, front] =
        [Face::Back, Face::Front].map(|face| taken(&varied(&fabric, 102), face, FAIR, 102));
    let are_known = |only_known| -> Vec<bool> {
        let settings = RecogniseSettings { only_known, ..RecogniseSettings::default() };
        let photos = [(&back, Face::Back), (&front, Face::Front)];
        let found = recognise(&photos, &settings).unwrap();
        found.ranked.iter().map(|ranked| ranked.is_known).collect()
    };
    assert!(are_known(true).iter().all(|is_known| *is_known));
    assert!(!are_known(false)[0]);
}

#[test]
fn a_locknit_s_photos_become_a_fabric_of_bars_and_noise_becomes_none() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (name, face) in [("back.png", Face::Back), ("face.png", Face::Front)] {
        knit_photo("locknit", face, 101).save(folder.join(name)).unwrap();
    }
    noise(&mut Random::new(7), 300).save(folder.join("noise.png")).unwrap();
    let output =
        run(folder, &["back.png", "--front", "face.png", "--width-mm", "12", "-o", "knit"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let fabric = Fabric::read(&folder.join("knit/fabric.toml")).unwrap();
    assert_eq!(fabric.warp_knit().unwrap().bars.len(), 2);
    let report: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.join("knit/report.json")).unwrap()).unwrap();
    assert_eq!(
        (&report["hypothesis"], &report["ranked"][0]["name"]),
        (&"warp".into(), &"locknit".into())
    );
    let refused = run(folder, &["noise.png", "--structure", "knit", "-o", "none"]);
    assert!(!refused.status.success() && !folder.join("none").exists());
}

/// As docs/capture.md has it: bars of two colours, uneven yarns whose filaments spread, raw edges.
#[test]
fn a_drawn_locknit_of_two_colours_is_known_from_both_faces() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for view in ["back", "front"] {
        let picture = format!("{view}.png");
        let arguments = ["--fabric", "locknit", "--view", view, "--wales", "24", "--courses", "36"];
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_warpknit"))
            .current_dir(folder)
            .arg("swatch")
            .args(arguments)
            .args(["--size", "800x800", "--background", "#101010", "-o", &picture])
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    let output = run(folder, &["back.png", "--front", "front.png", "-o", "knit"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report = std::fs::read(folder.join("knit/report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
    assert_eq!(report["ranked"][0]["name"], "locknit", "{}", report["ranked"]);
}
