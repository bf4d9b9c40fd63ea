//! Tubes as binary glTF 2.0: a node for each bar of each panel, a primitive for each block, metres.
//!
//! The JSON chunk comes first in the file but is known last (counts and bounds), so vertices stream to a nameless temporary file
//! that is appended at the end. Positions, normals and texture coordinates are `f32`, indices `u32`.

use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, Write};
use std::path::Path;

use glam::Vec3;
use gltf_json as json;
use json::accessor::{ComponentType, GenericComponentType, Type};
use json::buffer::Target;
use json::validation::Checked::Valid;
use json::validation::USize64;
use json::{Accessor, Index, Root};
use rayon::prelude::*;

use super::{ExportError, Output, Sink};
use crate::drape::Block;
use crate::fabric::Fabric;
use crate::ids::index32;

const METRES_PER_MM: f32 = 1e-3;
/// Fibres are rough and no metal.
const ROUGHNESS: f32 = 0.75;
/// Header of the file, and of each of its two chunks.
const HEADERS: u64 = 12 + 8 + 8;

/// Writes tubes as glTF.
#[derive(Debug)]
pub struct GlbWriter {
    output: Output,
    binary: BufWriter<File>,
    bytes: u64,
    root: Root,
    buffer: Index<json::Buffer>,
    /// Panel and bar of the last mesh.
    current: Option<(usize, usize)>,
}

impl GlbWriter {
    /// Starts the file: one material a bar.
    ///
    /// # Errors
    /// What the disk says.
    pub fn create(target: &Path, fabric: &Fabric) -> Result<Self, ExportError> {
        let output = Output::create(target)?;
        let folder = output.target().parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let binary = tempfile::tempfile_in(folder).map_err(|source| ExportError::Io { path: target.to_owned(), source })?;
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
        Ok(Self { output, binary: BufWriter::with_capacity(1 << 20, binary), bytes: 0, root, buffer, current: None })
    }

    /// Adds one block's tubes as a primitive.
    fn add(&mut self, block: &Block, positions: &[Vec3]) -> io::Result<()> {
        let tubes = &block.tubes;
        let position = self.vectors(positions, Type::Vec3)?;
        let (low, high) = positions.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
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

    fn vectors<T: bytemuck::NoUninit>(&mut self, values: &[T], kind: Type) -> io::Result<Index<Accessor>> {
        self.array(values, kind, ComponentType::F32, Target::ArrayBuffer)
    }

    /// Appends an array to the binary chunk with its view and accessor. All of its element sizes are multiples of 4, so it stays aligned.
    fn array<T: bytemuck::NoUninit>(
        &mut self,
        values: &[T],
        kind: Type,
        component: ComponentType,
        target: Target,
    ) -> io::Result<Index<Accessor>> {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        self.binary.write_all(bytes)?;
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

    /// The JSON chunk, padded with spaces to a multiple of 4 bytes.
    fn json_chunk(&mut self) -> Vec<u8> {
        self.root.buffers[self.buffer.value()].byte_length = USize64(self.bytes);
        let nodes = (0..self.root.nodes.len()).map(|node| Index::new(index32(node))).collect();
        let scene = self.root.push(json::Scene {
            name: Some("warpknit".to_owned()),
            nodes,
            extensions: None,
            extras: json::Extras::default(),
        });
        self.root.scene = Some(scene);
        let mut text = json::serialize::to_vec(&self.root).expect("numbers here are finite and keys are text");
        text.resize(text.len().next_multiple_of(4), b' ');
        text
    }
}

impl Sink for GlbWriter {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let metres = |block: &Block| block.tubes.positions.iter().map(|p| *p * METRES_PER_MM).collect();
        let positions: Vec<Vec<Vec3>> = blocks.par_iter().map(metres).collect();
        for (block, positions) in blocks.iter().zip(&positions) {
            if !positions.is_empty() {
                let path = self.output.target().to_owned();
                self.add(block, positions).map_err(|source| ExportError::Io { path, source })?;
            }
        }
        if self.bytes > u64::from(u32::MAX) {
            return Err(ExportError::TooLarge { path: self.output.target().to_owned(), bytes: self.bytes });
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<Output, ExportError> {
        let text = self.json_chunk();
        let length = HEADERS + text.len() as u64 + self.bytes;
        let too_large = || ExportError::TooLarge { path: self.output.target().to_owned(), bytes: length };
        let length = u32::try_from(length).map_err(|_over_4_gib| too_large())?;
        let Self { mut output, binary, bytes, .. } = *self;
        output.write_with(|file| {
            let mut binary = binary.into_inner()?;
            binary.rewind()?;
            file.write_all(b"glTF")?;
            for word in [2, length, index32(text.len())] {
                file.write_all(&word.to_le_bytes())?;
            }
            file.write_all(b"JSON")?;
            file.write_all(&text)?;
            file.write_all(&index32(usize::try_from(bytes).expect("checked against 4 GiB")).to_le_bytes())?;
            file.write_all(b"BIN\0")?;
            io::copy(&mut binary.take(bytes), file)?;
            Ok(())
        })?;
        output.seal()
    }
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
