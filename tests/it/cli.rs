//! The command line: exit codes, streams, and outputs that are whole or not there.

use std::path::Path;

use assert_cmd::Command;

use warpknit::fabric::builtin;

use crate::drape::mesh;

pub(crate) fn warpknit(folder: &Path) -> Command {
    let mut command = Command::cargo_bin("warpknit").unwrap();
    command.env("XDG_CACHE_HOME", crate::cache_home());
    command.current_dir(folder);
    command
}

/// stderr of a run that must end with `code` and leave nothing in its folder but what was there.
pub(crate) fn fails(code: i32, arguments: &[&str], prepare: impl Fn(&Path)) -> String {
    let folder = tempfile::tempdir().unwrap();
    prepare(folder.path());
    let names = || {
        let mut names: Vec<_> = std::fs::read_dir(folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        names.sort();
        names
    };
    let before = names();
    let output =
        warpknit(folder.path()).args(arguments).assert().code(code).stdout("").get_output().clone();
    assert_eq!(names(), before, "{arguments:?} left something behind");
    String::from_utf8(output.stderr).unwrap()
}

pub(crate) const SMALL: [&str; 6] = ["--size", "32x24", "--wales", "2", "--courses", "2"];

#[test]
fn who_pulls_a_garment_is_sent_to_the_swatch() {
    for arguments in [&["drape", "a.obj", "--stretch", "1.2"][..], &["view", "--stretch"]] {
        let error = fails(2, arguments, |_| {});
        assert!(error.contains("`warpknit swatch --stretch` pulls flat cloth"), "{error}");
        assert!(!error.contains("--sr"), "{error}");
    }
}

#[test]
fn wrong_usage_ends_with_2() {
    for arguments in [
        &["knit"][..],
        &["drape"],
        &["swatch", "--st", "0"],
        &["swatch", "--st", "257"],
        &["swatch", "--sr", "2"],
        &["swatch", "-o", "a.xyz"],
        &["swatch", "-o", "a"],
        &["swatch", "--size", "0x10"],
        &["swatch", "--eye", "1,2,3"],
        &["swatch", "--view", "inside"],
        &["drape", "a.obj", "--unit", "mile"],
        &["swatch", "--radius", "-1"],
        &["swatch", "--threading", "I"],
        &["swatch", "--run-in", "long"],
        &["swatch", "--run-in", "0"],
        &["swatch", "--run-in", "-1240"],
        &["drape", "a.obj", "--count", "78"],
        &[
            "swatch",
            "--lapping",
            "1-0",
            "--lapping",
            "1-0",
            "--lapping",
            "1-0",
            "--threading",
            "I",
            "--threading",
            "I",
        ],
        &["swatch", "--lapping", "1-0", "--threading", "I", "--threading", "I"],
    ] {
        assert!(fails(2, arguments, |_| {}).starts_with("error:"), "{arguments:?}");
    }
}

#[test]
fn failures_end_with_1_and_one_message() {
    let no_file = fails(1, &["drape", "absent.obj", "-o", "a.png"], |_| {});
    assert!(
        no_file.starts_with("error: absent.obj: ") && no_file.lines().count() == 1,
        "{no_file}"
    );
    let no_fabric = fails(1, &["swatch", "--fabric", "tweed"], |_| {});
    assert!(no_fabric.contains("there is no built-in fabric 'tweed'"), "{no_fabric}");
    assert!(!no_fabric.contains("did you mean"), "{no_fabric}");
    let misspelt = fails(1, &["swatch", "--fabric", "lokcnit"], |_| {});
    assert!(misspelt.contains("; did you mean 'locknit'?"), "{misspelt}");
    let no_folder = fails(1, &[&["swatch", "-o", "no/such/a.png"], &SMALL[..]].concat(), |_| {});
    assert!(no_folder.contains("no/such/a.png"), "{no_folder}");
    let endless = fails(1, &["swatch", "--wales", "20000", "--courses", "20000"], |_| {});
    assert!(endless.starts_with("error: 800000000 stitches are over the limit"), "{endless}");
    let folder = fails(1, &[&["swatch", "-o", "a.png"], &SMALL[..]].concat(), |p| {
        std::fs::create_dir(p.join("a.png")).unwrap();
    });
    assert!(folder.contains("a.png: can't write: it is a folder"), "{folder}");
}

#[test]
fn no_file_is_written_twice_or_over_an_input() {
    let twice =
        fails(1, &[&["swatch", "-o", "a.csv", "-o", "./a.csv"], &SMALL[..]].concat(), |p| {
            std::fs::write(p.join("a.csv"), "").unwrap();
        });
    assert!(twice.contains("a.csv: this file is an input or another output"), "{twice}");
    let input = fails(1, &["drape", "t.obj", "-o", "t.obj"], |p| {
        std::fs::copy(mesh("tshirt.obj"), p.join("t.obj")).unwrap();
    });
    assert!(input.contains("t.obj: this file is an input"), "{input}");
}

#[test]
fn an_error_in_a_chain_is_pointed_at() {
    let text = fails(1, &["swatch", "--fabric", "bad.toml"], |folder| {
        let fabric = String::from_utf8(
            warpknit(folder).args(["fabrics", "tricot"]).output().unwrap().stdout,
        )
        .unwrap();
        std::fs::write(folder.join("bad.toml"), fabric.replacen("1-2/1-0//", "1-2/1-7//", 1))
            .unwrap();
    });
    assert_eq!(
        text,
        "error: bad.toml:11: bar 1, lapping \"1-2/1-7//\": an overlap over 6 needles: guides lap over 1 or 2\n  \
         lapping = \"1-2/1-7//\"\n                 ^^^\n"
    );
    let unknown_key = fails(1, &["swatch", "--fabric", "bad.toml"], |folder| {
        std::fs::write(folder.join("bad.toml"), "name = 'x'\nwhales_per_cm = 3\n").unwrap();
    });
    assert!(
        unknown_key.starts_with("error: bad.toml:2: unknown field `whales_per_cm`"),
        "{unknown_key}"
    );
    assert!(unknown_key.ends_with("\n  whales_per_cm = 3\n  ^^^^^^^^^^^^^\n"), "{unknown_key}");
    let argument =
        fails(1, &["swatch", "--lapping", "1-0/1-2//", "--lapping", "1-0/3-1-4-1-5//"], |_| {});
    assert_eq!(
        argument,
        "error: --lapping \"1-0/3-1-4-1-5//\": a course of 5 links: 2, 3 or 4 (tempi) are known\n  \
         1-0/3-1-4-1-5//\n      ^^^^^^^^^\n"
    );
    let marks = fails(1, &["swatch", "--lapping", "1-0/1-2//", "--threading", "I-"], |_| {});
    assert!(
        marks.starts_with("error: --threading \"I-\": '-' is no")
            && marks.ends_with("\n  I-\n   ^\n"),
        "{marks}"
    );
}

#[test]
fn chains_are_knitted_from_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    let chains = ["--lapping", "2-3/1-0//", "--lapping", "1-0/1-2", "--threading", "I"];
    warpknit(folder.path())
        .args(["swatch", "--fabric", "reverse-locknit"])
        .args(chains)
        .args(SMALL)
        .args(["-o", "a.csv", "-o", "a.json"])
        .assert()
        .success();
    warpknit(folder.path())
        .args(["swatch", "--fabric", "locknit", "-o", "b.csv"])
        .args(SMALL)
        .assert()
        .success();
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    assert_eq!(
        read("a.csv"),
        read("b.csv"),
        "a locknit's chains at its densities and with its yarns"
    );
    assert!(read("a.json").contains("\"fabric\": \"2-3/1-0// + 1-0/1-2//\""));
    // A name of chains is no name of a file.
    warpknit(folder.path()).arg("swatch").args(chains).args(SMALL).assert().success();
    assert!(folder.path().join("swatch.png").exists());
}

