//! A picture of a fabric as a garment: the shipped T-shirt on its body, at true gauge, in the studio.
//!
//! In: a fabric. Out: a picture. Cost: some ten seconds. Loops are smaller than pixels, so nobody would
//! see that they follow the strain of the cloth, which takes up to a minute a fabric.

use std::path::Path;

use anyhow::{Context, Result};
use image::RgbImage;
use warpknit::export::Format;
use warpknit::fabric::Fabric;
use warpknit::garment::{self, ReadOptions};
use warpknit::map::Mapping;
use warpknit::pipeline::{
    Body, Clock, LoupeChoice, PictureSettings, Placement, Settings, Source, drape,
};

use crate::picture::{HEIGHT, WIDTH};

/// Samples of a pixel where it shows the body.
const SAMPLES: u32 = 16;

/// Draws a fabric as a T-shirt.
pub(crate) fn draw(fabric: &Fabric) -> Result<RgbImage> {
    let meshes = Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes");
    let garment = garment::read(&meshes.join("tshirt.obj"), None, &ReadOptions::default())?;
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("worn.png");
    let settings = Settings {
        outputs: vec![(path.clone(), Format::Png)],
        placement: Placement { mapping: Mapping::Smooth, ..Placement::default() },
        picture: PictureSettings {
            size: (WIDTH, HEIGHT),
            spp: SAMPLES,
            body: Body::Files(vec![meshes.join("tshirt_body.obj")]),
            loupe: LoupeChoice::Off,
            ..PictureSettings::default()
        },
        ..Settings::default()
    };
    drape(garment, None, fabric, &Source::default(), &settings, Clock::start(&()))?;
    Ok(image::open(&path).with_context(|| path.display().to_string())?.into_rgb8())
}
