//! One picture of the gallery: the middle of a piece of fabric.
//!
//! In: a fabric, and a scene of it that is larger than the frame. Out: a picture that the cloth
//! fills.

use std::path::Path;

use anyhow::{Context, Result};
use glam::{DVec2, DVec3};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{DynamicImage, RgbImage};
use warpknit::fabric::Fabric;
use warpknit::render::scene::Scene;
use warpknit::render::{Background, Camera, RenderOptions, View, render};

/// Pixels of all pictures.
pub(crate) const WIDTH: u32 = 320;
pub(crate) const HEIGHT: u32 = 240;
/// Fewest courses in a picture: enough to see how loops hang together, few enough to distinguish
/// yarns.
const COURSES: f64 = 9.0;
/// Fewest wales in a picture.
const WALES: f64 = 8.0;
/// Repeats in the height of a picture, so that a net shows complete meshes.
const REPEATS: f64 = 1.3;
/// A background that differs from light and from dark yarns.
const BACKGROUND: [u8; 3] = [0xA9, 0xB4, 0xBE];
/// Step to which brightness is rounded, of 255. Noise below it is invisible and would double the
/// size of the files.
const STEP: u8 = 8;
/// Wales and courses around the frame, so that the cloth's cut ends stay out of the picture.
const MARGIN: f64 = 4.0;

/// The part of a fabric that a picture shows, mm.
pub(crate) struct Frame(DVec2);

impl Frame {
    /// The frame for a fabric: enough courses, wales and repeats.
    pub(crate) fn new(fabric: &Fabric) -> Self {
        let aspect = f64::from(WIDTH) / f64::from(HEIGHT);
        #[expect(clippy::cast_precision_loss, reason = "some courses")]
        let courses = COURSES.max(REPEATS * fabric.repeat() as f64);
        let height =
            (courses * fabric.course_spacing()).max(WALES * fabric.wale_spacing() / aspect);
        Self(DVec2::new(height * aspect, height))
    }

    /// A smaller part of the fabric, shown so many times larger.
    pub(crate) fn nearer(self, times: f64) -> Self {
        Self(self.0 / times)
    }

    /// Wales and courses of a piece of fabric that fills the frame.
    pub(crate) fn swatch(&self, fabric: &Fabric) -> (u32, u32) {
        let reach = fabric.structure.widest_lapping();
        let spacing = DVec2::new(fabric.wale_spacing(), fabric.course_spacing());
        // Underlaps reach over `reach` gaps, so the cut ends lie that much farther in.
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
        // The distance at which the frame's height fills the vertical field of view.
        let distance = self.0.y / 2.0 / (Camera::DEFAULT_FOV / 2.0).tan();
        let camera = Camera::look_at(middle + side * distance, middle, Camera::DEFAULT_FOV, 1.0);
        let options = RenderOptions {
            width: WIDTH,
            height: HEIGHT,
            spp: 8,
            background: Background::Color(BACKGROUND),
            ..RenderOptions::default()
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
