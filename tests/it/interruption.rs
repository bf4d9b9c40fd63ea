//! Runs that are cut off: by signals, by a full disk, in a folder that can't be written. Old files
//! stay whole, new ones are whole or not there, and no temporary file is left.
//!
//! What a machine doesn't allow (mounting a small disk of one's own) is said to be skipped, and
//! stands beside a test of the same that always runs.

use std::collections::BTreeMap;
use std::os::unix::process::ExitStatusExt as _;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

use crate::drape::mesh;

/// What a folder holds, folders in it included.
type Files = BTreeMap<String, Vec<u8>>;

fn files(folder: &Path) -> Files {
    let mut files = Files::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(at) = folders.pop() {
        for entry in std::fs::read_dir(at).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path.clone());
            }
            let bytes = if path.is_dir() { Vec::new() } else { std::fs::read(&path).unwrap() };
            files.insert(path.strip_prefix(folder).unwrap().display().to_string(), bytes);
        }
    }
    files
}

/// Counts the temporary files and folders, in folders too, by their names alone: a living run may
/// remove one at any time.
fn temporaries(folder: &Path) -> usize {
    let Ok(entries) = std::fs::read_dir(folder) else { return 0 };
    let mut count = 0;
    for path in entries.map(|entry| entry.unwrap().path()) {
        count += usize::from(path.to_string_lossy().contains(".warpknit-"));
        count += if path.is_dir() { temporaries(&path) } else { 0 };
    }
    count
}

/// A run that takes some time, and what it leaves when nothing disturbs it.
struct Subject {
    arguments: Vec<String>,
    /// What is there before.
    old: Files,
    /// What is there after.
    whole: Files,
    takes: Duration,
}

/// How garments are knitted and drawn. No strains are solved, which would take nearly all of the
/// time.
const DRAWING: [&str; 6] = ["--wales-per-cm", "1", "--renderer", "cpu", "--mapping", "smooth"];

impl Subject {
    fn new(arguments: &[&str], old: Files) -> Self {
        let arguments = arguments.iter().map(|argument| (*argument).to_owned()).collect();
        let mut subject = Self { arguments, old, whole: Files::new(), takes: Duration::ZERO };
        let folder = subject.folder();
        let begun = Instant::now();
        assert!(subject.start(folder.path()).wait().unwrap().success());
        subject.takes = begun.elapsed();
        subject.whole = files(folder.path());
        subject
    }

    /// Yarns on a garment, in three formats.
    fn drape() -> Self {
        let [flat, draped] =
            ["pinch_flat.obj", "pinch_draped.obj"].map(|name| mesh(name).display().to_string());
        let outputs = ["--size", "320x240", "-o", "x.glb", "-o", "x.png", "-o", "x.csv"];
        let old = ["x.glb", "x.png", "x.csv"]
            .map(|name| (name.to_owned(), format!("old {name}").into_bytes()));
        Self::new(&[&["drape", &flat, &draped], &DRAWING[..], &outputs].concat(), old.into())
    }

    /// A sequence of three frames: files of one frame, with companions, and one of all, which keeps
    /// what it has in a file of its own meanwhile.
    fn sequence() -> Self {
        let [flat, draped] =
            ["pinch_flat.obj", "pinch_draped.obj"].map(|name| mesh(name).display().to_string());
        let outputs = ["--size", "160x120", "-o", "x.obj", "-o", "x.usda", "-o", "x.png"];
        let numbered = (1..=3)
            .flat_map(|frame| ["obj", "mtl", "png"].map(|end| format!("x-{frame:03}.{end}")));
        let old = numbered
            .chain(["x.usda".to_owned()])
            .map(|name| (name.clone(), format!("old {name}").into_bytes()));
        let subject = Self::new(
            &[&["drape", &flat, &draped, &draped, &draped], &DRAWING[..], &outputs].concat(),
            old.collect(),
        );
        assert_eq!(
            subject.old.keys().collect::<Vec<_>>(),
            subject.whole.keys().collect::<Vec<_>>(),
            "each file was there before"
        );
        subject
    }

    /// A yarn's maps in a folder, which is there already or not.
    fn yarn(photo: &Path, old: Files) -> Self {
        Self::new(&["yarn", photo.to_str().unwrap(), "-o", "maps"], old)
    }

