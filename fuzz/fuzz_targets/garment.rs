//! Garments of any format, by their content: glTF, USD, PLY or OBJ. What is read is inspected and,
//! coarsely, knitted onto; each of its frames, if it moves, is taken or refused.

#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use warpknit::garment::{Frames, ReadOptions, moments, read};
use warpknit_fuzz::{Desk, check_panel, one_line, use_garment};

/// The most frames that are read of one input.
const MOST_FRAMES: usize = 3;

static DESK: LazyLock<Desk> = LazyLock::new(Desk::new);

fuzz_target!(|data: &[u8]| {
    let file = DESK.file("garment", data);
    let options = ReadOptions { allow_loss: true, ..ReadOptions::default() };
    match read(&file, None, &options) {
        Ok(garment) => use_garment(&garment),
        Err(error) => one_line(&error),
    }
    let frames = moments(&file);
    let Some((first, others)) = frames.split_first().filter(|(_, others)| !others.is_empty()) else {
        return;
    };
    if let Ok((mut garment, reader)) = Frames::read(first, None, &options) {
        for frame in others.iter().take(MOST_FRAMES) {
            match reader.pose(&mut garment, frame) {
                Ok(odd) => odd.iter().for_each(one_line),
                Err(error) => one_line(&error),
            }
            garment.panels.iter().for_each(check_panel);
        }
    }
});
