//! OBJ files: a garment with its `vt`, or, with a NUL between each two, a flat and a draped file,
//! and one more frame. What is read is inspected and, coarsely, knitted onto; the frame is taken or
//! refused.

#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use warpknit::garment::{Frames, ReadOptions, read};
use warpknit_fuzz::{Desk, check_panel, one_line, parts, use_garment};

static DESK: LazyLock<Desk> = LazyLock::new(Desk::new);

fuzz_target!(|data: &[u8]| {
    let files = parts(data, b"\0");
    let flat = DESK.file("flat.obj", files[0]);
    let draped = files.get(1).map(|draped| DESK.file("draped.obj", draped));
    let options = [
        ReadOptions::default(),
        ReadOptions { unit: Some("cm".parse().expect("a unit")), uv_scale: Some(10.0), grain: 0.7, turn: true, allow_loss: true },
    ];
    for options in options {
        match read(&flat, draped.as_deref(), &options) {
            Ok(garment) => use_garment(&garment),
            Err(error) => one_line(&error),
        }
        if let Some(frame) = files.get(2).map(|frame| DESK.file("frame.obj", frame))
            && let Ok((mut garment, frames)) = Frames::read(&flat, draped.as_deref(), &options)
        {
            match frames.pose(&mut garment, &frame) {
                Ok(odd) => odd.iter().for_each(one_line),
                Err(error) => one_line(&error),
            }
            garment.panels.iter().for_each(check_panel);
        }
    }
});