    fn folder(&self) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, bytes) in &self.old {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, bytes).unwrap();
        }
        folder
    }

    fn start(&self, folder: &Path) -> Child {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("warpknit"));
        command.args(&self.arguments).args(["--quiet", "--threads", "1"]).current_dir(folder);
        command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    }

    /// Sends a signal after a share of the time that the run takes.
    fn cut_off(&self, folder: &Path, signal: Signal, share: f64) -> ExitStatus {
        let mut child = self.start(folder);
        std::thread::sleep(self.takes.mul_f64(share));
        kill_process(Pid::from_child(&child), signal).unwrap();
        child.wait().unwrap()
    }

    /// Asserts that each file is the old or the new one, whole, and that there is no other;
    /// temporaries aside.
    fn check(&self, folder: &Path, what: &str) {
        let found = files(folder);
        for (name, bytes) in found.iter().filter(|(name, _)| !name.contains(".warpknit-")) {
            let whole = [&self.old, &self.whole]
                .into_iter()
                .filter_map(|files| files.get(name))
                .any(|other| other == bytes);
            assert!(
                whole,
                "{what}: {name} is neither the old file nor the whole new one ({} bytes)",
                bytes.len()
            );
        }
        let lost: Vec<_> = self.old.keys().filter(|name| !found.contains_key(*name)).collect();
        assert!(lost.is_empty(), "{what}: {lost:?} are lost");
    }
}

/// Shares of a run's time: from before anything is made until it is all but done.
const MOMENTS: [f64; 8] = [0.02, 0.15, 0.3, 0.45, 0.6, 0.75, 0.88, 0.97];

/// A photo of a slanted thread.
fn photo(folder: &Path) -> std::path::PathBuf {
    let path = folder.join("photo.png");
    let grey = |x: u32, y: u32| {
        if (60..140).contains(&y) { 150 + 90 * u8::from((x + y) % 40 < 20) } else { 20 }
    };
    image::RgbImage::from_fn(500, 200, |x, y| image::Rgb([grey(x, y); 3])).save(&path).unwrap();
    path
}

/// The same for runs that take long in unoptimised builds.
const FEW_MOMENTS: [f64; 3] = [0.05, 0.5, 0.85];

/// Interrupts a run at these moments; some of them must hit it, even where the first run, by which
/// they are timed, was slowed down by others.
fn interrupts(subject: &Subject, signals: &[Signal], moments: &[f64]) {
    for &signal in signals {
        let mut hits = 0;
        for &share in moments {
            let what = format!("{signal:?} at {share} of {:?}", subject.takes);
            let folder = subject.folder();
            let status = subject.cut_off(folder.path(), signal, share);
            subject.check(folder.path(), &what);
            assert_eq!(temporaries(folder.path()), 0, "{what}: {:?}", files(folder.path()).keys());
            if status.success() {
                assert_eq!(files(folder.path()), subject.whole, "{what}");
            } else {
                assert_eq!(
                    status.signal(),
                    Some(signal.as_raw()),
                    "{what}: dies by the signal, as a shell expects"
                );
                hits += 1;
            }
        }
        assert!(
            hits >= moments.len().div_ceil(4),
            "{signal:?} came too late {} times: this tests nothing",
            moments.len() - hits
        );
    }
}

/// The signals that what is started here hears: those that are ignored here (SIGHUP below nohup,
/// SIGINT in the background of a script) stay so.
fn heard() -> Vec<Signal> {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status
        .lines()
        .find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    // Where the system doesn't say, the program doesn't listen for SIGHUP.
    let ignored = mask.unwrap_or(1 << (Signal::HUP.as_raw() - 1));
    let signals = [Signal::INT, Signal::TERM, Signal::HUP];
    let (heard, unheard): (Vec<_>, Vec<_>) =
        signals.into_iter().partition(|signal| ignored & (1 << (signal.as_raw() - 1)) == 0);
    if !unheard.is_empty() {
        eprintln!("skipped: {unheard:?}, ignored where these tests run");
    }
    assert!(heard.contains(&Signal::TERM), "SIGTERM is ignored here: this tests nothing");
    heard
}

#[test]
fn an_interrupted_run_leaves_old_files_and_no_others() {
    interrupts(&Subject::drape(), &heard(), &MOMENTS);
    interrupts(&Subject::sequence(), &[Signal::TERM], &MOMENTS);
}

#[test]
fn an_interrupted_yarn_leaves_no_folder_or_the_old_one() {
    let place = tempfile::tempdir().unwrap();
    let photo = photo(place.path());
    interrupts(&Subject::yarn(&photo, Files::new()), &heard()[..1], &FEW_MOMENTS);
    let old = ["base_color.png", "yarn.toml", "mine.txt"]
        .map(|name| (format!("maps/{name}"), format!("old {name}").into_bytes()));
    interrupts(&Subject::yarn(&photo, old.into()), &heard()[..1], &FEW_MOMENTS);
}

