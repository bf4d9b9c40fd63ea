//! The materials and textures of a `.glb`, before any yarn.
//!
//! Core materials of glTF 2.0 with metallic-roughness shading, and the sheen of the extension
//! `KHR_materials_sheen`: a layer of fibres that stand off the surface.

use gltf_json as json;
use json::validation::USize64;
use json::{Index, Root};

use super::ClothInfo;
use super::texture::Texture;
use warpknit_core::ids::index32;
use warpknit_render::cloth::ROUGHNESS;

/// Light that fibres standing off a yarn scatter, as a share of its colour.
const SHEEN: f32 = 0.4;
/// How widely they scatter it: near 0 it is a thin rim of light, at 1 it covers the whole yarn.
const SHEEN_ROUGHNESS: f32 = 0.5;
const SHEEN_EXTENSION: &str = "KHR_materials_sheen";

/// The JSON with materials and textures, before any yarn, and the index of its buffer.
pub(super) fn root_of(cloth: &ClothInfo<'_>) -> (Root, Index<json::Buffer>) {
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
    let textures = &cloth.textures;
    push_textures(&mut root, buffer, &textures.textures);
    for (bar, style) in cloth.strands.iter().enumerate() {
        let name = format!("{} {}", cloth.name, style.name);
        root.push(match textures.texture_of(bar) {
            Some(place) => textured(&name, place, textures.textures[place].mean),
            None => plain(&name, style.color.linear()),
        });
    }
    (root, buffer)
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

/// The index of one of the pictures at that place of the texture set.
fn texture_index(place: usize, picture: usize) -> Index<json::Texture> {
    Index::new(index32(Texture::PICTURES * place + picture))
}

fn texture_info(place: usize, picture: usize) -> json::texture::Info {
    json::texture::Info {
        index: texture_index(place, picture),
        tex_coord: 0,
        extensions: None,
        extras: json::Extras::default(),
    }
}

/// A yarn with the pictures at that place of the texture set, whose mean colour is `mean`.
fn textured(name: &str, place: usize, mean: [f32; 3]) -> json::Material {
    // Factors have their default, 1: the pictures' own values.
    let surface = json::material::PbrMetallicRoughness {
        base_color_texture: Some(texture_info(place, Texture::BASE)),
        metallic_roughness_texture: Some(texture_info(place, Texture::SURFACE)),
        ..json::material::PbrMetallicRoughness::default()
    };
    json::Material {
        normal_texture: Some(json::material::NormalTexture {
            index: texture_index(place, Texture::NORMAL),
            scale: 1.0,
            tex_coord: 0,
            extensions: None,
            extras: json::Extras::default(),
        }),
        occlusion_texture: Some(json::material::OcclusionTexture {
            index: texture_index(place, Texture::SURFACE),
            strength: json::material::StrengthFactor(1.0),
            tex_coord: 0,
            extensions: None,
            extras: json::Extras::default(),
        }),
        ..material(name, mean, surface)
    }
}

/// A material with the sheen of fibres of that colour.
fn material(
    name: &str,
    color: [f32; 3],
    surface: json::material::PbrMetallicRoughness,
) -> json::Material {
    let sheen = serde_json::json!({
        "sheenColorFactor": color.map(|channel| SHEEN * channel),
        "sheenRoughnessFactor": SHEEN_ROUGHNESS,
    });
    json::Material {
        name: Some(name.to_owned()),
        pbr_metallic_roughness: surface,
        extensions: Some(json::extensions::material::Material {
            others: [(SHEEN_EXTENSION.to_owned(), sheen)].into_iter().collect(),
        }),
        ..json::Material::default()
    }
}
