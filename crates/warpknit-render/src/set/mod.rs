//! The set of a picture: what stands around the cloth.
//!
//! In: surfaces in the draped axes, mm. Out: a [`Set`], which renderers place behind and under the
//! yarns. A body hides yarns and casts shadows on them. The cloth's own surface dims the light that
//! falls on the body and on the floor: its yarns need not be there for that. The studio's floor
//! turns up into a wall without an edge (`cove`), and stands square to the camera. Without a
//! studio, an environment is seen behind everything.
//!
//! Not promised: that bodies reflect light onto the cloth.

mod cove;
mod mesh;
mod sky;

use std::sync::Arc;

use glam::Vec3;

use crate::environment::Environment;
use crate::scene::Bounds;
pub(crate) use cove::Cove;
pub use mesh::Mesh;
#[cfg(test)]
pub(crate) use mesh::tests::soup;
pub(crate) use mesh::{MeshHit, MeshSurface};

/// What stands around the cloth.
#[derive(Debug, Default)]
pub struct Set {
    /// The box around what stands in a studio, on its floor and before its wall. `None` for no
    /// studio.
    pub(crate) studio: Option<Bounds>,
    /// An opaque body.
    pub(crate) body: Option<Mesh>,
    /// The fraction of the sky that each of its vertices sees.
    pub(crate) sky: Vec<f32>,
    /// The cloth as a surface, and the share of it that its yarns hide, seen face on.
    cloth: Option<(Mesh, f32)>,
    /// What is seen where there is nothing else.
    pub(crate) environment: Option<Arc<Environment>>,
}

/// Steepness below which a ray counts as no flatter along a cloth. There is a limit to how much
/// cloth hides when seen along it.
const FLATTEST: f32 = 0.1;
/// Length of rays by which light leaves a surface before it may be blocked, mm. A shorter one lets
/// a surface block its own light. A longer one loses the shadow where cloth lies on a body.
pub(crate) const LEAVE: f32 = 0.2;
/// Depth in a body up to which yarns are drawn on it, and lit, mm. Cloth lies in the skin of many
/// bodies by a millimetre or two. A larger depth would show the far side of thin limbs.
pub(crate) const SKIN: f32 = 3.0;

impl Set {
    /// A studio for what stands in a box, a body, and the cloth as a surface with the share of it
    /// that its yarns hide. Four million rays or fewer find how much of the sky the body sees.
    #[must_use]
    pub fn new(studio: Option<Bounds>, body: Option<Mesh>, cloth: Option<(Mesh, f32)>) -> Self {
        let mut set = Self { studio, body, sky: Vec::new(), cloth, environment: None };
        set.sky = set.body.as_ref().map_or_else(Vec::new, |body| set.sky_at_vertices(body));
        set
    }

    /// The same with this behind everything. Its light is that of the picture's options.
    #[must_use]
    pub fn with_environment(self, environment: Arc<Environment>) -> Self {
        Self { environment: Some(environment), ..self }
    }

    /// Whether there is nothing in it.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.studio.is_none() && self.body.is_none() && self.environment.is_none()
    }

    /// Fraction of the light that reaches a point of the set from a direction.
    pub(crate) fn passes(&self, from: Vec3, toward: Vec3) -> f32 {
        let body = self.body.as_ref();
        if body.is_some_and(|body| body.blocks(from, toward, [LEAVE, f32::INFINITY])) {
            return 0.0;
        }
        let Some((cloth, cover)) = &self.cloth else { return 1.0 };
        cloth.passes(from, toward, LEAVE, |_, cosine| passed(*cover, cosine))
    }
}

/// Fraction of the light that passes cloth whose yarns hide this share of it, seen face on. Light
/// crosses cloth obliquely along a longer way between its yarns.
pub(crate) fn passed(cover: f32, cosine: f32) -> f32 {
    (1.0 - cover).powf(cosine.max(FLATTEST).recip())
}
