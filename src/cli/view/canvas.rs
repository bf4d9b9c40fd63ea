//! The picture in the window, drawn on the window's own device.
//!
//! In: a scene, then a [`Shot`] of it at a time. Out: a texture that the window shows. Only this
//! file and the opening of the window name wgpu in the binary, for that texture and to know when a
//! frame is done. Nothing is drawn twice, and while something moves on a slow device, drafts are
//! drawn.

use std::ops::RangeInclusive;
use std::time::{Duration, Instant};

use eframe::egui::TextureId;
use eframe::egui_wgpu::RenderState;
use eframe::wgpu;
use image::RgbaImage;
use warpknit::render::gpu::{Gpu, GpuError, Renderer, Yarns};
use warpknit::render::{Camera, RenderOptions};
use warpknit::scene::Scene;

use super::panel::Look;

/// Frames that take longer are drawn as drafts while something moves.
const SLOW: Duration = Duration::from_millis(60);
/// Drafts that take longer become coarser.
const SLOW_DRAFT: Duration = Duration::from_millis(200);
/// Pixels of the window each way that one of a draft stands for.
const COARSENESS: RangeInclusive<u32> = 2..=4;

/// What a frame depends on, besides the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shot {
    pub(super) camera: Camera,
    pub(super) look: Look,
    /// Pixels across and down.
    pub(super) size: [u32; 2],
}

/// Draws into the window.
pub(super) struct Canvas {
    state: RenderState,
    /// None after something went wrong on the device, until it is tried again.
    easel: Option<Easel>,
    target: Option<Target>,
    shown: Option<(Shot, Quality)>,
    /// What the last frame of each quality took.
    pub(super) full: Duration,
    pub(super) draft: Duration,
    /// How coarse the next draft is.
    coarseness: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Quality {
    Draft,
    Full,
}

/// Renderers and what they draw.
struct Easel {
    full: Renderer,
    /// Made when it is first needed: a fast device never does.
    draft: Option<Renderer>,
    gpu: Gpu,
    yarns: Option<Yarns>,
}

/// The texture that is shown.
struct Target {
    size: [u32; 2],
    view: wgpu::TextureView,
    id: TextureId,
}

impl Canvas {
    /// Draws on the device that the window has opened.
    pub(super) fn open(state: &RenderState) -> Result<Self, GpuError> {
        let easel = Some(Easel::open(state)?);
        let (full, draft) = (Duration::ZERO, Duration::ZERO);
        Ok(Self {
            state: state.clone(),
            easel,
            target: None,
            shown: None,
            full,
            draft,
            coarseness: *COARSENESS.start(),
        })
    }

    /// The adapter's name.
    pub(super) fn adapter(&self) -> String {
        self.state.adapter.get_info().name
    }

    /// Puts a scene on the device, `st` pieces a stitch, in place of the last one.
    pub(super) fn hang(&mut self, scene: &Scene, st: u32) -> Result<(), GpuError> {
        self.shown = None;
        let result = self.try_hang(scene, st);
        self.forget_after(result)
    }

    fn try_hang(&mut self, scene: &Scene, st: u32) -> Result<(), GpuError> {
        let easel = match &mut self.easel {
            Some(easel) => easel,
            // A device that ran out of memory may do for less.
            gone => gone.insert(Easel::open(&self.state)?),
        };
        // The old one goes first, since both may not fit.
        easel.yarns = None;
        easel.yarns = Some(easel.full.load(scene, st)?);
        Ok(())
    }

    /// Draws a shot unless it is shown already, and says whether it did; a draft will do for one
    /// that `moves`.
    pub(super) fn draw(&mut self, shot: Shot, moves: bool) -> Result<bool, GpuError> {
        let quality = if moves && self.full > SLOW { Quality::Draft } else { Quality::Full };
        if self.shown.is_some_and(|(shown, best)| {
            shown == shot && (best == Quality::Full || best == quality)
        }) {
            return Ok(false);
        }
        // After a fault the last picture stays until there is cloth again.
        if self.easel.is_none() {
            return Ok(false);
        }
        let start = Instant::now();
        let result = self.try_draw(shot, quality);
        self.forget_after(result)?;
        self.shown = Some((shot, quality));
        match quality {
            Quality::Draft => self.time_draft(start.elapsed()),
            Quality::Full => self.full = start.elapsed(),
        }
        Ok(true)
    }

