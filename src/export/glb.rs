//! Tubes as binary glTF 2.0: a node for each bar of each panel, a primitive for each block, metres.
//!
//! The JSON chunk comes first in the file but is known last (counts and bounds), so it gets room for what so many blocks will need, and what it doesn't fill is spaces.
//! Positions, normals and texture coordinates are `f32`, indices `u32`.

use std::path::Path;

use glam::Vec3;
use gltf_json as json;
use json::accessor::{ComponentType, GenericComponentType, Type};
use json::buffer::Target;
use json::validation::Checked::Valid;
use json::validation::USize64;
use json::{Accessor, Index, Root};
use rayon::prelude::*;

use super::head::HeadLast;
use super::{ExportError, Output, Sink};
use crate::drape::Block;
use crate::fabric::Fabric;
use crate::ids::index32;

const METRES_PER_MM: f32 = 1e-3;
/// Fibres are rough and no metal.
const ROUGHNESS: f32 = 0.75;
/// Header of the file, and of each of its two chunks.
const HEADERS: usize = BARE_HEADERS + 8;
/// The same where there is no vertex, and so no second chunk.
const BARE_HEADERS: usize = 12 + 8;
/// Room for a block's entries in the JSON: a primitive, four accessors, four views, a mesh and a node if need be. They take about 900.
const BLOCK_JSON: usize = 1200;
/// Room for what closes the JSON.
const LAST_JSON: usize = 200;

/// Writes tubes as glTF.
#[derive(Debug)]
pub struct GlbWriter {
    file: HeadLast,
    /// Bytes of the binary chunk.
    bytes: u64,
    root: Root,
    buffer: Index<json::Buffer>,
    /// Panel and bar of the last mesh.
    current: Option<(usize, usize)>,
    /// Positions of the blocks at hand in metres, with their bounds.
    scaled: Vec<Scaled>,
}

/// A block's positions, m.
#[derive(Debug, Default)]
struct Scaled {
    positions: Vec<Vec3>,
    low: Vec3,
    high: Vec3,
}

impl GlbWriter {
    /// Starts the file: one material a bar. There is room for so many blocks; with more of them the file takes longer to finish.
    ///
    /// # Errors
    /// What the disk says.
    pub fn create(target: &Path, fabric: &Fabric, blocks: usize) -> Result<Self, ExportError> {
        let mut root = Root {
            asset: json::Asset {
                generator: Some(concat!("warpknit ", env!("CARGO_PKG_VERSION")).to_owned()),
                ..json::Asset::default()
            },
            ..Root::default()
        };
        let buffer = root.push(json::Buffer {
            byte_length: USize64(0),
            name: None,
            uri: None,
            extensions: None,
            extras: json::Extras::default(),
        });
        for (bar, number) in fabric.bars.iter().zip(1..) {
            root.push(material(&format!("{} bar {number}", fabric.name), bar.yarn.color.linear()));
        }
        let room = (HEADERS + json_text(&root).len() + LAST_JSON + BLOCK_JSON * blocks).next_multiple_of(4);
        let file = HeadLast::create(target, room)?;
        Ok(Self { file, bytes: 0, root, buffer, current: None, scaled: Vec::new() })
    }

    /// Adds one block's tubes as a primitive.
    fn add(&mut self, block: &Block, Scaled { positions, low, high }: &Scaled) -> Result<(), ExportError> {
        let tubes = &block.tubes;
        let position = self.vectors(positions, Type::Vec3)?;
        let accessor = &mut self.root.accessors[position.value()];
        accessor.min = Some(json::Value::from(low.to_array().to_vec()));
        accessor.max = Some(json::Value::from(high.to_array().to_vec()));
        let normal = self.vectors(&tubes.normals, Type::Vec3)?;
        let uv = self.vectors(&tubes.uvs, Type::Vec2)?;
        let corners: &[u32] = bytemuck::cast_slice(&tubes.triangles);
        let indices = self.array(corners, Type::Scalar, ComponentType::U32, Target::ElementArrayBuffer)?;
        let attributes = [
            (Valid(json::mesh::Semantic::Positions), position),
            (Valid(json::mesh::Semantic::Normals), normal),
            (Valid(json::mesh::Semantic::TexCoords(0)), uv),
        ];
        let primitive = json::mesh::Primitive {
            attributes: attributes.into_iter().collect(),
            indices: Some(indices),
            material: Some(Index::new(index32(block.bar))),
            mode: Valid(json::mesh::Mode::Triangles),
            targets: None,
            extensions: None,
            extras: json::Extras::default(),
        };
        self.mesh_of(block).primitives.push(primitive);
        Ok(())
    }

    /// The mesh of the block's panel and bar, new when one of them is.
    fn mesh_of(&mut self, block: &Block) -> &mut json::Mesh {
        if self.current != Some((block.panel, block.bar)) {
            self.current = Some((block.panel, block.bar));
            let name = Some(format!("panel {} bar {}", block.panel, block.bar + 1));
            let mesh = self.root.push(json::Mesh {
                name: name.clone(),
                primitives: Vec::new(),
                weights: None,
                extensions: None,
                extras: json::Extras::default(),
            });
            self.root.push(json::Node { name, mesh: Some(mesh), ..json::Node::default() });
        }
        self.root.meshes.last_mut().expect("pushed above")
    }

