//! `warpknit view` on a virtual display: it opens, draws cloth, says what is wrong, and closes.

use std::io::{BufRead, BufReader};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use image::RgbImage;
use warpknit::fabric::Fabric;
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{
    AtomEnum, ClientMessageEvent, ConnectionExt, EventMask, MapState, Window,
};

/// A window is open and drawn long before this, on two slow cores as well.
const PATIENCE: Duration = Duration::from_secs(120);
/// The window's first size.
const SIZE: (u32, u32) = (1280, 800);
/// The part of its width that is picture for certain.
const PICTURE: u32 = 900;

const SMALL: [&str; 5] = ["view", "--wales", "4", "--courses", "4"];

/// A virtual display that ends with the test.
struct Display {
    server: Child,
    name: String,
    runtime: tempfile::TempDir,
}

impl Display {
    /// None, with a word, where no virtual display is installed; the project's own checks need one.
    fn open() -> Option<Self> {
        let screen = format!("{}x{}x24", SIZE.0, SIZE.1);
        let started = Command::new("Xvfb")
            .args(["-displayfd", "1", "-nolisten", "tcp", "-screen", "0", &screen])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let Ok(mut server) = started else {
            assert!(
                std::env::var_os("WARPKNIT_CI").is_none(),
                "Xvfb is not installed, and WARPKNIT_CI wants this test"
            );
            println!("skipped: Xvfb is not installed");
            return None;
        };
        // It says its number once it takes connections.
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        let runtime = tempfile::tempdir().unwrap();
        std::fs::set_permissions(runtime.path(), PermissionsExt::from_mode(0o700)).unwrap();
        Some(Self { server, name: format!(":{}", number.trim()), runtime })
    }

    fn warpknit(&self, folder: &Path) -> Command {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("warpknit"));
        command.env("XDG_CACHE_HOME", crate::cache_home());
        command
            .current_dir(folder)
            .env("DISPLAY", &self.name)
            .env("XDG_RUNTIME_DIR", self.runtime.path());
        command.env_remove("WAYLAND_DISPLAY").stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let _gone = self.server.kill();
        let _gone = self.server.wait();
    }
}

