//! Tubes as binary glTF (Khronos Group, "glTF 2.0 Specification", chapter 4, "GLB File Format"): a
//! node for each bar of each panel, below it a node with a mesh for each yarn, a material a bar;
//! metres.
//!
//! Materials are those of fibres: rough, no metal, and with a sheen (`KHR_materials_sheen`), which
//! brightens cloth where it turns away from the eye. Textures lie in the file. The second texture
//! coordinate counts repeats of the texture, and millimetres of yarn where a bar has none.
//!
//! The JSON chunk comes first in the file but is known last (counts and bounds). So it gets room
//! for the expected blocks and yarns, and spaces fill what it doesn't take. Positions, normals and
//! texture coordinates are `f32`; indices are `u16` where no yarn of the block has more vertices
//! than these count, else `u32`. A block's arrays lie together: all of its
//! positions are one buffer view, and each of its yarns is an accessor to a range of it, with
//! indices counted from its own first vertex.

use std::collections::BTreeMap;
use std::io::{Seek, Write};
use std::ops::Range;
use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};
use gltf_json as json;
use json::accessor::{ComponentType, GenericComponentType, Type};
use json::buffer::{Stride, Target as ViewTarget};
use json::mesh::Semantic;
use json::validation::Checked::Valid;
use json::validation::USize64;
use json::{Accessor, Index, Root};
use rayon::prelude::*;

use super::glb_material::root_of;
use super::patched_header::PatchedHeader;
use super::texture::TextureSet;
use super::{ClothInfo, Destination, Expected, ExportError, Sink};
use warpknit_core::drape::Block;
use warpknit_core::ids::{YarnId, index32};

const METRES_PER_MM: f32 = 1e-3;
/// Bytes of the file's header and of those of its two chunks.
const HEADERS: usize = BARE_HEADERS + 8;
/// The same where there is no vertex, and so no second chunk.
const BARE_HEADERS: usize = 12 + 8;
/// Room for a block's entries in the JSON: four views, and a node if need be. They take about 500
/// bytes, and with all numbers at their longest less than this.
const BLOCK_JSON: usize = 770;
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
    root: Root,
    /// Nodes of panels' bars.
    bars: Vec<Index<json::Node>>,
    buffer: Index<json::Buffer>,
    textures: Arc<TextureSet>,
    /// Panel and bar of the last yarn, and their node.
    current: Option<((usize, usize), Index<json::Node>)>,
    /// The arrays of the blocks at hand as the file holds them.
    prepared: Vec<PreparedBlock>,
}

/// Those of a block's arrays that differ from its tubes'.
#[derive(Debug, Default)]
struct PreparedBlock {
    /// m.
    positions: Vec<Vec3>,
    /// Counted in repeats of the bar's texture; empty where it has none.
    uvs: Vec<Vec2>,
    /// Counted from the first vertex of each yarn.
    triangles: Vec<[u32; 3]>,
    /// The same where they fit; then `triangles` is empty.
    short_triangles: Vec<[u16; 3]>,
    yarns: Vec<YarnRange>,
}

/// A yarn's range of a block's arrays.
#[derive(Debug)]
struct YarnRange {
    yarn: YarnId,
    vertices: Range<usize>,
    triangles: Range<usize>,
    /// Bounds, m.
    low: Vec3,
    high: Vec3,
}

