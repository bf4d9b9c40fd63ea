//! Malformed input: always one line that names the file, and the line where there is one; never a
//! panic.

use std::io::Write;
use std::path::Path;

use proptest::prelude::*;
use warpknit::garment::{ReadOptions, read};

const HEAD: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n";

/// Reads `text` as one file and asserts its error: one line, the file's name, the line (0: none),
/// and `says`.
fn check(what: &str, text: &[u8], line: u64, says: &str) {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let path = folder.path().join("garment.obj");
    std::fs::write(&path, text).expect("a temporary file can be written");
    check_path(what, &path, None, line, says);
}

fn check_path(what: &str, path: &Path, draped: Option<&Path>, line: u64, says: &str) {
    let error = match read(path, draped, &ReadOptions::default()) {
        Err(error) => error.to_string(),
        Ok(garment) => panic!("{what}: read as {:?}", garment.summary),
    };
    let place = match line {
        0 => "garment.obj".to_owned(),
        line => format!("garment.obj:{line}: "),
    };
    assert!(error.contains(&place), "{what}: no `{place}` in: {error}");
    assert!(error.contains(says), "{what}: no `{says}` in: {error}");
    assert!(!error.contains(['\n', '\r']), "{what}: more than one line: {error:?}");
    check_command(what, path, draped, &error);
}

/// The command says the same in one line, ends with 1 and leaves no output.
fn check_command(what: &str, path: &Path, draped: Option<&Path>, error: &str) {
    let outputs = tempfile::tempdir().expect("a temporary folder can be made");
    let mut command =
        assert_cmd::Command::cargo_bin("warpknit").expect("cargo builds it for tests");
    command
        .current_dir(outputs.path())
        .arg("drape")
        .arg(path)
        .args(draped)
        .args(["-o", "a.png", "-o", "a.glb", "-o", "a.json"]);
    let output = command.output().expect("the command starts");
    assert_eq!((output.status.code(), output.stdout.len()), (Some(1), 0), "{what}");
    assert_eq!(String::from_utf8_lossy(&output.stderr), format!("error: {error}\n"), "{what}");
    assert_eq!(
        std::fs::read_dir(outputs.path()).expect("it is there").count(),
        0,
        "{what}: something was left behind"
    );
}

