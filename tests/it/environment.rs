//! Environments of pictures, from outside: what they light, what is seen of them, and wrong files.

use std::path::Path;

use image::{DynamicImage, ImageFormat, Rgb, Rgb32FImage, RgbaImage};

use crate::cli::{fails, warpknit};

/// An environment with a blue floor, a red sky, and a window that the front camera looks away from,
/// up and to the left or to the right of it.
fn room(path: &Path, is_left: bool) {
    // The front camera looks along -z, at a quarter across. Its left is -x, at the picture's edges.
    let window = if is_left { 54..60 } else { 36..42 };
    let picture = Rgb32FImage::from_fn(64, 32, |x, y| match y {
        8..12 if window.contains(&x) => Rgb([60.0; 3]),
        0..16 => Rgb([0.4, 0.1, 0.1]),
        _ => Rgb([0.1, 0.1, 0.4]),
    });
    let format = ImageFormat::from_path(path).unwrap();
    DynamicImage::from(picture).save_with_format(path, format).unwrap();
}

/// A picture of a jersey swatch with these flags, in a folder where `left` and `right` are.
fn swatch(flags: &[&str]) -> RgbaImage {
    let folder = tempfile::tempdir().unwrap();
    for format in ["hdr", "exr"] {
        for (is_left, name) in [(true, "left"), (false, "right")] {
            room(&folder.path().join(name).with_extension(format), is_left);
        }
    }
    let run = ["swatch", "--fabric", "jersey", "--wales", "6", "--courses", "8", "--zoom", "0.5"];
    let picture = ["--size", "120x90", "--renderer", "cpu", "--quiet", "-o", "s.png"];
    warpknit(folder.path()).args(run).args(picture).args(flags).assert().success();
    image::open(folder.path().join("s.png")).unwrap().into_rgba8()
}

/// Mean of all channels over the middle of a picture.
fn brightness(picture: &RgbaImage) -> f64 {
    let pixels = (40..80).flat_map(|x| (30..60).map(move |y| picture.get_pixel(x, y).0));
    let sum: u32 = pixels.flat_map(|[r, g, b, _]| [r, g, b]).map(u32::from).sum();
    f64::from(sum) / (3.0 * 40.0 * 30.0)
}

#[test]
fn it_is_seen_behind_the_cloth_unless_a_background_is_wanted() {
    let corners = |flags: &[&str]| {
        let picture = swatch(&[&["--environment", "left.hdr"], flags].concat());
        [[0, 0], [0, 89]].map(|[x, y]| picture.get_pixel(x, y).0)
    };
    let [above, below] = corners(&[]);
    assert!(above[0] > above[2] + 40 && below[2] > below[0] + 40, "{above:?} {below:?}");
    assert_eq!([above[3], below[3]], [255; 2]);
    assert_eq!(corners(&["--background", "#102030"]), [[16, 32, 48, 255]; 2]);
    assert_eq!(corners(&["--background", "transparent"]), [[0; 4]; 2]);
    let [in_studio, _] = corners(&["--studio"]);
    assert!(in_studio[0].abs_diff(in_studio[2]) < 20, "{in_studio:?}");
    assert_ne!(in_studio, swatch(&["--studio"]).get_pixel(0, 0).0, "it lights the studio");
}

#[test]
fn cloth_is_darker_when_its_window_is_behind_it() {
    let lit = |file: &str, turn: &str| {
        swatch(&["--environment", file, "--environment-turn", turn, "--background", "white"])
    };
    let [left, right] = ["left.hdr", "right.hdr"].map(|file| lit(file, "0"));
    // A loop's legs are lit from one side or from the other, by as much light.
    assert_ne!(left, right);
    let ratio = brightness(&left) / brightness(&right);
    assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
    let behind = brightness(&lit("left.hdr", "-90"));
    assert!(behind < 0.8 * brightness(&left), "{behind}");
}

