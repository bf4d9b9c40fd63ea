//! The folder of a recognised knit: a fabric as a designer writes it, and pictures to check it by.
//!
//! In: a [`Recognition`] and an [`OutputFolder`]. Out: `fabric.toml`, `preview.png`, `report.json`,
//! `back.png` and, where the face was given too, `front.png`.

use serde::Serialize;

use super::captured::{picture, preview, text};
use crate::export::{ExportError, OutputFolder};
use crate::photo::recognise::{Ranked, Recognition};
use crate::render::View;

/// All files of such a folder. The last one is there where two photos were given.
pub const FILES: [&str; 5] = ["fabric.toml", "preview.png", "report.json", "back.png", "front.png"];

/// Writes all files.
///
/// # Errors
/// [`ExportError`] if a file can't be written.
pub fn save(found: &Recognition, folder: &OutputFolder) -> Result<(), ExportError> {
    for (name, comparison) in FILES[3..].iter().zip(&found.comparisons) {
        picture(folder, name, comparison)?;
    }
    // The first photo is that of the technical back, but a weft knit's only one is taken for its face.
    let is_face = found.comparisons.len() == 1 && found.fabric.weft_knit().is_some();
    let view = if is_face { View::Front } else { View::Back };
    picture(folder, "preview.png", &preview(&found.fabric, view))?;
    text(folder, "fabric.toml", &fabric_text(found))?;
    let report = serde_json::to_string_pretty(&report(found)).expect("names and numbers are JSON");
    text(folder, "report.json", &(report + "\n"))
}

/// The text of `fabric.toml`.
fn fabric_text(found: &Recognition) -> String {
    format!(
        "# A knit as warpknit capture recognised it; {:.0} % of the photo's repeat is \
         unexplained.\n{}",
        100.0 * found.unexplained(),
        found.fabric
    )
}

/// What a person should check, one line each.
#[must_use]
pub fn warnings(found: &Recognition) -> Vec<String> {
    let mut warnings = Vec::new();
    if found.comparisons.len() == 1 && found.fabric.warp_knit().is_some() {
        warnings.push(
            "one photo tells less than two: the back shows the front bar, and --front adds what \
             the bars behind it do"
                .to_owned(),
        );
    }
    if found.is_sure() {
        return warnings;
    }
    match &found.ranked[..] {
        [best, ..] if !found.is_explained() => warnings.push(format!(
            "not sure: {} leaves {:.0} % of the repeat unexplained; compare the pictures",
            best.fabric.name,
            100.0 * found.unexplained()
        )),
        [best, next, ..] => warnings.push(format!(
            "not sure: {} explains the photo about as well as {}; compare the pictures",
            next.fabric.name, best.fabric.name
        )),
        _ => {}
    }
    warnings
}

/// The content of `report.json`.
#[derive(Serialize)]
struct RecognitionReport<'a> {
    warpknit: &'a str,
    /// `warp` or `weft`.
    hypothesis: &'a str,
    /// Share of what copies of the repeat have in common.
    unexplained: f64,
    margin: f64,
    wales_per_cm: f64,
    courses_per_cm: f64,
    /// For each photo the vectors of a wale and of a course, pixels, y down.
    frames: &'a [[[f64; 2]; 2]],
    /// The best, and the next two.
    ranked: Vec<RankedReport>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct RankedReport {
    name: String,
    lappings: Vec<String>,
    mirrored: bool,
    explained: f64,
    explained_of_common: f64,
}

impl From<&Ranked> for RankedReport {
    fn from(ranked: &Ranked) -> Self {
        let fabric = &ranked.fabric;
        Self {
            name: fabric.name.clone(),
            lappings: (0..fabric.yarn_systems()).map(|system| fabric.lapping(system)).collect(),
            mirrored: ranked.is_mirrored,
            explained: ranked.explained,
            explained_of_common: ranked.explained_of_common,
        }
    }
}

/// The content of `report.json`.
fn report(found: &Recognition) -> RecognitionReport<'_> {
    RecognitionReport {
        warpknit: env!("CARGO_PKG_VERSION"),
        hypothesis: if found.fabric.weft_knit().is_some() { "weft" } else { "warp" },
        unexplained: found.unexplained(),
        margin: found.margin(),
        wales_per_cm: found.fabric.wales_per_cm,
        courses_per_cm: found.fabric.courses_per_cm,
        frames: &found.frames,
        ranked: found.ranked.iter().map(RankedReport::from).collect(),
        warnings: warnings(found),
    }
}