    fn vectors<T: bytemuck::NoUninit>(&mut self, values: &[T], kind: Type) -> Result<Index<Accessor>, ExportError> {
        self.array(values, kind, ComponentType::F32, Target::ArrayBuffer)
    }

    /// Appends an array to the binary chunk with its view and accessor. All of its element sizes are multiples of 4, so it stays aligned.
    fn array<T: bytemuck::NoUninit>(
        &mut self,
        values: &[T],
        kind: Type,
        component: ComponentType,
        target: Target,
    ) -> Result<Index<Accessor>, ExportError> {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        self.file.write(bytes)?;
        let view = self.root.push(json::buffer::View {
            buffer: self.buffer,
            byte_length: USize64::from(bytes.len()),
            byte_offset: Some(USize64(self.bytes)),
            byte_stride: None,
            name: None,
            target: Some(Valid(target)),
            extensions: None,
            extras: json::Extras::default(),
        });
        self.bytes += bytes.len() as u64;
        Ok(self.root.push(Accessor {
            buffer_view: Some(view),
            byte_offset: Some(USize64(0)),
            count: USize64::from(values.len()),
            component_type: Valid(GenericComponentType(component)),
            type_: Valid(kind),
            min: None,
            max: None,
            name: None,
            normalized: false,
            sparse: None,
            extensions: None,
            extras: json::Extras::default(),
        }))
    }

    /// The JSON chunk, filled up with spaces to its room or else to a multiple of 4 bytes.
    fn json_chunk(&mut self) -> Vec<u8> {
        self.root.buffers[self.buffer.value()].byte_length = USize64(self.bytes);
        if self.bytes == 0 {
            // The format knows no empty buffers.
            self.root.buffers.clear();
        }
        let nodes = (0..self.root.nodes.len()).map(|node| Index::new(index32(node))).collect();
        let scene = self.root.push(json::Scene {
            name: Some("warpknit".to_owned()),
            nodes,
            extensions: None,
            extras: json::Extras::default(),
        });
        self.root.scene = Some(scene);
        let mut text = json_text(&self.root);
        text.resize(text.len().next_multiple_of(4).max(self.file.room() - self.headers()), b' ');
        text
    }
}

impl Sink for GlbWriter {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let mut scaled = std::mem::take(&mut self.scaled);
        scaled.resize_with(blocks.len().max(scaled.len()), Scaled::default);
        blocks.par_iter().zip(&mut scaled).for_each(|(block, scaled)| scaled.fill(&block.tubes.positions));
        for (block, scaled) in blocks.iter().zip(&scaled) {
            if !scaled.positions.is_empty() {
                self.add(block, scaled)?;
            }
        }
        self.scaled = scaled;
        self.within_limit(self.bytes).map(drop)
    }

    fn finish(mut self: Box<Self>) -> Result<Output, ExportError> {
        let text = self.json_chunk();
        let length = self.within_limit((self.headers() + text.len()) as u64 + self.bytes)?;
        let binary = self.within_limit(self.bytes)?;
        let mut head = Vec::with_capacity(HEADERS + text.len());
        head.extend_from_slice(b"glTF");
        for word in [2, length, index32(text.len())] {
            head.extend_from_slice(&word.to_le_bytes());
        }
        head.extend_from_slice(b"JSON");
        head.extend_from_slice(&text);
        if binary > 0 {
            head.extend_from_slice(&binary.to_le_bytes());
            head.extend_from_slice(b"BIN\0");
        }
        self.file.finish(&head)
    }
}

impl GlbWriter {
    /// Bytes of the headers that the file has.
    fn headers(&self) -> usize {
        if self.bytes > 0 { HEADERS } else { BARE_HEADERS }
    }

    /// A number of bytes that the format can hold.
    fn within_limit(&self, bytes: u64) -> Result<u32, ExportError> {
        u32::try_from(bytes).map_err(|_over_4_gib| ExportError::TooLarge { path: self.file.target().to_owned(), bytes })
    }
}

impl Scaled {
    fn fill(&mut self, positions: &[Vec3]) {
        self.positions.clear();
        self.positions.extend(positions.iter().map(|position| *position * METRES_PER_MM));
        let bounds = |(low, high): (Vec3, Vec3), position: &Vec3| (low.min(*position), high.max(*position));
        (self.low, self.high) = self.positions.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), bounds);
    }
}

fn json_text(root: &Root) -> Vec<u8> {
    json::serialize::to_vec(root).expect("numbers here are finite and keys are text")
}

fn material(name: &str, [r, g, b]: [f32; 3]) -> json::Material {
    json::Material {
        name: Some(name.to_owned()),
        pbr_metallic_roughness: json::material::PbrMetallicRoughness {
            base_color_factor: json::material::PbrBaseColorFactor([r, g, b, 1.0]),
            metallic_factor: json::material::StrengthFactor(0.0),
            roughness_factor: json::material::StrengthFactor(ROUGHNESS),
            ..json::material::PbrMetallicRoughness::default()
        },
        ..json::Material::default()
    }
}
