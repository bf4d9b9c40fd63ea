//! The folder of a fabric's maps: pictures, materials that name them, and a report.
//!
//! In: a [`MappedFabric`] and an [`OutputFolder`]. Out: the files of
//! [`crate::export::material::FabricMaterial`], and `report.json`. The material's picture shows the
//! face beside the back, as a plane of some repeats with these maps in the light of our pictures.

use std::fs;

use glam::DVec2;
use image::RgbaImage;
use serde::Serialize;

use super::captured::text;
use crate::export::material::{
    FabricMaterial, Making, MaterialFile, Means, Preview, UtcTime, file_name,
};
use crate::export::{ExportError, OutputFolder, png};
use crate::fabric::{Fabric, Structure};
use crate::pipeline::MappedFabric;
use crate::render::fabric_maps::{FabricMaps, MappedPlane, Side};
use crate::render::{Background, Light};

/// Pixels of each side of the cloth in the material's picture.
const PREVIEW_SIDE: u32 = 480;
/// The least number of repeats along each side.
const PREVIEW_REPEATS: f64 = 3.0;

/// What a report says, and how the maps were asked for.
#[derive(Debug, Serialize)]
pub struct FabricMapsReport {
    warpknit: &'static str,
    fabric: String,
    /// Width and height of the repeat.
    repeat_mm: [f64; 2],
    wales: usize,
    courses: usize,
    pixels: [u32; 2],
    /// Pixels per inch across and up, and those that were asked for.
    dpi: [f64; 2],
    dpi_asked: f64,
    /// Height that the full range of the height maps stands for.
    height_mm: f64,
    mass_g_m2: f64,
    thickness_mm: f64,
    /// Cover factor of the yarns, and the means of the alpha maps.
    cover: f64,
    alpha_front: f64,
    alpha_back: f64,
    files: Vec<String>,
}

impl FabricMapsReport {
    /// One line for each number, with its name first.
    #[must_use]
    pub fn table(&self) -> String {
        let [width, height] = self.repeat_mm;
        let [across, down] = self.pixels;
        let [x, y] = self.dpi;
        let rows = [
            ("fabric", self.fabric.clone()),
            (
                "repeat",
                format!(
                    "{width:.3} x {height:.3} mm, {} wales, {} courses",
                    self.wales, self.courses
                ),
            ),
            ("maps", format!("{across} x {down} pixels, {x:.2} x {y:.2} dpi")),
            ("height", format!("{:.3} mm from black to white", self.height_mm)),
            ("mass", format!("{:.1} g/m²", self.mass_g_m2)),
            ("thickness", format!("{:.3} mm", self.thickness_mm)),
            ("cover factor", format!("{:.3}", self.cover)),
        ];
        rows.iter().map(|(name, value)| format!("{name:12}  {value}\n")).collect()
    }
}

/// Writes all files, and returns the report.
///
/// # Errors
/// [`ExportError`] if a file can't be written.
pub fn save(
    mapped: &MappedFabric,
    name: &str,
    dpi_asked: f64,
    time: UtcTime,
    folder: &OutputFolder,
) -> Result<FabricMapsReport, ExportError> {
    let MappedFabric { maps, real } = mapped;
    let material = FabricMaterial {
        name: file_name(name),
        about: &real.fabric.about,
        making: making(&real.fabric),
        maps,
        preview: preview(maps),
        mass: real.numbers.mass,
        thickness: real.numbers.thickness,
        id: id(&real.fabric, maps),
        time,
    };
    let files = material.files();
    for file in &files {
        write(folder, file)?;
    }
    let report = report(mapped, name, dpi_asked, &files);
    let json = serde_json::to_string_pretty(&report).expect("names and numbers are JSON");
    text(folder, "report.json", &(json + "\n"))?;
    Ok(report)
}

fn report(
    mapped: &MappedFabric,
    name: &str,
    dpi_asked: f64,
    files: &[MaterialFile],
) -> FabricMapsReport {
    let MappedFabric { maps, real } = mapped;
    let [alpha_front, alpha_back] = Side::BOTH.map(|side| Means::of(maps.side(side)).alpha);
    FabricMapsReport {
        warpknit: crate::VERSION,
        fabric: name.to_owned(),
        repeat_mm: maps.size.to_array(),
        wales: real.fabric.threading_repeat(),
        courses: real.fabric.repeat(),
        pixels: maps.pixels(),
        dpi: maps.dpi(),
        dpi_asked,
        height_mm: maps.depth,
        mass_g_m2: real.numbers.mass,
        thickness_mm: real.numbers.thickness,
        cover: real.numbers.cover,
        alpha_front,
        alpha_back,
        files: files.iter().map(|file| file.name.clone()).collect(),
    }
}

fn making(fabric: &Fabric) -> Making {
    match &fabric.structure {
        Structure::Warp(_) => Making::WarpKnit,
        Structure::Weft(_) => Making::WeftKnit,
        Structure::Laid(_) => Making::Laid,
    }
}

/// A number of a fabric and the size of its maps (FNV-1a of 128 bits, Fowler, Noll and Vo): the same
/// material has the same number whenever it is made.
fn id(fabric: &Fabric, maps: &FabricMaps) -> u128 {
    const BASIS: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    const PRIME: u128 = 0x0000_0000_0100_0000_0000_0000_0000_013b;
    let text = format!("{fabric}{:?}", maps.pixels());
    text.bytes().fold(BASIS, |hash, byte| (hash ^ u128::from(byte)).wrapping_mul(PRIME))
}

/// The picture of the material: the face on the left and the back on the right.
fn preview(maps: &FabricMaps) -> Preview {
    // A pixel is no smaller than one of the maps, which have nothing finer to show.
    let [across, up] = maps.pixels().map(f64::from);
    let texel = (maps.size / DVec2::new(across, up)).max_element();
    let side = (PREVIEW_REPEATS * maps.size.max_element()).max(texel * f64::from(PREVIEW_SIDE));
    let pixel = side / f64::from(PREVIEW_SIDE);
    let [left, right] = Side::BOTH.map(|side| {
        MappedPlane::new(maps, side, &Light::default()).picture(
            [PREVIEW_SIDE; 2],
            pixel,
            Background::default(),
        )
    });
    let mut picture = RgbaImage::new(2 * PREVIEW_SIDE, PREVIEW_SIDE);
    image::imageops::replace(&mut picture, &left, 0, 0);
    image::imageops::replace(&mut picture, &right, i64::from(PREVIEW_SIDE), 0);
    let mut bytes = Vec::new();
    png::encode(&picture, &mut bytes).expect("memory takes all bytes");
    Preview {
        png: bytes,
        size: DVec2::new(2.0, 1.0) * side,
        pixels: [2 * PREVIEW_SIDE, PREVIEW_SIDE],
    }
}

/// Writes a file of the folder. An error names it as it will be when the folder is complete.
fn write(folder: &OutputFolder, file: &MaterialFile) -> Result<(), ExportError> {
    let path = folder.file(&file.name);
    let around = path.parent().map_or(Ok(()), fs::create_dir_all);
    around
        .and_then(|()| fs::write(&path, &file.bytes))
        .map_err(|source| ExportError::Io { path: Some(folder.target().join(&file.name)), source })
}
