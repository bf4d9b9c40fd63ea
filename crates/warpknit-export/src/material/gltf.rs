//! A `.glb` (Khronos, "glTF 2.0 Specification"): a plane of whole repeats, metres, y up, with the
//! face's material on its front and the back's on its back.
//!
//! Each side is a rectangle of its own that is seen from its side alone, so that both have their own
//! pictures. Core materials, and the sheen of `KHR_materials_sheen` where a yarn has any. Alpha is
//! blended. glTF has no heights; the folder's pictures have them.

use serde_json::{Value, json};

use super::maps::{Means, base_with_alpha, rgb, surface};
use super::{FabricMaterial, SHEEN_ROUGHNESS};
use warpknit_core::ids::index32;
use warpknit_core::number::narrow;
use warpknit_render::fabric_maps::{Side, SideMaps};

const MAGIC: u32 = 0x4654_6c67;
const JSON_CHUNK: u32 = 0x4e4f_534a;
const BINARY_CHUNK: u32 = 0x004e_4942;
const SHEEN: &str = "KHR_materials_sheen";
// Types of numbers and uses of arrays, by OpenGL's names.
const UNSIGNED_SHORT: u32 = 5123;
const FLOAT: u32 = 5126;
const VERTEX_ARRAY: u32 = 34_962;
const INDEX_ARRAY: u32 = 34_963;
/// Pictures of a side: base colour, normals, surface; and its sheen if it has any.
const PICTURES: usize = 3;
/// Two triangles.
const INDICES: [u16; 6] = [0, 1, 2, 0, 2, 3];

/// The binary chunk and its views.
#[derive(Default)]
struct Binary {
    bytes: Vec<u8>,
    views: Vec<Value>,
}

impl Binary {
    /// Adds bytes as a view; returns its index.
    fn push(&mut self, bytes: &[u8]) -> usize {
        let offset = self.bytes.len();
        self.bytes.extend(bytes);
        // Accessors of floats must lie on multiples of four.
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }));
        self.views.len() - 1
    }

    /// Adds an array of a mesh as a view.
    fn push_array(&mut self, bytes: &[u8], target: u32) -> usize {
        let view = self.push(bytes);
        self.views[view]["target"] = json!(target);
        view
    }
}

