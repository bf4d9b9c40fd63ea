//! Memory is bounded by what is read: 200 MB that hold nothing take no more than a small file, and
//! what holds something a known multiple of its size.
//!
//! The peak is the child's `VmHWM`, looked at until it ends; what is written at once before its end
//! is seen all the same, as it takes milliseconds.

use std::io::{self, Write};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

const MB: u64 = 1_000_000;
/// What a run takes that reads next to nothing, bytes, with room for other machines.
const PROGRAM: u64 = 60 * MB;

/// The most memory that `warpknit inspect` held while it read `bytes` bytes of lines, bytes; and
/// whether it took them for a garment.
fn peak(head: &str, mut line: impl FnMut(u64) -> String + Send, bytes: u64) -> (u64, bool) {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("warpknit"));
    command.env("XDG_CACHE_HOME", crate::cache_home());
    command
        .args(["inspect", "/dev/stdin"])
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let mut child = command.spawn().unwrap();
    let mut input = io::BufWriter::with_capacity(1 << 16, child.stdin.take().unwrap());
    let mut feed = move || -> io::Result<()> {
        input.write_all(head.as_bytes())?;
        let (mut written, mut number) = (0, 0);
        while written < bytes {
            number += 1;
            let line = line(number);
            written += line.len() as u64;
            input.write_all(line.as_bytes())?;
        }
        input.flush()
    };
    std::thread::scope(|scope| {
        // A program that has seen enough closes its end.
        scope.spawn(move || drop(feed()));
        most_held(&mut child)
    })
}

