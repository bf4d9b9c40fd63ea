//! Which renderer draws: the one that is wanted, or the best that there is.
//!
//! In: a scene, and [`Choice`]. Out: pictures, and the name of what drew them. `Auto` takes a
//! hardware adapter and never a software one, which is slower than tracing rays; whatever goes
//! wrong there, the processor draws instead, and [`Painter::notice`] says why.

use image::RgbaImage;

use crate::scene::Scene;
use crate::{Camera, GpuError, Options, cpu};

#[cfg(feature = "gpu")]
use crate::gpu::Uploaded;
#[cfg(not(feature = "gpu"))]
use crate::without_gpu::Uploaded;

/// What is to draw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// The graphics processor where there is one.
    Auto,
    /// The graphics adapter, be it one of software, or nothing.
    Gpu,
    /// The processor, which needs no driver.
    #[default]
    Cpu,
}

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
    /// With [`Choice::Gpu`] whatever the adapter can't do.
    pub fn new(scene: &'a Scene, options: &Options) -> Result<Self, GpuError> {
        let mut painter =
            Self { scene, gpu: None, falls_back: options.renderer == Choice::Auto, notice: None };
        if options.renderer != Choice::Cpu {
            match Uploaded::new(scene, options) {
                Ok(uploaded) => painter.gpu = Some(Box::new(uploaded)),
                Err(error) => painter.fall_back(error)?,
            }
        }
        Ok(painter)
    }

    /// What draws: the adapter's name, or `cpu`.
    #[must_use]
    pub fn name(&self) -> &str {
        self.gpu.as_ref().map_or("cpu", |gpu| gpu.name())
    }

    /// Why the processor had to step in, if it had to.
    #[must_use]
    pub fn notice(&self) -> Option<&str> {
        self.notice.as_deref()
    }

    /// Draws the scene as `camera` sees it. See [`super::render`].
    ///
    /// # Errors
    /// With [`Choice::Gpu`] whatever the adapter can't do.
    pub fn draw(
        &mut self,
        camera: &Camera,
        options: &Options,
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
        // A machine without an adapter is nothing to be told of, nor a build that can't use one.
        if !matches!(error, GpuError::NoAdapter | GpuError::NotBuiltIn) {
            self.notice = Some(format!("the processor draws instead: {error}"));
        }
        Ok(())
    }
}
