//! Pictures of yarns: a photo, read and, where it is small, developed; or a folder of maps, its
//! files divided by a line `--`: the base colour, `yarn.toml`, a height map, a normal map.

#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use warpknit::photo::yarn::develop::{YarnPhotoSettings, develop};
use warpknit::photo::yarn::{read_maps, read_photo};
use warpknit_fuzz::{Desk, one_line, parts};

/// The most pixels of a photo that is developed: some hundredths of a second.
const MOST_PIXELS: u32 = 96 * 96;
/// The files of a folder, in the order in which they stand in an input.
const FILES: [&str; 4] = ["base_color.png", "yarn.toml", "height.png", "normal.png"];

static DESK: LazyLock<Desk> = LazyLock::new(Desk::new);

fuzz_target!(|data: &[u8]| {
    let files = parts(data, b"\n--\n");
    let given = FILES.iter().zip(&files);
    given.for_each(|(name, bytes)| drop(DESK.file(name, bytes)));
    // What the last input wrote and this one doesn't.
    for name in FILES.iter().skip(files.len()) {
        let _absent = std::fs::remove_file(DESK.path().join(name));
    }
    match read_maps(DESK.path(), 0.2, None) {
        Ok(maps) => assert!(maps.length > 0.0 && maps.width > 0.0 && maps.length.is_finite() && maps.width.is_finite()),
        Err(error) => one_line(&error),
    }
    match read_photo(&DESK.path().join(FILES[0])) {
        Ok(photo) if photo.width() * photo.height() <= MOST_PIXELS => {
            if let Err(error) = develop(&photo, &YarnPhotoSettings::default(), &mut |_, _| ()) {
                one_line(&error);
            }
        }
        Ok(_large) => {}
        Err(error) => one_line(&error),
    }
});
