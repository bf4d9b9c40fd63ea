//! The frames of a drape sequence: how they are read, and what a camera of all of them has to see.
//!
//! In: paths, and a job on the first usable frame. Out: points around the cloth in all frames.
//!
//! Cost: each frame is read once more.

use std::path::PathBuf;

use glam::{DVec3, Vec3};

use super::RunError;
use super::clock::{Clock, Task};
use super::job::Job;
use crate::garment::{Frames, Garment};

/// The frames of a run. The cloth of its job lies on the first usable frame.
pub struct Sequence<'a> {
    /// The first usable frame, and how the others are read.
    pub motion: &'a Motion,
    /// All frames, including those before the first usable one.
    pub paths: &'a [PathBuf],
    /// Whether frames that can't be read are left out.
    pub skip_bad: bool,
    /// Frames per second in a `.usda` or `.usdc`.
    pub frames_per_second: f64,
}

/// A sequence whose first usable frame has been read.
#[derive(Debug)]
pub struct Motion {
    /// Reads the other frames.
    pub reader: Frames,
    /// Index of the first usable frame.
    pub first: usize,
    /// The errors of the frames before it.
    pub bad: Vec<String>,
}

impl Sequence<'_> {
    /// Points around all frames, for one camera that sees each of them. They are the outermost
    /// points of each frame in 26 directions, moved outward by one wale spacing for the thickness
    /// of the cloth.
    ///
    /// Without them the camera would move with each frame, and a film would shake.
    pub(super) fn extent(
        &self,
        job: &Job<'_>,
        clock: &mut Clock<'_>,
    ) -> Result<Vec<Vec3>, RunError> {
        clock.begin(Task::Render, 0.0);
        let (mut garment, reach) = (job.unfinished_garment(), job.shown.wale_spacing());
        let mut extent = outermost(&garment, reach);
        for path in &self.paths[self.motion.first + 1..] {
            match self.motion.reader.pose(&mut garment, path) {
                Ok(_odd) => extent.extend(outermost(&garment, reach)),
                // The warning follows when this frame is drawn.
                Err(_bad) if self.skip_bad => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(extent)
    }
}

/// The outermost points of a draped garment in 26 directions, each moved outward by `reach`.
fn outermost(garment: &Garment, reach: f64) -> Vec<Vec3> {
    let points: Vec<DVec3> =
        garment.panels.iter().flat_map(|panel| panel.draped.iter().copied()).collect();
    // The directions from the centre of a cube to its 6 faces, 12 edges and 8 corners, as in a
    // k-DOP. The 27th, zero, only adds a point of the garment itself.
    let steps = [-1.0, 0.0, 1.0];
    let mut outermost = Vec::new();
    for x in steps {
        for y in steps {
            for z in steps {
                let toward = DVec3::new(x, y, z);
                let farthest = points.iter().max_by(|a, b| a.dot(toward).total_cmp(&b.dot(toward)));
                outermost.extend(
                    farthest.map(|point| (*point + reach * toward.normalize_or_zero()).as_vec3()),
                );
            }
        }
    }
    outermost
}
