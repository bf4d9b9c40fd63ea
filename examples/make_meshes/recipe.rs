//! What every garment's recipe hands back to `main`.

use glam::DVec3;

use crate::{body::Body, cloth::Cloth, pattern::Garment};

/// A garment at rest.
pub(crate) struct Made {
    pub(crate) name: &'static str,
    pub(crate) garment: Garment,
    /// One position a flat vertex; sewn vertices have the same one.
    pub(crate) draped: Vec<DVec3>,
    /// The speed left at the end, in cm/s.
    pub(crate) speed: f64,
    /// Whether it is written as one file with the pattern in `vt`, or as a pair.
    pub(crate) one_file: bool,
    /// The body as it is at the end.
    pub(crate) body: Body,
}

/// The particles' positions, one a vertex.
pub(crate) fn spread(cloth: &Cloth, particle_of: &[u32]) -> Vec<DVec3> {
    particle_of.iter().map(|&particle| cloth.position[particle as usize]).collect()
}
