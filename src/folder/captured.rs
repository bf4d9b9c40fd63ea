//! The folder of a captured cloth: pictures, a layout to correct by hand, and a fabric to drape.
//!
//! In: [`Captured`] and an [`OutputFolder`]. Out: [`FILES`] in it. A preview of the cloth and the
//! fibres of one cell are made here. The other files come from the capture.

use std::fs;
use std::path::Path;

use image::RgbaImage;

use crate::chart::svg;
use crate::drape::{Cloth, swatch_panel};
use crate::export::{self, ExportError, Format, Output, OutputFolder, WriteOptions, png};
use crate::fabric::Fabric;
use crate::ids::index32;
use crate::number::{narrow, whole};
use crate::photo::capture::Captured;
use crate::render::{self, Camera, View, cloth};
use crate::yarn::fibres::FIBRE_RADIUS;

/// All files of such a folder.
pub const FILES: [&str; 10] = [
    "cell.png",
    "texture.png",
    "grid3x3.png",
    "layout.svg",
    "layout.toml",
    "depth.png",
    "fabric.toml",
    "fibres.usda",
    "preview.png",
    "report.json",
];
/// Cells of the preview along the longer side of a cell.
const PREVIEW_CELLS: f64 = 5.0;
/// Width and height of the preview, pixels.
const PREVIEW_SIDE: u32 = 640;
/// Vertical field of view of the preview's camera, radians.
const PREVIEW_VIEW: f64 = 0.3;
/// The most cells of the preview along either side. It limits the work for very narrow cells.
const MOST_CELLS: u32 = 256;

/// Writes all files.
///
/// # Errors
/// [`ExportError`] if a file can't be written.
pub fn save(captured: &Captured, folder: &OutputFolder) -> Result<(), ExportError> {
    picture(folder, "cell.png", &captured.cell_picture())?;
    picture(folder, "grid3x3.png", &captured.grid_picture())?;
    picture(folder, "texture.png", captured.texture())?;
    picture(folder, "depth.png", &captured.depth_picture())?;
    picture(folder, "preview.png", &preview(&captured.fabric, View::Front))?;
    fibres(&captured.fabric, &folder.file("fibres.usda"))?;
    text(folder, "layout.svg", &svg::text(&captured.drawing()))?;
    text(folder, "layout.toml", &captured.layout_text())?;
    text(folder, "fabric.toml", &captured.fabric_text())?;
    text(folder, "report.json", &captured.report_text())
}

/// Writes a picture of the folder.
pub(super) fn picture(
    folder: &OutputFolder,
    name: &str,
    picture: &RgbaImage,
) -> Result<(), ExportError> {
    png::write(&folder.file(name), picture)?.publish()
}

/// Writes a text of the folder. An error names the file as it will be when the folder is complete.
pub(super) fn text(folder: &OutputFolder, name: &str, text: &str) -> Result<(), ExportError> {
    fs::write(folder.file(name), text)
        .map_err(|source| ExportError::Io { path: Some(folder.target().join(name)), source })
}

/// Writes all fibres of one cell, with the default radius.
fn fibres(fabric: &Fabric, path: &Path) -> Result<(), ExportError> {
    let panel = swatch_panel(fabric, 1, 1);
    let cloth = Cloth::swatch(&panel, fabric, 1, 1);
    let options = WriteOptions {
        path: Some(path.to_owned()),
        fibre_radius: Some(FIBRE_RADIUS),
        ..WriteOptions::default()
    };
    let mut output = Output::create(path)?;
    export::write(Format::Usda, &cloth, fabric, &options, &mut output)?;
    output.publish()
}

/// A picture of some cells of the cloth as seen from a side.
pub(super) fn preview(fabric: &Fabric, view: View) -> RgbaImage {
    // More cells along their shorter side, so that the preview is about square.
    let side = PREVIEW_CELLS * fabric.wale_spacing().max(fabric.course_spacing());
    let [wales, courses] =
        [fabric.wale_spacing(), fabric.course_spacing()].map(|spacing| cells(side, spacing));
    let scene = cloth::swatch(fabric, wales, courses);
    let options = render::RenderOptions {
        width: PREVIEW_SIDE,
        height: PREVIEW_SIDE,
        ..render::RenderOptions::default()
    };
    let camera = Camera::view(view, &scene.positions, PREVIEW_VIEW, 1.0, 1.0);
    render::render(&scene, &camera, &options, &|_| ()).expect("pictures of that size can be drawn")
}

/// The number of cells of this spacing along a side, at most [`MOST_CELLS`].
fn cells(side: f64, spacing: f64) -> u32 {
    index32(whole(narrow((side / spacing).round())).min(MOST_CELLS as usize))
}
