//! Pictures are compared with those accepted before, `tests/golden/NAME.png`, as an eye would
//! compare them.
//!
//! `UPDATE_GOLDEN=1` accepts what is drawn now. A failure leaves `target/tmp/golden/NAME.png`:
//! expected, difference, actual.

use crate::flip::{Difference, flip};
use image::{Rgb, RgbImage, Rgba, RgbaImage, imageops};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::{env, fs};

/// What shows through where a picture is transparent, and lies between the pictures of a failure.
const GREY: u8 = 128;

/// The largest FLIP values that pass: of the mean, and of what 99 in 100 pixels do not exceed.
#[derive(Clone, Copy)]
struct Limits {
    mean: f32,
    p99: f32,
}

/// Panics unless the picture, straight alpha over grey, looks like its golden one within these FLIP
/// values.
#[track_caller]
pub(crate) fn check(name: &str, picture: &RgbaImage, mean_limit: f32, p99_limit: f32) {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/golden/{name}.png"));
    if env::var_os("UPDATE_GOLDEN").is_some_and(|value| value == "1") {
        save(&over_grey(picture), &golden);
    } else if let Err(complaint) =
        compare(&golden, picture, Limits { mean: mean_limit, p99: p99_limit }, &failures())
    {
        panic!("{complaint}; run with UPDATE_GOLDEN=1 to accept");
    }
}

/// Where the pictures of failures go: out of the repository.
fn failures() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("golden")
}

/// Says what is wrong, and leaves a picture of it in the folder `failures`.
fn compare(
    golden: &Path,
    picture: &RgbaImage,
    limits: Limits,
    failures: &Path,
) -> Result<(), String> {
    let actual = over_grey(picture);
    let shown = failures.join(golden.file_name().expect("a golden is a file"));
    if !golden.exists() {
        save(&actual, &shown);
        return Err(format!("no golden {}; the picture is {}", golden.display(), shown.display()));
    }
    let expected = over_grey(&image::open(golden).unwrap().to_rgba8());
    let mut complaint = format!("not as {}: ", golden.display());
    if expected.dimensions() == actual.dimensions() {
        let difference = flip(&expected, &actual);
        let (mean, p99) = (difference.mean(), difference.percentile(0.99));
        if mean <= limits.mean && p99 <= limits.p99 {
            return Ok(());
        }
        write!(
            complaint,
            "FLIP mean {mean:.4} (limit {}), 99th percentile {p99:.4} (limit {})",
            limits.mean, limits.p99
        )
        .unwrap();
        save(&side_by_side(&[&expected, &heat(&difference, actual.dimensions()), &actual]), &shown);
    } else {
        write!(complaint, "{:?} pixels and not {:?}", actual.dimensions(), expected.dimensions())
            .unwrap();
        save(&side_by_side(&[&expected, &actual]), &shown);
    }
    Err(format!("{complaint}; see {}", shown.display()))
}

fn save(picture: &RgbImage, path: &Path) {
    fs::create_dir_all(path.parent().expect("a picture lies in a folder")).unwrap();
    picture.save(path).unwrap();
}

fn over_grey(picture: &RgbaImage) -> RgbImage {
    RgbImage::from_fn(picture.width(), picture.height(), |x, y| {
        let [red, green, blue, alpha] = picture.get_pixel(x, y).0.map(u16::from);
        Rgb([red, green, blue]
            .map(|value| ((value * alpha + u16::from(GREY) * (255 - alpha) + 127) / 255) as u8))
    })
}

/// Black where nothing differs, by red and yellow to white.
fn heat(difference: &Difference, (width, height): (u32, u32)) -> RgbImage {
    let ramp = |value: &f32| {
        [0.0, 1.0, 2.0].map(|start| ((3.0 * value - start).clamp(0.0, 1.0) * 255.0).round() as u8)
    };
    let bytes = difference.map.iter().flat_map(ramp).collect();
    RgbImage::from_raw(width, height, bytes).expect("the map has a value for each pixel")
}

