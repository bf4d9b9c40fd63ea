//! Renders the picture in the window on the window's own graphics device.
//!
//! In: a scene, then one [`FrameRequest`] at a time. Out: a texture that the window shows. A frame
//! that is shown already is not drawn again. While something moves on a slow device, drafts of
//! lower resolution are drawn, whose coarseness follows their times. In the command, only this file
//! and the opening of the window name wgpu.

use std::ops::RangeInclusive;
use std::time::{Duration, Instant};

use eframe::egui::TextureId;
use eframe::egui_wgpu::RenderState;
use eframe::wgpu;
use image::RgbaImage;
use warpknit::render::GpuError;
use warpknit::render::gpu::{Gpu, Renderer, Yarns};
use warpknit::render::scene::Scene;
use warpknit::render::{Camera, RenderOptions};

use super::panel::RenderSettings;

/// Time of a full frame above which drafts are drawn while something moves.
const SLOW: Duration = Duration::from_millis(60);
/// Time of a draft above which the next one is coarser.
const SLOW_DRAFT: Duration = Duration::from_millis(200);
/// Least and greatest size of a draft's pixel in pixels of the window, each way.
const COARSENESS: RangeInclusive<u32> = 2..=4;

/// Everything that a frame depends on besides the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FrameRequest {
    pub(super) camera: Camera,
    pub(super) rendering: RenderSettings,
    /// Pixels across and down.
    pub(super) size: [u32; 2],
}

/// Draws into the window.
pub(super) struct FrameRenderer {
    state: RenderState,
    /// `None` after an error of the device, until the next upload.
    renderers: Option<DeviceRenderers>,
    target: Option<FrameTexture>,
    shown: Option<(FrameRequest, Quality)>,
    /// Time of the last full frame.
    pub(super) full: Duration,
    /// Time of the last draft.
    pub(super) draft: Duration,
    /// Size of the next draft's pixels, see [`COARSENESS`].
    coarseness: u32,
}

/// The quality of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Quality {
    Draft,
    Full,
}

/// The renderers of the device, and the yarns on it.
struct DeviceRenderers {
    full: Renderer,
    /// Created with the first draft; a fast device never needs it.
    draft: Option<Renderer>,
    gpu: Gpu,
    yarns: Option<Yarns>,
}

/// The texture that is shown.
struct FrameTexture {
    size: [u32; 2],
    view: wgpu::TextureView,
    id: TextureId,
}

