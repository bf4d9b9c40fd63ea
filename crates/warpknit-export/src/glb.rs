//! Tubes as binary glTF (Khronos Group, "glTF 2.0 Specification", chapter 4, "GLB File Format"): a
//! node with a mesh for each bar of each panel, or below it a node with a mesh for each yarn; a
//! material a bar; metres.
//!
//! Materials are those of fibres: rough, no metal, and with a sheen (`KHR_materials_sheen`), which
//! brightens cloth where it turns away from the eye. Textures lie in the file. Only bars with a
//! texture have texture coordinates; the second one counts repeats of it.
//!
//! The JSON chunk comes first in the file but is known last (counts and bounds). So it gets room
//! for the expected blocks and yarns, and spaces fill what it doesn't take. Positions are `u16` on a
//! grid (`glb_grid`) or `f32`, normals `i8` or `f32` (`KHR_mesh_quantization`), and texture
//! coordinates `f32`; indices are `u16` where no mesh part of the block has more vertices than these
//! count, else `u32`. A block's arrays lie together: all of its positions are one buffer view, and
//! the block, or each of its yarns, is an accessor to a range of it, with indices counted from its
//! own first vertex. On request the arrays are compressed (`meshopt`); views then count in a second
//! buffer that isn't there, which readers fill.

use std::collections::BTreeMap;
use std::io::{Seek, Write};
use std::ops::Range;
use std::sync::Arc;

use glam::Vec3;
use gltf_json as json;
use json::accessor::{ComponentType, GenericComponentType};
use json::buffer::{Stride, Target as ViewTarget, View};
use json::mesh::Semantic;
use json::validation::Checked::Valid;
use json::validation::USize64;
use json::{Accessor, Index, Root};
use rayon::prelude::*;

use super::glb_array::GlbArray;
use super::glb_block::PreparedBlock;
use super::glb_grid::QUANTIZATION;
use super::glb_material::root_of;
use super::glb_nodes::{BarGrid, NodeTree};
pub use super::glb_options::{GlbOptions, Nodes, Precision};
use super::patched_header::PatchedHeader;
use super::texture::TextureSet;
use super::{ClothInfo, Destination, Expected, ExportError, Sink};
use warpknit_core::drape::Block;
use warpknit_core::ids::index32;

/// Bytes of the file's header and of those of its two chunks.
const HEADERS: usize = BARE_HEADERS + 8;
/// The same where there is no vertex, and so no second chunk.
const BARE_HEADERS: usize = 12 + 8;
/// Room for a block's entries in the JSON: four views, and a node if need be. They take about 500
/// bytes, and with all numbers at their longest less than this.
const BLOCK_JSON: usize = 900;
/// Further room for a block's entries where arrays are compressed: 170 bytes for each of four views.
const COMPRESSED_JSON: usize = 800;
/// Room for a yarn's entries: four accessors, a mesh, a node. They take about 900 bytes, and with
/// all numbers at their longest less than this.
const YARN_JSON: usize = 1100;
/// Room for the end of the JSON.
const LAST_JSON: usize = 200;

/// Writes tubes as glTF.
#[derive(Debug)]
pub struct GlbWriter<W> {
    file: PatchedHeader<W>,
    /// Bytes of the binary chunk.
    bytes: u64,
    /// Bytes of the arrays before they were compressed, if they are.
    unpacked: u64,
    root: Root,
    nodes: NodeTree,
    buffer: Index<json::Buffer>,
    textures: Arc<TextureSet>,
    options: GlbOptions,
    /// The arrays of the blocks at hand as the file holds them.
    prepared: Vec<PreparedBlock>,
}

