//! Resources of passes: buffers, textures, bind groups, and reading pictures back.
//!
//! In: bytes and sizes. Out: wgpu's handles. Only reading back returns errors itself; `Gpu::fault`
//! reports what else the device refused.

use std::sync::mpsc;

use image::RgbaImage;
use wgpu::{BufferUsages, TextureFormat, TextureUsages};

use super::device::Gpu;
use crate::GpuError;
use crate::mips::Mips;
use warpknit_core::ids::index32;

/// Alignment of texel rows in buffers, bytes.
const ROW_BYTES: u32 = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT;

impl Gpu {
    /// A texture to render to and then to read in a shader.
    pub(super) fn target(
        &self,
        format: TextureFormat,
        size: [u32; 2],
        samples: u32,
    ) -> wgpu::TextureView {
        let texture = self.texture(format, size, TextureUsages::TEXTURE_BINDING, samples);
        texture.create_view(&wgpu::TextureViewDescriptor::default())
    }

    /// A texture to render to, with further usages.
    pub(super) fn texture(
        &self,
        format: TextureFormat,
        size: [u32; 2],
        usage: TextureUsages,
        sample_count: u32,
    ) -> wgpu::Texture {
        self.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: usage | TextureUsages::RENDER_ATTACHMENT,
            view_formats: &[],
        })
    }

    /// A uniform buffer with these contents.
    pub(super) fn uniform(&self, contents: &[u8]) -> wgpu::Buffer {
        self.store("uniform", contents, BufferUsages::UNIFORM)
    }

    /// A bind group with resources at bindings 0, 1, 2 and so on.
    pub(super) fn group(
        &self,
        label: &str,
        layout: &wgpu::BindGroupLayout,
        resources: &[wgpu::BindingResource<'_>],
    ) -> wgpu::BindGroup {
        let entries: Vec<_> = (0..)
            .zip(resources)
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource: resource.clone() })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(label),
            layout,
            entries: &entries,
        })
    }

    /// Uploads a texture with all of its mip levels.
    pub(super) fn mips(&self, mips: &Mips, format: TextureFormat) -> wgpu::TextureView {
        let (width, height) = mips.levels[0].dimensions();
        let size = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
        let descriptor = wgpu::TextureDescriptor {
            label: Some("map"),
            size,
            mip_level_count: index32(mips.levels.len()),
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
            view_formats: &[],
        };
        let texture = self.device.create_texture(&descriptor);
        // The mip levels are computed on the CPU: hardware generation would average sRGB codes and
        // ignore alpha.
        for (level, picture) in (0..).zip(&mips.levels) {
            let to = wgpu::TexelCopyTextureInfo { mip_level: level, ..texture.as_image_copy() };
            let layout = wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(picture.width() * 4),
                rows_per_image: None,
            };
            let (width, height) = picture.dimensions();
            self.queue.write_texture(
                to,
                picture,
                layout,
                wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            );
        }
        texture.create_view(&wgpu::TextureViewDescriptor::default())
    }

    /// Copies a tile into the picture at `corner`.
    pub(super) fn read(
        &self,
        tile: &wgpu::Texture,
        picture: &mut RgbaImage,
        corner: [u32; 2],
    ) -> Result<(), GpuError> {
        let size = tile.size();
        // wgpu wants rows in buffers aligned, so the copy has padding, which the loop below drops.
        let row = (size.width * 4).next_multiple_of(ROW_BYTES);
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("pixels"),
            size: u64::from(row) * u64::from(size.height),
            usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(row),
            rows_per_image: None,
        };
        let mut encoder =
            self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_texture_to_buffer(
            tile.as_image_copy(),
            wgpu::TexelCopyBufferInfo { buffer: &buffer, layout },
            size,
        );
        self.queue.submit([encoder.finish()]);
        let (sender, mapped) = mpsc::channel();
        buffer.slice(..).map_async(wgpu::MapMode::Read, move |result| {
            // The receiver is gone if waiting has failed.
            let _unheard = sender.send(result);
        });
        self.wait()?;
        // Another thread that waits for the same device may be about to send it.
        match mapped.recv() {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return Err(self.refused(&error)),
            Err(_never) => return Err(self.refused(&"it never finished")),
        }
        let pixels = buffer.slice(..).get_mapped_range().map_err(|error| self.refused(&error))?;
        for (y, row) in (corner[1]..).zip(pixels.chunks_exact(row as usize)) {
            let start = (y as usize * picture.width() as usize + corner[0] as usize) * 4;
            let bytes = size.width as usize * 4;
            picture.as_mut()[start..start + bytes].copy_from_slice(&row[..bytes]);
        }
        Ok(())
    }
    /// The error for a command that the device refused.
    fn refused(&self, reason: &dyn std::fmt::Display) -> GpuError {
        GpuError::Refused { adapter: self.name().to_owned(), reason: reason.to_string() }
    }
}
