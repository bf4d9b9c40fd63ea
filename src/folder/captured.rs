//! The folder that a capture fills: the cloth as pictures, as a layout to correct by hand, and as a
//! fabric to drape.
//!
//! In: [`Captured`] and an [`OutputFolder`]. Out: [`FILES`] in it. Besides what the capture itself
//! gives there are a preview of the draped cloth and the fibres of one cell.

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
/// Cells each way of the preview, its pixels, and how wide its camera sees.
const PREVIEW_CELLS: f64 = 5.0;
const PREVIEW_SIDE: u32 = 640;
const PREVIEW_VIEW: f64 = 0.3;
/// The most cells of the preview each way, however narrow they are.
const MOST_CELLS: u32 = 256;

/// Writes all files.
///
/// # Errors
/// What the disk says.
pub fn save(captured: &Captured, folder: &OutputFolder) -> Result<(), ExportError> {
    let picture =
        |name: &str, picture: &RgbaImage| png::write(&folder.file(name), picture)?.publish();
    picture("cell.png", &captured.cell_picture())?;
    picture("grid3x3.png", &captured.grid_picture())?;
    picture("texture.png", captured.texture())?;
    picture("depth.png", &captured.depth_picture())?;
    picture("preview.png", &preview(&captured.fabric))?;
    fibres(&captured.fabric, &folder.file("fibres.usda"))?;
    let text = |name: &str, text: String| {
        fs::write(folder.file(name), text)
            .map_err(|source| ExportError::Io { path: Some(folder.target().join(name)), source })
    };
    text("layout.svg", svg::text(&captured.drawing()))?;
    text("layout.toml", captured.layout_text())?;
    text("fabric.toml", captured.fabric_text())?;
    text("report.json", captured.report_text())
}

/// All fibres of one cell, as thick as the paper's.
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

/// The cloth as it will look, some cells of it.
fn preview(fabric: &Fabric) -> RgbaImage {
    let longer = fabric.wale_spacing().max(fabric.course_spacing());
    let cells = |spacing: f64| {
        index32(whole(narrow((PREVIEW_CELLS * longer / spacing).round())).min(MOST_CELLS as usize))
    };
    let scene = cloth::swatch(fabric, cells(fabric.wale_spacing()), cells(fabric.course_spacing()));
    let options = render::RenderOptions {
        width: PREVIEW_SIDE,
        height: PREVIEW_SIDE,
        ..render::RenderOptions::default()
    };
    let camera = Camera::view(View::Front, &scene.positions, PREVIEW_VIEW, 1.0, 1.0);
    render::render(&scene, &camera, &options, &|_| ()).expect("pictures of that size can be drawn")
}