impl<W: Write + Seek + Send> GlbWriter<W> {
    /// Starts the file, with its materials and textures.
    ///
    /// There is room for the blocks and yarns that the cloth expects, and more are refused at the
    /// end. If it expects none in particular, the body waits in a temporary file.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn create(target: Destination<W>, cloth: &ClothInfo<'_>) -> Result<Self, ExportError> {
        let textures = Arc::clone(&cloth.textures);
        let (mut root, buffer) = root_of(cloth);
        let options = cloth.glb;
        if options.precision == Precision::Quantised {
            root.extensions_used.push(QUANTIZATION.to_owned());
            root.extensions_required.push(QUANTIZATION.to_owned());
        }
        let mut buffer = buffer;
        if options.is_compressed {
            root.extensions_used.push(COMPRESSION.to_owned());
            root.extensions_required.push(COMPRESSION.to_owned());
            buffer = root.push(fallback());
        }
        let room = cloth.expected.map(|expected| room_for(&root, expected, options));
        let mut writer = Self {
            file: PatchedHeader::create(target, room)?,
            bytes: 0,
            unpacked: 0,
            root,
            nodes: NodeTree::new(cloth),
            buffer,
            textures,
            options,
            prepared: Vec::new(),
        };
        writer.write_textures()?;
        Ok(writer)
    }

    /// Appends the pictures to the binary chunk, each at a multiple of 4 bytes, as their views say
    /// ([`root_of`]).
    fn write_textures(&mut self) -> Result<(), ExportError> {
        for picture in self.textures.textures.iter().flat_map(|texture| &texture.pictures) {
            let padding = picture.len().next_multiple_of(4) - picture.len();
            self.file.write(picture)?;
            self.file.write(&[0; 3][..padding])?;
            self.bytes += (picture.len() + padding) as u64;
        }
        Ok(())
    }

    /// Adds one block's tubes, on that grid.
    fn add(
        &mut self,
        block: &Block,
        prepared: &PreparedBlock,
        bar_grid: BarGrid,
    ) -> Result<(), ExportError> {
        let parent = self.nodes.bar_of(&mut self.root, block, bar_grid);
        let arrays = prepared.arrays();
        let mut views = Vec::with_capacity(arrays.len());
        for (index, array) in arrays.iter().enumerate() {
            views.push(self.array(array, prepared.compressed.get(index).map(Vec::as_slice))?);
        }
        for part in &prepared.parts {
            let mut attributes = BTreeMap::new();
            let mut indices = None;
            for (array, view) in arrays.iter().zip(&views) {
                let Some(semantic) = &array.semantic else {
                    let corners = 3 * part.triangles.start..3 * part.triangles.end;
                    indices = Some(self.range_of(array, *view, corners, None));
                    continue;
                };
                // The format demands bounds of positions, and of nothing else.
                let is_position = *semantic == Semantic::Positions;
                let bounds = is_position.then(|| match &bar_grid.grid {
                    Some(grid) => [part.low, part.high].map(|corner| grid.corner(corner)),
                    None => [part.low, part.high],
                });
                let vertices = self.range_of(array, *view, part.vertices.clone(), bounds);
                attributes.insert(Valid(semantic.clone()), vertices);
            }
            let primitive = json::mesh::Primitive {
                attributes,
                indices,
                material: Some(Index::new(index32(block.bar))),
                mode: Valid(json::mesh::Mode::Triangles),
                targets: None,
                extensions: None,
                extras: json::Extras::default(),
            };
            self.nodes.add(&mut self.root, parent, part.yarn, primitive);
        }
        Ok(())
    }

    /// An accessor to some elements of an array, with their bounds if it needs them.
    fn range_of(
        &mut self,
        array: &GlbArray<'_>,
        view: Index<View>,
        elements: Range<usize>,
        bounds: Option<[Vec3; 2]>,
    ) -> Index<Accessor> {
        self.root.push(Accessor {
            buffer_view: Some(view),
            byte_offset: Some(USize64::from(elements.start * array.size)),
            count: USize64::from(elements.len()),
            component_type: Valid(GenericComponentType(array.component)),
            type_: Valid(array.kind),
            min: bounds.map(|[low, _]| json::Value::from(low.to_array().to_vec())),
            max: bounds.map(|[_, high]| json::Value::from(high.to_array().to_vec())),
            name: None,
            // Normals in whole numbers stand for -1 to 1.
            normalized: array.component == ComponentType::I8,
            sparse: None,
            extensions: None,
            extras: json::Extras::default(),
        })
    }

    /// Appends an array to the binary chunk, with its view, and fills it up to a multiple of 4 bytes
    /// as the format wants it.
    fn array(
        &mut self,
        array: &GlbArray<'_>,
        compressed: Option<&[u8]>,
    ) -> Result<Index<View>, ExportError> {
        let bytes = array.bytes;
        let padded = |count: usize| count.next_multiple_of(4) as u64;
        let (offset, extensions) = match compressed {
            None => (self.bytes, None),
            Some(compressed) => {
                (self.unpacked, Some(compression(self.bytes, compressed.len(), array)))
            }
        };
        let written = compressed.unwrap_or(bytes);
        self.file.write(written)?;
        self.file.write(&[0; 3][..written.len().next_multiple_of(4) - written.len()])?;
        // A view of vertices that several accessors share must state its stride; indices may have
        // none.
        let (target, stride) = match array.semantic {
            None => (ViewTarget::ElementArrayBuffer, None),
            Some(_) => (ViewTarget::ArrayBuffer, Some(Stride(array.size))),
        };
        let view = self.root.push(View {
            buffer: self.buffer,
            byte_length: USize64::from(bytes.len()),
            byte_offset: Some(USize64(offset)),
            byte_stride: stride,
            name: None,
            target: Some(Valid(target)),
            extensions,
            extras: json::Extras::default(),
        });
        self.bytes += padded(written.len());
        if compressed.is_some() {
            self.unpacked += padded(bytes.len());
        }
        Ok(view)
    }

    /// The JSON chunk, filled up with spaces to its room, or to a multiple of 4 bytes.
    fn json_chunk(&mut self) -> Vec<u8> {
        self.root.buffers[self.buffer.value()].byte_length = USize64(self.unpacked);
        // The file's own is the first, whatever stands in it.
        self.root.buffers[0].byte_length = USize64(self.bytes);
        if self.bytes == 0 {
            // The format has no empty buffers.
            self.root.buffers.clear();
        }
        let nodes = self.nodes.top(&mut self.root);
        let scene = self.root.push(json::Scene {
            name: Some("warpknit".to_owned()),
            nodes,
            extensions: None,
            extras: json::Extras::default(),
        });
        self.root.scene = Some(scene);
        let mut text = json_text(&self.root);
        text.resize(
            text.len().next_multiple_of(4).max(self.file.room().saturating_sub(self.headers())),
            b' ',
        );
        text
    }
}