/// Where an array lies in the file.
#[derive(Clone, Copy)]
struct ArrayView {
    index: Index<json::buffer::View>,
    kind: Type,
    component: ComponentType,
    /// Bytes of an element.
    size: usize,
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
        let (root, buffer) = root_of(cloth);
        let room = cloth.expected.map(|expected| room_for(&root, expected));
        let mut writer = Self {
            file: PatchedHeader::create(target, room)?,
            bytes: 0,
            root,
            bars: Vec::new(),
            buffer,
            textures,
            current: None,
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

    /// Adds one block's tubes, a mesh a yarn.
    fn add(&mut self, block: &Block, prepared: &PreparedBlock) -> Result<(), ExportError> {
        let uvs = if prepared.uvs.is_empty() { &block.tubes.uvs } else { &prepared.uvs };
        let vertices = [
            (Semantic::Positions, self.array(&prepared.positions, Type::Vec3, ComponentType::F32)?),
            (Semantic::Normals, self.array(&block.tubes.normals, Type::Vec3, ComponentType::F32)?),
            (Semantic::TexCoords(0), self.array(uvs, Type::Vec2, ComponentType::F32)?),
        ];
        // Indices are a view of their own: the format wants them apart from vertices.
        let corners = if prepared.triangles.is_empty() {
            let corners = prepared.short_triangles.as_flattened();
            self.array(corners, Type::Scalar, ComponentType::U16)?
        } else {
            self.array(prepared.triangles.as_flattened(), Type::Scalar, ComponentType::U32)?
        };
        for yarn in &prepared.yarns {
            let mut attributes = BTreeMap::new();
            for (semantic, view) in &vertices {
                // The format demands bounds of positions, and of nothing else.
                let bounds = (*semantic == Semantic::Positions).then_some([yarn.low, yarn.high]);
                attributes.insert(
                    Valid(semantic.clone()),
                    self.range_of(*view, yarn.vertices.clone(), bounds),
                );
            }
            let indices =
                self.range_of(corners, 3 * yarn.triangles.start..3 * yarn.triangles.end, None);
            let primitive = json::mesh::Primitive {
                attributes,
                indices: Some(indices),
                material: Some(Index::new(index32(block.bar))),
                mode: Valid(json::mesh::Mode::Triangles),
                targets: None,
                extensions: None,
                extras: json::Extras::default(),
            };
            self.add_yarn(block, yarn.yarn, primitive);
        }
        Ok(())
    }

    /// Adds a yarn's mesh, and its node below that of its panel's bar.
    fn add_yarn(&mut self, block: &Block, yarn: YarnId, primitive: json::mesh::Primitive) {
        let name = Some(format!("yarn {}", yarn.0));
        let mesh = self.root.push(json::Mesh {
            name: name.clone(),
            primitives: vec![primitive],
            weights: None,
            extensions: None,
            extras: json::Extras::default(),
        });
        let node = self.root.push(json::Node { name, mesh: Some(mesh), ..json::Node::default() });
        let parent = self.node_of(block);
        self.root.nodes[parent.value()].children.get_or_insert_default().push(node);
    }

    /// The node of the block's panel and bar, new when one of them is.
    fn node_of(&mut self, block: &Block) -> Index<json::Node> {
        let at = (block.panel, block.bar);
        if let Some((_, node)) = self.current.filter(|(current, _)| *current == at) {
            return node;
        }
        let name = Some(format!("panel {} bar {}", block.panel, block.bar + 1));
        // Far from the origin positions count from a place near the garment, where they are exact.
        let place =
            (block.origin != DVec3::ZERO).then(|| (block.origin / 1000.0).as_vec3().to_array());
        let node = self.root.push(json::Node { name, translation: place, ..json::Node::default() });
        self.bars.push(node);
        self.current = Some((at, node));
        node
    }

    /// An accessor to some elements of an array, with their bounds if it needs them.
    fn range_of(
        &mut self,
        view: ArrayView,
        elements: Range<usize>,
        bounds: Option<[Vec3; 2]>,
    ) -> Index<Accessor> {
        self.root.push(Accessor {
            buffer_view: Some(view.index),
            byte_offset: Some(USize64::from(elements.start * view.size)),
            count: USize64::from(elements.len()),
            component_type: Valid(GenericComponentType(view.component)),
            type_: Valid(view.kind),
            min: bounds.map(|[low, _]| json::Value::from(low.to_array().to_vec())),
            max: bounds.map(|[_, high]| json::Value::from(high.to_array().to_vec())),
            name: None,
            normalized: false,
            sparse: None,
            extensions: None,
            extras: json::Extras::default(),
        })
    }

    /// Appends an array to the binary chunk, with its view, and fills it up to a multiple of 4 bytes
    /// as the format wants it.
    fn array<T: bytemuck::NoUninit>(
        &mut self,
        values: &[T],
        kind: Type,
        component: ComponentType,
    ) -> Result<ArrayView, ExportError> {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        let padding = bytes.len().next_multiple_of(4) - bytes.len();
        self.file.write(bytes)?;
        self.file.write(&[0; 3][..padding])?;
        // A view of vertices that several accessors share must state its stride; indices may have
        // none.
        let (target, stride) = if kind == Type::Scalar {
            (ViewTarget::ElementArrayBuffer, None)
        } else {
            (ViewTarget::ArrayBuffer, Some(Stride(size_of::<T>())))
        };
        let index = self.root.push(json::buffer::View {
            buffer: self.buffer,
            byte_length: USize64::from(bytes.len()),
            byte_offset: Some(USize64(self.bytes)),
            byte_stride: stride,
            name: None,
            target: Some(Valid(target)),
            extensions: None,
            extras: json::Extras::default(),
        });
        self.bytes += (bytes.len() + padding) as u64;
        Ok(ArrayView { index, kind, component, size: size_of::<T>() })
    }

    /// The JSON chunk, filled up with spaces to its room, or to a multiple of 4 bytes.
    fn json_chunk(&mut self) -> Vec<u8> {
        self.root.buffers[self.buffer.value()].byte_length = USize64(self.bytes);
        if self.bytes == 0 {
            // The format has no empty buffers.
            self.root.buffers.clear();
        }
        let scene = self.root.push(json::Scene {
            name: Some("warpknit".to_owned()),
            nodes: std::mem::take(&mut self.bars),
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
        let textures = &self.textures;
        blocks
            .par_iter()
            .zip(&mut prepared)
            .for_each(|(block, prepared)| prepared.fill(block, textures));
        for (block, prepared) in blocks.iter().zip(&prepared) {
            if !prepared.positions.is_empty() {
                self.add(block, prepared)?;
            }
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

impl PreparedBlock {
    /// Takes the arrays of a block.
    fn fill(&mut self, block: &Block, textures: &TextureSet) {
        let tubes = &block.tubes;
        self.positions.clear();
        self.positions.extend(tubes.positions.iter().map(|position| *position * METRES_PER_MM));
        self.uvs.clear();
        if textures.texture_of(block.bar).is_some() {
            let repeats = Vec2::new(1.0, textures.repeats_per_mm(block.bar));
            self.uvs.extend(tubes.uvs.iter().map(|uv| *uv * repeats));
        }
        self.yarns.clear();
        let strands: Vec<_> = block.strands.strands.iter().zip(&tubes.strands).collect();
        // A yarn is one mesh: its strands follow each other, and so do their vertices and
        // triangles.
        for strands in strands.chunk_by(|(a, _), (b, _)| a.yarn == b.yarn) {
            let ((strand, (first, first_triangles)), (_, (last, last_triangles))) =
                (strands[0], strands[strands.len() - 1]);
            let (vertices, triangles) = (
                first.start as usize..last.end as usize,
                first_triangles.start as usize..last_triangles.end as usize,
            );
            let [low, high] = bounds(&self.positions[vertices.clone()]);
            self.yarns.push(YarnRange { yarn: strand.yarn, vertices, triangles, low, high });
        }
        self.fill_triangles(&tubes.triangles);
    }

    /// Counts the corners of a block's triangles from the first vertex of each yarn.
    fn fill_triangles(&mut self, triangles: &[[u32; 3]]) {
        self.triangles.clear();
        self.short_triangles.clear();
        // The greatest number of 16 bits ends a strip in some readers, so it is no vertex.
        let is_short = self.yarns.iter().all(|yarn| yarn.vertices.len() <= usize::from(u16::MAX));
        for yarn in &self.yarns {
            let first = index32(yarn.vertices.start);
            let own = triangles[yarn.triangles.clone()]
                .iter()
                .map(|corners| corners.map(|corner| corner - first));
            if is_short {
                #[expect(clippy::cast_possible_truncation, reason = "no yarn has more vertices")]
                self.short_triangles.extend(own.map(|corners| corners.map(|corner| corner as u16)));
            } else {
                self.triangles.extend(own);
            }
        }
    }
}

/// Bytes that the headers and the JSON take at the most.
fn room_for(root: &Root, Expected { blocks, yarns }: Expected) -> usize {
    let json = json_text(root).len() + LAST_JSON + BLOCK_JSON * blocks + YARN_JSON * yarns;
    (HEADERS + json).next_multiple_of(4)
}

/// Lowest and highest corner of some positions.
fn bounds(positions: &[Vec3]) -> [Vec3; 2] {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for position in positions {
        low = low.min(*position);
        high = high.max(*position);
    }
    [low, high]
}

fn json_text(root: &Root) -> Vec<u8> {
    json::serialize::to_vec(root).expect("numbers here are finite and keys are text")
}
