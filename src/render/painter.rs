//! Which renderer draws: the one that is wanted, or the best that there is.
//!
//! In: a scene, and [`RendererChoice`]. Out: pictures, and the name of what drew them. `Auto` takes a
//! hardware adapter and never a software one, which is slower than tracing rays; whatever goes
//! wrong there, the processor draws instead, and [`Painter::notice`] says why.

use image::{RgbaImage, imageops};

use super::gpu::{Gpu, GpuError, Renderer, Yarns};
use super::{Camera, RenderOptions, cpu};
use crate::ids::index32;
use crate::scene::Scene;

/// What is to draw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RendererChoice {
    /// The graphics processor where there is one.
    Auto,
    /// The graphics adapter, be it one of software, or nothing.
    Gpu,
    /// The processor, which needs no driver.
    #[default]
    Cpu,
}

/// Fewest pieces of a stitch that are uploaded: its data points. What needs fewer is made of them
/// as it is drawn.
const LEAST_ST: u32 = 10;
/// Pieces that are uploaded for each pixel of a stitch's length, where far yarns may be coarser.
const PIECES_A_PIXEL: f64 = 2.0;

/// Draws a scene as often as is wanted.
#[derive(Debug)]
pub struct Painter<'a> {
    scene: &'a Scene,
    gpu: Option<Box<Uploaded>>,
    /// Whether the processor may step in.
    falls_back: bool,
    notice: Option<String>,
}

impl<'a> Painter<'a> {
    /// Makes ready to draw `scene`; of `options` only the renderer and the samples count.
    ///
    /// # Errors
    /// With [`RendererChoice::Gpu`] whatever the adapter can't do.
    pub fn new(scene: &'a Scene, options: &RenderOptions) -> Result<Self, GpuError> {
        let mut painter = Self {
            scene,
            gpu: None,
            falls_back: options.renderer == RendererChoice::Auto,
            notice: None,
        };
        if options.renderer != RendererChoice::Cpu {
            let found = Gpu::find(options.renderer == RendererChoice::Gpu);
            match found.and_then(|gpu| Renderer::new(gpu, options.samples)) {
                Ok(renderer) => {
                    painter.gpu = Some(Box::new(Uploaded {
                        renderer,
                        stitch: stitch_length(scene),
                        yarns: None,
                    }))
                }
                Err(error) => painter.fall_back(error)?,
            }
        }
        Ok(painter)
    }

    /// What draws: the adapter's name, or `cpu`.
    #[must_use]
    pub fn name(&self) -> &str {
        self.gpu.as_ref().map_or("cpu", |gpu| gpu.renderer.name())
    }

    /// Why the processor had to step in, if it had to.
    #[must_use]
    pub fn notice(&self) -> Option<&str> {
        self.notice.as_deref()
    }

    /// Draws the scene as `camera` sees it. See [`super::render`].
    ///
    /// # Errors
    /// With [`RendererChoice::Gpu`] whatever the adapter can't do.
    pub fn draw(
        &mut self,
        camera: &Camera,
        options: &RenderOptions,
        progress: &(dyn Fn(f32) + Sync),
    ) -> Result<RgbaImage, GpuError> {
        if let Some(gpu) = &mut self.gpu {
            match gpu.draw(self.scene, camera, options) {
                Ok(picture) => {
                    progress(1.0);
                    return Ok(picture);
                }
                Err(error) => self.fall_back(error)?,
            }
        }
        Ok(cpu::render(self.scene, camera, options, progress))
    }

    /// Leaves the graphics processor, where that is allowed.
    fn fall_back(&mut self, error: GpuError) -> Result<(), GpuError> {
        if !self.falls_back {
            return Err(error);
        }
        self.gpu = None;
        // A machine without an adapter is nothing to be told of.
        if error != GpuError::NoAdapter {
            self.notice = Some(format!("the processor draws instead: {error}"));
        }
        Ok(())
    }
}

/// A renderer, and the scene on its device once it is known how near it is seen.
#[derive(Debug)]
struct Uploaded {
    renderer: Renderer,
    /// Mean length of a stitch, mm.
    stitch: f64,
    /// With their St.
    yarns: Option<(u32, Yarns)>,
}

impl Uploaded {
    fn draw(
        &mut self,
        scene: &Scene,
        camera: &Camera,
        options: &RenderOptions,
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

/// St that the nearest stitches need, [`RenderOptions::st`] at most: a million stitches of forty pieces
/// would take a gigabyte.
fn uploaded_st(scene: &Scene, stitch: f64, camera: &Camera, options: &RenderOptions) -> u32 {
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