impl FrameRenderer {
    /// Draws on the device that the window has opened.
    pub(super) fn open(state: &RenderState) -> Result<Self, GpuError> {
        let renderers = Some(DeviceRenderers::open(state)?);
        let (full, draft) = (Duration::ZERO, Duration::ZERO);
        Ok(Self {
            state: state.clone(),
            renderers,
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

    /// Uploads a scene with `st` segments a stitch, in place of the last one.
    pub(super) fn upload(&mut self, scene: &Scene, st: u32) -> Result<(), GpuError> {
        self.shown = None;
        let result = self.try_upload(scene, st);
        self.forget_after(result)
    }

    fn try_upload(&mut self, scene: &Scene, st: u32) -> Result<(), GpuError> {
        let renderers = match &mut self.renderers {
            Some(renderers) => renderers,
            // A device that ran out of memory may have room for a smaller scene.
            gone => gone.insert(DeviceRenderers::open(&self.state)?),
        };
        // The old scene is freed first, since both together may not fit.
        renderers.yarns = None;
        renderers.yarns = Some(renderers.full.load(scene, st)?);
        Ok(())
    }

    /// Draws a frame unless it is shown already, and returns whether it drew. While the picture
    /// `moves`, a draft is good enough.
    pub(super) fn draw(&mut self, shot: FrameRequest, moves: bool) -> Result<bool, GpuError> {
        let quality = if moves && self.full > SLOW { Quality::Draft } else { Quality::Full };
        if self.shown.is_some_and(|(shown, best)| {
            shown == shot && (best == Quality::Full || best == quality)
        }) {
            return Ok(false);
        }
        // After an error the last picture stays until the next upload.
        if self.renderers.is_none() {
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

    /// Notes the time of a draft and adapts the next one's coarseness. The gap between the two
    /// limits keeps it from changing back and forth.
    fn time_draft(&mut self, spent: Duration) {
        self.draft = spent;
        if spent > SLOW_DRAFT && self.coarseness < *COARSENESS.end() {
            self.coarseness += 1;
        } else if spent < SLOW && self.coarseness > *COARSENESS.start() {
            self.coarseness -= 1;
        }
    }

    /// Draws a frame and waits for it.
    fn try_draw(&mut self, shot: FrameRequest, quality: Quality) -> Result<(), GpuError> {
        let (size, samples) = match quality {
            Quality::Draft => (shot.size.map(|pixels| pixels.div_ceil(self.coarseness)), 1),
            Quality::Full => (shot.size, 4),
        };
        let target = match self.target.take() {
            Some(target) if target.size == size => target,
            old => self.texture_of_size(size, old),
        };
        if let Some(renderers) = &mut self.renderers
            && let Some(yarns) = &renderers.yarns
        {
            let renderer = match (quality, &mut renderers.draft) {
                (Quality::Full, _) => &mut renderers.full,
                (Quality::Draft, Some(renderer)) => renderer,
                (Quality::Draft, none) => {
                    none.insert(Renderer::new(renderers.gpu.clone(), samples)?)
                }
            };
            let options = shot.rendering.options(size, samples);
            let options =
                RenderOptions { lod: options.lod || quality == Quality::Draft, ..options };
            renderer.draw_to(yarns, &shot.camera, &options, &target.view)?;
            // Waiting makes the measured time that of the whole frame, and keeps frames from piling
            // up on a slow device. An error of waiting shows up with the next frame.
            let _waited = self.state.device.poll(wgpu::PollType::wait_indefinitely());
        }
        self.target = Some(target);
        Ok(())
    }

    /// A texture of another size under the old one's id.
    fn texture_of_size(&self, size: [u32; 2], old: Option<FrameTexture>) -> FrameTexture {
        let RenderState { device, renderer, .. } = &self.state;
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("window"),
            size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            // The renderer writes sRGB-encoded values, and egui samples them without decoding.
            format: wgpu::TextureFormat::Rgba8Unorm,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let (mut renderer, filter) = (renderer.write(), wgpu::FilterMode::Linear);
        let id = if let Some(FrameTexture { id, .. }) = old {
            renderer.update_egui_texture_from_wgpu_texture(device, &view, filter, id);
            id
        } else {
            renderer.register_native_texture(device, &view, filter)
        };
        FrameTexture { size, view, id }
    }

    /// The texture to show, once something was drawn.
    pub(super) fn texture(&self) -> Option<TextureId> {
        self.target.as_ref().map(|target| target.id)
    }

    /// Whether the shown frame is a draft, so that a full one should follow.
    pub(super) fn is_draft(&self) -> bool {
        self.shown.is_some_and(|(_, quality)| quality == Quality::Draft)
    }

    /// Draws a picture for a file.
    pub(super) fn picture(
        &mut self,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<Option<RgbaImage>, GpuError> {
        let Some(DeviceRenderers { full, yarns: Some(yarns), .. }) = &mut self.renderers else {
            return Ok(None);
        };
        let drawn = full.draw(yarns, camera, options).map(Some);
        self.forget_after(drawn)
    }

    /// The largest side of a picture in the window.
    pub(super) fn largest_side(&self) -> u32 {
        self.state.device.limits().max_texture_dimension_2d
    }

    /// Drops the renderers after an error: a device in an error state keeps failing, and new
    /// renderers start clean.
    fn forget_after<T>(&mut self, result: Result<T, GpuError>) -> Result<T, GpuError> {
        if result.is_err() {
            self.renderers = None;
        }
        result
    }
}

impl DeviceRenderers {
    fn open(state: &RenderState) -> Result<Self, GpuError> {
        let gpu = Gpu::on(&state.adapter, state.device.clone(), state.queue.clone())?;
        Ok(Self { full: Renderer::new(gpu.clone(), 4)?, draft: None, gpu, yarns: None })
    }
}
