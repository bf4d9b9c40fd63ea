//! Timing of pictures: their size, their number, and the renderer.
//!
//! In: a scene. Out: the time of drawing it once or several times.

use anyhow::Result;
use warpknit::render::scene::Scene;
use warpknit::render::{Camera, Painter, RenderOptions, RendererChoice, View};

use super::super::args::Bench;
use super::measure::{Moment, Sample};

/// The most runs of each picture. It takes a thousand times as long as a row of coordinates, and
/// its times spread less.
const MOST_RUNS: u32 = 3;

/// Draws and times scenes with fixed options.
#[derive(Debug)]
pub(super) struct PictureTimer {
    options: RenderOptions,
    /// Runs of each picture, after one that warms up.
    pub(super) runs: u32,
}

impl PictureTimer {
    pub(super) fn new(arguments: &Bench) -> Self {
        let (width, height) = arguments.size;
        let options = RenderOptions {
            width,
            height,
            renderer: arguments.renderer.into(),
            ..RenderOptions::default()
        };
        Self { options, runs: arguments.runs.min(MOST_RUNS) }
    }

    /// The same with tubes of St by Sr segments everywhere, for renderers that draw triangles.
    pub(super) fn with_tubes(&self, st: u32, sr: u32) -> Self {
        Self {
            options: RenderOptions { st, sr, lod: false, ..self.options.clone() },
            runs: self.runs,
        }
    }

    /// A note on how pictures are drawn.
    pub(super) fn note(&self) -> String {
        let by = match self.options.renderer {
            RendererChoice::Cpu => "drawn on the processor",
            RendererChoice::Gpu => "drawn on the graphics adapter, which is found anew each time",
            RendererChoice::Auto => {
                "drawn on the graphics adapter, found anew each time, or on the processor where there is none"
            }
        };
        let RenderOptions { width, height, spp, .. } = self.options;
        format!("{width} x {height} pixels, {spp} samples each, {by}; runs of each: {}", self.runs)
    }

    /// Whether the processor draws, so that its time is that of the work.
    pub(super) fn is_on_cpu(&self) -> bool {
        self.options.renderer == RendererChoice::Cpu
    }

    /// Whether St and Sr make a difference. The CPU renderer traces curves, not tubes.
    pub(super) fn heeds_tubes(&self) -> bool {
        !self.is_on_cpu()
    }

    /// Draws once to warm up, and then once for each run.
    pub(super) fn timed(&self, scene: &Scene) -> Result<Vec<Sample>> {
        self.draw(scene)?;
        (0..self.runs).map(|_| self.draw(scene)).collect()
    }

    /// Draws once. The time includes setting up the renderer.
    pub(super) fn draw(&self, scene: &Scene) -> Result<Sample> {
        let start = Moment::now();
        let camera = Camera::view(
            View::Front,
            &scene.positions,
            Camera::DEFAULT_FOV,
            1.0,
            self.options.aspect(),
        );
        // A new painter each time: setting up the renderer is part of a picture's cost.
        let picture = Painter::new(scene, &self.options)?.draw(&camera, &self.options, &|_| ())?;
        std::hint::black_box(picture);
        Ok(start.elapsed())
    }
}
