//! One picture of the gallery: a window on the middle of a piece of fabric.
//!
//! In: a fabric, and a scene of it that is larger than the window. Out: a picture whose frame is
//! full of cloth.

use std::path::Path;

use anyhow::{Context, Result};
use glam::{DVec2, DVec3};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{DynamicImage, RgbImage};
use warpknit::fabric::Fabric;
use warpknit::render::scene::Scene;
use warpknit::render::{Background, Camera, Options, View, render};

const WIDTH: u32 = 320;
const HEIGHT: u32 = 240;
/// Fewest courses and wales in a picture: enough to see how loops hang together, few enough to tell
/// yarns apart.
const COURSES: f64 = 9.0;
const WALES: f64 = 8.0;
/// Repeats in the height of a picture, so that a net shows whole meshes.
const REPEATS: f64 = 1.3;
/// Neither the colour of a light yarn nor that of a dark one.
const BACKGROUND: [u8; 3] = [0xA9, 0xB4, 0xBE];
/// Brightness is rounded to this, of 255: noise below it is not seen and would double the files.
const STEP: u8 = 8;
/// Wales and courses around the window: cut-off yarns stay out of it.
const MARGIN: f64 = 4.0;

/// What a picture shows of a fabric, mm.
pub(crate) struct Frame(DVec2);

impl Frame {
    pub(crate) fn of(fabric: &Fabric) -> Self {
        let aspect = f64::from(WIDTH) / f64::from(HEIGHT);
        #[expect(clippy::cast_precision_loss, reason = "some courses")]
        let courses = COURSES.max(REPEATS * fabric.repeat() as f64);
        let height =
            (courses * fabric.course_spacing()).max(WALES * fabric.wale_spacing() / aspect);
        Self(DVec2::new(height * aspect, height))
    }

    /// A window on less of the fabric, which shows it so many times larger.
    pub(crate) fn nearer(self, times: f64) -> Self {
        Self(self.0 / times)
    }

    /// Wales and courses of a piece of fabric that fills the frame.
    pub(crate) fn swatch(&self, fabric: &Fabric) -> (u32, u32) {
        let reach = fabric.structure.widest_lapping();
        let spacing = DVec2::new(fabric.wale_spacing(), fabric.course_spacing());
        let count = (self.0 / spacing
            + 2.0 * (DVec2::splat(MARGIN) + DVec2::new(f64::from(reach), 0.0)))
        .ceil();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some tens")]
        let count = (count.x as u32, count.y as u32);
        count
    }

    /// The middle of `scene` from the front or the back.
    pub(crate) fn draw(&self, scene: &Scene, view: View) -> RgbImage {
        let side = if view == View::Back { DVec3::NEG_Z } else { DVec3::Z };
        let middle = scene.bounds().map_or(DVec3::ZERO, |bounds| bounds.centre().as_dvec3());
        let distance = self.0.y / 2.0 / (Camera::DEFAULT_FOV / 2.0).tan();
        let camera = Camera::look_at(middle + side * distance, middle, Camera::DEFAULT_FOV, 1.0);
        let options = Options {
            width: WIDTH,
            height: HEIGHT,
            spp: 8,
            background: Background::Color(BACKGROUND),
            ..Options::default()
        };
        let mut picture = DynamicImage::from(
            render(scene, &camera, &options, &|_| ()).expect("the processor needs no driver"),
        )
        .into_rgb8();
        for value in picture.iter_mut() {
            *value = *value / STEP * STEP + STEP / 2;
        }
        picture
    }
}

/// Writes a picture as small as PNG gets.
pub(crate) fn write(path: &Path, picture: &RgbImage) -> Result<()> {
    let mut bytes = Vec::new();
    let encoder =
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive);
    picture.write_with_encoder(encoder).context("a picture can't be encoded")?;
    std::fs::write(path, bytes).with_context(|| path.display().to_string())
}