#[test]
fn what_a_killed_run_leaves_the_next_one_removes() {
    let place = tempfile::tempdir().unwrap();
    let [drape, sequence] =
        [Subject::drape(), Subject::sequence()].map(|subject| (subject, &MOMENTS[..]));
    for (subject, moments) in
        [drape, sequence, (Subject::yarn(&photo(place.path()), Files::new()), &FEW_MOMENTS)]
    {
        let mut swept = 0;
        for &share in moments {
            let what = format!("killed at {share} of {:?}", subject.takes);
            let folder = subject.folder();
            subject.cut_off(folder.path(), Signal::KILL, share);
            subject.check(folder.path(), &what);
            swept += usize::from(temporaries(folder.path()) > 0);
            swatch(folder.path(), "next.csv");
            assert_eq!(temporaries(folder.path()), 0, "{what}: {:?}", files(folder.path()).keys());
            std::fs::remove_file(folder.path().join("next.csv")).unwrap();
            subject.check(folder.path(), &what);
        }
        assert!(swept > 0, "no kill left a temporary file: this tests nothing");
    }
}

/// Writes a small swatch.
fn swatch(folder: &Path, name: &str) {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("warpknit"));
    command
        .args(["swatch", "--wales", "2", "--courses", "2", "--quiet", "-o", name])
        .current_dir(folder)
        .stdout(Stdio::null());
    assert!(command.status().unwrap().success());
}

#[test]
fn runs_beside_each_other_leave_each_others_files_alone() {
    let subject = Subject::drape();
    let folder = subject.folder();
    let mut child = subject.start(folder.path());
    let mut beside = 0;
    while child.try_wait().unwrap().is_none() {
        beside += usize::from(temporaries(folder.path()) > 0);
        swatch(folder.path(), "beside.csv");
    }
    assert!(beside > 0, "the run was over before another began: this tests nothing");
    assert!(child.wait().unwrap().success());
    std::fs::remove_file(folder.path().join("beside.csv")).unwrap();
    assert_eq!(files(folder.path()), subject.whole);
}

#[test]
fn a_signal_that_is_to_be_ignored_stays_ignored() {
    let subject = Subject::drape();
    let folder = subject.folder();
    let binary = assert_cmd::cargo::cargo_bin!("warpknit");
    let mut command = Command::new("sh");
    command
        .args(["-c", "trap '' HUP INT; exec \"$@\"", "sh"])
        .arg(binary)
        .args(&subject.arguments)
        .args(["--threads", "1"]);
    let mut child = command
        .current_dir(folder.path())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(subject.takes.mul_f64(0.5));
    if cfg!(target_os = "linux") {
        kill_process(Pid::from_child(&child), Signal::INT).unwrap();
    }
    kill_process(Pid::from_child(&child), Signal::HUP).unwrap();
    assert!(child.wait().unwrap().success());
    assert_eq!(files(folder.path()), subject.whole);
}

/// Runs `warpknit` in a shell script, where it is `"$@"`, in a folder with an old file.
fn in_shell(script: &str, folder: &Path, arguments: &[&str]) -> Output {
    std::fs::write(folder.join("x.glb"), "old").unwrap();
    let mut command = Command::new("sh");
    command
        .args(["-c", script, "sh"])
        .arg(assert_cmd::cargo::cargo_bin!("warpknit"))
        .args(arguments)
        .arg("--quiet");
    command.current_dir(folder).output().unwrap()
}

const LARGE: [&str; 9] =
    ["swatch", "--wales", "30", "--courses", "30", "-o", "x.glb", "-o", "x.csv"];

/// Asserts one line on stderr that names a file and says `why`, and nothing in the folder but the
/// old file.
fn check_refusal(output: &Output, folder: &Path, why: &str) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!((output.status.code(), output.status.signal()), (Some(1), None), "{message}");
    assert!(message.starts_with("error: ") && message.lines().count() == 1, "{message}");
    assert!(
        (message.contains("x.glb: can't write") || message.contains("x.csv: can't write"))
            && message.contains(why),
        "{message}"
    );
    assert_eq!(files(folder), Files::from([("x.glb".to_owned(), b"old".to_vec())]), "{message}");
}