/// The bytes of a `.glb`.
pub(super) fn bytes(material: &FabricMaterial<'_>) -> Vec<u8> {
    let mut binary = Binary::default();
    let mut lists = Lists::default();
    for side in Side::BOTH {
        lists.add_side(material, side, &mut binary);
    }
    let mut document = json!({
        "asset": { "version": "2.0", "generator": concat!("warpknit ", env!("CARGO_PKG_VERSION")) },
        "scene": 0,
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": lists.nodes,
        "meshes": lists.meshes,
        "materials": lists.materials,
        "textures": lists.textures,
        "images": lists.images,
        "samplers": [{ "magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497 }],
        "accessors": lists.accessors,
        "bufferViews": binary.views,
        "buffers": [{ "byteLength": binary.bytes.len() }],
    });
    if lists.shines {
        document["extensionsUsed"] = json!([SHEEN]);
    }
    container(&document, &binary.bytes)
}

/// The arrays of the document.
#[derive(Default)]
struct Lists {
    nodes: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    textures: Vec<Value>,
    images: Vec<Value>,
    accessors: Vec<Value>,
    shines: bool,
}

impl Lists {
    /// Adds a side: its pictures, its material and its rectangle.
    fn add_side(&mut self, material: &FabricMaterial<'_>, side: Side, binary: &mut Binary) {
        let (maps, name) = (material.maps.side(side), format!("{} {}", material.name, side.name()));
        let first = self.textures.len();
        let shines = Means::of(maps).sheen > 0.0;
        self.shines |= shines;
        for png in pictures(maps, shines) {
            let view = binary.push(&png);
            self.textures.push(json!({ "sampler": 0, "source": self.images.len() }));
            self.images.push(json!({ "bufferView": view, "mimeType": "image/png" }));
        }
        self.materials.push(look(&name, maps, first, shines));
        let attributes = self.add_rectangle(material, side, binary);
        self.nodes.push(json!({ "mesh": self.meshes.len(), "name": name }));
        self.meshes.push(json!({
            "name": name,
            "primitives": [{
                "attributes": attributes,
                "indices": self.accessors.len() - 1,
                "material": self.materials.len() - 1,
            }],
        }));
    }

    /// Adds the arrays of a side's rectangle, its indices last; returns the attributes.
    fn add_rectangle(
        &mut self,
        material: &FabricMaterial<'_>,
        side: Side,
        binary: &mut Binary,
    ) -> Value {
        let ([width, height], [u, v]) = (
            (material.plane() / 1000.0).to_array().map(narrow),
            material.repeats().to_array().map(narrow),
        );
        // Seen from its side, a rectangle's corners run counter-clockwise from the lower left.
        let facing = match side {
            Side::Front => 1.0,
            Side::Back => -1.0,
        };
        let (right, up) = (facing * width / 2.0, height / 2.0);
        let positions =
            [[-right, -up, 0.0], [right, -up, 0.0], [right, up, 0.0], [-right, up, 0.0]];
        // v runs down, from the picture's upper edge.
        let places = [[0.0, v], [u, v], [u, 0.0], [0.0, 0.0]];
        let (half, low) = ([width / 2.0, up, 0.0], [-width / 2.0, -up, 0.0]);
        let attributes = json!({
            "POSITION": self.add_floats(&positions, "VEC3", binary),
            "NORMAL": self.add_floats(&[[0.0, 0.0, facing]; 4], "VEC3", binary),
            "TANGENT": self.add_floats(&[[facing, 0.0, 0.0, 1.0]; 4], "VEC4", binary),
            "TEXCOORD_0": self.add_floats(&places, "VEC2", binary),
        });
        let place = attributes["POSITION"].as_u64().and_then(|at| usize::try_from(at).ok());
        let positions = &mut self.accessors[place.expect("added above")];
        (positions["min"], positions["max"]) = (json!(low), json!(half));
        let indices: Vec<u8> = INDICES.iter().flat_map(|index| index.to_le_bytes()).collect();
        self.add(binary.push_array(&indices, INDEX_ARRAY), UNSIGNED_SHORT, INDICES.len(), "SCALAR");
        attributes
    }

    /// Adds four vectors; returns the index of their accessor.
    fn add_floats<const N: usize>(
        &mut self,
        vectors: &[[f32; N]; 4],
        kind: &str,
        binary: &mut Binary,
    ) -> usize {
        let view = binary.push_array(bytemuck::cast_slice(vectors.as_flattened()), VERTEX_ARRAY);
        self.add(view, FLOAT, vectors.len(), kind)
    }

    fn add(&mut self, view: usize, number: u32, count: usize, kind: &str) -> usize {
        self.accessors.push(json!({
            "bufferView": view, "componentType": number, "count": count, "type": kind,
        }));
        self.accessors.len() - 1
    }
}

/// The pictures of a side.
fn pictures(maps: &SideMaps, shines: bool) -> Vec<Vec<u8>> {
    let mut pictures = vec![base_with_alpha(maps), rgb(&maps.normal), surface(maps)];
    if shines {
        let grey = image::DynamicImage::from(maps.sheen.clone()).into_rgb8();
        pictures.push(rgb(&grey));
    }
    pictures
}

/// A side's material, whose textures are those from `first` on.
fn look(name: &str, maps: &SideMaps, first: usize, shines: bool) -> Value {
    let is_opaque = maps.alpha.as_raw().iter().all(|&alpha| alpha == u8::MAX);
    let mut look = json!({
        "name": name,
        "alphaMode": if is_opaque { "OPAQUE" } else { "BLEND" },
        "pbrMetallicRoughness": {
            "baseColorTexture": { "index": first },
            "metallicRoughnessTexture": { "index": first + 2 },
        },
        "normalTexture": { "index": first + 1 },
        "occlusionTexture": { "index": first + 2 },
    });
    if shines {
        look["extensions"] = json!({
            SHEEN: {
                "sheenColorFactor": [1, 1, 1],
                "sheenColorTexture": { "index": first + PICTURES },
                "sheenRoughnessFactor": SHEEN_ROUGHNESS,
            },
        });
    }
    look
}

/// The container of a document and its binary chunk, which is a multiple of four bytes long.
fn container(document: &Value, binary: &[u8]) -> Vec<u8> {
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let length = 12 + 8 + text.len() + 8 + binary.len();
    let mut bytes = Vec::with_capacity(length);
    let version = 2;
    let header = [MAGIC, version, index32(length), index32(text.len()), JSON_CHUNK];
    bytes.extend(header.map(u32::to_le_bytes).as_flattened());
    bytes.extend(text);
    bytes.extend([index32(binary.len()), BINARY_CHUNK].map(u32::to_le_bytes).as_flattened());
    bytes.extend(binary);
    bytes
}
