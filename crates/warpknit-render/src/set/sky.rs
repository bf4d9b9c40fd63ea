//! How much of the sky places of a set see.
//!
//! In: a place and its normal. Out: the fraction of the sky's light that reaches it, past the body and
//! through the cloth. The directions are Malley's: a uniform point of the disc, projected up to the
//! hemisphere. The points lie on Vogel's spiral (1979, 'A better way to construct the sunflower head').
//! They are the same at all places, so that neighbours differ by what they see and not by chance.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use warpknit_core::ids::index32;

use super::{Mesh, Set};

/// Rays from a vertex of the body at least and at most, and the number from all vertices that decides
/// between the two. Neighbouring vertices of a fine mesh make up for few rays.
const RAYS: [u32; 2] = [2, 192];
const MOST_RAYS: u32 = 4_000_000;
/// Turns from one point of the spiral to the next: the golden angle.
const GOLDEN_TURN: f32 = 0.381_966;

impl Set {
    /// The fraction of the sky's light that reaches a place, by so many rays.
    pub(crate) fn open_sky(&self, place: Vec3, normal: Vec3, rays: u32) -> f32 {
        let (across, up) = normal.any_orthonormal_pair();
        let passed = (0..rays).map(|ray| {
            let inside = (ray as f32 + 0.5) / rays as f32;
            let at = Vec2::from_angle(TAU * GOLDEN_TURN * ray as f32) * inside.sqrt();
            self.passes(place, across * at.x + up * at.y + normal * (1.0 - inside).sqrt())
        });
        passed.sum::<f32>() / rays as f32
    }

    /// The same for each vertex of a body.
    pub(super) fn sky_at_vertices(&self, body: &Mesh) -> Vec<f32> {
        let (positions, normals) = body.vertices();
        let rays = (MOST_RAYS / index32(positions.len()).max(1)).clamp(RAYS[0], RAYS[1]);
        let vertices = positions.par_iter().zip(normals);
        vertices.map(|(place, normal)| self.open_sky(*place, *normal, rays)).collect()
    }
}
