//! Choice of the renderer: the one that is wanted, or the best that there is.
//!
//! In: a scene, and [`RendererChoice`]. Out: pictures, and the name of the renderer. `Auto` takes a
//! hardware adapter. It never takes a software one, because ray tracing on the CPU is faster. If
//! the adapter fails, the CPU renderer draws instead, and [`Painter::notice`] says why.

use image::RgbaImage;

use crate::scene::Scene;
use crate::{Background, Camera, GpuError, RenderOptions, RendererChoice, cpu};

#[cfg(feature = "gpu")]
use crate::gpu::Uploaded;
#[cfg(not(feature = "gpu"))]
use crate::without_gpu::Uploaded;

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
            match Uploaded::new(scene, options) {
                Ok(uploaded) => painter.gpu = Some(Box::new(uploaded)),
                Err(error) => painter.fall_back(error)?,
            }
        }
        Ok(painter)
    }

    /// The renderer's name: that of the adapter, or `cpu`.
    #[must_use]
    pub fn name(&self) -> &str {
        self.gpu.as_ref().map_or("cpu", |gpu| gpu.name())
    }

    /// The reason why the CPU draws instead of the GPU, if it does.
    #[must_use]
    pub fn notice(&self) -> Option<&str> {
        self.notice.as_deref()
    }

    /// Draws the scene as `camera` sees it. See [`super::render`].
    ///
    /// # Errors
    /// With [`RendererChoice::Gpu`], whatever the adapter cannot do.
    pub fn draw(
        &mut self,
        camera: &Camera,
        options: &RenderOptions,
        progress: &(dyn Fn(f32) + Sync),
    ) -> Result<RgbaImage, GpuError> {
        if let Some(gpu) = &mut self.gpu {
            match in_front_of_set(gpu, self.scene, camera, options) {
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
        // A machine without an adapter needs no notice, nor a build that can't use one.
        if !matches!(error, GpuError::NoAdapter | GpuError::NotBuiltIn) {
            self.notice = Some(format!("the processor draws instead: {error}"));
        }
        Ok(())
    }
}

/// Yarns that the graphics processor draws, in front of the set that the processor draws.
fn in_front_of_set(
    gpu: &mut Uploaded,
    scene: &Scene,
    camera: &Camera,
    options: &RenderOptions,
) -> Result<RgbaImage, GpuError> {
    let Some(set) = options.set.as_ref().filter(|set| !set.is_empty()) else {
        return gpu.draw(scene, camera, options);
    };
    if set.body.is_some() {
        return Err(GpuError::Body);
    }
    let alone = RenderOptions { background: Background::Transparent, ..options.clone() };
    Ok(cpu::before_set(gpu.draw(scene, camera, &alone)?, camera, options))
}
