//! What a renderer draws: yarns as control points, and what they are made of.
//!
//! In: the strands of the blocks that [`crate::drape`] hands out. Out: structure-of-arrays control points in `f32`, 12 bytes a
//! data point, so that millions of stitches fit; renderers expand them on their own.

use glam::Vec3;

/// How a yarn looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct YarnLook {
    /// Base colour, linear RGB 0..1.
    pub albedo: Vec3,
    /// Perceived roughness 0..1 (Beckmann's `a` is its square).
    pub roughness: f32,
    /// 0 for fibres, 1 for metal.
    pub metallic: f32,
    /// Radius, mm.
    pub radius: f32,
}

/// One uninterrupted run of yarn.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Strand {
    /// Its control points in [`Scene::positions`].
    pub points: std::ops::Range<u32>,
    /// Its look in [`Scene::looks`].
    pub look: u16,
}

/// Everything in front of the camera.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Control points of all strands, mm; the yarn passes through each (centripetal Catmull-Rom, [`crate::yarn::curve`]).
    pub positions: Vec<Vec3>,
    /// Strands, in yarn order.
    pub strands: Vec<Strand>,
    /// Looks, one a guide bar.
    pub looks: Vec<YarnLook>,
}