#[test]
fn a_fabric_lays_itself_out_panel_by_panel() {
    let write = |folder: &Path, panel: usize| {
        let fabric = String::from_utf8(
            warpknit(folder).args(["fabrics", "tricot"]).output().unwrap().stdout,
        )
        .unwrap();
        let layout = format!("\n[[panels]]\npanel = {panel}\ngrain = 15.0\norigin = [3.0, 4.5]\n");
        std::fs::write(folder.join("mine.toml"), fabric + &layout).unwrap();
    };
    let (flat, draped) = (mesh("pinch_flat.obj"), mesh("pinch_draped.obj"));
    let garment =
        ["drape", flat.to_str().unwrap(), draped.to_str().unwrap(), "--wales-per-cm", "1"];
    let absent =
        fails(1, &[&garment[..], &["--fabric", "mine.toml"]].concat(), |folder| write(folder, 7));
    assert!(
        absent.contains(
            "a [[panels]] table for panel 7, but the garment's panels are numbered 0 to 0"
        ),
        "{absent}"
    );

    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), 0);
    for (out, more) in
        [("a.csv", &["--fabric", "mine.toml"][..]), ("b.csv", &["--grain", "15"]), ("c.csv", &[])]
    {
        warpknit(folder.path()).args(garment).args(more).args(["-o", out]).assert().success();
    }
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    assert!(read("a.csv") != read("b.csv") && read("b.csv") != read("c.csv"));
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error_that_names_the_file() {
    for name in ["full.png", "full.glb", "full.obj", "full.csv", "full.json"] {
        let arguments = [&["swatch", "-o", name], &SMALL[..]].concat();
        let message = fails(1, &arguments, |folder| {
            std::os::unix::fs::symlink("/dev/full", folder.join(name)).unwrap();
        });
        assert!(
            message.contains("/dev/full: can't write")
                && message.contains("No space left on device"),
            "{name}: {message}"
        );
        assert_eq!(message.lines().count(), 1);
    }
}

