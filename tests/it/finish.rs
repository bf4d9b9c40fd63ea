//! Yarn counts, run-ins, drafts and finishing, from the command line and from fabric files to the
//! report.

use warpknit::fabric::Fabric;

use crate::cli::{SMALL, fails, warpknit};

#[test]
fn run_ins_and_counts_that_fit_no_bar_are_refused() {
    let run_in = fails(2, &["swatch", "--run-in", "1,240"], |_| {});
    assert!(
        run_in.starts_with(
            "error: invalid value '1,240' for '--run-in <MM>': write mm a rack of 480 courses, such as \
             1240, or - for a bar that keeps its own"
        ),
        "{run_in}"
    );
    for (arguments, message) in [
        (&["--run-in", "-", "--run-in", "-", "--run-in", "9"][..], "--run-in is given 3 times"),
        (&["--run-in", "1e9"], "--run-in of bar 1 is 1000000000, but must be between 1 and"),
        (&["--fabric", "jersey", "--run-in", "900"], "a weft knit has no --run-in"),
        (
            &["--lapping", "1-0/0-1", "--lapping", "weft", "--run-in", "-", "--run-in", "9"],
            "bar 2:",
        ),
        (&["--lapping", "1-0/0-1", "--count", "1 tex", "--count", "2 tex"], "--count is given 2"),
    ] {
        let text = fails(1, &[&["swatch"], arguments].concat(), |_| {});
        assert!(text.starts_with(&format!("error: {message}")), "{arguments:?}: {text}");
        assert_eq!(text.lines().count(), 1, "{text}");
    }
}

#[test]
fn a_try_on_the_command_line_becomes_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let printed = |arguments: &[&str]| {
        let output = warpknit(folder.path()).arg("fabrics").args(arguments).output().unwrap();
        assert!(output.status.success(), "{arguments:?}");
        Fabric::parse(&String::from_utf8(output.stdout).unwrap()).unwrap()
    };
    let named = Fabric::named("locknit").unwrap();
    let tried = printed(&["locknit", "--run-in", "-", "--run-in", "1100", "--count", "176 dtex"]);
    let bars = &tried.warp_knit().unwrap().bars;
    assert_eq!((bars[0].run_in, bars[1].run_in), (None, Some(1100.0)));
    assert!((tried.wales_per_cm - named.wales_per_cm / 2.0).abs() < 1e-9);
    let chain = printed(&["--lapping", "3-4/1-0//", "--run-in", "1800"]);
    assert_eq!(chain.lapping(0), "3-4/1-0//");
    assert_eq!(chain.warp_knit().unwrap().bars[0].run_in, Some(1800.0));
}

#[test]
fn a_cover_far_from_the_fabrics_is_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let warned = |arguments: &[&str]| {
        let mut command = warpknit(folder.path());
        command.args(["swatch", "--fabric", "locknit", "-o", "a.json"]).args(SMALL);
        let output = command.args(arguments).output().unwrap();
        assert!(output.status.success(), "{arguments:?}");
        String::from_utf8(output.stderr).unwrap().contains("yarns of these counts cover")
    };
    let own = ["--wales-per-cm", "14.6", "--courses-per-cm", "21.74"];
    assert!(warned(&[&own[..], &["--count", "78 dtex"]].concat()));
    assert!(!warned(&[&own[..], &["--count", "33 dtex"]].concat()));
    assert!(!warned(&["--count", "78 dtex"]));
    assert!(!warned(&["--wales-per-cm", "2"]));
}

#[test]
fn the_report_has_the_machine_and_the_relaxed_length_where_they_are_given() {
    let folder = tempfile::tempdir().unwrap();
    let report = |fabric: &str| -> serde_json::Value {
        std::fs::write(folder.path().join("f.toml"), fabric).unwrap();
        let mut command = warpknit(folder.path());
        command.args(["swatch", "--fabric", "f.toml", "-o", "a.json"]).args(SMALL);
        command.assert().success();
        serde_json::from_slice(&std::fs::read(folder.path().join("a.json")).unwrap()).unwrap()
    };
    let text = Fabric::named("power-net").unwrap().to_string();
    let plain = report(&text.replace("draft = 2.5\n", ""));
    assert_eq!(plain.get("machine"), None);
    let finish = "[finish]\nwidth_shrink = 0.25\nlength_shrink = 0.1\n\n[[bars]]";
    let text = text.replacen("[[bars]]", finish, 1);
    let finished = report(&text);
    let number =
        |report: &serde_json::Value, path: &str| report.pointer(path).unwrap().as_f64().unwrap();
    let near = |path: &str, expected: f64| {
        let found = number(&finished, path);
        assert!((found - expected).abs() < 1e-6 * expected, "{path}: {found} {expected}");
    };
    near("/machine/wales_per_cm", 13.0 * 0.75);
    near("/machine/gauge", 13.0 * 0.75 * 2.54);
    near("/machine/courses_per_cm", 19.0 * 0.9);
    near("/machine/width_shrink", 0.25);
    near("/machine/length_shrink", 0.1);
    assert_eq!(
        finished.pointer("/cloth/relaxed_run_in_mm_per_rack/0"),
        Some(&serde_json::Value::Null)
    );
    let fed = number(&finished, "/cloth/run_in_mm_per_rack/2");
    near("/cloth/relaxed_run_in_mm_per_rack/2", fed / 2.5);
    assert!(number(&finished, "/cloth/mass_g_m2") < number(&plain, "/cloth/mass_g_m2"));
}