fn side_by_side(pictures: &[&RgbImage]) -> RgbImage {
    const GAP: u32 = 4;
    let width = pictures.iter().map(|picture| picture.width() + GAP).sum::<u32>() - GAP;
    let height = pictures.iter().map(|picture| picture.height()).max().unwrap_or(0);
    let mut row = RgbImage::from_pixel(width, height, Rgb([GREY; 3]));
    let mut left = 0;
    for picture in pictures {
        imageops::replace(&mut row, *picture, i64::from(left), 0);
        left += picture.width() + GAP;
    }
    row
}

/// A disc on nothing with a soft edge.
fn disc(size: u32, red: u8) -> RgbaImage {
    RgbaImage::from_fn(size, size, |x, y| {
        let [x, y] = [x, y].map(|at| f64::from(at) + 0.5 - f64::from(size) / 2.0);
        let cover = (f64::from(size) / 3.0 - x.hypot(y)).clamp(0.0, 1.0);
        Rgba([red, 90, 60, (cover * 255.0) as u8])
    })
}

/// Compares a picture with a golden one, both given here, and reads back the picture that a failure
/// left.
fn judged(
    golden: Option<&RgbaImage>,
    picture: &RgbaImage,
) -> (Result<(), String>, Option<RgbImage>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("accepted/disc.png");
    if let Some(golden) = golden {
        save(&over_grey(golden), &path);
    }
    let verdict =
        compare(&path, picture, Limits { mean: 0.03, p99: 0.1 }, &folder.path().join("failed"));
    let left = folder.path().join("failed/disc.png");
    (verdict, left.exists().then(|| image::open(left).unwrap().to_rgb8()))
}

#[test]
fn what_is_transparent_is_grey() {
    let over = |pixel| over_grey(&RgbaImage::from_pixel(1, 1, Rgba(pixel))).get_pixel(0, 0).0;
    assert_eq!(over([9, 200, 3, 0]), [GREY; 3]);
    assert_eq!(over([9, 200, 3, 255]), [9, 200, 3]);
    assert_eq!(over([255, 0, 128, 51]), [153, 102, 128]);
}

#[test]
fn a_picture_passes_as_itself_and_nearly_itself() {
    for red in [200, 202] {
        let (verdict, shown) = judged(Some(&disc(40, 200)), &disc(40, red));
        assert_eq!(verdict, Ok(()));
        assert!(shown.is_none());
    }
}

#[test]
fn another_picture_fails_and_is_shown_beside_the_golden() {
    let (expected, actual) = (disc(40, 200), disc(40, 120));
    let (verdict, shown) = judged(Some(&expected), &actual);
    let (complaint, shown) = (verdict.unwrap_err(), shown.unwrap());
    assert!(
        complaint.contains("FLIP mean 0.")
            && complaint.contains("(limit 0.03), 99th percentile 0."),
        "{complaint}"
    );
    assert_eq!(shown.dimensions(), (3 * 40 + 2 * 4, 40));
    let panel = |number: u32| imageops::crop_imm(&shown, number * 44, 0, 40, 40).to_image();
    assert!(panel(0) == over_grey(&expected) && panel(2) == over_grey(&actual));
    // Nothing differs in the corner, and the disc does in its middle.
    assert_eq!(panel(1).get_pixel(0, 0).0, [0; 3]);
    assert!(panel(1).get_pixel(20, 20).0[0] > 128);
}

#[test]
fn a_picture_of_another_size_fails() {
    let (verdict, shown) = judged(Some(&disc(40, 200)), &disc(30, 200));
    assert!(verdict.unwrap_err().contains("(30, 30) pixels and not (40, 40)"));
    assert_eq!(shown.unwrap().dimensions(), (40 + 4 + 30, 40));
}

#[test]
fn a_missing_golden_fails_and_shows_the_picture() {
    let (verdict, shown) = judged(None, &disc(40, 200));
    assert!(verdict.unwrap_err().starts_with("no golden "));
    assert!(shown == Some(over_grey(&disc(40, 200))));
}