#[test]
fn a_limit_of_files_is_an_error_that_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let output = in_shell("ulimit -f 40 && exec \"$@\"", folder.path(), &LARGE);
    check_refusal(&output, folder.path(), "File too large");
    // An archive has a way of its own to fail, and a word for it.
    let output = in_shell(
        "ulimit -f 2000 && exec \"$@\"",
        folder.path(),
        &[&LARGE[..5], &["-o", "x.npz"]].concat(),
    );
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(
        message.starts_with("error: x.npz: can't write") && message.lines().count() == 1,
        "{message}"
    );
    assert_eq!(
        files(folder.path()).len(),
        1,
        "nothing but the old file: {:?}",
        files(folder.path()).keys()
    );
    let photo = photo(folder.path());
    let outputs = tempfile::tempdir().unwrap();
    let output = in_shell(
        "ulimit -f 1 && exec \"$@\"",
        outputs.path(),
        &["yarn", photo.to_str().unwrap(), "-o", "x.glb.maps"],
    );
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(
        message.contains("x.glb.maps/")
            && message.contains("File too large")
            && message.lines().count() == 1,
        "{message}"
    );
    assert_eq!(
        files(outputs.path()).len(),
        1,
        "nothing but the old file: {:?}",
        files(outputs.path()).keys()
    );
}

#[test]
fn a_reader_who_leaves_takes_no_sheet_along() {
    let folder = tempfile::tempdir().unwrap();
    let [flat, draped] = ["pinch_flat.obj", "pinch_draped.obj"].map(mesh);
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("warpknit"));
    command
        .arg("inspect")
        .args([&flat, &draped, &draped])
        .args(["-o", "sheet.svg"])
        .current_dir(folder.path());
    let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    assert!(child.wait().unwrap().success());
    assert_eq!(files(folder.path()).keys().collect::<Vec<_>>(), ["sheet-001.svg", "sheet-002.svg"]);
}

#[test]
fn a_pipe_whose_reader_leaves_is_no_error_unless_other_files_are_lost() {
    let folder = tempfile::tempdir().unwrap();
    for (others, expected) in [(&[][..], true), (&["-o", "other.csv"], false)] {
        // `/dev/stdout` has no ending, and a link to it has one.
        let link = folder.path().join("out.csv");
        if !link.exists() {
            std::os::unix::fs::symlink("/dev/stdout", &link).unwrap();
        }
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("warpknit"));
        command
            .args(&LARGE[..5])
            .args(["-o", "out.csv", "--quiet"])
            .args(others)
            .current_dir(folder.path());
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        drop(child.stdout.take());
        assert_eq!(child.wait().unwrap().success(), expected, "{others:?}");
        assert!(!folder.path().join("other.csv").exists());
    }
}

#[test]
fn a_pipe_gets_the_whole_picture() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("x.png");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let reader = std::thread::spawn(move || std::fs::read(pipe).unwrap());
    swatch(folder.path(), "x.png");
    assert!(image::load_from_memory(&reader.join().unwrap()).is_ok(), "it is a picture");
}

/// A script in which `mount` is allowed and seen by nobody else; none where the system doesn't let
/// us.
fn with_mounts(script: &str) -> Option<String> {
    let wraps = ["unshare --mount", "unshare --user --map-root-user --mount"];
    let allowed = |wrap: &&&str| {
        let probe = format!("{wrap} sh -c 'mount -t tmpfs -o size=64k none /mnt'");
        Command::new("sh").args(["-c", &probe]).output().is_ok_and(|output| output.status.success())
    };
    let wrap = wraps.iter().find(allowed)?;
    Some(format!("exec {wrap} sh -c '{script}' \"$0\" \"$@\""))
}

#[test]
fn a_full_disk_leaves_nothing_but_the_old_files() {
    // What the small disk holds at the end is printed: it is gone with the shell.
    let script = "mount -t tmpfs -o size=64k none . && cd \"$PWD\" && printf old >x.glb && \"$@\"; status=$?; ls -A; cat x.glb; exit $status";
    let Some(script) = with_mounts(script) else {
        eprintln!(
            "skipped: no small disk can be mounted here; a_limit_of_files… and cli::a_full_disk… test the same"
        );
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let output = in_shell(&script, folder.path(), &LARGE);
    assert_eq!(String::from_utf8_lossy(&output.stdout), "x.glb\nold", "{output:?}");
    check_refusal(&output, folder.path(), "No space left on device");
}

#[test]
fn a_read_only_folder_is_an_error_that_names_the_file() {
    // Nobody, not even root, can make files here.
    #[cfg(target_os = "linux")]
    {
        let folder = tempfile::tempdir().unwrap();
        let output = in_shell(
            "exec \"$@\"",
            folder.path(),
            &[&LARGE[..5], &["-o", "/proc/self/x.glb"]].concat(),
        );
        check_refusal(&output, folder.path(), "/proc/self/x.glb");
    }
    let Some(script) =
        with_mounts("mount --bind . . && mount -o remount,ro,bind . && cd \"$PWD\" && exec \"$@\"")
    else {
        eprintln!(
            "skipped: no folder can be made read-only for root here; /proc is one that was tested"
        );
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let output = in_shell(&script, folder.path(), &LARGE);
    check_refusal(&output, folder.path(), "Read-only file system");
}