    fn time_draft(&mut self, spent: Duration) {
        self.draft = spent;
        if spent > SLOW_DRAFT && self.coarseness < *COARSENESS.end() {
            self.coarseness += 1;
        } else if spent < SLOW && self.coarseness > *COARSENESS.start() {
            self.coarseness -= 1;
        }
    }

    fn try_draw(&mut self, shot: Shot, quality: Quality) -> Result<(), GpuError> {
        let (size, samples) = match quality {
            Quality::Draft => (shot.size.map(|pixels| pixels.div_ceil(self.coarseness)), 1),
            Quality::Full => (shot.size, 4),
        };
        let target = match self.target.take() {
            Some(target) if target.size == size => target,
            old => self.target_of(size, old),
        };
        if let Some(easel) = &mut self.easel
            && let Some(yarns) = &easel.yarns
        {
            let renderer = match (quality, &mut easel.draft) {
                (Quality::Full, _) => &mut easel.full,
                (Quality::Draft, Some(renderer)) => renderer,
                (Quality::Draft, none) => none.insert(Renderer::new(easel.gpu.clone(), samples)?),
            };
            let options = shot.look.options(size, samples);
            let options =
                RenderOptions { lod: options.lod || quality == Quality::Draft, ..options };
            renderer.draw_to(yarns, &shot.camera, &options, &target.view)?;
            // Frames are timed whole, and none is begun before the last one is done. What goes
            // wrong here, the next frame tells.
            let _waited = self.state.device.poll(wgpu::PollType::wait_indefinitely());
        }
        self.target = Some(target);
        Ok(())
    }

    /// A texture of another size under the same name.
    fn target_of(&self, size: [u32; 2], old: Option<Target>) -> Target {
        let RenderState { device, renderer, .. } = &self.state;
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("window"),
            size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            // Encoded as files are, which is what the window samples.
            format: wgpu::TextureFormat::Rgba8Unorm,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let (mut renderer, filter) = (renderer.write(), wgpu::FilterMode::Linear);
        let id = if let Some(Target { id, .. }) = old {
            renderer.update_egui_texture_from_wgpu_texture(device, &view, filter, id);
            id
        } else {
            renderer.register_native_texture(device, &view, filter)
        };
        Target { size, view, id }
    }

    /// What to show, if anything was drawn.
    pub(super) fn texture(&self) -> Option<TextureId> {
        self.target.as_ref().map(|target| target.id)
    }

    /// Whether a better frame of what is shown is wanted.
    pub(super) fn is_draft(&self) -> bool {
        self.shown.is_some_and(|(_, quality)| quality == Quality::Draft)
    }

    /// Draws a picture for a file.
    pub(super) fn picture(
        &mut self,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<Option<RgbaImage>, GpuError> {
        let Some(Easel { full, yarns: Some(yarns), .. }) = &mut self.easel else { return Ok(None) };
        let drawn = full.draw(yarns, camera, options).map(Some);
        self.forget_after(drawn)
    }

    /// The largest side of a picture in the window.
    pub(super) fn largest_side(&self) -> u32 {
        self.state.device.limits().max_texture_dimension_2d
    }

    /// A device on which something went wrong says so ever after, and is asked anew.
    fn forget_after<T>(&mut self, result: Result<T, GpuError>) -> Result<T, GpuError> {
        if result.is_err() {
            self.easel = None;
        }
        result
    }
}

impl Easel {
    fn open(state: &RenderState) -> Result<Self, GpuError> {
        let gpu = Gpu::on(&state.adapter, state.device.clone(), state.queue.clone())?;
        Ok(Self { full: Renderer::new(gpu.clone(), 4)?, draft: None, gpu, yarns: None })
    }
}