#[test]
fn a_bad_record_is_named_with_its_line() {
    // What is wrong, the record after HEAD's six lines, and what the message says. All of them
    // stand on line 7.
    let records = [
        ("a NaN", "v nan 0 0", "not finite"),
        ("a signed NaN", "v 0 -NaN 0", "not finite"),
        ("Microsoft's NaN", "v 0 -1.#IND00 0", "not finite"),
        ("Microsoft's infinity", "vt 1.#INF 0", "not finite"),
        ("an infinity", "v 0 0 inf", "not finite"),
        ("a negative infinity", "vt -Infinity 0", "not finite"),
        ("an overflow", "v 1e999 0 0", "not finite"),
        ("a NaN colour", "v 0 0 0 1 nan 1", "not finite"),
        ("a word", "v one 0 0", "no number"),
        ("a decimal comma", "v 0,5 0 0", "no number"),
        ("a lone exponent", "v 1e 0 0", "no number"),
        ("a hexadecimal", "vt 0x10 0", "no number"),
        ("a control character", "v 1\u{7}2 0 0", "\\u{7}"),
        ("an endless token", &format!("v {} 0 0", "x".repeat(500_000)), "…"),
        ("no coordinates", "v", "holds 0 numbers"),
        ("two coordinates", "v 0 0", "holds 2 numbers"),
        ("coordinates cut by a comment", "v 0 0 # 0", "holds 2 numbers"),
        ("eight coordinates", "v 1 2 3 4 5 6 7 8", "holds 8 numbers"),
        ("no texture coordinates", "vt", "holds 0 numbers"),
        ("four texture coordinates", "vt 1 2 3 4", "holds 4 numbers"),
        ("index 0", "f 0 1 2", "index 0"),
        ("texture index 0", "f 1/0 2/2 3/3", "index 0"),
        ("an index out of range", "f 1 2 4", "`v` number 4, but there are 3"),
        ("a texture index out of range", "f 1/1 2/2 3/9", "`vt` number 9, but there are 3"),
        ("a huge index", "f 1 2 4294967297", "number 4294967297"),
        ("an index over 64 bits", "f 1 2 99999999999999999999999", "number 9223372036854775807"),
        ("a negative index out of range", "f -1 -2 -4", "number -4, but there are 3"),
        (
            "a huge negative index",
            "f -1 -2 -99999999999999999999999",
            "number -9223372036854775807",
        ),
        ("a negative texture index out of range", "f 1/-1 2/-2 3/-5", "`vt` number -5"),
        ("no corners", "f", "0 corners"),
        ("one corner", "f 1/1", "1 corner,"),
        ("two corners", "f 1/1 2/2", "2 corners"),
        ("a letter for a texture index", "f 1/a 2/2 3/3", "\"1/a\""),
        ("a letter for a normal", "f 1/1/n 2/2 3/3", "\"1/1/n\""),
        ("a letter for a vertex", "f a b c", "\"a\""),
        ("a corner with four parts", "f 1/1/1/1 2/2 3/3", "\"1/1/1/1\""),
        ("a corner without vertex", "f /1 2/2 3/3", "\"/1\""),
        ("a corner cut off", "f 1/1 2/2 3/", "\"3/\""),
        ("a fraction for an index", "f 1.5 2 3", "\"1.5\""),
        ("a lone sign", "f 1 2 -", "\"-\""),
        ("backslash in a corner", "f 1\\1 2 3", "corner"),
        ("a bad continuation", "f 1 2 \\\nx", "\"x\""),
        ("bytes for a corner", "f 1 2 \u{0}", "\\0"),
    ];
    for (what, record, says) in records {
        for end in ["", "\n", "\r\n"] {
            check(what, format!("{HEAD}{record}{end}").as_bytes(), 7, says);
        }
        check(
            what,
            format!("\u{feff}# a comment\r\n\r\n{HEAD}{record}\nf 1/1 2/2 3/3\n").as_bytes(),
            9,
            says,
        );
    }
    check(
        "bytes that aren't UTF-8",
        &[HEAD.as_bytes(), b"v \xFF\xFE 0 0\n"].concat(),
        7,
        "no number",
    );
}

#[test]
fn the_first_bad_index_is_named_though_others_follow() {
    let text = format!("f 1/1 2/2 3/3\nf 3/3 4/2 1/1\nf 9/3 8/1 7/2\n{HEAD}");
    check("indices before the vertices", text.as_bytes(), 2, "number 4");
}

