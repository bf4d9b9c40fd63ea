//! The result of every garment's recipe, which `main` checks and writes.

use glam::DVec3;

use crate::{body::Body, cloth::Cloth, pattern::Garment};

/// A garment at rest.
pub(crate) struct Made {
    pub(crate) name: &'static str,
    pub(crate) garment: Garment,
    /// A position for each flat vertex. Sewn vertices have the same position.
    pub(crate) draped: Vec<DVec3>,
    /// Root mean square of the speeds at the end, cm/s.
    pub(crate) speed: f64,
    /// Whether it is written as one file with the pattern in `vt`, or as a pair of files.
    pub(crate) one_file: bool,
    /// The body at the end.
    pub(crate) body: Body,
}

/// The position of each vertex's particle.
pub(crate) fn spread(cloth: &Cloth, particle_of: &[u32]) -> Vec<DVec3> {
    particle_of.iter().map(|&particle| cloth.position[particle as usize]).collect()
}
