//! MaterialX 1.39 (Academy Software Foundation): a graph of tiled images and an OpenPBR surface for
//! each side.
//!
//! One unit of the texture coordinates is a metre, and `uvtiling` says how many repeats lie on it: no
//! unit system is needed. Pictures of plain numbers have no colour space. OpenPBR has no ambient
//! occlusion; the renderers that read it find their own.

use std::fmt::Write as _;

use super::maps::{Means, Role};
use super::{FabricMaterial, SHEEN_ROUGHNESS, decimal};
use warpknit_render::fabric_maps::Side;

/// A picture of a graph: what it says, and its MaterialX type.
const IMAGES: [(Role, &str); 7] = [
    (Role::BaseColor, "color3"),
    (Role::Roughness, "float"),
    (Role::Metallic, "float"),
    (Role::Alpha, "float"),
    (Role::Sheen, "float"),
    (Role::Height, "float"),
    (Role::Normal, "vector3"),
];
/// Inputs of the surface that a graph's outputs are for.
const INPUTS: [(Role, &str); 5] = [
    (Role::BaseColor, "base_color"),
    (Role::Roughness, "specular_roughness"),
    (Role::Metallic, "base_metalness"),
    (Role::Alpha, "geometry_opacity"),
    (Role::Sheen, "fuzz_weight"),
];

/// The text of a `.mtlx`.
pub(super) fn text(material: &FabricMaterial<'_>) -> String {
    let mut text = format!(
        "<?xml version=\"1.0\"?>\n\
         <!-- {}: one repeat is {} x {} mm; one unit of the texture coordinates is 1 m. -->\n\
         <materialx version=\"1.39\" colorspace=\"lin_rec709\">\n",
        material.name,
        decimal(material.maps.size.x),
        decimal(material.maps.size.y)
    );
    for side in Side::BOTH {
        add(&mut text, format_args!("{}{}", graph(material, side), surface(material, side)));
    }
    text + "</materialx>\n"
}

/// The graph of a side's pictures.
fn graph(material: &FabricMaterial<'_>, side: Side) -> String {
    let mut text = format!("  <nodegraph name=\"maps_{}\">\n", side.name());
    let tiling = (1000.0 / material.maps.size).to_array().map(decimal);
    for (role, kind) in IMAGES {
        let space = if role == Role::BaseColor { " colorspace=\"srgb_texture\"" } else { "" };
        let (name, path) = (role.name(), role.path(side));
        add(
            &mut text,
            format_args!(
                "    <tiledimage name=\"{name}_image\" type=\"{kind}\">\n\
                 \x20     <input name=\"file\" type=\"filename\" value=\"{path}\"{space} />\n\
                 \x20     <input name=\"uvtiling\" type=\"vector2\" value=\"{}, {}\" />\n\
                 \x20   </tiledimage>\n",
                tiling[0], tiling[1]
            ),
        );
    }
    text.push_str(
        "    <normalmap name=\"normal_map\" type=\"vector3\">\n\
         \x20     <input name=\"in\" type=\"vector3\" nodename=\"normal_image\" />\n\
         \x20   </normalmap>\n",
    );
    for (role, kind) in IMAGES {
        let (name, from) = (role.name(), if role == Role::Normal { "map" } else { "image" });
        add(
            &mut text,
            format_args!(
                "    <output name=\"{name}\" type=\"{kind}\" nodename=\"{name}_{from}\" />\n"
            ),
        );
    }
    text + "  </nodegraph>\n"
}

/// The surface, the displacement and the material of a side.
fn surface(material: &FabricMaterial<'_>, side: Side) -> String {
    // Names are letters, digits and `_`, and begin with no digit, as that of a chain does.
    let (name, side_name) = (material.name.replace('-', "_"), side.name());
    let mut text =
        format!("  <open_pbr_surface name=\"surface_{side_name}\" type=\"surfaceshader\">\n");
    let shines = Means::of(material.maps.side(side)).sheen > 0.0;
    for (role, name) in INPUTS.into_iter().filter(|(role, _)| shines || *role != Role::Sheen) {
        text += &input(name, role, side);
    }
    text += &input("geometry_normal", Role::Normal, side);
    // A height of 0 is the lowest surface, in metres as the texture coordinates.
    let depth = decimal(material.maps.depth / 1000.0);
    let displacement = input("displacement", Role::Height, side);
    add(
        &mut text,
        format_args!(
            "    <input name=\"fuzz_roughness\" type=\"float\" value=\"{SHEEN_ROUGHNESS}\" />\n\
             \x20   <input name=\"geometry_thin_walled\" type=\"boolean\" value=\"true\" />\n\
             \x20 </open_pbr_surface>\n\
             \x20 <displacement name=\"displacement_{side_name}\" type=\"displacementshader\">\n\
             {displacement}\
             \x20   <input name=\"scale\" type=\"float\" value=\"{depth}\" />\n\
             \x20 </displacement>\n\
             \x20 <surfacematerial name=\"fabric_{name}_{side_name}\" type=\"material\">\n\
             \x20   <input name=\"surfaceshader\" type=\"surfaceshader\" nodename=\"surface_{side_name}\" />\n\
             \x20   <input name=\"displacementshader\" type=\"displacementshader\" nodename=\"displacement_{side_name}\" />\n\
             \x20 </surfacematerial>\n"
        ),
    );
    text
}

/// An input that takes a picture of a side.
fn input(name: &str, role: Role, side: Side) -> String {
    let kind = IMAGES.iter().find(|(own, _)| *own == role).map_or("", |(_, kind)| *kind);
    format!(
        "    <input name=\"{name}\" type=\"{kind}\" nodegraph=\"maps_{}\" output=\"{}\" />\n",
        side.name(),
        role.name()
    )
}

fn add(text: &mut String, more: std::fmt::Arguments<'_>) {
    text.write_fmt(more).expect("a string takes any text");
}