#[test]
fn a_failed_run_keeps_the_old_files() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("old.csv"), "old").unwrap();
    let arguments = [&["swatch", "-o", "old.csv", "-o", "no/such.png"], &SMALL[..]].concat();
    warpknit(folder.path()).args(arguments).assert().code(1);
    assert_eq!(std::fs::read_to_string(folder.path().join("old.csv")).unwrap(), "old");
}

#[test]
fn data_go_to_stdout_and_a_closed_pipe_is_no_error() {
    let folder = tempfile::tempdir().unwrap();
    let listed = warpknit(folder.path())
        .arg("fabrics")
        .assert()
        .success()
        .stderr("")
        .get_output()
        .stdout
        .clone();
    let lines: Vec<_> = std::str::from_utf8(&listed).unwrap().lines().collect();
    assert_eq!(
        lines.iter().map(|line| line.split_whitespace().next().unwrap()).collect::<Vec<_>>(),
        builtin::names().collect::<Vec<_>>()
    );
    let columns = |line: &&str| {
        line.char_indices().map(|(at, _)| at).filter(|&at| line[..at].ends_with("  ")).count()
    };
    assert!(
        lines.iter().all(|line| columns(line) >= 2 && line.chars().count() < 170),
        "three columns each"
    );
    let inspected = warpknit(folder.path())
        .arg("inspect")
        .arg(mesh("tshirt.obj"))
        .assert()
        .success()
        .stderr("")
        .get_output()
        .stdout
        .clone();
    assert!(std::str::from_utf8(&inspected).unwrap().contains("unit cm (guessed)"));

    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let status = std::process::Command::new(assert_cmd::cargo::cargo_bin!("warpknit"))
        .arg("fabrics")
        .stdout(writer)
        .status()
        .unwrap();
    assert!(status.success());
}

