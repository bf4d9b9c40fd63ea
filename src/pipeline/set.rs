//! The set of a run's pictures: the studio, the environment, the body, and the cloth as a surface.
//!
//! In: [`PictureSettings`], and the cloth as it is draped. Out: a [`Set`], or `None` where nobody
//! wants one.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::RunError;
use super::job::Job;
use super::settings::{Body, PictureSettings};
use crate::fabric::Fabric;
use crate::garment::Garment;
use crate::garment::solid::Solid;
use crate::knit::{Pattern, numbers};
use crate::render::scene::Bounds;
use crate::render::set::{Mesh, Set};
use crate::render::{GpuError, RendererChoice};

/// Distance of a lining behind the technical face's middle, in wales. A smaller one comes through the
/// loops of thick cloth. A larger one shows the lining beside the cloth at its outline.
const LINING_WALES: f64 = 1.5;

impl PictureSettings {
    /// Whether a body stands in the cloth.
    pub(super) fn has_body(&self) -> bool {
        self.body != Body::None
    }
}

/// Refuses bodies that can't be drawn, before any work: `frames` is the number of drapes.
pub(super) fn check(job: &Job<'_>, frames: usize) -> Result<(), RunError> {
    let picture = &job.settings.picture;
    if picture.renderer == RendererChoice::Gpu && picture.has_body() {
        return Err(GpuError::Body.into());
    }
    let Body::Files(bodies) = &picture.body else { return Ok(()) };
    if bodies.len() > 1 && bodies.len() != frames {
        return Err(RunError::Bodies { bodies: bodies.len(), frames });
    }
    // That of a single drape is read before the work anyway.
    let read = |body| Ok(Solid::read(body, job.cloth.garment()).map(drop)?);
    if frames == 1 { Ok(()) } else { bodies.iter().map(PathBuf::as_path).try_for_each(read) }
}

/// Cloth that a set stands around.
#[derive(Clone, Copy, Debug)]
pub struct Staged<'a> {
    /// As it is draped.
    pub garment: &'a Garment,
    /// As it is drawn.
    pub fabric: &'a Fabric,
    /// The fabric's repeat.
    pub pattern: &'a Pattern,
    /// Points around the cloth in all frames.
    pub around: &'a [Vec3],
    /// Whether it stands in a studio where nobody says.
    pub has_studio: bool,
}

/// The set around a job's garment, in frame number `frame` of a sequence. `around` are points around
/// the cloth in all frames.
pub(super) fn of(
    job: &Job<'_>,
    garment: &Garment,
    frame: usize,
    around: &[Vec3],
) -> Result<Option<Arc<Set>>, RunError> {
    let (fabric, pattern) = (job.shown, job.cloth.pattern());
    let staged = Staged { garment, fabric, pattern, around, has_studio: !job.is_swatch };
    set(&job.settings.picture, &staged, frame)
}

/// The set that a picture's settings ask for, in frame number `frame` of a sequence. `None` where
/// they ask for none.
///
/// # Errors
/// [`RunError::Garment`]: a body that can't be read.
pub fn set(
    picture: &PictureSettings,
    cloth: &Staged<'_>,
    frame: usize,
) -> Result<Option<Arc<Set>>, RunError> {
    // A chosen background would not be seen in a studio, nor an environment.
    let by_itself =
        cloth.has_studio && picture.background.is_none() && picture.environment.is_none();
    let has_studio = picture.studio.unwrap_or(by_itself);
    let environment = picture.environment.clone().filter(|_| picture.background.is_none());
    if !has_studio && !picture.has_body() {
        return Ok(environment.map(|seen| Arc::new(Set::default().with_environment(seen))));
    }
    let body = body(picture, cloth, frame)?.and_then(|body| mesh(&body));
    let standing = Bounds::around(cloth.around).into_iter().chain(body.as_ref().map(Mesh::bounds));
    let studio = if has_studio { standing.reduce(Bounds::union) } else { None };
    let cover = numbers::measure(cloth.fabric, cloth.pattern).cover;
    #[expect(clippy::cast_possible_truncation, reason = "a share needs no more")]
    let surface = mesh(&Solid::lining(cloth.garment, 0.0)).map(|surface| (surface, cover as f32));
    let set = Set::new(studio, body, surface);
    Ok(Some(Arc::new(match environment {
        Some(seen) => set.with_environment(seen),
        None => set,
    })))
}

/// The body in the cloth, if there is one.
fn body(
    picture: &PictureSettings,
    cloth: &Staged<'_>,
    frame: usize,
) -> Result<Option<Solid>, RunError> {
    Ok(match &picture.body {
        Body::None => None,
        Body::Lining => {
            Some(Solid::lining(cloth.garment, LINING_WALES * cloth.fabric.wale_spacing()))
        }
        // One body stands still, and several move with the frames.
        Body::Files(files) => match files.get(frame).or(files.last()) {
            Some(file) => Some(Solid::read(file, cloth.garment)?),
            None => None,
        },
    })
}

/// A solid as renderers take it. `None` where it has no area.
fn mesh(solid: &Solid) -> Option<Mesh> {
    let narrow = |places: &[DVec3]| places.iter().map(|place| place.as_vec3()).collect();
    Mesh::new(narrow(&solid.positions), narrow(&solid.normals), &solid.triangles)
}
