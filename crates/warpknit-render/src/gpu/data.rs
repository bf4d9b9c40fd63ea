//! The shaders' structures, byte for byte as WGSL lays them out.
//!
//! In and out: memory only. A test reads the shaders and compares the name and offset of each
//! field. Fields named `spare` pad structures to WGSL's alignment.

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec2, Vec3, Vec4};

/// Largest number of pieces in a chunk.
// Chunks are the unit of culling and level of detail. Shorter ones cull better and cost more
// instances and memory; longer ones do the opposite. The products are fixed in the shader too.
pub(super) const CHUNK: u32 = PARTS * STEPS;
/// Steps of an instance: `STEPS` of `shaders/yarn.wgsl`.
pub(super) const STEPS: u32 = 8;
/// Instances of a full chunk: `PARTS` of `shaders/yarn.wgsl`.
pub(super) const PARTS: u32 = 32;

/// `ViewUniform` of `shaders/view.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct ViewUniform {
    pub(super) clip_from_world: Mat4,
    pub(super) sun_from_world: Mat4,
    pub(super) eye: Vec4,
    pub(super) toward_sun: Vec3,
    pub(super) pixel: f32,
    pub(super) sun: Vec3,
    pub(super) tile_width: f32,
    pub(super) zenith: Vec3,
    pub(super) tile_height: f32,
    pub(super) sky_above: Vec3,
    pub(super) depth_scale: f32,
    pub(super) sky_below: Vec3,
    pub(super) corner_x: f32,
    pub(super) on_cloth: Vec3,
    pub(super) corner_y: f32,
    pub(super) sun_bias: f32,
    pub(super) layer: f32,
    pub(super) near_open: Vec2,
    pub(super) near_brightness: f32,
    pub(super) near_sunshine: f32,
    pub(super) farness: f32,
    pub(super) depth_texel: f32,
    pub(super) depth_sigma: f32,
    pub(super) gap_to_sun: f32,
    pub(super) gap_light: Vec2,
}

/// `LookData` of `shaders/view.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct LookData {
    pub(super) albedo: Vec3,
    pub(super) roughness: f32,
    pub(super) metallic: f32,
    pub(super) radius: f32,
    pub(super) plies: f32,
    pub(super) ply_slope: f32,
    pub(super) fibre_slope: f32,
    pub(super) repeat: f32,
    pub(super) sheen: f32,
    pub(super) spare: f32,
}

/// `Chunk` of `shaders/yarn.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Chunk {
    pub(super) first: u32,
    pub(super) count: u32,
    pub(super) look: u32,
    /// How much lighter its yarn is than even yarn: a signed byte that over 127 is a share of
    /// [`MOST_UNEVEN`].
    pub(super) lightness: u32,
    /// How much thicker it is at [`KNOTS`] even places from its start to its end, as such bytes.
    pub(super) thickness: [u32; 2],
}

/// Places along a chunk that have a thickness of their own: `KNOTS` of `shaders/yarn.wgsl`.
pub(super) const KNOTS: u32 = 8;

/// Largest difference from 1 of the factors on a yarn's radius and on its base colour:
/// `MOST_UNEVEN` of `shaders/yarn.wgsl`.
pub(super) const MOST_UNEVEN: f32 = 0.25;

/// `Draw` of `shaders/yarn.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Draw {
    pub(super) first: u32,
    pub(super) stride: u32,
    pub(super) edges: u32,
    pub(super) spare: u32,
}

/// `Blur` of `shaders/moments.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Blur {
    pub(super) step: [i32; 2],
    pub(super) reach: i32,
    pub(super) sigma: f32,
    pub(super) near: f32,
    pub(super) far: f32,
    pub(super) perspective: f32,
    pub(super) layer: f32,
}

/// `Tone` of `shaders/tone.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Tone {
    pub(super) background: Vec4,
    pub(super) exposure: f32,
    pub(super) scale: i32,
    pub(super) corner: [i32; 2],
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::mem::{offset_of, size_of};
    use warpknit_shaders as shaders;

    /// Names and offsets of a structure's fields, and its size.
    type Layout = (Vec<(String, usize)>, usize);

    macro_rules! layout {
        ($name:ident: $($field:ident),*) => {
            (
                stringify!($name),
                (
                    vec![$((stringify!($field).to_owned(), offset_of!($name, $field))),*],
                    size_of::<$name>(),
                ),
            )
        };
    }

    /// Layouts of the structure `name` in all shaders that have it.
    fn in_shaders(name: &str) -> Vec<Layout> {
        let mut found = Vec::new();
        for (_, source) in shaders::ALL {
            let module = naga::front::wgsl::parse_str(source).unwrap();
            for (_, shape) in
                module.types.iter().filter(|(_, shape)| shape.name.as_deref() == Some(name))
            {
                let naga::TypeInner::Struct { members, span } = &shape.inner else {
                    panic!("{name} is no structure")
                };
                let fields = members
                    .iter()
                    .map(|member| (member.name.clone().unwrap(), member.offset as usize))
                    .collect();
                found.push((fields, *span as usize));
            }
        }
        found
    }

    #[test]
    fn structures_lie_in_memory_as_the_shaders_read_them() {
        let twins = [
            layout!(ViewUniform: clip_from_world, sun_from_world, eye, toward_sun, pixel, sun,
                tile_width, zenith, tile_height, sky_above, depth_scale, sky_below, corner_x,
                on_cloth, corner_y, sun_bias, layer, near_open, near_brightness,
                near_sunshine, farness, depth_texel, depth_sigma, gap_to_sun, gap_light),
            layout!(LookData: albedo, roughness, metallic, radius, plies, ply_slope, fibre_slope,
                repeat, sheen, spare),
            layout!(Chunk: first, count, look, lightness, thickness),
            layout!(Draw: first, stride, edges, spare),
            layout!(Blur: step, reach, sigma, near, far, perspective, layer),
            layout!(Tone: background, exposure, scale, corner),
        ];
        for (name, twin) in twins {
            let shader = in_shaders(name);
            assert!(!shader.is_empty(), "no shader has {name}");
            shader.iter().for_each(|layout| assert_eq!(*layout, twin, "{name}"));
        }
    }

    #[test]
    fn a_chunk_is_as_long_as_the_shader_says() {
        let yarn = shaders::ALL.iter().find(|(name, _)| *name == "yarn").unwrap().1;
        for line in [
            format!("const STEPS = {STEPS}u;"),
            format!("const PARTS = {PARTS}u;"),
            format!("const MOST_UNEVEN = {MOST_UNEVEN};"),
            format!("const KNOTS = {KNOTS}u;"),
        ] {
            assert!(yarn.contains(&line), "{line}");
        }
    }
}
