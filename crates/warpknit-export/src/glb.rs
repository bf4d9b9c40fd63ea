//! Tubes as binary glTF 2.0: a node for each bar of each panel, below it a node with a mesh for
//! each yarn, a material a bar; metres.
//!
//! Materials are those of fibres: rough, no metal, and with a sheen (`KHR_materials_sheen`) by
//! which cloth is brighter where it turns away. Bars whose yarns wear pictures have them as
//! textures, in the file; the second texture coordinate then counts repeats of the picture, and
//! else millimetres of yarn. The JSON chunk comes first in the file but is known last (counts and
//! bounds), so it gets room for what so many blocks will need, and what it doesn't fill is spaces.
//! Positions, normals and texture coordinates are `f32`, indices `u32`. A block's arrays lie
//! together; each of its yarns is a part of them, its indices counted from its own first vertex.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use gltf_json as json;
use json::accessor::{ComponentType, GenericComponentType, Type};
use json::buffer::{Stride, Target};
use json::mesh::Semantic;
use json::validation::Checked::Valid;
use json::validation::USize64;
use json::{Accessor, Index, Root};
use rayon::prelude::*;

use super::patched_header::HeadLast;
use super::texture::{Texture, Wardrobe};
use super::{ExportError, Output, Sink};
use warpknit_core::drape::Block;
use warpknit_core::fabric::Fabric;
use warpknit_core::ids::{YarnId, index32};
use warpknit_render::cloth::ROUGHNESS;

const METRES_PER_MM: f32 = 1e-3;
/// Light that fibres standing off a yarn scatter, as a share of its colour, and how widely.
const SHEEN: f32 = 0.4;
const SHEEN_ROUGHNESS: f32 = 0.5;
const SHEEN_EXTENSION: &str = "KHR_materials_sheen";
/// Header of the file, and of each of its two chunks.
const HEADERS: usize = BARE_HEADERS + 8;
/// The same where there is no vertex, and so no second chunk.
const BARE_HEADERS: usize = 12 + 8;
/// Room for a block's entries in the JSON: four views, and a node if need be. They take about 500.
const BLOCK_JSON: usize = 700;
/// Room for a yarn's: four accessors, a mesh, a node. They take about 900.
const YARN_JSON: usize = 1100;
/// Room for what closes the JSON.
const LAST_JSON: usize = 200;

/// Writes tubes as glTF.
#[derive(Debug)]
pub struct GlbWriter {
    file: HeadLast,
    /// Bytes of the binary chunk.
    bytes: u64,
    root: Root,
    /// Nodes of panels' bars.
    bars: Vec<Index<json::Node>>,
    buffer: Index<json::Buffer>,
    wardrobe: Arc<Wardrobe>,
    /// Panel and bar of the last yarn, and their node.
    current: Option<((usize, usize), Index<json::Node>)>,
    /// The blocks at hand as the file holds them.
    prepared: Vec<Prepared>,
}

/// What of a block's arrays is not as tubes have it.
#[derive(Debug, Default)]
struct Prepared {
    /// m.
    positions: Vec<Vec3>,
    /// Counted in repeats of the bar's picture; empty where it has none.
    uvs: Vec<Vec2>,
    /// Counted from the first vertex of each yarn.
    triangles: Vec<[u32; 3]>,
    yarns: Vec<Part>,
}

/// A yarn's part of a block's arrays.
#[derive(Debug)]
struct Part {
    yarn: YarnId,
    vertices: Range<usize>,
    triangles: Range<usize>,
    low: Vec3,
    high: Vec3,
}

/// Where an array lies in the file.
#[derive(Clone, Copy)]
struct View {
    index: Index<json::buffer::View>,
    kind: Type,
    component: ComponentType,
    /// Bytes of an element.
    size: usize,
}

