//! Choice of the renderer: the one that is wanted, or the best that there is.
//!
//! In: a scene, and [`RendererChoice`]. Out: pictures, and the name of the renderer. `Auto` takes a
//! hardware adapter. It never takes a software one, because ray tracing on the CPU is faster. If
//! the adapter fails, the CPU renderer draws instead, and [`Painter::notice`] says why.

use image::{RgbaImage, imageops};

use super::gpu::{Gpu, GpuError, Renderer, Yarns};
use super::{Camera, RenderOptions, cpu};
use crate::ids::index32;
use crate::scene::Scene;

/// Which renderer to use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RendererChoice {
    /// The GPU if there is a hardware adapter, otherwise the CPU.
    Auto,
    /// The GPU, also with a software adapter. Without an adapter it is an error.
    Gpu,
    /// The CPU, which needs no driver.
    #[default]
    Cpu,
}

/// Smallest number of uploaded pieces a stitch, the number of its data points. Coarser levels of
/// detail skip points when drawing.
const LEAST_ST: u32 = 10;
/// Uploaded pieces for each pixel of a stitch's length, where level of detail is allowed. With
/// fewer than about 1, bends show corners. More take memory and vertex work for pieces that level
/// of detail skips.
const PIECES_A_PIXEL: f64 = 2.0;

/// Draws a scene any number of times.
#[derive(Debug)]
pub struct Painter<'a> {
    scene: &'a Scene,
    gpu: Option<Box<Uploaded>>,
    /// Whether the CPU may draw if the GPU fails.
    falls_back: bool,
    notice: Option<String>,
}

impl<'a> Painter<'a> {
    /// Prepares to draw `scene`. Only `options.renderer` and `options.samples` matter here.
    ///
    /// # Errors With [`RendererChoice::Gpu`], whatever the adapter cannot do.
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
                    }));
                }
                Err(error) => painter.fall_back(error)?,
            }
        }
        Ok(painter)
    }

    /// The renderer's name: that of the adapter, or `cpu`.
    #[must_use]
    pub fn name(&self) -> &str {
        self.gpu.as_ref().map_or("cpu", |gpu| gpu.renderer.name())
    }

    /// The reason why the CPU draws instead of the GPU, if it does.
    #[must_use]
    pub fn notice(&self) -> Option<&str> {
        self.notice.as_deref()
    }

    /// Draws the scene as `camera` sees it. See [`super::render`].
    ///
    /// # Errors With [`RendererChoice::Gpu`], whatever the adapter cannot do.
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

    /// Switches to the CPU, where that is allowed.
    fn fall_back(&mut self, error: GpuError) -> Result<(), GpuError> {
        if !self.falls_back {
            return Err(error);
        }
        self.gpu = None;
        // A machine without an adapter needs no notice.
        if error != GpuError::NoAdapter {
            self.notice = Some(format!("the processor draws instead: {error}"));
        }
        Ok(())
    }
}

/// A GPU renderer. The scene is uploaded once its first camera, and so its detail, is known.
#[derive(Debug)]
struct Uploaded {
    renderer: Renderer,
    /// Mean length of a stitch, mm.
    stitch: f64,
    /// The uploaded yarns with their St.
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
