//! Maps read from files: what is there, what is made up, what is refused.

use image::{GrayImage, Luma, Rgba, RgbaImage};
use std::path::Path;
use tempfile::TempDir;
use warpknit::photo::yarn::{PhotoError, read_maps};

/// A folder with a base colour of 16 x 8.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let base = RgbaImage::from_fn(16, 8, |x, _| Rgba([if x < 8 { 200 } else { 60 }, 90, 30, 255]));
    base.save(folder.path().join("base_color.png")).unwrap();
    folder
}

fn grey(folder: &TempDir, name: &str, side: (u32, u32), of: impl Fn(u32, u32) -> u8) {
    GrayImage::from_fn(side.0, side.1, |x, y| Luma([of(x, y)]))
        .save(folder.path().join(name))
        .unwrap();
}

fn error(path: &Path) -> (PhotoError, String) {
    let error = read_maps(path, 1.0, None).unwrap_err();
    let text = error.to_string();
    assert!(
        text.contains(path.file_name().unwrap().to_str().unwrap()) && !text.contains('\n'),
        "{text:?}"
    );
    (error, text)
}

#[test]
fn a_base_colour_alone_is_flat_dull_and_a_quarter_wider_than_the_yarn() {
    let folder = folder();
    for path in [folder.path().to_owned(), folder.path().join("base_color.png")] {
        let maps = read_maps(&path, 1.0, None).unwrap();
        assert_eq!(maps.base.levels[0].get_pixel(3, 3).0, [200, 90, 30, 255]);
        assert_eq!(maps.normal.levels[0].get_pixel(3, 3).0[..3], [128, 128, 255]);
        assert_eq!(maps.surface.levels[0].get_pixel(3, 3).0[..3], [255, 191, 0]);
        assert_eq!((maps.length, maps.width, maps.base.levels.len()), (2.5, 1.25, 5));
    }
}

#[test]
fn maps_of_other_sizes_are_scaled_and_sizes_are_read() {
    let folder = folder();
    grey(&folder, "roughness.png", (32, 4), |x, _| if x < 16 { 40 } else { 240 });
    grey(&folder, "metallic.png", (16, 8), |_, _| 77);
    grey(&folder, "ao.png", (4, 4), |_, _| 120);
    let toml = |text: &str| std::fs::write(folder.path().join("yarn.toml"), text).unwrap();
    toml("length_mm = 3\nthreshold = 0.4\n");
    let maps = read_maps(folder.path(), 1.0, None).unwrap();
    assert_eq!(maps.surface.levels[0].get_pixel(2, 4).0[..3], [120, 40, 77]);
    assert_eq!(maps.surface.levels[0].get_pixel(13, 4).0[1], 240);
    assert_eq!((maps.length, maps.width), (3.0, 1.5));
    toml("length_mm = 3\nwidth_mm = 0.25\n");
    assert_eq!(read_maps(folder.path(), 1.0, None).unwrap().width, 0.25);
}

#[test]
fn heights_become_normals_where_there_are_none() {
    let folder = folder();
    // A ridge along the yarn's middle, and nothing that changes along it.
    grey(&folder, "height.png", (16, 8), |_, y| [0, 30, 60, 90, 90, 60, 30, 0][y as usize]);
    let maps = read_maps(folder.path(), 1.0, None).unwrap();
    let at = |y| maps.normal.levels[0].get_pixel(5, y).0;
    // 30 of 255 a texel, white being half of 8 texels high: a slope of 8/17.
    let slope = |pixel: [u8; 4]| (f32::from(pixel[1]) - 127.5) / (f32::from(pixel[2]) - 127.5);
    assert!(
        (slope(at(1)) - 8.0 / 17.0).abs() < 0.02,
        "the upper side looks to the top: {:?}",
        at(1)
    );
    assert!((slope(at(6)) + 8.0 / 17.0).abs() < 0.02, "{:?}", at(6));
    assert_eq!(at(1)[0], 128);
    RgbaImage::from_pixel(16, 8, Rgba([200, 128, 230, 255]))
        .save(folder.path().join("normal.png"))
        .unwrap();
    assert_eq!(
        read_maps(folder.path(), 1.0, None).unwrap().normal.levels[0].get_pixel(5, 1).0[0],
        200
    );
}

#[test]
fn what_is_wrong_is_said_with_the_files_name_and_a_way_out() {
    let folder = folder();
    let file = |name: &str| folder.path().join(name);
    std::fs::write(file("notes.png"), "not a picture").unwrap();
    let (wrong, text) = error(&file("notes.png"));
    assert!(matches!(wrong, PhotoError::NotAnImage { .. }) && text.contains("PNG"));
    assert!(matches!(error(&file("absent.png")).0, PhotoError::Read { .. }));
    RgbaImage::new(9, 3).save(file("small.png")).unwrap();
    assert!(matches!(
        error(&file("small.png")).0,
        PhotoError::TooSmall { width: 9, height: 3, least: 4, .. }
    ));
    RgbaImage::new(16_385, 4).save(file("large.png")).unwrap();
    assert!(matches!(error(&file("large.png")).0, PhotoError::TooLarge { most: 16_384, .. }));
    std::fs::create_dir(file("empty")).unwrap();
    let (wrong, text) = error(&file("empty"));
    assert!(matches!(wrong, PhotoError::NoBaseColor { .. }) && text.contains("base_color.png"));
    for (text, key) in [
        ("width_mm = 0", Some("width_mm")),
        ("length_mm = nan", Some("length_mm")),
        ("width_mm = 'wide'", None),
    ] {
        std::fs::write(file("yarn.toml"), text).unwrap();
        let message = match read_maps(folder.path(), 1.0, None).unwrap_err() {
            PhotoError::Size { key, .. } => Some(key),
            PhotoError::Toml { .. } => None,
            other => panic!("{other}"),
        };
        assert_eq!(message, key);
    }
}

#[test]
fn a_decoder_that_speaks_in_lines_is_quoted_in_one() {
    let folder = folder();
    let path = folder.path().join("start.jpg");
    std::fs::write(&path, b"\xFF\xD8\xFF").unwrap();
    assert!(matches!(error(&path).0, PhotoError::NotAnImage { .. }));
}

#[test]
fn a_file_that_claims_more_than_it_can_hold_takes_no_memory() {
    let folder = folder();
    let path = folder.path().join("claims.png");
    // 16384 x 16384 pixels of eight bytes: 2 GB, in a file of 57 bytes.
    let head = b"\x89PNG\r\n\x1A\n\0\0\0\x0DIHDR\0\0\x40\0\0\0\x40\0\x10\x06\0\0\0\xF9\x58\xCC\xC7";
    let data = b"\0\0\0\0IDAT\x35\xAF\x06\x1E\0\0\0\0IEND\xAE\x42\x60\x82";
    std::fs::write(&path, [&head[..], data].concat()).unwrap();
    assert!(matches!(error(&path).0, PhotoError::CutShort { .. }));
    // What is packed tightly is read all the same.
    let black = folder.path().join("black.png");
    RgbaImage::new(2048, 1024).save(&black).unwrap();
    assert!(std::fs::metadata(&black).unwrap().len() < 2048 * 1024 * 4 / 100);
    assert!(read_maps(&black, 1.0, None).is_ok());
}