#[test]
fn a_band_of_it_and_any_number_of_threads_give_the_same_pixels() {
    let whole = swatch(&["--environment", "left.exr", "--threads", "1"]);
    assert!(whole == swatch(&["--environment", "left.exr", "--threads", "2"]));
    let folder = tempfile::tempdir().unwrap();
    room(&folder.path().join("left.exr"), true);
    let run = ["swatch", "--fabric", "jersey", "--wales", "6", "--courses", "8", "--zoom", "0.5"];
    let picture = ["--size", "120x90", "--renderer", "cpu", "--quiet", "-o", "s.png"];
    let part = ["--environment", "left.exr", "--tile", "2/3"];
    warpknit(folder.path()).args(run).args(picture).args(part).assert().success();
    let band = std::fs::read_dir(folder.path()).unwrap().find_map(|entry| {
        let path = entry.unwrap().path();
        path.extension().is_some_and(|ending| ending == "png").then_some(path)
    });
    let band = image::open(band.unwrap()).unwrap().into_rgba8();
    assert!(band.as_raw()[..] == whole.as_raw()[120 * 30 * 4..120 * 60 * 4]);
}

#[test]
fn the_command_line_s_sun_goes_before_the_file_s_environment() {
    let folder = tempfile::tempdir().unwrap();
    let drawn = |flags: &[&str]| {
        let run = ["swatch", "--wales", "4", "--courses", "4", "--size", "40x30", "--quiet"];
        warpknit(folder.path()).args(run).args(["-o", "s.png"]).args(flags).assert().success();
        std::fs::read(folder.path().join("s.png")).unwrap()
    };
    let sunny = drawn(&["--sun", "60,20"]);
    room(&folder.path().join("left.hdr"), true);
    std::fs::write(folder.path().join("warpknit.toml"), "environment = \"left.hdr\"\n").unwrap();
    assert!(drawn(&[]) != sunny);
    assert!(drawn(&["--sun", "60,20"]) == sunny);
}

#[test]
fn hdr_and_exr_are_the_same() {
    let [hdr, exr] = ["left.hdr", "left.exr"].map(|file| swatch(&["--environment", file]));
    let apart = hdr.as_raw().iter().zip(exr.as_raw()).map(|(a, b)| a.abs_diff(*b)).max();
    assert!(apart <= Some(2), "{apart:?}");
}

#[test]
fn what_is_no_environment_is_one_line() {
    let prepare = |folder: &Path| {
        room(&folder.join("whole.hdr"), true);
        room(&folder.join("whole.exr"), true);
        for name in ["whole.hdr", "whole.exr"] {
            let bytes = std::fs::read(folder.join(name)).unwrap();
            std::fs::write(folder.join(name.replace("whole", "cut")), &bytes[..bytes.len() / 2])
                .unwrap();
        }
        RgbaImage::new(8, 4).save(folder.join("picture.png")).unwrap();
        let flat =
            |width, height, light: f32| Rgb32FImage::from_pixel(width, height, Rgb([light; 3]));
        DynamicImage::from(flat(64, 64, 1.0)).save(folder.join("square.exr")).unwrap();
        DynamicImage::from(flat(64, 32, 0.0)).save(folder.join("black.hdr")).unwrap();
        std::fs::write(folder.join("huge.hdr"), "#?RADIANCE\n\n-Y 99999999 +X 99999999\n").unwrap();
        std::fs::write(folder.join("hollow.hdr"), "#?RADIANCE\n\n-Y 4096 +X 8192\n").unwrap();
        std::fs::write(folder.join("empty.hdr"), "").unwrap();
    };
    for (file, says) in [
        ("none.hdr", "none.hdr: "),
        ("empty.hdr", "no .hdr and no .exr"),
        ("picture.png", "no .hdr and no .exr"),
        ("cut.hdr", "save it again"),
        ("hollow.hdr", "too short for 8192 x 4096"),
        ("cut.exr", "save it again"),
        ("huge.hdr", "scale it down"),
        ("square.exr", "twice as wide as high"),
        ("black.hdr", "no light comes from it"),
        (".", ".: "),
    ] {
        let run =
            ["swatch", "--wales", "2", "--courses", "2", "--environment", file, "-o", "s.png"];
        let said = fails(1, &run, prepare);
        assert!(said.contains(says) && said.lines().count() == 1, "{file}: {said}");
        assert!(said.contains(file), "{said}");
    }
}

#[test]
fn flags_that_exclude_each_other_are_refused() {
    for flags in [
        ["--environment", "e.hdr", "--sun", "10,20"].as_slice(),
        &["--environment-turn", "10"],
        &["--environment", "e.hdr", "--environment-turn", "south"],
    ] {
        let said = fails(2, &[&["swatch"], flags].concat(), |_| ());
        assert!(said.contains("--environment"), "{said}");
    }
}