#[test]
fn files_that_are_no_mesh_are_named() {
    check("an empty file", b"", 0, "empty");
    check("blanks", b"  \n\t\n\r\n   ", 0, "no OBJ");
    check("a comment", b"# nothing", 0, "no OBJ");
    check("a mark alone", b"\xEF\xBB\xBF", 0, "no OBJ");
    check("a picture", b"\x89PNG\r\n\x1A\n\0\0\0\rIHDR\0\0\x01\0", 0, "this is a picture");
    check("FBX", b"Kaydara FBX Binary  \0", 0, "this is FBX; export OBJ, GLB, USD or PLY");
    check("UTF-16", b"\xFF\xFEv\0 \x000\0 \x000\0 \x000\0\n\0", 0, "UTF-16");
    check(
        "a PLY file",
        b"ply\nformat ascii 1.0\nelement vertex 3\nend_header\n0 0 0\n",
        0,
        "vertex 0 is cut off",
    );
    check("texture alone", b"vt 0 0\nvt 1 0\n", 0, "no OBJ");
    check("vertices alone", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2 3\n", 0, "3 points and no face");
    check("faces alone", b"f 1 2 3\n", 1, "there are 0");
    check("no vt", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", 0, "export it with UVs");
    check("vt that no face uses", format!("{HEAD}f 1 2 3\n").as_bytes(), 0, "holds 3 `vt`");
    check("one vt for all", format!("{HEAD}f 1/1 2/1 3/1\n").as_bytes(), 0, "no flat area");
    check("one v for all", format!("{HEAD}f 1/1 1/2 1/3\n").as_bytes(), 0, "no draped area");
    let immense = format!("{HEAD}v 1e200 0 0\nf 1/1 4/2 3/3\n");
    check("a coordinate that overflows areas", immense.as_bytes(), 8, "over the limit");
    let minute = HEAD.replace("v 1", "v 1e-300").replace("v 0 1", "v 0 1e-300");
    check(
        "a garment smaller than an atom",
        format!("{minute}f 1/1 2/2 3/3\n").as_bytes(),
        0,
        "no draped area",
    );
    let noise: Vec<u8> =
        (0..3_000_000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8 | 0x80).collect();
    check("noise without line ends", &noise, 1, "longer than");
}

#[test]
fn a_file_cut_anywhere_reads_or_says_why_not() {
    let text = format!("{HEAD}v 1.25 1e0 0\nvt 1 1\nf 1/1 2/2 3/3\nf -3/-3 -2/-2 -1/-1\n");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("garment.obj");
    let mut errors = 0;
    for length in 0..text.len() {
        std::fs::write(&path, &text[..length]).unwrap();
        if let Err(error) = read(&path, None, &ReadOptions::default()) {
            let error = error.to_string();
            assert!(
                error.contains("garment.obj") && !error.contains('\n'),
                "cut at {length}: {error}"
            );
            errors += 1;
        }
    }
    // Up to the first face's last corner nothing can be read; after it the cut shows only inside of
    // the second face.
    assert!(errors > text.find("\nf -3").unwrap() - 2, "{errors}");
}

#[test]
fn a_line_of_200_megabytes_is_an_error_and_not_held() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("garment.obj");
    let mut file = std::fs::File::create(&path).unwrap();
    write!(file, "{HEAD}f").unwrap();
    // A hole in the file: 200 MB of zero bytes that take no disk.
    file.set_len(200_000_000).unwrap();
    check_path("a hole", &path, None, 7, "longer than 1048576 bytes");
    std::fs::write(&path, format!("{HEAD}f 1/1{}", " \\\n 2/2 ".repeat(300_000))).unwrap();
    check_path("endless continuations", &path, None, 7, "longer than 1048576 bytes");
}

#[test]
fn what_is_no_readable_file_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("garment.obj");
    check_path("a missing file", &path, None, 0, "cannot be opened");
    std::fs::create_dir(&path).unwrap();
    let good = folder.path().join("good.obj");
    std::fs::write(&good, format!("{HEAD}f 1/1 2/2 3/3\n")).unwrap();
    for (flat, draped) in [(&path, None), (&good, Some(path.as_path()))] {
        let error = read(flat, draped, &ReadOptions::default()).unwrap_err().to_string();
        assert_eq!(error, format!("{}: is a directory: give a file", path.display()));
        // A folder may hold the frames of a sequence, and this one has none.
        check_command(
            "an empty folder",
            flat,
            draped,
            &format!(
                "{}: there is no .obj, .glb, .usd or .ply file in this folder",
                path.display()
            ),
        );
    }
}

#[cfg(unix)]
#[test]
fn a_file_without_permission_is_named() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("garment.obj");
    std::fs::write(&path, "v 0 0 0").unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o000)).unwrap();
    if std::fs::File::open(&path).is_ok() {
        // Permissions don't bind root; then the file is read, and has no face.
        check_path("no permission, as root", &path, None, 0, "no face");
    } else {
        check_path("no permission", &path, None, 0, "cannot be opened");
    }
}

