//! The GPU renderer, through wgpu.
//!
//! In: a scene, a camera and options, as for every renderer. Out: the picture, or an error that
//! says what to do. In the library, only this module names wgpu. The passes of a frame are:
//!
//! 1. Depths from the sun, filtered (variance shadow map).
//! 2. Depths around the eye, filtered (ambient occlusion). From afar, means over traced patches of cloth
//!    take the place of what both maps say of neighbouring yarns.
//! 3. The yarns with their light, tile by tile, so that no picture is too large. A depth pre-pass
//!    comes first. A pixel has as many texels as the thinnest yarn needs.
//! 4. Tone mapping, the same curve as in all renderers.
//!
//! `device` opens the adapter. `pages` keeps the yarns in its memory. `lod` selects the level of
//! detail. `frame` computes projections, and `tiles` divides the picture. `pipelines` compiles
//! shaders, `passes` records commands, and `resources` creates buffers and textures.
//!
//! Not promised: the same bytes on two adapters. On one adapter they depend on the arguments alone.

mod data;
mod device;
#[cfg(test)]
mod far;
mod frame;
mod lod;
mod pages;
#[cfg(test)]
mod parity;
mod passes;
mod pipelines;
mod resources;
#[cfg(unix)]
mod silence;
mod tiles;
mod uploaded;

use std::collections::BTreeMap;

use bytemuck::bytes_of;
use glam::{DVec3, Vec3, Vec4};
use image::{Rgba, RgbaImage};
use wgpu::{BufferUsages, TextureFormat, TextureUsages};

pub use device::Gpu;
pub(crate) use uploaded::Uploaded;

use super::mips::Mips;
use super::{Background, Camera, RenderOptions, ply};
use crate::GpuError;
use crate::cpu::patches::YarnPatches;
use crate::scene::{Scene, Shape, YarnLook};
use frame::{DepthMap, FrameSetup};
use lod::{Chunks, Frustum, LodRules};
use pages::Page;
use passes::{PreparedDraws, depth_attachment, screen_pass};
use pipelines::{Layouts, PassKind, Pipelines};
use tiles::PictureTile;

/// Light before tone mapping. Half floats hold a thousand times the sun's.
const LIGHT: TextureFormat = TextureFormat::Rgba16Float;
/// Mean, variance and cover of depths. Half floats would lose a yarn's radius at a metre.
const MOMENTS: TextureFormat = TextureFormat::Rgba32Float;
const DEPTH: TextureFormat = TextureFormat::Depth32Float;
/// Pixels as they go to files. The shader encodes sRGB itself.
const PICTURE: TextureFormat = TextureFormat::Rgba8Unorm;

/// A device with everything that does not depend on the scene.
#[derive(Debug)]
pub struct Renderer {
    gpu: Gpu,
    layouts: Layouts,
    pipelines: Pipelines,
    /// Index buffers and their lengths, by number of edges.
    indices: BTreeMap<u32, (wgpu::Buffer, u32)>,
    sampler: wgpu::Sampler,
}

/// A scene in the device's memory.
#[derive(Debug)]
pub struct Yarns {
    centre: DVec3,
    pages: Vec<Page>,
    shape: Shape,
    lod: LodRules,
    /// Whether any look has a sheen.
    has_sheen: bool,
    /// Whether any section is no circle.
    is_flattened: bool,
    looks: wgpu::Buffer,
    thinnest: f32,
    /// Radii of the thinnest and of the thickest yarn that is no fibre or hair.
    yarn_radii: (f32, f32),
    /// See [`Scene::mean_albedo`].
    albedo: Vec3,
    /// What they leave visible to each other, for pictures from afar.
    patches: YarnPatches,
    /// Textures of each set of maps. The last entry stands for yarns without any.
    maps: Vec<wgpu::BindGroup>,
}

/// A frame's projections, and its filtered depths bound for the light pass.
type Geometry = (FrameSetup, wgpu::BindGroup);

