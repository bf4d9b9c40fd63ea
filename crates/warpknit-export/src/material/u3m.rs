//! U3M 1.1 (Unified 3D Material, vizoogmbh/u3m): a JSON file beside its pictures.
//!
//! Every key is written, those without a picture with the format's default. Sizes are mm, and agree
//! with pixels and dpi. Constants are the means of the pictures. Displacement is in mm, toward the
//! viewer from the lowest surface. There is no key for ambient occlusion: it stands under `custom`.

use serde_json::{Value, json};

use super::maps::{Means, Role};
use super::{FabricMaterial, Making, PREVIEW, decimal};
use warpknit_render::fabric_maps::Side;

/// The text of a `.u3m`.
pub(super) fn text(material: &FabricMaterial<'_>) -> String {
    let time = material.time.to_string();
    let document = json!({
        "schema": "1.1",
        "custom": {
            "warpknit": {
                "occlusion": {
                    "front": Role::Occlusion.path(Side::Front),
                    "back": Role::Occlusion.path(Side::Back),
                },
            },
        },
        "material": {
            "id": uuid(material.id),
            "name": material.name,
            "description": material.about,
            "created": time,
            "modified": time,
            "front": visual(material, Side::Front),
            "back": visual(material, Side::Back),
            "side": null,
            "physics": physics(material),
            "metadata": {},
        },
    });
    serde_json::to_string_pretty(&document).expect("names and numbers are JSON") + "\n"
}

/// A version 4 UUID of these bits.
fn uuid(id: u128) -> String {
    // Version 4 and variant 1 (RFC 9562).
    let id = id & !(0xf << 76) & !(0x3 << 62) | 0x4 << 76 | 0x2 << 62;
    let digits = format!("{id:032x}");
    let parts = [0..8, 8..12, 12..16, 16..20, 20..32].map(|part| &digits[part]);
    parts.join("-")
}

/// One side's look.
fn visual(material: &FabricMaterial<'_>, side: Side) -> Value {
    let means = Means::of(material.maps.side(side));
    let [r, g, b] = means.base_color.map(decimal);
    let depth = material.maps.depth;
    json!({
        "shader": "principled",
        "preview": preview(material),
        "basecolor": {
            "constant": { "r": r, "g": g, "b": b },
            "texture": {
                "mode": "multiply",
                "factor": { "r": 1, "g": 1, "b": 1 },
                "image": image(material, &Role::BaseColor.path(side)),
            },
        },
        "normal": {
            "constant": { "x": 0, "y": 0, "z": 1 },
            "texture": { "scale": 1, "image": image(material, &Role::Normal.path(side)) },
        },
        "alpha": mapped(material, (side, Role::Alpha), means.alpha, 1.0),
        "roughness": mapped(material, (side, Role::Roughness), means.roughness, 1.0),
        "metalness": mapped(material, (side, Role::Metallic), means.metallic, 1.0),
        "displacement": mapped(material, (side, Role::Height), depth * means.height, depth),
        "sheen_value": mapped(material, (side, Role::Sheen), means.sheen, 1.0),
        "sheen_tint": number(0.0),
        "specular_value": number(0.5),
        "specular_tint": number(0.0),
        "ior": number(1.5),
        "anisotropy_value": number(0.0),
        "anisotropy_rotation": number(0.0),
        "clearcoat_value": number(0.0),
        "clearcoat_roughness": number(0.0),
        "clearcoat_normal": { "constant": { "x": 0, "y": 0, "z": 1 }, "texture": null },
        "subsurface_color": { "constant": { "r": r, "g": g, "b": b }, "texture": null },
        "subsurface_radius": number(0.0),
        "subsurface_value": number(0.0),
        "transmission": number(0.0),
    })
}

/// A number with a side's picture, whose white stands for `factor`.
fn mapped(
    material: &FabricMaterial<'_>,
    (side, role): (Side, Role),
    mean: f64,
    factor: f64,
) -> Value {
    let image = image(material, &role.path(side));
    let texture = json!({ "factor": decimal(factor), "offset": 0, "image": image });
    json!({ "constant": decimal(mean), "texture": texture })
}

/// A number without a picture.
fn number(constant: f64) -> Value {
    json!({ "constant": constant, "texture": null })
}

/// A picture of one repeat.
fn image(material: &FabricMaterial<'_>, path: &str) -> Value {
    let mut image = sized(path, material.maps.size.to_array(), material.maps.pixels());
    image["repeat"] = json!({ "mode": "normal", "rotation": 0 });
    image
}

/// A path with the size of its picture. Numbers are not rounded, so that dpi is exactly that of
/// pixels and mm.
fn sized(path: &str, [width, height]: [f64; 2], pixels: [u32; 2]) -> Value {
    let [across, up] = pixels.map(f64::from);
    let dpi = json!({ "x": across / (width / 25.4), "y": up / (height / 25.4) });
    json!({ "path": path, "width": width, "height": height, "dpi": dpi })
}

fn preview(material: &FabricMaterial<'_>) -> Value {
    sized(PREVIEW, material.preview.size.to_array(), material.preview.pixels)
}

/// What the cloth weighs and how it is made. Its fibres are not known: a fabric file has their
/// density only.
fn physics(material: &FabricMaterial<'_>) -> Value {
    let (kind, construction) = match material.making {
        Making::WarpKnit => ("Knit", json!({ "type": "other", "name": "Warp knit" })),
        Making::WeftKnit => ("Knit", json!({ "type": "other", "name": "Weft knit" })),
        Making::Laid => ("Woven", Value::Null),
    };
    json!({
        "thickness": decimal(material.thickness),
        "weight": decimal(material.mass),
        "composition": null,
        "material_type": { "type": kind, "name": null },
        "construction": construction,
        // The text "null", not null: the format's way to say that there is no file.
        "devices": { "fab": "null" },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_is_a_uuid_of_version_4() {
        for id in [0, u128::MAX, 0x0123_4567_89ab_cdef_0123_4567_89ab_cdef] {
            let text = uuid(id);
            assert_eq!(text.len(), 36);
            assert_eq!(&text[14..15], "4", "{text}");
            assert!("89ab".contains(&text[19..20]), "{text}");
        }
    }
}
