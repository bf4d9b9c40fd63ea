//! Layout files of `capture`: what is read has numbers that can be worked with, what isn't is told
//! in one line, with the line of the file.

#![no_main]

use libfuzzer_sys::fuzz_target;
use warpknit::photo::capture::{GivenLayout, Segment};
use warpknit_fuzz::one_line;

fuzz_target!(|text: &str| {
    match GivenLayout::parse(text) {
        Ok(layout) => check(&layout),
        Err(error) => {
            one_line(&error);
            assert!((1..=1 + text.matches('\n').count()).contains(&error.line), "line {} of {text:?}", error.line);
        }
    }
});

fn check(layout: &GivenLayout) {
    assert!(layout.cell.iter().all(|vector| vector.is_finite()) && layout.ground.is_finite(), "{layout:?}");
    for segment in &layout.segments {
        let Segment { centre, angle, width, length, top, round, sag, tilt, bow, sway } = *segment;
        assert!(centre.is_finite() && [angle, top, round, sag, tilt, bow, sway].iter().all(|number| number.is_finite()), "{segment:?}");
        assert!(width > 0.0 && length > 0.0 && width.is_finite() && length.is_finite(), "{segment:?}");
    }
}