#[test]
fn a_printed_fabric_is_taken_back() {
    let folder = tempfile::tempdir().unwrap();
    let text = warpknit(folder.path()).args(["fabrics", "locknit"]).output().unwrap().stdout;
    std::fs::write(folder.path().join("mine.toml"), text).unwrap();
    for (fabric, out) in [("mine.toml", "mine.csv"), ("locknit", "own.csv")] {
        warpknit(folder.path())
            .args(["swatch", "--fabric", fabric, "-o", out])
            .args(SMALL)
            .assert()
            .success();
    }
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_eq!(read("mine.csv"), read("own.csv"));
}

#[test]
fn negative_numbers_are_values_and_no_flags() {
    let folder = tempfile::tempdir().unwrap();
    for flag in ["wales", "courses", "st", "sr", "flatten", "spp", "samples", "fov", "fibre-radius"]
    {
        let flag = format!("--{flag}");
        let output = warpknit(folder.path()).args(["swatch", &flag, "-3"]).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.starts_with(&format!("error: invalid value '-3' for '{flag}")), "{said}");
    }
}

#[test]
fn chains_that_are_joined_as_in_names_are_those_of_several_bars() {
    let folder = tempfile::tempdir().unwrap();
    let numbers = |flags: &[&str]| {
        let mut command = warpknit(folder.path());
        command
            .args(["swatch", "--threading", "I.", "--threading", ".I", "-o", "a.csv"])
            .args(flags);
        command.output().unwrap()
    };
    let joined = numbers(&["--lapping", "1-0/1-2// + 1-2/1-0//"]);
    assert!(joined.status.success(), "{joined:?}");
    let apart = numbers(&["--lapping", "1-0/1-2//", "--lapping", "1-2/1-0//"]);
    assert_eq!(joined.stdout, apart.stdout);
    let one = numbers(&["--lapping", "1-0/1-2//"]);
    let said = String::from_utf8(one.stderr).unwrap();
    assert_eq!(one.status.code(), Some(2));
    assert!(said.contains("--threading is given 2 times for one chain"), "{said}");
}

/// Of every file but the report, which has times in it.
const ENDINGS: [&str; 12] =
    ["png", "glb", "csv", "obj", "ply", "html", "usda", "usdc", "bcc", "curves.txt", "inp", "npz"];

#[test]
fn every_output_is_the_same_on_one_and_on_two_threads() {
    let folder = tempfile::tempdir().unwrap();
    let garment = [mesh("pinch_flat.obj"), mesh("pinch_draped.obj")];
    for threads in ["1", "2"] {
        std::fs::create_dir(folder.path().join(threads)).unwrap();
        let outputs = ENDINGS.map(|ending| format!("{threads}/cloth.{ending}"));
        let mut command = warpknit(folder.path());
        command.arg("drape").args(&garment).args([
            "--wales-per-cm",
            "1",
            "--courses-per-cm",
            "1.5",
            "--st",
            "3",
            "--sr",
            "3",
        ]);
        command
            .args(outputs.iter().flat_map(|out| ["-o", out]))
            .args(["--size", "160x120", "--threads", threads])
            .assert()
            .success();
    }
    for ending in ENDINGS {
        let read = |threads: u32| {
            std::fs::read(folder.path().join(format!("{threads}/cloth.{ending}"))).unwrap()
        };
        assert!(read(1) == read(2), ".{ending} differs");
    }
}

#[test]
fn a_swatch_prints_its_numbers_even_quietly() {
    let folder = tempfile::tempdir().unwrap();
    let output = warpknit(folder.path())
        .args(["swatch", "--fabric", "weft-inserted", "--quiet"])
        .args(SMALL)
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success() && output.stderr.is_empty());
    for name in [
        "fabric",
        "wales",
        "courses",
        "mass",
        "yarn length",
        "thickness",
        "cover factor",
        "porosity",
        "clearance",
    ] {
        assert_eq!(
            text.lines().filter(|line| line.starts_with(&format!("{name}  "))).count(),
            1,
            "{name}: {text}"
        );
    }
    let weft = text.lines().last().unwrap().split_whitespace().collect::<Vec<_>>();
    assert_eq!(
        (weft[..3].join(" "), weft[4], weft[7]),
        ("2 110 dtex".to_owned(), "-", "weft"),
        "a weft has no run-in: {text}"
    );
}

