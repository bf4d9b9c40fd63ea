//! Pages, opened in a browser without a window and used by a script: they draw, turn, zoom, hide bars
//! and magnify, without an error and without fetching anything.
//!
//! Without Chromium the test is skipped, except in `.ci/run`.

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex, mpsc};
use std::time::Duration;

use crate::cli::warpknit;
use crate::drape::mesh;

/// How long a page may take on a busy machine.
const LONGEST: Duration = Duration::from_secs(300);

/// The browser's name. `None` where there is none.
fn chromium() -> Option<&'static str> {
    ["chromium", "chromium-browser", "google-chrome"].into_iter().find(|name| {
        let mut command = Command::new(name);
        command.arg("--version").stdout(Stdio::null()).stderr(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    })
}

/// What the probe found in a page, as words.
fn probed(browser: &str, folder: &Path, page: &str) -> String {
    let text = std::fs::read_to_string(folder.join(page)).unwrap();
    let probe = include_str!("../readers/page_probe.js");
    let probed = text.replace("</body>", &format!("<script>\n{probe}</script>\n</body>"));
    let path = folder.join(format!("probed-{page}"));
    std::fs::write(&path, probed).unwrap();
    let child = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-logging=stderr"])
        .args(["--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--window-size=700,500"])
        .args(["--disable-dev-shm-usage", "--disable-background-timer-throttling"])
        .arg(format!("--user-data-dir={}", folder.join("profile").display()))
        .arg(format!("file://{}", path.display()))
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let child = Arc::new(Mutex::new(child));
    let errors = BufReader::new(child.lock().unwrap().stderr.take().unwrap());
    // A browser that says nothing is ended, and its lines then end too.
    let watched = Arc::clone(&child);
    let (done, is_done) = mpsc::channel::<()>();
    let watch = std::thread::spawn(move || {
        let _ = is_done.recv_timeout(LONGEST);
        let mut child = watched.lock().unwrap();
        let _ = child.kill();
        let _ = child.wait();
    });
    let mut all = String::new();
    let lines = errors.lines().map_while(Result::ok);
    let found = lines.into_iter().find_map(|line| {
        let found = line.split_once("probe: ").map(|(_, rest)| rest.to_owned());
        all += &format!("{line}\n");
        found
    });
    drop(done);
    watch.join().unwrap();
    let found = found.unwrap_or_else(|| panic!("{page}: the probe did not end\n{all}"));
    found.split_once('"').map_or(found.clone(), |(found, _)| found.to_owned())
}

#[test]
fn a_browser_draws_turns_and_magnifies_pages_and_fetches_nothing() {
    let Some(browser) = chromium() else {
        assert!(std::env::var_os("WARPKNIT_CI").is_none(), "no Chromium here");
        println!("skipped: no Chromium here");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let garment = [mesh("pinch_flat.obj"), mesh("pinch_draped.obj")];
    let drape = ["--wales-per-cm", "1", "--courses-per-cm", "1.5", "-o", "garment.html"];
    warpknit(folder.path()).arg("drape").args(&garment).args(drape).assert().success();
    // Black, so that what is light is the ground.
    let net = warpknit(folder.path()).args(["fabrics", "hex-net-5"]).output().unwrap().stdout;
    let net = String::from_utf8(net).unwrap();
    let black = net.replace("#ece4d4", "#000000").replace("#7d8f69", "#000000");
    std::fs::write(folder.path().join("black.toml"), black).unwrap();
    for (fabric, side, page) in [
        ("locknit", "8", "warp.html"),
        ("cable", "8", "weft.html"),
        ("tricot", "160", "large.html"),
        ("black.toml", "120", "sheer.html"),
    ] {
        let swatch = ["swatch", "--fabric", fabric, "--wales", side, "--courses", side, "-o", page];
        warpknit(folder.path()).args(swatch).assert().success();
    }
    for page in ["garment.html", "warp.html", "weft.html", "large.html", "sheer.html"] {
        let found = probed(browser, folder.path(), page);
        for expected in [
            "draws=true",
            "sharpens=true",
            "turns=true",
            "returns=true",
            "hides=true",
            "magnifies=true",
            "zooms=true",
            "fetched=0",
            "error=none",
            "gl_error=0",
            "errors=none",
        ] {
            assert!(found.split(' ').any(|word| word == expected), "{page}: {expected}: {found}");
        }
        assert!(!found.contains("facts=0"), "{page}: {found}");
        let number = |name: &str| {
            let value = found.split(' ').find_map(|word| word.strip_prefix(name));
            value.and_then(|number| number.parse::<u32>().ok()).unwrap_or(u32::MAX)
        };
        match page {
            // Its loops are finer than pixels: each part of it then has the colour of the whole.
            "large.html" => assert!(number("uneven=") <= 12, "{page}: {found}"),
            // Its yarns are a fifth of a pixel wide, and cover a fifth of the cloth.
            "sheer.html" => assert!(number("stops=").abs_diff(20) <= 1, "{page}: {found}"),
            _ => {}
        }
    }
}

/// A page that no browser could show is refused before anything is knitted.
#[test]
fn more_stitches_than_a_page_holds_are_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let run = ["swatch", "--wales", "800", "--courses", "700", "-o", "big.html"];
    let output = warpknit(folder.path()).args(run).assert().code(1).get_output().clone();
    let said = String::from_utf8(output.stderr).unwrap();
    let last = said.lines().last().unwrap_or_default();
    assert!(last.starts_with("error: big.html: 1120000 stitches are over the 500000"), "{said}");
    assert!(!folder.path().join("big.html").exists());
}
