//! Render passes: over the yarns (which instances, with which pipelines), and over all pixels.
//!
//! In: a [`DrawPlan`]. Out: commands. Bind groups other than the yarns' are created anew for each
//! pass; they are small.

use bytemuck::bytes_of;
use wgpu::BufferUsages;

use super::lod::{self, DrawPlan};
use super::pages::Page;
use super::pipelines::{self, Expansion, PassKind, PipelineKey};
use super::{Renderer, Yarns, data};
use crate::RenderOptions;
use crate::scene::Shape;
use warpknit_core::ids::index32;

/// Draws of a pass whose instances are on the device.
pub(super) struct PreparedDraws {
    plan: DrawPlan,
    /// Bind group of each page; `None` for pages with nothing to draw.
    groups: Vec<Option<wgpu::BindGroup>>,
}

impl Yarns {
    /// The pipeline for a batch in this kind of pass.
    fn pipeline_key(&self, key: &lod::BatchKey, pass_kind: PassKind) -> PipelineKey {
        let expansion = match (self.shape, key.edges) {
            (Shape::Ribbon, _) => Expansion::Ribbon,
            (Shape::Tube, 2) => Expansion::Strip,
            (Shape::Tube, _) => Expansion::Tube,
        };
        // Depth passes do not shade, so they share pipelines with and without sheen.
        let has_sheen = self.has_sheen && matches!(pass_kind, PassKind::Light | PassKind::Fuzz);
        let (has_maps, is_flattened) = (key.maps.is_some(), self.is_flattened);
        PipelineKey { expansion, pass_kind, has_maps, has_sheen, is_flattened }
    }
}

impl Renderer {
    /// Plans a pass over chunks, creates its pipelines, and uploads its instances.
    pub(super) fn prepare_draws(
        &mut self,
        yarns: &Yarns,
        chunks: &lod::Chunks,
        frustum: &lod::Frustum,
        options: &RenderOptions,
        pass_kind: &[PassKind],
    ) -> PreparedDraws {
        let plan = DrawPlan::new(&yarns.lod, &yarns.pages, chunks, frustum, options);
        for batch in &plan.batches {
            for pipeline in pass_kind
                .iter()
                .map(|&pass_kind| yarns.pipeline_key(&batch.key, pass_kind))
                .filter(|pipeline| pipeline.is_drawn())
            {
                // Pipelines are compiled on first use.
                self.pipelines.make(&self.gpu, &self.layouts, pipeline);
            }
            self.indices.entry(batch.key.edges).or_insert_with(|| {
                let indices = pipelines::indices(batch.key.edges);
                (
                    self.gpu.store("indices", bytemuck::cast_slice(&indices), BufferUsages::INDEX),
                    index32(indices.len()),
                )
            });
        }
        // All batches' uniforms share one buffer.
        let draws: Vec<u8> = plan.batches.iter().flat_map(|batch| self.draw_bytes(batch)).collect();
        if draws.is_empty() {
            return PreparedDraws { plan, groups: Vec::new() };
        }
        let draws = self.gpu.uniform(&draws);
        let groups = plan
            .parts
            .iter()
            .zip(&yarns.pages)
            .map(|(parts, page)| self.page_group(page, parts, &draws))
            .collect();
        PreparedDraws { plan, groups }
    }

    /// A batch's `Draw`, padded to the alignment of dynamic uniform offsets.
    fn draw_bytes(&self, batch: &lod::Batch) -> Vec<u8> {
        let draw = data::Draw {
            first: batch.first,
            stride: batch.key.stride,
            edges: batch.key.edges,
            spare: 0,
        };
        let mut bytes = bytes_of(&draw).to_vec();
        bytes.resize(self.gpu.device.limits().min_uniform_buffer_offset_alignment as usize, 0);
        bytes
    }

    /// Bind group of a page; `None` if nothing of it is drawn.
    fn page_group(
        &self,
        page: &Page,
        parts: &[u32],
        draws: &wgpu::Buffer,
    ) -> Option<wgpu::BindGroup> {
        if parts.is_empty() {
            return None;
        }
        let parts = self.gpu.store("parts", bytemuck::cast_slice(parts), BufferUsages::STORAGE);
        let draw = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: draws,
            offset: 0,
            size: std::num::NonZeroU64::new(size_of::<data::Draw>() as u64),
        });
        let stored = [&page.points, &page.tangent_frames, &page.chunks, &parts, &page.ovals]
            .map(wgpu::Buffer::as_entire_binding);
        let [points, tangent_frames, chunks, parts, ovals] = stored;
        Some(self.gpu.group(
            "page",
            &self.layouts.page,
            &[points, tangent_frames, chunks, parts, draw, ovals],
        ))
    }

    /// Draws all batches with their pipelines.
    pub(super) fn draw_prepared(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        yarns: &Yarns,
        prepared: &PreparedDraws,
        view: &data::ViewUniform,
        pass_kind: PassKind,
    ) {
        let view = self.gpu.uniform(bytes_of(view));
        let view = self.gpu.group(
            "view",
            &self.layouts.view,
            &[view.as_entire_binding(), yarns.looks.as_entire_binding()],
        );
        pass.set_bind_group(0, &view, &[]);
        let alignment = self.gpu.device.limits().min_uniform_buffer_offset_alignment;
        for (batch, number) in prepared.plan.batches.iter().zip(0_u32..) {
            let pipeline = yarns.pipeline_key(&batch.key, pass_kind);
            let (Some(pipeline), Some(group)) =
                (self.pipelines.made(pipeline), &prepared.groups[batch.page])
            else {
                continue;
            };
            let (indices, count) = &self.indices[&batch.key.edges];
            // The last entry stands for yarns without textures.
            let maps = batch.key.maps.map_or(yarns.maps.len() - 1, usize::from);
            pass.set_pipeline(pipeline);
            // A dynamic offset selects the batch's `Draw`; the bind group stays the same.
            pass.set_bind_group(1, group, &[number * alignment]);
            pass.set_bind_group(2, &yarns.maps[maps], &[]);
            pass.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint16);
            pass.draw_indexed(0..*count, 0, 0..batch.count);
        }
    }
}

/// A depth buffer as a pass' attachment.
pub(super) fn depth_attachment(
    view: &wgpu::TextureView,
    load: wgpu::LoadOp<f32>,
    store: wgpu::StoreOp,
) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    wgpu::RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(wgpu::Operations { load, store }),
        stencil_ops: None,
    }
}

/// Runs a fragment shader over all pixels of `to`, or over those from a corner on.
pub(super) fn screen_pass(
    encoder: &mut wgpu::CommandEncoder,
    pipeline: &wgpu::RenderPipeline,
    group: &wgpu::BindGroup,
    to: &wgpu::TextureView,
    part: Option<([u32; 2], [u32; 2])>,
) {
    // Other parts are kept.
    let load = part.map_or(wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), |_| wgpu::LoadOp::Load);
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: None,
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: to,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
        })],
        ..wgpu::RenderPassDescriptor::default()
    });
    if let Some(([x, y], [width, height])) = part {
        pass.set_viewport(x as f32, y as f32, width as f32, height as f32, 0.0, 1.0);
    }
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, group, &[]);
    pass.draw(0..3, 0..1);
}