#[test]
fn a_fabric_prints_back_what_it_was_given() {
    let folder = tempfile::tempdir().unwrap();
    let print = |name: &str| {
        let output = warpknit(folder.path()).args(["fabrics", name]).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    std::fs::write(folder.path().join("mine.toml"), print("power-net").replace("0.65", "0.5"))
        .unwrap();
    let once = print("mine.toml");
    assert!(once.contains("packing = 0.5"), "{once}");
    std::fs::write(folder.path().join("again.toml"), &once).unwrap();
    assert_eq!(print("again.toml"), once);
}

#[test]
fn inspect_takes_chains_as_a_swatch_does() {
    let folder = tempfile::tempdir().unwrap();
    let chains = ["--lapping", "3-4/1-0//", "--lapping", "1-0/1-2//", "-o", "satin.svg"];
    let output = warpknit(folder.path()).arg("inspect").args(chains).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success() && text.contains("bar 1: chain 3-4/1-0//"), "{text}");
    assert!(folder.path().join("satin.svg").exists());
}

#[test]
fn without_an_output_a_picture_is_named_after_the_input() {
    let folder = tempfile::tempdir().unwrap();
    warpknit(folder.path()).arg("swatch").args(SMALL).assert().success();
    let picture = image::open(folder.path().join("tricot.png")).unwrap();
    assert_eq!((picture.width(), picture.height()), (32, 24));
}

#[test]
fn what_pictures_need_is_asked_before_the_work() {
    let absent = fails(1, &["swatch", "--texture", "absent", "-o", "a.png"], |_| {});
    assert!(absent.contains("absent") && absent.lines().count() == 1, "{absent}");
    let still = fails(1, &["swatch", "--turntable", "3", "-o", "a.csv"], |_| {});
    assert!(still.contains("--turntable") && still.lines().count() == 1, "{still}");
    fails(2, &["swatch", "--samples", "2"], |_| {});
    fails(2, &["swatch", "--turntable", "0"], |_| {});
}

#[cfg(feature = "view")]
#[test]
fn the_window_refuses_what_it_has_no_use_for() {
    for flags in [
        &["--turntable", "3"][..],
        &["--renderer", "cpu"],
        &["-o", "a.png"],
        &["--texture", "absent"],
    ] {
        let arguments = [&["view", "--wales", "2", "--courses", "2"], flags].concat();
        let message = fails(1, &arguments, |_| {});
        assert!(message.starts_with("error: ") && message.lines().count() == 1, "{message}");
    }
}

#[test]
fn a_turntable_writes_pictures_from_all_around() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["swatch", "--turntable", "4", "--renderer", "cpu", "-o", "turn.png"];
    let size = ["--size", "64x48", "--wales", "10", "--courses", "8"];
    warpknit(folder.path()).args(arguments).args(size).assert().success();
    let frames = [1, 2, 3, 4].map(|frame| {
        image::open(folder.path().join(format!("turn-00{frame}.png"))).unwrap().into_rgba8()
    });
    assert!(!folder.path().join("turn.png").exists());
    let covered =
        |frame: &image::RgbaImage| frame.pixels().filter(|pixel| pixel.0 != [255; 4]).count();
    assert!(covered(&frames[0]) > 2 * covered(&frames[1]), "a swatch seen from its side is thin");
    assert!(frames[0] != frames[2] && covered(&frames[2]) > 2 * covered(&frames[3]));
}

