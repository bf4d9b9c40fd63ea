//! `warpknit bench`: its tables, on our garments and on a user's, and its files read back.

use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;

fn bench(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::cargo_bin("warpknit").unwrap();
    command.current_dir(folder).arg("bench").args(arguments).args(["--runs", "1", "--quiet"]);
    command
}

/// stdout of a run that succeeds and says nothing else.
fn table(folder: &Path, arguments: &[&str]) -> String {
    let output = bench(folder, arguments).assert().success().stderr("").get_output().clone();
    String::from_utf8(output.stdout).unwrap()
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// A panel of two triangles that hangs in a bend.
fn garment(folder: &Path) {
    let text = "v 0 0 0\nv 200 0 40\nv 200 300 40\nv 0 300 0\nvt 0 0\nvt 204 0\nvt 204 300\nvt 0 300\nf 1/1 2/2 3/3 4/4\n";
    std::fs::write(folder.join("own.obj"), text).unwrap();
}

#[test]
fn table_2_stands_beside_what_was_published_wherever_the_program_runs() {
    let folder = tempfile::tempdir().unwrap();
    let text = table(
        folder.path(),
        &["--only", "plane-curved", "-o", "b.json", "-o", "b.svg", "-o", "b.png"],
    );
    assert!(
        text.starts_with("Table 2")
            && text.contains("published,\n")
            && text.contains("other machine"),
        "{text}"
    );

    let record = json(&folder.path().join("b.json"));
    assert!(
        record["machine"]["cores"].as_u64().unwrap() > 0
            && record["machine"]["threads"].as_u64().unwrap() > 0
    );
    assert_eq!(
        (&record["runs"], &record["warpknit"]),
        (&1.into(), &env!("CARGO_PKG_VERSION").into())
    );
    let rows = record["tables"]["plane-curved"]["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 4 * 6);
    let paper = [
        (576.0, 41.46, 58.35),
        (3500.0, 201.45, 209.46),
        (8480.0, 496.52, 521.08),
        (26_180.0, 1208.39, 1375.15),
    ];
    for (rows, (stitches, plane, curved)) in rows.chunks(6).zip(paper) {
        let ms = |row: usize| rows[row]["ms"].as_f64().unwrap();
        let there = rows[0]["stitches"].as_f64().unwrap();
        assert!((there / stitches - 1.0).abs() < 0.01, "{there} stitches for {stitches}");
        assert_eq!([4, 5].map(|row| rows[row]["published"].as_f64().unwrap()), [plane, curved]);
        assert_eq!(
            rows.iter().map(|row| row["part"].as_str().unwrap().len()).collect::<Vec<_>>(),
            [5, 5, 20, 6, 13, 14]
        );
        // With one run the parts add up.
        assert!((ms(1) + ms(2) - ms(3)).abs() < 1e-6 && ms(0) > 0.0, "{rows:?}");
        assert!(ms(4) > ms(1) && (ms(4) + ms(2) - ms(5)).abs() < 1e-6, "{rows:?}");
        let (times, cpu) = (rows[5]["times"].as_f64().unwrap(), rows[5]["cpu_ms"].as_f64());
        assert!((times - curved / cpu.unwrap_or(ms(5))).abs() < 1e-9);
        assert_eq!(rows[5]["samples_ms"], serde_json::json!([ms(5)]));
    }

    let svg = std::fs::read_to_string(folder.path().join("b.svg")).unwrap();
    let document = roxmltree::Document::parse(&svg).unwrap();
    let texts: Vec<_> = document
        .descendants()
        .filter(|node| node.has_tag_name("text"))
        .filter_map(|node| node.text())
        .collect();
    for wanted in ["stitches", "time, ms", "plane, here", "curved, published", "10k"] {
        assert!(texts.contains(&wanted), "{wanted}: {texts:?}");
    }
    let picture = image::open(folder.path().join("b.png")).unwrap().into_rgb8();
    assert!(picture.width() >= 1000 && picture.pixels().any(|pixel| pixel.0 == [0x00, 0x72, 0xb2]));
}

#[test]
fn tables_go_into_data_frames_pages_and_papers() {
    let folder = tempfile::tempdir().unwrap();
    garment(folder.path());
    let files = ["b.csv", "b.md", "b.tex"].map(|name| ["-o", name]).concat();
    table(
        folder.path(),
        &[&["own.obj", "--unit", "mm", "--only", "plane-curved"], &files[..]].concat(),
    );
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    let csv = read("b.csv");
    let fields = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
    let head = fields(csv.lines().next().unwrap());
    assert_eq!((head[0].as_str(), head.last().unwrap().as_str()), ("table", "machine"));
    for key in ["part", "ms", "cpu_ms", "samples_ms", "over_plane", "warpknit", "commit"] {
        assert!(head.iter().any(|own| own == key), "{head:?}");
    }
    assert_eq!(csv.lines().count(), 1 + 4 * 6);
    assert!(read("b.md").contains("| plane |") && read("b.md").contains("All runs"));
    assert!(
        read("b.tex").contains("\\toprule") && read("b.tex").contains("% runs, ms: own tricot")
    );
}

#[test]
fn a_garment_of_ones_own_is_measured_alone() {
    let folder = tempfile::tempdir().unwrap();
    garment(folder.path());
    let arguments = [
        "own.obj",
        "--unit",
        "mm",
        "--only",
        "plane-curved",
        "--brute",
        "--threads",
        "1",
        "-o",
        "b.json",
    ];
    let text = table(folder.path(), &arguments);
    assert!(
        text.contains("all triangles") && text.contains("own") && !text.contains("hex-net-3"),
        "{text}"
    );
    let record = json(&folder.path().join("b.json"));
    assert_eq!(record["machine"]["threads"], 1);
    for row in record["tables"]["plane-curved"]["rows"].as_array().unwrap() {
        assert!(
            row["cloth"] == "own" && row["fabric"] == "tricot" && row["published"].is_null(),
            "{row}"
        );
        assert_eq!(
            row["brute_ms"].is_number(),
            ["curved", "location and mapping", "relax + curved"]
                .contains(&row["part"].as_str().unwrap())
        );
    }
}

#[test]
fn pictures_are_timed_over_stitches_tubes_and_textures() {
    let folder = tempfile::tempdir().unwrap();
    table(
        folder.path(),
        &[
            "--only", "total", "--only", "st-sr", "--only", "textures", "--size", "160x120", "-o",
            "b.json",
        ],
    );
    let tables = &json(&folder.path().join("b.json"))["tables"];
    let notes = tables["total"]["notes"].to_string();
    assert!(notes.contains("160 x 120 pixels"), "{notes}");
    let of = |table: &str, key: &str| -> Vec<f64> {
        tables[table]["rows"]
            .as_array()
            .unwrap()
            .iter()
            .map(|row| row[key].as_f64().unwrap())
            .collect()
    };
    let stitches = of("total", "stitches");
    assert!(
        stitches.iter().zip([5400.0, 9996.0, 10_400.0, 21_600.0]).all(|(there, asked)| (there
            / asked
            - 1.0_f64)
            .abs()
            < 0.01)
    );
    assert_eq!(of("total", "published"), [4420.0, 7430.0, 7800.0, 15_560.0]);
    for ((cloth, picture), all) in
        of("total", "cloth_ms").into_iter().zip(of("total", "picture_ms")).zip(of("total", "ms"))
    {
        assert!(cloth > 0.0 && picture > 0.0 && (cloth + picture - all).abs() < 1e-6);
    }
    // Six sections on each of three sizes; a stitch has two triangles for each of its St times Sr.
    let (st, sr, triangles) = (of("st-sr", "st"), of("st-sr", "sr"), of("st-sr", "triangles"));
    assert!(st.len() == 18 && (0..18).all(|row| triangles[row] == 2.0 * st[row] * sr[row]));
    assert!(
        of("st-sr", "tubes_ms")
            .iter()
            .zip(of("st-sr", "ms"))
            .all(|(tubes, all)| *tubes > 0.0 && *tubes < all)
    );
    let over_none = of("textures", "over_none");
    assert!(
        over_none.len() == 6 && over_none[0] == 1.0 && over_none.iter().all(|times| *times > 0.0)
    );
}

#[test]
fn what_the_ribbon_paper_published_is_printed_bare_alone_and_titled_among_others() {
    let folder = tempfile::tempdir().unwrap();
    let headings = "loops segments vertices ms from to cpu ms ns/vertex other machine times";
    let words = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
    for flags in [&["--weft"][..], &["--only", "weft"]] {
        let text = table(folder.path(), flags);
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(
            (lines.len(), words(lines[0]).as_str(), words(lines[1]).as_str()),
            (11, "published,", headings),
            "{text}"
        );
        // Where the scripts look: loops, segments, CPU time.
        let cells: Vec<_> = lines[2].split_whitespace().collect();
        assert_eq!((cells[0], cells[3]), ("20", "15"));
        assert!(cells[8].parse::<f64>().is_ok_and(|ms| ms > 0.0), "{text}");
    }
    garment(folder.path());
    let both = table(folder.path(), &["own.obj", "--weft", "--only", "plane-curved"]);
    assert!(
        both.contains("Plain weft knits from motif to tubes") && both.contains("Table 2"),
        "{both}"
    );
}

#[test]
fn the_mappings_stand_side_by_side() {
    let folder = tempfile::tempdir().unwrap();
    garment(folder.path());
    table(folder.path(), &["own.obj", "--unit", "mm", "--only", "mapping", "-o", "b.json"]);
    let record = json(&folder.path().join("b.json"));
    let rows = record["tables"]["mapping"]["rows"].as_array().unwrap();
    let parts: Vec<_> = rows.iter().map(|row| row["part"].as_str().unwrap()).collect();
    assert_eq!(parts[..5], ["plane", "frame", "smooth", "relaxed", "solving strains"]);
    assert!(rows.iter().all(|row| row["ns_a_point"].as_f64().unwrap() > 0.0));
}

#[test]
fn yarn_keeps_its_length_better_relaxed_than_smooth() {
    let folder = tempfile::tempdir().unwrap();
    // Pulled to 1.15 times its width.
    let text = "v 0 0 0\nv 230 0 0\nv 230 300 0\nv 0 300 0\nvt 0 0\nvt 200 0\nvt 200 300\nvt 0 300\nf 1/1 2/2 3/3 4/4\n";
    std::fs::write(folder.path().join("own.obj"), text).unwrap();
    let outputs = ["--only", "yarn-length", "-o", "b.json", "-o", "b.svg"];
    let units = ["own.obj", "--unit", "mm", "--uv-scale", "1", "--fabric", "locknit"];
    table(folder.path(), &[&units[..], &outputs[..]].concat());
    let record = json(&folder.path().join("b.json"));
    let rows = record["tables"]["yarn-length"]["rows"].as_array().unwrap();
    assert!(!rows.is_empty());
    for [smooth, relaxed] in rows.as_chunks().0 {
        assert_eq!([&smooth["map"], &relaxed["map"]], ["smooth", "relaxed"]);
        assert_eq!(relaxed["fabric"], "locknit");
        let [smooth, relaxed] = [smooth, relaxed].map(|row| row["over_2"].as_f64().unwrap());
        assert!(smooth > 90.0 && relaxed < 5.0, "{smooth} % smooth, {relaxed} % relaxed");
    }
    let plot = std::fs::read_to_string(folder.path().join("b.svg")).unwrap();
    assert!(plot.contains("longer or shorter by more than, %"));
}

#[test]
fn wrong_files_are_told_of_before_anything_is_measured() {
    let folder = tempfile::tempdir().unwrap();
    garment(folder.path());
    // Growth would take minutes.
    let fails = |code: i32, arguments: &[&str], why: &str| {
        let arguments = [&["--only", "growth"], arguments].concat();
        let output =
            bench(folder.path(), &arguments).assert().code(code).stdout("").get_output().clone();
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(message.contains(why), "{arguments:?}: {message}");
    };
    fails(2, &["-o", "b.ods"], ".json .csv .md .tex .svg .png");
    fails(2, &["--only", "speed"], "plane-curved");
    fails(2, &["a.obj", "b.obj", "c.obj"], "unexpected");
    fails(1, &["-o", "absent/b.json"], "there is no folder absent");
    fails(1, &["-o", "b.json", "-o", "b.json"], "another output");
    fails(1, &["-o", "b.json", "-o", "./b.json"], "another output");
    fails(1, &["absent.obj"], "absent.obj");
    fails(1, &["--brute"], "--only plane-curved");
    fails(1, &["--fabric", "locknit"], "--only yarn-length");
    let pictures = bench(folder.path(), &["own.obj", "--only", "st-sr"])
        .assert()
        .code(1)
        .stdout("")
        .get_output()
        .clone();
    assert!(
        String::from_utf8(pictures.stderr)
            .unwrap()
            .contains("plane-curved, mapping, yarn-length, total and growth")
    );
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}
