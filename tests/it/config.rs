//! `warpknit.toml` of the working folder, completions and manual pages.

use std::path::Path;

use assert_cmd::Command;

fn run(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output = Command::cargo_bin("warpknit")
        .unwrap()
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap(), text(&output.stdout), text(&output.stderr))
}

fn fabric_of(folder: &Path, arguments: &[&str]) -> (String, u64) {
    let all =
        [&["swatch", "--wales", "3", "--courses", "3", "-o", "r.json", "--quiet"][..], arguments]
            .concat();
    let (code, _, told) = run(folder, &all);
    assert_eq!(code, 0, "{told}");
    let report: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.join("r.json")).unwrap()).unwrap();
    (report["fabric"].as_str().unwrap().to_owned(), report["surface"]["st"].as_u64().unwrap())
}

#[test]
fn a_file_in_the_folder_sets_defaults_and_the_command_line_goes_before_it() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    assert_eq!(fabric_of(folder, &[]), ("tricot".to_owned(), 10));
    std::fs::write(
        folder.join("warpknit.toml"),
        "fabric = \"locknit\"\nst = 7\nquiet = true\n\n[swatch]\nst = 8\n\n[yarn]\ndpi = 600.0\n",
    )
    .unwrap();
    assert_eq!(
        fabric_of(folder, &[]),
        ("locknit".to_owned(), 8),
        "a command's own table goes before what is for all"
    );
    assert_eq!(fabric_of(folder, &["--fabric", "satin", "--st", "9"]), ("satin".to_owned(), 9));
    assert_eq!(fabric_of(folder, &["--no-config"]), ("tricot".to_owned(), 10));
    let (code, help, _) = run(folder, &["swatch", "--help"]);
    assert!(
        code == 0 && help.contains("[default: locknit]"),
        "help tells the defaults that hold here"
    );
    // What is given stands in for what the file has of it; `inspect` is not asked about the file's
    // fabric.
    std::fs::write(
        folder.join("warpknit.toml"),
        "lapping = \"1-0/1-2//\"\neye = \"0,0,90\"\nlook-at = \"0,0,0\"\n",
    )
    .unwrap();
    assert_eq!(fabric_of(folder, &["--fabric", "satin"]).0, "satin");
    let picture = |flags: &[&str]| {
        let all = [
            &[
                "swatch",
                "--fabric",
                "tricot",
                "--size",
                "64x48",
                "--renderer",
                "cpu",
                "-o",
                "p.png",
            ][..],
            flags,
        ]
        .concat();
        assert_eq!(run(folder, &all).0, 0);
        std::fs::read(folder.join("p.png")).unwrap()
    };
    assert!(
        picture(&["--view", "back"]) == picture(&["--view", "back", "--no-config"])
            && picture(&[]) != picture(&["--no-config"])
    );
    let mesh = Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes/tshirt.obj");
    std::fs::write(folder.join("warpknit.toml"), "fabric = \"locknit\"\n").unwrap();
    let (code, told, _) = run(folder, &["inspect", mesh.to_str().unwrap(), "-o", "sheet.svg"]);
    assert!(code == 0 && told.contains("pairs: yes") && !told.contains("locknit"), "{told}");
    std::fs::write(folder.join("warpknit.toml"), "fabric = \n").unwrap();
    assert_eq!(run(folder, &["swatch", "--help"]).0, 0, "help is there for whoever mends the file");
    // Several values, and a flag without one.
    std::fs::write(
        folder.join("warpknit.toml"),
        "lapping = [\"1-0/1-2//\", \"1-2/1-0//\"]\ncaps = true\n",
    )
    .unwrap();
    assert_eq!(fabric_of(folder, &[]).0, "1-0/1-2// + 1-2/1-0//");
}

#[test]
fn what_is_wrong_with_the_file_is_told_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (text, line, part) in [
        ("fabric = \"tricot\"\nfabrik = \"satin\"\n", 2, "no command has a flag --fabrik"),
        ("[swatch]\nfps = 3\n", 2, "swatch does not have a flag --fps"),
        ("\n[sweater]\nst = 3\n", 3, "there is no command sweater"),
        ("st = \"many\"\n", 1, "invalid value 'many' for '--st <N>'"),
        ("size = [\"3x3\", \"4x4\"]\n", 1, "--size of drape takes one value"),
        ("quiet = \"loudly\"\n", 1, "--quiet of drape takes no value"),
        ("st = 1979-05-27\n", 1, "st is no value of a flag"),
        ("st = \n", 1, ""),
    ] {
        std::fs::write(folder.join("warpknit.toml"), text).unwrap();
        let (code, out, told) = run(folder, &["swatch", "-o", "a.csv"]);
        assert_eq!((code, out.as_str()), (1, ""), "{text}");
        assert!(
            told.starts_with(&format!("error: warpknit.toml:{line}: ")) && told.contains(part),
            "{text}: {told}"
        );
        assert_eq!(told.lines().count(), 1, "{told}");
        assert!(!folder.join("a.csv").exists());
    }
    // Wrong usage is wrong usage whatever the file says.
    std::fs::write(folder.join("warpknit.toml"), "fabric = \"locknit\"\n").unwrap();
    assert_eq!(run(folder, &["swatch", "--st", "0"]).0, 2);
}

#[test]
fn shells_and_man_learn_every_command_and_flag() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let (code, script, _) = run(folder.path(), &["completions", shell]);
        assert!(
            code == 0 && script.contains("swatch") && script.contains("wales-per-cm"),
            "{shell}"
        );
    }
    let (code, page, _) = run(folder.path(), &["man"]);
    assert!(code == 0 && page.contains(".TH warpknit 1") && page.contains("drape"), "{page}");
    let (code, page, _) = run(folder.path(), &["man", "drape"]);
    assert!(
        code == 0 && page.contains("wales\\-per\\-cm") && page.contains("warpknit\\-drape"),
        "{page}"
    );
    assert_eq!(run(folder.path(), &["man", "knit"]).0, 1);
    // Every command has examples.
    let (_, help, _) = run(folder.path(), &["--help"]);
    let commands = help.split("Commands:").nth(1).unwrap().split("Options:").next().unwrap();
    for command in commands
        .lines()
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
    {
        let (_, help, _) = run(folder.path(), &[command, "--help"]);
        assert!(help.contains("Examples:\n  warpknit "), "{command}");
    }
}
