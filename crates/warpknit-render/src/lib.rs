//! Pictures of yarns. All renderers share one scene, one camera and one shading model.
//!
//! In: a [`Scene`], a [`Camera`] and [`RenderOptions`]. Out: an sRGB picture with straight alpha.
//!
//! All renderers share these modules: [`camera`] (rays and framing), [`light`] (sun and sky),
//! [`environment`] (both from a picture of everything around), [`shade`] (reflection of a surface),
//! [`sheen`] (specular reflection of fibres), [`ply`] (procedural plies and fibres), [`maps`]
//! (textures of yarns), `paths` (curves as polylines) and [`tone`] (from light to pixels). [`cpu`]
//! traces rays through the trees of `bvh`, or splats distant yarns. [`gpu`] rasterises triangles;
//! only it names wgpu. [`painter`] chooses between the two. [`fabric_maps`] draws one repeat of a
//! fabric without light, for renderers of surfaces.
//!
//! ```
//! use warpknit_render::{Camera, RenderOptions, View, render};
//! use warpknit_render::scene::{Scene, YarnLook};
//! let mut scene = Scene::default();
//! scene.looks.push(YarnLook::plain(glam::Vec3::splat(0.5), 0.7, 0.1));
//! scene.push_strand([glam::Vec3::NEG_X, glam::Vec3::X], 0);
//! let options = RenderOptions { width: 40, height: 30, ..RenderOptions::default() };
//! let (fov, aspect) = (Camera::DEFAULT_FOV, options.aspect());
//! let camera = Camera::view(View::Front, &scene.positions, fov, 1.0, aspect);
//! let picture = render(&scene, &camera, &options, &|_| ())?;
//! assert_ne!(picture.get_pixel(20, 15), picture.get_pixel(20, 2));
//! # Ok::<(), warpknit_render::GpuError>(())
//! ```

pub mod averaged;
mod bvh;
pub mod camera;
pub mod cloth;
pub mod cpu;
pub mod environment;
mod error;
pub mod fabric_maps;
pub mod fibres;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod hairs;
pub mod light;
mod limits;
mod look;
pub mod maps;
pub mod mips;
pub mod octahedral;
pub mod oval;
pub mod painter;
mod paths;
pub mod ply;
mod point_run;
pub mod scene;
pub mod set;
pub mod shade;
mod shape;
pub mod sheen;
mod tangent_frame;
pub mod tone;
mod unroll;
#[cfg(not(feature = "gpu"))]
mod without_gpu;

pub use camera::{Camera, View};
pub use error::GpuError;
pub use light::Light;
pub use painter::Painter;
pub use tone::Background;

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::averaged::AveragedCloth;
use crate::scene::Scene;
use crate::set::Set;
use image::RgbaImage;

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

/// Distance of pixels' middles from the wanted disc within which they matter to it, pixels: half a
/// pixel for its smooth rim, and the diagonal of a pixel for the filter.
const FILTER_REACH: f32 = 2.0;

/// Settings of a picture.
#[derive(Clone, Debug)]
pub struct RenderOptions {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Rows of the picture that are wanted, or all. They are the same to the byte as in the whole
    /// picture.
    pub rows: Option<Range<u32>>,
    /// Whether only the largest disc within the picture is wanted. The processor then leaves most
    /// of the rest empty.
    pub is_round: bool,
    /// The renderer.
    pub renderer: RendererChoice,
    /// Samples per pixel, at least 1. The GPU renderer takes `samples` of them by multisampling and
    /// the rest by supersampling.
    pub spp: u32,
    /// Ambient occlusion rays per sample.
    pub sky_rays: u32,
    /// Colour of pixels without yarn.
    pub background: Background,
    /// What stands around the cloth. By default nothing.
    pub set: Option<Arc<Set>>,
    /// Cloth that is drawn as a surface, besides the yarns of the scene. Only the processor draws
    /// it.
    pub averaged: Option<Arc<AveragedCloth>>,
    /// Sun and sky.
    pub light: Light,
    /// Factor on the light before tone mapping.
    pub exposure: f32,
    /// Multisampling of the GPU renderer, samples per pixel: 1 or 4.
    pub samples: u32,
    /// St: largest number of pieces a stitch in the GPU renderer.
    pub st: u32,
    /// Sr: largest number of edges of a tube's cross-section there.
    pub sr: u32,
    /// Level of detail: whether distant yarns may be coarser.
    pub lod: bool,
    /// Seed of the sampling noise. The same seed gives the same bytes.
    pub seed: u32,
    /// Ends the drawing once it is true. What isn't drawn by then is empty. Only the processor
    /// looks at it.
    pub stop: Option<Arc<AtomicBool>>,
}

impl RenderOptions {
    /// Width over height.
    #[must_use]
    pub fn aspect(&self) -> f64 {
        f64::from(self.width.max(1)) / f64::from(self.height.max(1))
    }

    /// Whether nobody wants the picture any longer.
    pub(crate) fn is_stopped(&self) -> bool {
        self.stop.as_ref().is_some_and(|stop| stop.load(Ordering::Relaxed))
    }

    /// A place of a pixel, 0..1 across and down, in the coordinates of [`Camera::direction`].
    pub(crate) fn picture_point(&self, [x, y]: [u32; 2], place: [f32; 2]) -> [f64; 2] {
        let across = (f64::from(x) + f64::from(place[0])) / f64::from(self.width) * 2.0 - 1.0;
        let up = 1.0 - (f64::from(y) + f64::from(place[1])) / f64::from(self.height) * 2.0;
        [across, up]
    }

    /// Whether a pixel is wanted, or one next to it, whose filter reaches it.
    pub(crate) fn is_wanted(&self, pixel: [u32; 2]) -> bool {
        if !self.is_round {
            return true;
        }
        let [width, height] = [self.width, self.height].map(|side| side as f32);
        let [x, y] = pixel.map(|at| at as f32 + 0.5);
        let from_middle = (x - 0.5 * width).hypot(y - 0.5 * height);
        from_middle < 0.5 * width.min(height) + FILTER_REACH
    }

    /// The wanted rows, clipped to the picture.
    #[must_use]
    pub fn rows(&self) -> Range<u32> {
        let rows = self.rows.clone().unwrap_or(0..self.height);
        // A range beyond the picture becomes empty, never reversed.
        let end = rows.end.min(self.height);
        rows.start.min(end)..end
    }
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            width: 1600,
            height: 1200,
            rows: None,
            is_round: false,
            renderer: RendererChoice::Cpu,
            spp: 4,
            sky_rays: 2,
            background: Background::default(),
            set: None,
            averaged: None,
            light: Light::default(),
            exposure: 1.0,
            samples: 4,
            st: 40,
            sr: 12,
            lod: true,
            seed: 0,
            stop: None,
        }
    }
}

/// Draws `scene` as `camera` sees it. `progress` receives the finished fraction, 0..1, from any
/// thread and in no fixed order.
///
/// The bytes depend on the arguments alone, and on the graphics adapter if one draws. They do not
/// depend on the number of threads. An empty scene gives the background. [`Painter`] draws several
/// pictures of one scene.
///
/// # Errors
/// With [`RendererChoice::Gpu`], whatever the adapter cannot do.
pub fn render(
    scene: &Scene,
    camera: &Camera,
    options: &RenderOptions,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<RgbaImage, GpuError> {
    Painter::new(scene, options)?.draw(camera, options, progress)
}
