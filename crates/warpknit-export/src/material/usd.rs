//! USD preview materials as text (Alliance for OpenUSD, "UsdPreviewSurface Specification"): a plane of
//! whole repeats, mm, y up, with the face's material on its front and the back's on its back.
//!
//! Texture coordinates count repeats. Each side is a mesh of its own that is seen from its side
//! alone. Occlusion and heights are connected too. The preview surface has no sheen.

use std::fmt::Write as _;

use super::FabricMaterial;
use super::maps::Role;
use warpknit_render::fabric_maps::Side;

/// Inputs of the preview surface, with their types and the pictures and channels for them.
const INPUTS: [(&str, &str, Role, &str); 7] = [
    ("diffuseColor", "color3f", Role::BaseColor, "rgb"),
    ("normal", "normal3f", Role::Normal, "rgb"),
    ("opacity", "float", Role::Alpha, "r"),
    ("roughness", "float", Role::Roughness, "r"),
    ("metallic", "float", Role::Metallic, "r"),
    ("occlusion", "float", Role::Occlusion, "r"),
    ("displacement", "float", Role::Height, "r"),
];

/// The text of a `.usda`.
pub(super) fn text(material: &FabricMaterial<'_>) -> String {
    let mut text = format!(
        "#usda 1.0\n(\n    defaultPrim = \"fabric\"\n    doc = \"{}: one repeat is {:.6} x {:.6} mm\"\n    \
         metersPerUnit = 0.001\n    upAxis = \"Y\"\n)\n\ndef Xform \"fabric\"\n{{\n",
        material.name, material.maps.size.x, material.maps.size.y
    );
    for side in Side::BOTH {
        add(&mut text, format_args!("{}{}", mesh(material, side), look(material, side)));
    }
    text + "}\n"
}

/// The rectangle of a side.
fn mesh(material: &FabricMaterial<'_>, side: Side) -> String {
    let (plane, repeats, name) = (material.plane() / 2.0, material.repeats(), side.name());
    let facing = match side {
        Side::Front => 1.0,
        Side::Back => -1.0,
    };
    // Seen from its side, the corners run counter-clockwise from the lower left.
    let (x, y) = (facing * plane.x, plane.y);
    let (u, v) = (repeats.x, repeats.y);
    format!(
        "    def Mesh \"{name}\" (\n        prepend apiSchemas = [\"MaterialBindingAPI\"]\n    )\n    {{\n        \
         uniform bool doubleSided = 0\n        uniform token subdivisionScheme = \"none\"\n        \
         float3[] extent = [({:.6}, {:.6}, 0), ({:.6}, {:.6}, 0)]\n        \
         int[] faceVertexCounts = [4]\n        int[] faceVertexIndices = [0, 1, 2, 3]\n        \
         point3f[] points = [({:.6}, {:.6}, 0), ({:.6}, {:.6}, 0), ({:.6}, {:.6}, 0), ({:.6}, {:.6}, 0)]\n        \
         normal3f[] normals = [(0, 0, {facing}), (0, 0, {facing}), (0, 0, {facing}), (0, 0, {facing})] (\n            \
         interpolation = \"vertex\"\n        )\n        \
         texCoord2f[] primvars:st = [(0, 0), ({u}, 0), ({u}, {v}), (0, {v})] (\n            \
         interpolation = \"vertex\"\n        )\n        \
         rel material:binding = </fabric/{name}_material>\n    }}\n",
        -plane.x, -y, plane.x, y, -x, -y, x, -y, x, y, -x, y
    )
}

/// The material of a side.
fn look(material: &FabricMaterial<'_>, side: Side) -> String {
    let name = side.name();
    let path = format!("/fabric/{name}_material");
    let mut text = format!(
        "    def Material \"{name}_material\"\n    {{\n        \
         token outputs:surface.connect = <{path}/surface.outputs:surface>\n        \
         token outputs:displacement.connect = <{path}/surface.outputs:displacement>\n\n        \
         def Shader \"surface\"\n        {{\n            \
         uniform token info:id = \"UsdPreviewSurface\"\n"
    );
    for (input, kind, role, channel) in INPUTS {
        let picture = role.name();
        add(
            &mut text,
            format_args!(
                "            {kind} inputs:{input}.connect = <{path}/{picture}.outputs:{channel}>\n"
            ),
        );
    }
    text += "            token outputs:surface\n            token outputs:displacement\n        }\n\n        \
             def Shader \"st\"\n        {\n            \
             uniform token info:id = \"UsdPrimvarReader_float2\"\n            \
             string inputs:varname = \"st\"\n            float2 outputs:result\n        }\n";
    for (_, _, role, channel) in INPUTS {
        text += &texture(material, side, role, channel);
    }
    text + "    }\n"
}

/// A picture's texture.
fn texture(material: &FabricMaterial<'_>, side: Side, role: Role, channel: &str) -> String {
    let (name, file) = (role.name(), role.path(side));
    let space = if role == Role::BaseColor { "sRGB" } else { "raw" };
    let scaled = match role {
        // From 0..1 to -1..1.
        Role::Normal => Some(([2.0, 2.0, 2.0, 1.0], [-1.0, -1.0, -1.0, 0.0])),
        // mm from the middle of the cloth.
        Role::Height => Some(([material.maps.depth; 4], [-material.maps.depth / 2.0; 4])),
        _ => None,
    };
    let numbers = |[a, b, c, d]: [f64; 4]| format!("({a:.6}, {b:.6}, {c:.6}, {d:.6})");
    let scaled = scaled.map_or_else(String::new, |(scale, bias)| {
        format!(
            "            float4 inputs:scale = {}\n            float4 inputs:bias = {}\n",
            numbers(scale),
            numbers(bias)
        )
    });
    let output = if channel == "rgb" { "float3 outputs:rgb" } else { "float outputs:r" };
    format!(
        "\n        def Shader \"{name}\"\n        {{\n            uniform token info:id = \"UsdUVTexture\"\n            \
         asset inputs:file = @{file}@\n            \
         float2 inputs:st.connect = </fabric/{}_material/st.outputs:result>\n            \
         token inputs:sourceColorSpace = \"{space}\"\n            \
         token inputs:wrapS = \"repeat\"\n            token inputs:wrapT = \"repeat\"\n\
         {scaled}            {output}\n        }}\n",
        side.name()
    )
}

fn add(text: &mut String, more: std::fmt::Arguments<'_>) {
    text.write_fmt(more).expect("a string takes any text");
}