impl<W: Write + Seek + Send> Sink<W> for GlbWriter<W> {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        // Arrays are made in parallel, and written in order below. Their memory is kept for the
        // next blocks.
        let mut prepared = std::mem::take(&mut self.prepared);
        prepared.resize_with(blocks.len().max(prepared.len()), PreparedBlock::default);
        let (textures, options) = (&self.textures, self.options);
        blocks
            .par_iter()
            .zip(&mut prepared)
            .for_each(|(block, prepared)| prepared.fill(block, textures, options));
        // The grid of a block depends on those before it.
        let full = blocks.iter().zip(&mut prepared).filter(|(_, prepared)| !prepared.is_empty());
        let mut full: Vec<_> = full
            .map(|(block, prepared)| {
                (self.nodes.grid_of(block, prepared.bounds()), block, prepared)
            })
            .collect();
        full.par_iter_mut()
            .for_each(|(bar_grid, _, prepared)| prepared.encode(bar_grid.grid.as_ref(), options));
        for (bar_grid, block, prepared) in full {
            self.add(block, prepared, bar_grid)?;
        }
        self.prepared = prepared;
        // Refused now, and not when the disk is full of bytes that the header can't count.
        self.within_limit(self.bytes).map(drop)
    }

    fn finish(mut self: Box<Self>) -> Result<W, ExportError> {
        let text = self.json_chunk();
        let length = self.within_limit((self.headers() + text.len()) as u64 + self.bytes)?;
        let binary = self.within_limit(self.bytes)?;
        let mut header = Vec::with_capacity(HEADERS + text.len());
        header.extend_from_slice(b"glTF");
        for word in [2, length, index32(text.len())] {
            header.extend_from_slice(&word.to_le_bytes());
        }
        header.extend_from_slice(b"JSON");
        header.extend_from_slice(&text);
        if binary > 0 {
            header.extend_from_slice(&binary.to_le_bytes());
            header.extend_from_slice(b"BIN\0");
        }
        self.file.finish(&header)
    }
}

impl<W: Write + Seek> GlbWriter<W> {
    /// Bytes of the headers that the file has.
    fn headers(&self) -> usize {
        if self.bytes > 0 { HEADERS } else { BARE_HEADERS }
    }

    /// That number of bytes, where the format can hold it.
    fn within_limit(&self, bytes: u64) -> Result<u32, ExportError> {
        u32::try_from(bytes)
            .map_err(|_over_4_gib| ExportError::TooLarge { path: self.file.error_path(), bytes })
    }
}

/// Bytes that the headers and the JSON take at the most.
fn room_for(root: &Root, Expected { blocks, yarns }: Expected, options: GlbOptions) -> usize {
    let block = BLOCK_JSON + if options.is_compressed { COMPRESSED_JSON } else { 0 };
    let parts = match options.nodes {
        Nodes::Bar => blocks,
        Nodes::Yarn => yarns,
    };
    let json = json_text(root).len() + LAST_JSON + block * blocks + YARN_JSON * parts;
    (HEADERS + json).next_multiple_of(4)
}

/// The extension of compressed arrays.
const COMPRESSION: &str = "EXT_meshopt_compression";

/// The buffer of what readers unpack, of which nothing is in the file.
fn fallback() -> json::Buffer {
    let mut extension = json::extensions::buffer::Buffer::default();
    extension.others.insert(COMPRESSION.to_owned(), serde_json::json!({ "fallback": true }));
    json::Buffer {
        byte_length: USize64(0),
        name: None,
        uri: None,
        extensions: Some(extension),
        extras: json::Extras::default(),
    }
}

/// Where an array lies compressed, in that many bytes.
fn compression(offset: u64, length: usize, array: &GlbArray<'_>) -> json::extensions::buffer::View {
    let mode = if array.semantic.is_none() { "TRIANGLES" } else { "ATTRIBUTES" };
    let mut extension = json::extensions::buffer::View::default();
    let own = serde_json::json!({
        "buffer": 0, "byteOffset": offset, "byteLength": length, "byteStride": array.size,
        "count": array.count(), "mode": mode,
    });
    extension.others.insert(COMPRESSION.to_owned(), own);
    extension
}

fn json_text(root: &Root) -> Vec<u8> {
    json::serialize::to_vec(root).expect("numbers here are finite and keys are text")
}
