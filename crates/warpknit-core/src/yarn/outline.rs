//! The outline of a tube's section.
//!
//! In: a [`Section`], and a ratio of width to height. Out: [`SectionOutline`], the vertices of a ring
//! with their normals, in the ring's own axes. Cost: a root for each vertex of another ratio.

use std::f64::consts::TAU;

use glam::{DVec2, Vec2};

use super::tube::Section;
use crate::number::narrow;

/// The data that rings of one ratio share. With it a ring needs no trigonometry.
pub(super) struct SectionOutline {
    /// Ratio of width to height for which the vertices were made last.
    pub(super) ratio: f32,
    /// Unit vectors to the vertices of a circle. The first is repeated at the seam.
    directions: Vec<DVec2>,
    /// Vertices of the section: mm along the ring's normal, and mm along its binormal.
    pub(super) vertices: Vec<Vec2>,
    /// Their unit normals: normalised gradients of the ellipse.
    pub(super) normals: Vec<Vec2>,
    /// The texture coordinate u of each vertex.
    pub(super) u: Vec<f32>,
    /// Two triangles for each edge. Indices count from the first vertex of the previous ring.
    pub(super) triangles: Vec<[u32; 3]>,
}

impl SectionOutline {
    pub(super) fn new(section: &Section) -> Self {
        let (mut directions, mut us) = (Vec::new(), Vec::new());
        for s in 0..=section.sr {
            // The seam vertex equals the first one to the last bit, so that tubes are watertight.
            let angle = TAU * f64::from(s % section.sr) / f64::from(section.sr);
            directions.push(DVec2::from_angle(angle));
            us.push(narrow(f64::from(s) / f64::from(section.sr)));
        }
        let mut triangles = Vec::new();
        for s in 0..section.sr {
            // a and b lie on the previous ring, c and d on the next one:
            //   c --- d
            //   |  \  |
            //   a --- b
            let (a, b, c, d) = (s, s + 1, s + section.sr + 1, s + section.sr + 2);
            triangles.extend([[a, b, c], [b, d, c]]);
        }
        let (vertices, normals) = (Vec::new(), Vec::new());
        let mut outline = Self { ratio: 0.0, directions, vertices, normals, u: us, triangles };
        outline.flatten(section.radius, section.flatten);
        outline
    }

    /// Makes the vertices for another ratio of width to height.
    pub(super) fn flatten(&mut self, radius: f64, ratio: f64) {
        // The area of the ellipse is that of the circle: width times the root, height over it.
        let root = ratio.sqrt();
        let (half_width, half_height) = (radius * root, radius / root);
        self.ratio = narrow(ratio);
        self.vertices.clear();
        self.normals.clear();
        for &direction in &self.directions {
            self.vertices.push((direction * DVec2::new(half_height, half_width)).as_vec2());
            // The gradient of (x/h)² + (y/w)² at (h cos, w sin) is parallel to (w cos, h sin).
            let normal = direction * DVec2::new(half_width, half_height);
            self.normals.push(normal.normalize().as_vec2());
        }
    }
}