/// Waits for the end of a program that must end by itself.
fn end(mut program: Child) -> Output {
    let start = Instant::now();
    while program.try_wait().unwrap().is_none() {
        if start.elapsed() > PATIENCE {
            program.kill().unwrap();
            panic!("the window did not close: {:?}", program.wait_with_output().unwrap());
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    program.wait_with_output().unwrap()
}

fn succeeds(output: &Output) {
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
}

/// Pixels of the picture in which a colour is seen, whatever the light on it.
fn pixels_of(color: [u8; 3], window: &RgbImage) -> usize {
    let hue = |color: [u8; 3]| {
        let color = color.map(f32::from);
        let most = color.into_iter().fold(1.0, f32::max);
        color.map(|channel| channel / most)
    };
    let wanted = hue(color);
    let is_like = |found: [u8; 3]| hue(found).iter().zip(wanted).all(|(a, b)| (a - b).abs() < 0.08);
    window.enumerate_pixels().filter(|(x, _, pixel)| *x < PICTURE && is_like(pixel.0)).count()
}

/// Pixels of the picture that show a background of #2040c0, which lies far from all yarns here.
fn background_pixels(window: &RgbImage) -> usize {
    let pixels = window.enumerate_pixels();
    pixels.filter(|(x, _, pixel)| *x < PICTURE && pixel.0 == [0x20, 0x40, 0xc0]).count()
}

#[test]
fn hems_of_a_net_are_less_sheer() {
    let Some(display) = Display::open() else { return };
    let folder = tempfile::tempdir().unwrap();
    let sheet = "v 0 0 0\nv 200 0 0\nv 200 150 0\nv 0 150 0\n\
                 vt 0 0\nvt 200 0\nvt 200 150\nvt 0 150\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n";
    std::fs::write(folder.path().join("sheet.obj"), sheet).unwrap();
    let [raw, hemmed] = ["raw", "hemmed"].map(|edges| {
        let mut command = display.warpknit(folder.path());
        command.args(["view", "sheet.obj", "--unit", "mm", "--fabric", "hex-net-5"]);
        command.args(["--background", "#2040c0", "--edges", edges, "--screenshot", "out.png"]);
        succeeds(&end(command.spawn().unwrap()));
        let window = image::open(folder.path().join("out.png")).unwrap().to_rgb8();
        std::fs::remove_file(folder.path().join("out.png")).unwrap();
        background_pixels(&window)
    });
    // Hems of 20 mm all round are two fifths of the sheet.
    assert!(hemmed < raw - raw / 20, "{hemmed} pixels are background, {raw} with raw edges");
}

#[test]
fn a_window_shows_the_cloth() {
    let Some(display) = Display::open() else { return };
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["--fabric", "tricot", "--background", "#2040c0", "--screenshot", "out.png"];
    succeeds(&end(display.warpknit(folder.path()).args(SMALL).args(arguments).spawn().unwrap()));
    let window = image::open(folder.path().join("out.png")).unwrap().to_rgb8();
    assert_eq!(window.dimensions(), SIZE);
    let all = (PICTURE * SIZE.1) as usize;
    let background = background_pixels(&window);
    assert!(
        (all / 10..all * 9 / 10).contains(&background),
        "{background} of {all} pixels are background"
    );
    for yarn in Fabric::named("tricot").unwrap().yarns() {
        let color = yarn.color.0;
        let seen = pixels_of(color, &window);
        assert!(seen > all / 50, "{seen} of {all} pixels are {color:?}");
    }
}

#[test]
fn what_cannot_be_shown_ends_with_a_word_and_no_file() {
    let Some(display) = Display::open() else { return };
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["--radius", "50", "--screenshot", "out.png"];
    let output = end(display.warpknit(folder.path()).args(SMALL).args(arguments).spawn().unwrap());
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.starts_with("error: a radius of 50 mm is over the wale spacing"), "{said}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn without_a_display_it_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("warpknit"));
    command.env("XDG_CACHE_HOME", crate::cache_home());
    command.current_dir(folder.path()).args(SMALL).stdout(Stdio::piped()).stderr(Stdio::piped());
    let output = end(command
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("WAYLAND_SOCKET")
        .spawn()
        .unwrap());
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(
        said.starts_with("error: no window can be opened here") && said.lines().count() == 1,
        "{said}"
    );
}

#[test]
fn closing_the_window_ends_with_0() {
    let Some(display) = Display::open() else { return };
    let folder = tempfile::tempdir().unwrap();
    let program = display.warpknit(folder.path()).args(SMALL).spawn().unwrap();
    let (connection, screen) = x11rb::connect(Some(&display.name)).unwrap();
    let root = connection.setup().roots[screen].root;
    let start = Instant::now();
    let window = loop {
        assert!(start.elapsed() < PATIENCE, "no window opened");
        if let Some(window) = window_of(&connection, root) {
            break window;
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    ask_to_close(&connection, window);
    succeeds(&end(program));
}

/// The program's window, once it is to be seen.
fn window_of(connection: &impl Connection, root: Window) -> Option<Window> {
    let windows = connection.query_tree(root).unwrap().reply().unwrap().children;
    windows.into_iter().find(|&window| {
        // A window may be gone again by the time it is asked.
        let seen = connection.get_window_attributes(window).unwrap().reply();
        let name = connection
            .get_property(false, window, AtomEnum::WM_NAME, AtomEnum::ANY, 0, 64)
            .unwrap()
            .reply();
        seen.is_ok_and(|seen| seen.map_state == MapState::VIEWABLE)
            && name.is_ok_and(|name| name.value == b"warpknit")
    })
}

/// Does what a window manager does when the cross is pressed.
fn ask_to_close(connection: &impl Connection, window: Window) {
    let atom = |name: &[u8]| connection.intern_atom(false, name).unwrap().reply().unwrap().atom;
    let message = ClientMessageEvent::new(
        32,
        window,
        atom(b"WM_PROTOCOLS"),
        [atom(b"WM_DELETE_WINDOW"), 0, 0, 0, 0],
    );
    connection.send_event(false, window, EventMask::NO_EVENT, message).unwrap();
    connection.flush().unwrap();
}
