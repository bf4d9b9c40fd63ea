//! A scene on a graphics device, uploaded as finely as the camera needs it.
//!
//! In: a scene, a camera, [`Options`]. Out: pictures, for [`crate::Painter`].

use image::{RgbaImage, imageops};
use warpknit_core::ids::index32;

use super::{Gpu, Renderer, Yarns};
use crate::scene::Scene;
use crate::{Camera, Choice, GpuError, Options};

/// Fewest pieces of a stitch that are uploaded: its data points. What needs fewer is made of them
/// as it is drawn.
const LEAST_ST: u32 = 10;
/// Pieces that are uploaded for each pixel of a stitch's length, where far yarns may be coarser.
const PIECES_A_PIXEL: f64 = 2.0;

/// A renderer, and the scene on its device once it is known how near it is seen.
#[derive(Debug)]
pub(crate) struct Uploaded {
    renderer: Renderer,
    /// Mean length of a stitch, mm.
    stitch: f64,
    /// With their St.
    yarns: Option<(u32, Yarns)>,
}

impl Uploaded {
    /// Opens the adapter that the options ask for. Nothing is uploaded yet.
    ///
    /// # Errors
    /// [`GpuError`] where there is none, or it can't draw yarns.
    pub(crate) fn new(scene: &Scene, options: &Options) -> Result<Self, GpuError> {
        let gpu = Gpu::find(options.renderer == Choice::Gpu)?;
        let renderer = Renderer::new(gpu, options.samples)?;
        Ok(Self { renderer, stitch: stitch_length(scene), yarns: None })
    }

    /// The adapter's name.
    pub(crate) fn name(&self) -> &str {
        self.renderer.name()
    }

    /// Draws the scene, which is uploaded first if what is there is too coarse for this camera.
    pub(crate) fn draw(
        &mut self,
        scene: &Scene,
        camera: &Camera,
        options: &Options,
    ) -> Result<RgbaImage, GpuError> {
        let st = uploaded_st(scene, self.stitch, camera, options);
        let (_, yarns) = match &mut self.yarns {
            Some(uploaded) if uploaded.0 >= st => uploaded,
            // The old ones go first, since both may not fit.
            coarser => {
                *coarser = None;
                coarser.insert((st, self.renderer.load(scene, st)?))
            }
        };
        let whole = self.renderer.draw(yarns, camera, options)?;
        let rows = options.rows();
        Ok(imageops::crop_imm(&whole, 0, rows.start, options.width, rows.end - rows.start)
            .to_image())
    }
}

/// The mean length of yarn in a stitch, mm.
fn stitch_length(scene: &Scene) -> f64 {
    scene.span_lengths().sum / f64::from(index32(scene.stitches.len().max(1)))
}

/// St that the nearest stitches need, [`Options::st`] at most: a million stitches of forty pieces
/// would take a gigabyte.
fn uploaded_st(scene: &Scene, stitch: f64, camera: &Camera, options: &Options) -> u32 {
    let Some(bounds) = scene.bounds().filter(|_| options.lod) else { return options.st };
    let eye = camera.eye();
    let nearest = eye.distance(eye.clamp(bounds.min.as_dvec3(), bounds.max.as_dvec3()));
    let wanted = PIECES_A_PIXEL * stitch / camera.pixel_size(nearest, options.height);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates, and is held to what is wanted at most"
    )]
    let wanted = wanted.ceil() as u32;
    wanted.clamp(LEAST_ST.min(options.st), options.st)
}
