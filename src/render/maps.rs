//! What a photo of a yarn says of its surface: base colour, normals, roughness, metal, occlusion, each with its smaller levels.
//!
//! In: pictures of one repeat of the yarn, x along it and y across. Out: [`Maps`], which both renderers look up, the GPU's hardware and
//! [`Maps::sample`] alike.

use glam::Vec3;
use image::RgbaImage;

use super::tone;

/// A picture and its smaller levels, each half as large, down to one pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mips {
    /// Level 0 is the picture itself.
    pub levels: Vec<RgbaImage>,
}

/// One yarn's pictures, all of one size.
#[derive(Clone, Debug, PartialEq)]
pub struct Maps {
    /// Base colour, sRGB, and alpha, straight: the fuzz.
    pub base: Mips,
    /// Normals as colours, OpenGL's way: x along the yarn, y toward the picture's top, z outward.
    pub normal: Mips,
    /// Red: ambient occlusion, green: roughness, blue: metal, as glTF packs them.
    pub surface: Mips,
    /// What one repeat is long, mm.
    pub length: f32,
    /// What the picture is wide across the yarn, fuzz included, mm.
    pub width: f32,
}

impl Maps {
    /// The smallest level's colour, linear RGB.
    #[must_use]
    pub fn mean_albedo(&self) -> Vec3 {
        let last = self.base.levels.last().and_then(|level| level.pixels().next());
        last.map_or(Vec3::ONE, |pixel| Vec3::from_array([0, 1, 2].map(|c| tone::linear(f32::from(pixel.0[c]) / 255.0))))
    }
}