impl GlbWriter {
    /// Starts the file: one material a bar, with the pictures that the wardrobe has for it. There
    /// is room for so many blocks and yarns; with more of them the file takes longer to finish.
    ///
    /// # Errors
    /// What the disk says.
    pub fn create(
        target: &Path,
        fabric: &Fabric,
        wardrobe: Arc<Wardrobe>,
        blocks: usize,
        yarns: usize,
    ) -> Result<Self, ExportError> {
        let mut root = Root {
            asset: json::Asset {
                generator: Some(concat!("warpknit ", env!("CARGO_PKG_VERSION")).to_owned()),
                ..json::Asset::default()
            },
            extensions_used: vec![SHEEN_EXTENSION.to_owned()],
            ..Root::default()
        };
        let buffer = root.push(json::Buffer {
            byte_length: USize64(0),
            name: None,
            uri: None,
            extensions: None,
            extras: json::Extras::default(),
        });
        push_textures(&mut root, buffer, &wardrobe.textures);
        for (number, yarn) in fabric.yarns().enumerate() {
            let name = format!("{} bar {}", fabric.name, number + 1);
            let material = match wardrobe.worn_by(number) {
                Some(place) => textured(&name, place, wardrobe.textures[place].mean),
                None => plain(&name, yarn.color.linear()),
            };
            root.push(material);
        }
        let room = (HEADERS
            + json_text(&root).len()
            + LAST_JSON
            + BLOCK_JSON * blocks
            + YARN_JSON * yarns)
            .next_multiple_of(4);
        let file = HeadLast::create(target, room)?;
        let mut writer = Self {
            file,
            bytes: 0,
            root,
            bars: Vec::new(),
            buffer,
            wardrobe,
            current: None,
            prepared: Vec::new(),
        };
        writer.write_textures()?;
        Ok(writer)
    }

    /// Appends the pictures to the binary chunk, each from a multiple of 4 bytes on, as their views
    /// say.
    fn write_textures(&mut self) -> Result<(), ExportError> {
        for picture in self.wardrobe.textures.iter().flat_map(|texture| &texture.pictures) {
            let padding = picture.len().next_multiple_of(4) - picture.len();
            self.file.write(picture)?;
            self.file.write(&[0; 3][..padding])?;
            self.bytes += (picture.len() + padding) as u64;
        }
        Ok(())
    }

    /// Adds one block's tubes, a mesh a yarn.
    fn add(&mut self, block: &Block, prepared: &Prepared) -> Result<(), ExportError> {
        let uvs = if prepared.uvs.is_empty() { &block.tubes.uvs } else { &prepared.uvs };
        let vertices = [
            (Semantic::Positions, self.array(&prepared.positions, Type::Vec3, ComponentType::F32)?),
            (Semantic::Normals, self.array(&block.tubes.normals, Type::Vec3, ComponentType::F32)?),
            (Semantic::TexCoords(0), self.array(uvs, Type::Vec2, ComponentType::F32)?),
        ];
        let corners: &[u32] = bytemuck::cast_slice(&prepared.triangles);
        let corners = self.array(corners, Type::Scalar, ComponentType::U32)?;
        for part in &prepared.yarns {
            let mut attributes = std::collections::BTreeMap::new();
            for (semantic, view) in &vertices {
                let bounds = (*semantic == Semantic::Positions).then_some([part.low, part.high]);
                attributes.insert(
                    Valid(semantic.clone()),
                    self.part_of(*view, part.vertices.clone(), bounds),
                );
            }
            let indices =
                self.part_of(corners, 3 * part.triangles.start..3 * part.triangles.end, None);
            let primitive = json::mesh::Primitive {
                attributes,
                indices: Some(indices),
                material: Some(Index::new(index32(block.bar))),
                mode: Valid(json::mesh::Mode::Triangles),
                targets: None,
                extensions: None,
                extras: json::Extras::default(),
            };
            self.add_yarn(block, part.yarn, primitive);
        }
        Ok(())
    }

