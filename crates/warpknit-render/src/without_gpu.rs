//! What stands in for the graphics card in a build without the feature `gpu`: an adapter that is
//! never there.

use image::RgbaImage;

use crate::scene::Scene;
use crate::{Camera, GpuError, RenderOptions};

/// Never made: [`Uploaded::new`] is always an error.
#[derive(Debug)]
pub(crate) enum Uploaded {}

impl Uploaded {
    pub(crate) fn new(_scene: &Scene, _options: &RenderOptions) -> Result<Self, GpuError> {
        Err(GpuError::NotBuiltIn)
    }

    pub(crate) fn name(&self) -> &str {
        match *self {}
    }

    pub(crate) fn draw(
        &mut self,
        _scene: &Scene,
        _camera: &Camera,
        _options: &RenderOptions,
    ) -> Result<RgbaImage, GpuError> {
        match *self {}
    }
}