impl Renderer {
    /// Compiles the shaders for pictures with this number of samples per pixel: 1 or 4.
    ///
    /// # Errors
    /// Whatever the device refuses.
    pub fn new(gpu: Gpu, samples: u32) -> Result<Self, GpuError> {
        let layouts = Layouts::new(&gpu);
        let pipelines = Pipelines::new(&gpu, &layouts, if samples > 1 { 4 } else { 1 });
        let filter = wgpu::FilterMode::Linear;
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            address_mode_u: wgpu::AddressMode::Repeat,
            address_mode_v: wgpu::AddressMode::Repeat,
            mag_filter: filter,
            min_filter: filter,
            mipmap_filter: wgpu::MipmapFilterMode::Linear,
            ..wgpu::SamplerDescriptor::default()
        });
        gpu.fault()?;
        Ok(Self { gpu, layouts, pipelines, indices: BTreeMap::new(), sampler })
    }

    /// The adapter's name.
    #[must_use]
    pub fn name(&self) -> &str {
        self.gpu.name()
    }

    /// Uploads a scene with `st` pieces a stitch. The scene is not needed afterwards.
    ///
    /// # Errors
    /// Whatever the device refuses, above all memory.
    pub fn load(&self, scene: &Scene, st: u32) -> Result<Yarns, GpuError> {
        let centre = scene.bounds().map_or(DVec3::ZERO, |bounds| bounds.centre().as_dvec3());
        let (thinnest, _) = scene.radii();
        // Bindings must not be empty.
        let mut looks: Vec<_> = scene.looks.iter().map(|look| shader_look(look, scene)).collect();
        if looks.is_empty() {
            looks.push(bytemuck::Zeroable::zeroed());
        }
        let is_flattened = !scene.presses.is_empty();
        let has_sheen = scene.looks.iter().any(|look| look.sheen > 0.0);
        let looks = self.gpu.store("looks", bytemuck::cast_slice(&looks), BufferUsages::STORAGE);
        let most = self.gpu.device.limits().max_texture_dimension_2d;
        if let Some(maps) = scene
            .maps
            .iter()
            .find(|maps| maps.base.levels[0].width().max(maps.base.levels[0].height()) > most)
        {
            let (width, height) = maps.base.levels[0].dimensions();
            let lacking = format!(
                "room for a yarn's picture of {width} x {height} pixels, {most} a side at most"
            );
            return Err(GpuError::Lacking { adapter: self.name().to_owned(), lacking });
        }
        let mut maps: Vec<_> = scene
            .maps
            .iter()
            .map(|maps| self.maps_group(&maps.base, &maps.normal, &maps.surface))
            .collect();
        // Yarns without textures bind white texels, because every binding needs a resource.
        let none = Mips { levels: vec![RgbaImage::from_pixel(1, 1, Rgba([255; 4]))] };
        maps.push(self.maps_group(&none, &none, &none));
        let pages = pages::upload(&self.gpu, scene, centre, st)?;
        let (albedo, lod) = (scene.mean_albedo(), LodRules::new(scene));
        Ok(Yarns {
            centre,
            pages,
            shape: scene.shape,
            lod,
            has_sheen,
            is_flattened,
            looks,
            thinnest,
            yarn_radii: scene.yarn_radii(),
            albedo,
            patches: YarnPatches::new(scene),
            maps,
        })
    }

    /// Draws a picture and reads it back.
    ///
    /// # Errors
    /// Whatever the device refuses.
    pub fn draw(
        &mut self,
        yarns: &Yarns,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<RgbaImage, GpuError> {
        let mut picture = RgbaImage::new(options.width, options.height);
        let geometry = self.geometry(yarns, camera, options)?;
        let scale = texels_a_pixel(geometry.as_ref(), options);
        for tile in tiles::tiles(options, scale, tiles::most_texels(&self.gpu)) {
            let drawn = self.gpu.texture(PICTURE, tile.size, TextureUsages::COPY_SRC, 1);
            let view = drawn.create_view(&wgpu::TextureViewDescriptor::default());
            self.tile(yarns, geometry.as_ref(), options, tile, (&view, [0, 0]));
            self.gpu.read(&drawn, &mut picture, tile.corner)?;
        }
        Ok(picture)
    }

    /// Draws the whole picture to a texture of its size, to be shown in a window.
    ///
    /// # Errors
    /// Whatever the device refuses.
    pub fn draw_to(
        &mut self,
        yarns: &Yarns,
        camera: &Camera,
        options: &RenderOptions,
        to: &wgpu::TextureView,
    ) -> Result<(), GpuError> {
        let geometry = self.geometry(yarns, camera, options)?;
        let scale = texels_a_pixel(geometry.as_ref(), options);
        // A window of one texel a pixel is drawn at once, since each tile has passes of its own.
        let whole = self.gpu.device.limits().max_texture_dimension_2d;
        let most = if scale == 1 { whole } else { tiles::most_texels(&self.gpu) };
        for tile in tiles::tiles(options, scale, most) {
            self.tile(yarns, geometry.as_ref(), options, tile, (to, tile.corner));
            // Without waiting, all tiles would have their textures at once.
            self.gpu.wait()?;
        }
        Ok(())
    }

    /// Computes a frame's projections and depths. `None` if the camera sees no yarn.
    fn geometry(
        &mut self,
        yarns: &Yarns,
        camera: &Camera,
        options: &RenderOptions,
    ) -> Result<Option<Geometry>, GpuError> {
        let Some(frame) = FrameSetup::new(yarns, camera, options) else { return Ok(None) };
        let depth_maps = self.depth_maps(yarns, &frame, options)?;
        Ok(Some((frame, depth_maps)))
    }

    /// Draws and filters the depths from the sun and around the eye; returns them bound for the
    /// light pass.
    fn depth_maps(
        &mut self,
        yarns: &Yarns,
        frame: &FrameSetup,
        options: &RenderOptions,
    ) -> Result<wgpu::BindGroup, GpuError> {
        let mut encoder = self
            .gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("depths") });
        let sunward = Chunks::inside(&yarns.pages, &frame.sun.frustum);
        let [sun, depth] =
            [(&frame.sun, &sunward), (&frame.depth, &frame.visible)].map(|(map, chunks)| {
                let depths = &[PassKind::Depth];
                let prepared = self.prepare_draws(yarns, chunks, &map.frustum, options, depths);
                self.depth_map(&mut encoder, yarns, frame, map, &prepared)
            });
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.fault()?;
        Ok(self.gpu.group(
            "light",
            &self.layouts.light,
            &[wgpu::BindingResource::TextureView(&sun), wgpu::BindingResource::TextureView(&depth)],
        ))
    }

    /// Draws depths and filters them.
    fn depth_map(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        yarns: &Yarns,
        frame: &FrameSetup,
        map: &DepthMap,
        prepared: &PreparedDraws,
    ) -> wgpu::TextureView {
        let depths = self.gpu.target(DEPTH, map.size, 1);
        let view = data::ViewUniform {
            clip_from_world: map.frustum.clip_from_world,
            eye: map.frustum.eye,
            pixel: map.frustum.pixel,
            ..frame.view
        };
        {
            // Far depths, 1, stay where no yarn is drawn.
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("depth"),
                depth_stencil_attachment: Some(depth_attachment(
                    &depths,
                    wgpu::LoadOp::Clear(1.0),
                    wgpu::StoreOp::Store,
                )),
                ..wgpu::RenderPassDescriptor::default()
            });
            self.draw_prepared(&mut pass, yarns, prepared, &view, PassKind::Depth);
        }
        // A Gaussian is separable: one pass along rows and one along columns cost 2 n taps instead
        // of n^2.
        let [once, twice] = [(); 2].map(|()| self.gpu.target(MOMENTS, map.size, 1));
        let [from_depths, from_moments] =
            if map.layer.is_some() { &self.pipelines.nearest } else { &self.pipelines.all };
        for (step, pipeline, from, to) in
            [([1, 0], from_depths, &twice, &once), ([0, 1], from_moments, &once, &twice)]
        {
            #[expect(clippy::cast_possible_truncation, reason = "some texels")]
            // Two standard deviations hold 95 % of the Gaussian's weight.
            let reach = (2.0 * map.sigma).round() as i32;
            let (perspective, layer) = (map.frustum.eye.w, map.layer.unwrap_or_default());
            let blur = data::Blur {
                step,
                reach,
                sigma: map.sigma,
                near: map.near,
                far: map.far,
                perspective,
                layer,
            };
            let blur = self.gpu.uniform(bytes_of(&blur));
            let (depths, from) = (
                wgpu::BindingResource::TextureView(&depths),
                wgpu::BindingResource::TextureView(from),
            );
            let group = self.gpu.group(
                "blur",
                &self.layouts.moments,
                &[blur.as_entire_binding(), depths, from],
            );
            screen_pass(encoder, pipeline, &group, to, None);
        }
        twice
    }

    /// Draws one tile of the picture to a texture, from a pixel of it on.
    fn tile(
        &mut self,
        yarns: &Yarns,
        geometry: Option<&Geometry>,
        options: &RenderOptions,
        tile: PictureTile,
        (to, at): (&wgpu::TextureView, [u32; 2]),
    ) {
        let size = tile.texels();
        let light = self.gpu.target(LIGHT, size, 1);
        let draws = geometry.map(|(frame, depth_maps)| {
            let view = tile.view(frame, options);
            let frustum = Frustum { clip_from_world: view.clip_from_world, ..frame.camera };
            let chunks = frame.visible.within(&yarns.pages, &frustum);
            let kinds = &[PassKind::Prepass, PassKind::Light, PassKind::Fuzz];
            (view, depth_maps, self.prepare_draws(yarns, &chunks, &frustum, options, kinds))
        });
        let mut encoder = self
            .gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("picture") });
        self.light(&mut encoder, yarns, draws.as_ref(), size, &light);
        let background = match options.background {
            Background::Transparent => Vec4::ZERO,
            Background::Color([r, g, b]) => {
                Vec4::new(f32::from(r), f32::from(g), f32::from(b), 255.0) / 255.0
            }
        };
        let tone = data::Tone {
            background,
            exposure: options.exposure,
            scale: tile.scale.cast_signed(),
            corner: at.map(u32::cast_signed),
        };
        let tone = self.gpu.uniform(bytes_of(&tone));
        let bound = [tone.as_entire_binding(), wgpu::BindingResource::TextureView(&light)];
        screen_pass(
            &mut encoder,
            &self.pipelines.tone,
            &self.gpu.group("tone", &self.layouts.tone, &bound),
            to,
            Some((at, tile.size)),
        );
        self.gpu.queue.submit([encoder.finish()]);
    }

    /// Draws the yarns' light to `light`, after a depth pre-pass. Without yarns it stays black.
    fn light(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        yarns: &Yarns,
        draws: Option<&(data::ViewUniform, &wgpu::BindGroup, PreparedDraws)>,
        size: [u32; 2],
        light: &wgpu::TextureView,
    ) {
        let samples = self.pipelines.samples;
        // With multisampling, the pass renders to a texture of its own and the hardware averages
        // its samples into `light`.
        let sampled = (samples > 1).then(|| self.gpu.target(LIGHT, size, samples));
        let depths = self.gpu.target(DEPTH, size, samples);
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("before"),
                depth_stencil_attachment: Some(depth_attachment(
                    &depths,
                    wgpu::LoadOp::Clear(1.0),
                    wgpu::StoreOp::Store,
                )),
                ..wgpu::RenderPassDescriptor::default()
            });
            if let Some((view, _, prepared)) = draws {
                self.draw_prepared(&mut pass, yarns, prepared, view, PassKind::Prepass);
            }
        }
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("light"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: sampled.as_ref().unwrap_or(light),
                depth_slice: None,
                resolve_target: sampled.is_some().then_some(light),
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })],
            depth_stencil_attachment: Some(depth_attachment(
                &depths,
                wgpu::LoadOp::Load,
                wgpu::StoreOp::Discard,
            )),
            ..wgpu::RenderPassDescriptor::default()
        });
        if let Some((view, depth_maps, prepared)) = draws {
            pass.set_bind_group(3, *depth_maps, &[]);
            self.draw_prepared(&mut pass, yarns, prepared, view, PassKind::Light);
            // Fuzz comes last: it is blended over the solid yarns behind it.
            self.draw_prepared(&mut pass, yarns, prepared, view, PassKind::Fuzz);
        }
    }

    /// Uploads one set of textures and binds it.
    fn maps_group(&self, base: &Mips, normal: &Mips, surface: &Mips) -> wgpu::BindGroup {
        let formats =
            [TextureFormat::Rgba8UnormSrgb, TextureFormat::Rgba8Unorm, TextureFormat::Rgba8Unorm];
        let views: Vec<_> = [base, normal, surface]
            .iter()
            .zip(formats)
            .map(|(mips, format)| self.gpu.mips(mips, format))
            .collect();
        let mut bound: Vec<_> = views.iter().map(wgpu::BindingResource::TextureView).collect();
        bound.push(wgpu::BindingResource::Sampler(&self.sampler));
        self.gpu.group("maps", &self.layouts.maps, &bound)
    }
}

/// Texels of a picture a pixel each way.
fn texels_a_pixel(geometry: Option<&Geometry>, options: &RenderOptions) -> u32 {
    tiles::scale(geometry.map_or(1, |(frame, _)| frame.scale), options)
}

/// A look in the shaders' layout.
fn shader_look(look: &YarnLook, scene: &Scene) -> data::LookData {
    #[expect(clippy::cast_precision_loss, reason = "a few plies")]
    let plies = look.plies as f32;
    let [ply_slope, fibre_slope] = ply::slopes(plies, look.twist_slope);
    let repeat = scene.maps_of(look).map_or(0.0, |maps| maps.length);
    data::LookData {
        albedo: look.albedo,
        roughness: look.roughness,
        metallic: look.metallic,
        radius: look.radius,
        plies,
        ply_slope,
        fibre_slope,
        repeat,
        sheen: look.sheen,
        spare: 0.0,
    }
}
