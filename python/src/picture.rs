//! Pictures of yarns, as keywords of Python ask for them.
//!
//! In: the keywords of `Yarns.render`. Out: a run's [`PictureSettings`]; and a scene of yarns, drawn by
//! them on what the yarns were laid on. Defaults are those of the command, but for the size and for
//! stitches, which are those of the arrays.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::DVec3;
use image::RgbaImage;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use warpknit::fabric::Fabric;
use warpknit::garment::Garment;
use warpknit::knit::Pattern;
use warpknit::pipeline::{self, Body, PictureSettings, RunError, Settings, Staged};
use warpknit::render::environment::Environment;
use warpknit::render::light::toward_sun;
use warpknit::render::scene::Scene;
use warpknit::render::{self, Background, Camera, RenderOptions, RendererChoice};

use crate::error;
use crate::names;
use crate::yarns::whole;

/// The largest picture each way, pixels.
const MOST_PIXELS: u32 = 16_384;
/// The most samples of a pixel.
const MOST_SAMPLES: u32 = 4096;

/// The keywords of `Yarns.render`.
pub(crate) struct Keywords<'a> {
    pub(crate) size: (i64, i64),
    pub(crate) view: &'a str,
    pub(crate) zoom: f64,
    pub(crate) background: Option<&'a str>,
    pub(crate) spp: i64,
    pub(crate) shape: &'a str,
    pub(crate) studio: Option<bool>,
    pub(crate) body: Option<PathBuf>,
    pub(crate) body_cloth: bool,
    pub(crate) sun: Option<[f64; 2]>,
    pub(crate) environment: Option<PathBuf>,
    pub(crate) environment_turn: f64,
}

impl Keywords<'_> {
    /// What they ask for, or an error in words of Python.
    pub(crate) fn settings(self, py: Python<'_>) -> PyResult<PictureSettings> {
        let zoom = self.zoom;
        if !(zoom.is_finite() && zoom > 0.0) {
            return Err(PyValueError::new_err(format!("zoom is {zoom}, but must be above 0")));
        }
        let background = self.background.map(str::parse::<Background>).transpose();
        Ok(PictureSettings {
            size: size(self.size)?,
            view: names::view(self.view)?,
            zoom,
            background: background.map_err(|error| PyValueError::new_err(error.to_string()))?,
            spp: whole("spp", self.spp, &(1..=MOST_SAMPLES))?,
            shape: names::shape(self.shape)?,
            studio: self.studio,
            sun: self.sun()?,
            environment: self.environment(py)?,
            body: self.body()?,
            ..PictureSettings::default()
        })
    }

    /// The direction to the sun.
    fn sun(&self) -> PyResult<Option<DVec3>> {
        let Some(angles) = self.sun else { return Ok(None) };
        if self.environment.is_some() {
            return Err(PyValueError::new_err("give either sun or environment, which has its own"));
        }
        let direction = toward_sun(angles).ok_or_else(|| {
            PyValueError::new_err(format!(
                "sun is {angles:?}, but must be degrees to the right, up to 360, and up, up to 90"
            ))
        })?;
        Ok(Some(direction))
    }

    /// The environment of a file.
    fn environment(&self, py: Python<'_>) -> PyResult<Option<Arc<Environment>>> {
        let turn = self.environment_turn;
        let Some(path) = &self.environment else {
            let text = "environment_turn needs an environment to turn";
            return if turn == 0.0 { Ok(None) } else { Err(PyValueError::new_err(text)) };
        };
        if !turn.is_finite() {
            let text = format!("environment_turn is {turn}, but must be an angle in degrees");
            return Err(PyValueError::new_err(text));
        }
        let read = py.detach(|| pipeline::read_environment(path, turn.to_radians()));
        let read = read.map_err(|error| PyValueError::new_err(error::line(&error)))?;
        Ok(Some(Arc::new(read)))
    }

    /// The body in the cloth.
    fn body(self) -> PyResult<Body> {
        match (self.body, self.body_cloth) {
            (Some(_), true) => Err(PyValueError::new_err("give either body or body_cloth")),
            (Some(file), false) => Ok(Body::Files(vec![file])),
            (None, true) => Ok(Body::Lining),
            (None, false) => Ok(Body::None),
        }
    }
}

/// Width and height of a picture that has pixels, and that memory holds.
pub(crate) fn size((width, height): (i64, i64)) -> PyResult<(u32, u32)> {
    let pixels = 1..=MOST_PIXELS;
    Ok((whole("the width in size", width, &pixels)?, whole("the height in size", height, &pixels)?))
}

/// Draws yarns of a fabric that lie on a garment or are a swatch. The camera frames the garment, or the
/// swatch's yarns. `stop` ends it.
pub(crate) fn draw(
    scene: &Scene,
    picture: PictureSettings,
    (garment, fabric): (&Garment, &Fabric),
    is_swatch: bool,
    stop: Arc<AtomicBool>,
) -> Result<RgbaImage, RunError> {
    let pattern = Pattern::new(fabric);
    let around = &pipeline::draped_points(garment);
    let staged = Staged { garment, fabric, pattern: &pattern, around, has_studio: !is_swatch };
    let set = pipeline::set(&picture, &staged, 0)?;
    let (view, zoom) = (picture.view, picture.zoom);
    let picture = PictureSettings { renderer: RendererChoice::Cpu, ..picture };
    let settings = Settings { picture, ..Settings::default() };
    let options = RenderOptions { set, stop: Some(stop), ..pipeline::options(&settings) };
    let framed = if is_swatch { &scene.positions } else { around };
    let camera = Camera::view(view, framed, Camera::DEFAULT_FOV, zoom, options.aspect());
    Ok(render::render(scene, &camera, &options, &|_| ())?)
}