    /// Hangs a yarn below the node of its panel's bar.
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
        let node = self.root.push(json::Node { name, ..json::Node::default() });
        self.bars.push(node);
        self.current = Some((at, node));
        node
    }

    /// Some elements of an array, with their bounds if they are to be told.
    fn part_of(
        &mut self,
        view: View,
        elements: Range<usize>,
        bounds: Option<[Vec3; 2]>,
    ) -> Index<Accessor> {
        let bound =
            |at: usize| bounds.map(|bounds| json::Value::from(bounds[at].to_array().to_vec()));
        self.root.push(Accessor {
            buffer_view: Some(view.index),
            byte_offset: Some(USize64::from(elements.start * view.size)),
            count: USize64::from(elements.len()),
            component_type: Valid(GenericComponentType(view.component)),
            type_: Valid(view.kind),
            min: bound(0),
            max: bound(1),
            name: None,
            normalized: false,
            sparse: None,
            extensions: None,
            extras: json::Extras::default(),
        })
    }

    /// Appends an array to the binary chunk with its view. All of its element sizes are multiples
    /// of 4, so it stays aligned.
    fn array<T: bytemuck::NoUninit>(
        &mut self,
        values: &[T],
        kind: Type,
        component: ComponentType,
    ) -> Result<View, ExportError> {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        self.file.write(bytes)?;
        // Parts of one view need its stride, but indices may have none.
        let (target, stride) = if kind == Type::Scalar {
            (Target::ElementArrayBuffer, None)
        } else {
            (Target::ArrayBuffer, Some(Stride(size_of::<T>())))
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
        self.bytes += bytes.len() as u64;
        Ok(View { index, kind, component, size: size_of::<T>() })
    }

    /// The JSON chunk, filled up with spaces to its room or else to a multiple of 4 bytes.
    fn json_chunk(&mut self) -> Vec<u8> {
        self.root.buffers[self.buffer.value()].byte_length = USize64(self.bytes);
        if self.bytes == 0 {
            // The format knows no empty buffers.
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
        text.resize(text.len().next_multiple_of(4).max(self.file.room() - self.headers()), b' ');
        text
    }
}

impl Sink for GlbWriter {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let mut prepared = std::mem::take(&mut self.prepared);
        prepared.resize_with(blocks.len().max(prepared.len()), Prepared::default);
        let wardrobe = &self.wardrobe;
        blocks
            .par_iter()
            .zip(&mut prepared)
            .for_each(|(block, prepared)| prepared.fill(block, wardrobe));
        for (block, prepared) in blocks.iter().zip(&prepared) {
            if !prepared.positions.is_empty() {
                self.add(block, prepared)?;
            }
        }
        self.prepared = prepared;
        self.within_limit(self.bytes).map(drop)
    }

    fn finish(mut self: Box<Self>) -> Result<Vec<Output>, ExportError> {
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
        Ok(vec![self.file.finish(&head)?])
    }
}

impl GlbWriter {
    /// Bytes of the headers that the file has.
    fn headers(&self) -> usize {
        if self.bytes > 0 { HEADERS } else { BARE_HEADERS }
    }

    /// A number of bytes that the format can hold.
    fn within_limit(&self, bytes: u64) -> Result<u32, ExportError> {
        u32::try_from(bytes).map_err(|_over_4_gib| ExportError::TooLarge {
            path: self.file.target().to_owned(),
            bytes,
        })
    }
}

impl Prepared {
    fn fill(&mut self, block: &Block, wardrobe: &Wardrobe) {
        let tubes = &block.tubes;
        self.positions.clear();
        self.positions.extend(tubes.positions.iter().map(|position| *position * METRES_PER_MM));
        self.uvs.clear();
        if wardrobe.worn_by(block.bar).is_some() {
            let repeats = Vec2::new(1.0, wardrobe.per_mm(block.bar));
            self.uvs.extend(tubes.uvs.iter().map(|uv| *uv * repeats));
        }
        self.triangles.clear();
        self.yarns.clear();
        let strands: Vec<_> = block.strands.strands.iter().zip(&tubes.strands).collect();
        // A yarn's strands follow each other, and so do their vertices and triangles.
        for strands in strands.chunk_by(|(a, _), (b, _)| a.yarn == b.yarn) {
            let ((strand, (first, first_triangles)), (_, (last, last_triangles))) =
                (strands[0], strands[strands.len() - 1]);
            let (vertices, triangles) = (
                first.start as usize..last.end as usize,
                first_triangles.start as usize..last_triangles.end as usize,
            );
            let own = tubes.triangles[triangles.clone()]
                .iter()
                .map(|corners| corners.map(|corner| corner - first.start));
            self.triangles.extend(own);
            let bounds = |(low, high): (Vec3, Vec3), position: &Vec3| {
                (low.min(*position), high.max(*position))
            };
            let positions = &self.positions[vertices.clone()];
            let (low, high) = positions.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), bounds);
            self.yarns.push(Part { yarn: strand.yarn, vertices, triangles, low, high });
        }
    }
}

