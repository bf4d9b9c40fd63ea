//! A scene on a graphics device, uploaded as finely as the camera needs it.
//!
//! In: a scene, a camera, [`RenderOptions`]. Out: pictures, for [`crate::Painter`].

use image::{RgbaImage, imageops};
use warpknit_core::ids::index32;

use super::{Gpu, Renderer, Yarns};
use crate::scene::Scene;
use crate::{Camera, GpuError, RenderOptions, RendererChoice};

/// Smallest number of uploaded pieces a stitch, the number of its data points. Coarser levels of
/// detail skip points when drawing.
const LEAST_ST: u32 = 10;
/// Uploaded pieces for each pixel of a stitch's length, where level of detail is allowed. With
/// fewer than about 1, bends show corners. More take memory and vertex work for pieces that level
/// of detail skips.
const PIECES_A_PIXEL: f64 = 2.0;

/// A GPU renderer. The scene is uploaded once its first camera, and so its detail, is known.
#[derive(Debug)]
pub(crate) struct Uploaded {
    renderer: Renderer,
    /// Mean length of a stitch, mm.
    stitch: f64,
    /// The uploaded yarns with their St.
    yarns: Option<(u32, Yarns)>,
}

impl Uploaded {
    /// Opens the adapter that the options ask for. Nothing is uploaded yet.
    ///
    /// # Errors
    /// [`GpuError`] where there is none, or it can't draw yarns.
    pub(crate) fn new(scene: &Scene, options: &RenderOptions) -> Result<Self, GpuError> {
        let gpu = Gpu::find(options.renderer == RendererChoice::Gpu)?;
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
        options: &RenderOptions,
    ) -> Result<RgbaImage, GpuError> {
        let st = uploaded_st(scene, self.stitch, camera, options);
        let (_, yarns) = match &mut self.yarns {
            Some(uploaded) if uploaded.0 >= st => uploaded,
            // The old yarns are freed first, because both may not fit into memory.
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

/// St that the nearest stitches need, at most [`RenderOptions::st`]. A million stitches of forty
/// pieces would take a gigabyte.
fn uploaded_st(scene: &Scene, stitch: f64, camera: &Camera, options: &RenderOptions) -> u32 {
    let Some(bounds) = scene.bounds().filter(|_| options.lod) else { return options.st };
    let eye = camera.eye();
    // Distance to the bounding box: no stitch is nearer.
    let nearest = eye.distance(eye.clamp(bounds.min.as_dvec3(), bounds.max.as_dvec3()));
    let wanted = PIECES_A_PIXEL * stitch / camera.pixel_size(nearest, options.height);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates, and is clamped below"
    )]
    let wanted = wanted.ceil() as u32;
    wanted.clamp(LEAST_ST.min(options.st), options.st)
}