#[test]
fn files_that_do_not_pair_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let (flat, draped) = (folder.path().join("garment.obj"), folder.path().join("draped.obj"));
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    let pairs = [
        ("fewer faces", "f 1 2 3\nf 1 3 4\n", "f 1 2 3\n", "first that differs is face 2"),
        (
            "a quad for two triangles",
            "f 1 2 3\nf 1 3 4\n",
            "f 1 2 3 4\n",
            "first that differs is face 1",
        ),
        (
            "another polygon",
            "f 1 2 3\nf 1 2 3 4\n",
            "f 1 2 3\nf 1 3 4\n",
            "first that differs is face 2",
        ),
        ("other corners", "f 1 2 3\nf 1 3 4\n", "f 1 2 3\nf 3 4 1\n", "disagree"),
    ];
    for (what, flat_faces, draped_faces, says) in pairs {
        std::fs::write(&flat, format!("{square}{flat_faces}")).unwrap();
        std::fs::write(&draped, format!("{square}{draped_faces}")).unwrap();
        check_path(what, &flat, Some(&draped), 0, says);
        check_path(what, &flat, Some(&draped), 0, "draped.obj has");
    }
    std::fs::write(&draped, "v 0 0 0\nf 1 2 3\n").unwrap();
    let error = read(&flat, Some(&draped), &ReadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("draped.obj:2: "), "{error}");
}

#[test]
fn options_out_of_range_are_named() {
    let path = Path::new("garment.obj");
    for uv_scale in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e300] {
        let error =
            read(path, None, &ReadOptions { uv_scale: Some(uv_scale), ..Default::default() })
                .unwrap_err();
        assert!(error.to_string().starts_with("--uv-scale is"), "{error}");
    }
    let error =
        read(path, None, &ReadOptions { grain: f64::NAN, ..Default::default() }).unwrap_err();
    assert!(error.to_string().starts_with("--grain is"), "{error}");
}

/// Reads bytes as one file and as both of a pair; whatever comes of it is sound.
fn survives(bytes: &[u8]) -> Result<(), TestCaseError> {
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let path = folder.path().join("garment.obj");
    std::fs::write(&path, bytes).expect("a temporary file can be written");
    for (draped, turn) in [(None, true), (Some(path.as_path()), false)] {
        match read(&path, draped, &ReadOptions { turn, ..Default::default() }) {
            Err(error) => {
                let error = error.to_string();
                prop_assert!(error.contains("garment.obj") && !error.contains('\n'), "{}", error);
            }
            Ok(garment) => {
                prop_assert!(!garment.panels.is_empty());
                for panel in &garment.panels {
                    prop_assert!(
                        panel.uv.iter().all(|p| p.is_finite())
                            && panel.draped.iter().all(|p| p.is_finite())
                    );
                    prop_assert!(panel.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-9));
                    prop_assert!(panel.area() > 0.0 && panel.area().is_finite());
                }
            }
        }
    }
    Ok(())
}

/// Words that OBJ files are made of, and some that they are not.
fn word() -> impl Strategy<Value = String> {
    let fixed = [
        "v",
        "vt",
        "vn",
        "f",
        "o",
        "g",
        "s",
        "l",
        "usemtl",
        "\n",
        "\n",
        "\n",
        "\r\n",
        "\\\n",
        "\\",
        "#",
        "1//",
        "1/",
        "-1/-1",
        "nan",
        "1e308",
        "1e-308",
        "1e12",
        "-0",
        "\u{feff}",
        "\0",
        "v 0 0 0\n",
        "v 1 0 0\n",
        "v 0 1 0\n",
        "v 1 1 1e-9\n",
        "vt 0 0\n",
        "vt 1 0\n",
        "vt 0 1\n",
        "vt 1 1e-15\n",
        "f 1/1 2/2 3/3\n",
        "f 1 2 3\n",
        "f -1/-1 -2/-2 -3/-3\n",
        "f 1/2 2/3 3/4 4/1 1/1\n",
        "g a\n",
        "o b\n",
    ];
    prop_oneof![
        6 => prop::sample::select(fixed.to_vec()).prop_map(str::to_owned),
        2 => (-3_i64..9).prop_map(|index| index.to_string()),
        2 => (1_u8..9, 1_u8..9).prop_map(|(v, vt)| format!("{v}/{vt}")),
        1 => any::<f64>().prop_map(|number| number.to_string()),
    ]
}

proptest! {
    #[test]
    fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        survives(&bytes)?;
    }

    #[test]
    fn token_soup_never_panics(words in prop::collection::vec(word(), 0..80), sound: bool) {
        let head = if sound { "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvt 1 1\nf 1/1 2/2 3/3\n" } else { "" };
        survives(format!("{head}{}", words.join(" ")).as_bytes())?;
    }
}