#[test]
fn one_image_makes_ribbons_as_wide_as_yarns() {
    let folder = tempfile::tempdir().unwrap();
    image::RgbaImage::from_pixel(16, 8, image::Rgba([200, 30, 30, 255]))
        .save(folder.path().join("yarn.png"))
        .unwrap();
    let draw = |name: &str, flags: &[&str]| {
        warpknit(folder.path())
            .args(["swatch", "--renderer", "cpu", "-o", name])
            .args(SMALL)
            .args(flags)
            .assert()
            .success();
        let picture = image::open(folder.path().join(name)).unwrap().into_rgba8();
        picture.pixels().map(|pixel| f64::from(255 - pixel.0[2])).sum::<f64>()
    };
    let (tubes, ribbons) = (
        draw("tubes.png", &["--texture", "yarn.png"]),
        draw("ribbons.png", &["--texture", "yarn.png", "--shape", "ribbon"]),
    );
    assert!(ribbons > 0.8 * tubes && ribbons < 1.6 * tubes, "{ribbons} {tubes}");
}

#[test]
fn a_fabric_file_names_its_yarns_pictures() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("mine")).unwrap();
    let fabric = warpknit::fabric::Fabric::named("tricot").unwrap().to_string();
    let with = |texture: &str| {
        let text = fabric.replacen("[bars.yarn]", &format!("[bars.yarn]\n{texture}"), 1);
        assert_ne!(text, fabric, "{fabric}");
        std::fs::write(folder.path().join("mine/red.toml"), text).unwrap();
    };
    image::RgbaImage::from_pixel(16, 8, image::Rgba([200, 0, 0, 255]))
        .save(folder.path().join("mine/yarn.png"))
        .unwrap();
    let draw = |flags: &[&str]| {
        let arguments = ["swatch", "--fabric", "mine/red.toml", "--renderer", "cpu", "-o", "a.png"];
        warpknit(folder.path()).args(arguments).args(SMALL).args(flags).assert().success();
        let picture = image::open(folder.path().join("a.png")).unwrap().into_rgba8();
        picture.pixels().filter(|pixel| u32::from(pixel.0[0]) > 3 * u32::from(pixel.0[1])).count()
    };
    with("");
    assert_eq!(draw(&[]), 0);
    with("texture = \"yarn.png\"");
    let of_one_bar = draw(&[]);
    let of_all = draw(&["--texture", "mine/yarn.png"]);
    assert!(
        of_one_bar > 20 && of_all > of_one_bar + 20,
        "the path starts from the file's folder: {of_one_bar} {of_all}"
    );
    // The pictures of a fine yarn on a thick one: ribbons would be threads.
    let thin = "texture = \"yarn.png\"\ntexture_length = 0.02";
    with(thin);
    let arguments = ["swatch", "--fabric", "mine/red.toml", "--shape", "ribbon", "-o", "b.png"];
    let output =
        warpknit(folder.path()).args(arguments).args(SMALL).assert().success().get_output().clone();
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(
        message.contains("warning: bar 1: its pictures are of a yarn 0.01 mm wide"),
        "{message}"
    );
    with("texture = \"absent\"");
    let output = warpknit(folder.path())
        .args(["swatch", "--fabric", "mine/red.toml"])
        .args(SMALL)
        .assert()
        .code(1)
        .get_output()
        .clone();
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(
        message.contains("the yarn of bar 1: ") && message.contains("mine/absent"),
        "{message}"
    );
}

#[test]
fn bench_prints_the_papers_table() {
    let output = warpknit(Path::new("."))
        .args(["bench", "--weft", "--runs", "1", "--quiet"])
        .assert()
        .success()
        .stderr("")
        .get_output()
        .clone();
    let table = String::from_utf8(output.stdout).unwrap();
    let rows: Vec<Vec<&str>> =
        table.lines().skip(2).map(|row| row.split_whitespace().collect()).collect();
    assert_eq!(rows.len(), 9, "{table}");
    for row in &rows {
        let number =
            |column: usize| row[column].parse::<f64>().unwrap_or_else(|_| panic!("{table}"));
        let (side, segments) = (number(0), number(3));
        assert_eq!(number(4), side * (side * segments + 1.0) * 6.0, "vertices: {table}");
        assert!(number(5) > 0.0 && number(6) <= number(5) && number(5) <= number(7), "{table}");
    }
    fails(2, &["bench", "--sr", "2"], |_| {});
}