/// The most memory that a process holds until it ends, bytes, and whether it ends well.
pub(crate) fn most_held(child: &mut Child) -> (u64, bool) {
    let status = format!("/proc/{}/status", child.id());
    let mut most = 0;
    loop {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let kilobytes = text
            .lines()
            .find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.parse().ok());
        most = kilobytes.unwrap_or(0_u64).max(most);
        if let Some(status) = child.try_wait().unwrap() {
            return (1024 * most, status.success());
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";

#[test]
fn what_holds_nothing_takes_nothing() {
    let page = |text: &str| text.repeat(100_000 / text.len());
    for (what, head, line) in [
        ("blanks", TRIANGLE, page(" ")),
        ("blank lines", TRIANGLE, page("   \n")),
        ("comments", TRIANGLE, page("# nothing at all\n")),
        (
            "one comment",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n#",
            page("nothing at all "),
        ),
        ("unknown records", TRIANGLE, page("seam 1 2 3\n")),
        ("normals", TRIANGLE, page("vn 0 0 1\n")),
    ] {
        let (most, read) = peak(head, |_| line.clone(), 200 * MB);
        assert!(read && most > MB, "{what}: not read, or not measured ({most} bytes)");
        assert!(most < PROGRAM, "{what}: {} MB", most / MB);
    }
}

#[test]
fn names_that_no_face_has_take_nothing() {
    let (most, read) = peak(TRIANGLE, |number| format!("o a-rather-long-name-{number}\n"), 50 * MB);
    assert!(read && most > MB && most < PROGRAM, "{} MB", most / MB);
}

#[test]
fn noise_is_refused_early() {
    let mut state = 1_u64;
    let noise = move |_| {
        let next = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            char::from((state >> 32) as u8)
        };
        std::iter::repeat_with(next).take(4096).collect::<String>()
    };
    let (most, read) = peak("", noise, 20 * MB);
    assert!(!read && most < PROGRAM, "{} MB", most / MB);
}

#[test]
fn records_take_a_known_multiple_of_their_size() {
    let flat = |number: u64| format!("v {} {} 0\nvt {0} {1}\n", number % 1000, number / 1000);
    // The shortest records that there are, which take most for their size, and a plain net's.
    for (what, head, line) in [
        (
            "v",
            TRIANGLE,
            Box::new(|_| "v 1 2 3\n".to_owned()) as Box<dyn FnMut(u64) -> String + Send>,
        ),
        ("vt", TRIANGLE, Box::new(|_| "vt 1 2\n".to_owned())),
        ("faces", TRIANGLE, Box::new(|_| "f 1 2 3\n".to_owned())),
        ("faces that are no garment", "", Box::new(|_| "f 1 2 3\n".to_owned())),
        ("polygons", TRIANGLE, Box::new(|_| format!("f{}\n", " 1 2 3".repeat(7)))),
        ("named faces", TRIANGLE, Box::new(|number| format!("o {number}\nf 1 2 3\n"))),
        ("a net", TRIANGLE, Box::new(move |number| flat(number) + &face(number))),
    ] {
        let bytes = 10 * MB;
        let (most, _) = peak(head, line, bytes);
        assert!(
            most < PROGRAM + MULTIPLE * bytes,
            "{what}: {} MB for {} MB",
            most / MB,
            bytes / MB
        );
    }
}

/// The most bytes that are held for each that is read, as docs/memory.md says. Measured 2026-11:
/// polygons of short indices 26, triangles of them 19, each with a name of its own 16, vertices 4.
const MULTIPLE: u64 = 40;

/// A triangle of the net that [`records_take_a_known_multiple_of_their_size`] writes.
fn face(number: u64) -> String {
    let at = number + 3;
    if number <= 1000 || number.is_multiple_of(1000) {
        String::new()
    } else {
        format!("f {at}/{at} {0}/{0} {1}/{1}\n", at - 1, at - 1000)
    }
}

/// What a command says that may take so many kB of addresses, and its exit status.
fn within(kilobytes: u32, arguments: &[&str]) -> (Option<i32>, String) {
    let folder = tempfile::tempdir().unwrap();
    let mut shell = Command::new("sh");
    shell.env("XDG_CACHE_HOME", crate::cache_home()).env("RUST_BACKTRACE", "1");
    shell.args(["-c", &format!("ulimit -v {kilobytes}; exec \"$0\" \"$@\"")]);
    shell.arg(assert_cmd::cargo::cargo_bin!("warpknit")).args(arguments);
    let done = shell.current_dir(folder.path()).output().unwrap();
    let left = folder.path().read_dir().unwrap().count();
    assert!(done.status.success() || left == 0, "no file stays");
    (done.status.code(), String::from_utf8_lossy(&done.stderr).into_owned())
}

#[test]
fn a_picture_without_room_is_refused_before_the_work() {
    let mesh = crate::drape::mesh("tshirt.obj");
    let all = ["drape", mesh.to_str().unwrap(), "--wales-per-cm", "13", "--renderer", "cpu"];
    // From afar no yarn has to be held.
    let (status, said) = within(1_000_000, &[&all[..], &["--loupe", "off"]].concat());
    assert_eq!(status, Some(0), "{said}");
    let all = [&all[..], &["--lod", "off"]].concat();
    let (status, said) = within(1_000_000, &all);
    assert_eq!(status, Some(1), "{said}");
    let lines: Vec<_> = said.lines().collect();
    assert!(lines.len() == 1 && lines[0].starts_with("error: a picture of"), "{said}");
    // A close-up takes what it shows.
    let near = [&all[..], &["--zoom", "60", "--size", "160x120", "-o", "near.png"]].concat();
    let (status, said) = within(1_000_000, &near);
    assert_eq!(status, Some(0), "{said}");
}

#[test]
fn no_renderer_runs_out_of_memory_in_the_middle() {
    let mesh = crate::drape::mesh("tshirt.obj");
    let cloth = ["drape", mesh.to_str().unwrap(), "--wales-per-cm", "6.6", "-o", "near.png"];
    for renderer in ["auto", "gpu", "cpu"] {
        let all = [&cloth[..], &["--zoom", "14", "--size", "160x120", "--renderer", renderer]];
        // With the least there is room for no yarn, with the most there is for all but a driver.
        let found = [300_000, 400_000, 500_000, 700_000, 900_000, 1_300_000].map(|kilobytes| {
            let (status, said) = within(kilobytes, &all.concat());
            let errors = said.lines().filter(|line| !line.starts_with("warning: ")).count();
            let is_clean = if status == Some(0) {
                !said.contains("error: ")
            } else {
                status == Some(1) && errors == 1 && said.contains("error: ")
            };
            assert!(is_clean, "{renderer} in {kilobytes} kB: {status:?} {said}");
            status == Some(0)
        });
        assert!(!found[0] && found.is_sorted(), "{renderer}: {found:?}");
    }
}