fn json_text(root: &Root) -> Vec<u8> {
    json::serialize::to_vec(root).expect("numbers here are finite and keys are text")
}

/// Adds the views, images and textures of pictures that the binary chunk begins with: base colour,
/// normals and surface of each yarn.
fn push_textures(root: &mut Root, buffer: Index<json::Buffer>, textures: &[Texture]) {
    let mut offset = 0;
    for picture in textures.iter().flat_map(|texture| &texture.pictures) {
        let view = root.push(json::buffer::View {
            buffer,
            byte_length: USize64::from(picture.len()),
            byte_offset: Some(USize64::from(offset)),
            byte_stride: None,
            name: None,
            target: None,
            extensions: None,
            extras: json::Extras::default(),
        });
        offset += picture.len().next_multiple_of(4);
        let source = root.push(json::Image {
            buffer_view: Some(view),
            mime_type: Some(json::image::MimeType("image/png".to_owned())),
            name: None,
            uri: None,
            extensions: None,
            extras: json::Extras::default(),
        });
        root.push(json::Texture {
            name: None,
            sampler: None,
            source,
            extensions: None,
            extras: json::Extras::default(),
        });
    }
}

/// A yarn of one colour.
fn plain(name: &str, color: [f32; 3]) -> json::Material {
    let surface = json::material::PbrMetallicRoughness {
        base_color_factor: json::material::PbrBaseColorFactor([color[0], color[1], color[2], 1.0]),
        metallic_factor: json::material::StrengthFactor(0.0),
        roughness_factor: json::material::StrengthFactor(ROUGHNESS),
        ..json::material::PbrMetallicRoughness::default()
    };
    material(name, color, surface)
}

/// A yarn that wears the pictures at that place of the wardrobe, of such a mean colour.
fn textured(name: &str, place: usize, mean: [f32; 3]) -> json::Material {
    let texture = |picture: usize| Index::new(index32(Texture::PICTURES * place + picture));
    let info = |picture: usize| json::texture::Info {
        index: texture(picture),
        tex_coord: 0,
        extensions: None,
        extras: json::Extras::default(),
    };
    // Factors are 1 where nothing is said: the pictures' own values.
    let surface = json::material::PbrMetallicRoughness {
        base_color_texture: Some(info(Texture::BASE)),
        metallic_roughness_texture: Some(info(Texture::SURFACE)),
        ..json::material::PbrMetallicRoughness::default()
    };
    json::Material {
        normal_texture: Some(json::material::NormalTexture {
            index: texture(Texture::NORMAL),
            scale: 1.0,
            tex_coord: 0,
            extensions: None,
            extras: json::Extras::default(),
        }),
        occlusion_texture: Some(json::material::OcclusionTexture {
            index: texture(Texture::SURFACE),
            strength: json::material::StrengthFactor(1.0),
            tex_coord: 0,
            extensions: None,
            extras: json::Extras::default(),
        }),
        ..material(name, mean, surface)
    }
}

/// A yarn whose fibres catch the light as its colour says.
fn material(
    name: &str,
    color: [f32; 3],
    surface: json::material::PbrMetallicRoughness,
) -> json::Material {
    let sheen = serde_json::json!({ "sheenColorFactor": color.map(|channel| SHEEN * channel), "sheenRoughnessFactor": SHEEN_ROUGHNESS });
    json::Material {
        name: Some(name.to_owned()),
        pbr_metallic_roughness: surface,
        extensions: Some(json::extensions::material::Material {
            others: [(SHEEN_EXTENSION.to_owned(), sheen)].into_iter().collect(),
        }),
        ..json::Material::default()
    }
}
