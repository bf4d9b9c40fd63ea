//! The pictures that are timed: their size, their number, and what draws them.

use anyhow::Result;
use warpknit::render::{Camera, Painter, RenderOptions, RendererChoice, View};
use warpknit::scene::Scene;

use super::super::args::Bench;
use super::measure::{Moment, Sample};

/// Pixels each way: small, so that three pictures of every row take minutes and not an hour.
pub(super) const SIZE: (u32, u32) = (640, 480);
/// The most runs of each: a picture takes a thousand times as long as a row of coordinates, and
/// spreads less.
const MOST_RUNS: u32 = 3;

/// Draws scenes in one way.
#[derive(Debug)]
pub(super) struct Easel {
    options: RenderOptions,
    /// Runs of each picture, after one that warms up.
    pub(super) runs: u32,
}

impl Easel {
    pub(super) fn new(arguments: &Bench) -> Self {
        let options = RenderOptions {
            width: SIZE.0,
            height: SIZE.1,
            renderer: arguments.renderer.into(),
            ..RenderOptions::default()
        };
        Self { options, runs: arguments.runs.min(MOST_RUNS) }
    }

    /// The same with tubes of St by Sr everywhere, where tubes are drawn as triangles.
    pub(super) fn with_tubes(&self, st: u32, sr: u32) -> Self {
        Self {
            options: RenderOptions { st, sr, lod: false, ..self.options.clone() },
            runs: self.runs,
        }
    }

    /// How pictures are made, in words.
    pub(super) fn note(&self) -> String {
        let by = match self.options.renderer {
            RendererChoice::Cpu => "drawn on the processor",
            RendererChoice::Gpu => "drawn on the graphics adapter, which is found anew each time",
            RendererChoice::Auto => {
                "drawn on the graphics adapter, found anew each time, or on the processor where there is none"
            }
        };
        format!("{by}; runs of each: {}", self.runs)
    }

    /// Whether St and Sr make a difference.
    pub(super) fn heeds_tubes(&self) -> bool {
        self.options.renderer != RendererChoice::Cpu
    }

    /// Draws once to warm up, and then as often as runs are wanted.
    pub(super) fn timed(&self, scene: &Scene) -> Result<Vec<Sample>> {
        self.draw(scene)?;
        (0..self.runs).map(|_| self.draw(scene)).collect()
    }

    /// Draws once, and says how long that took.
    pub(super) fn draw(&self, scene: &Scene) -> Result<Sample> {
        let start = Moment::now();
        let camera = Camera::view(
            View::Front,
            &scene.positions,
            Camera::DEFAULT_FOV,
            1.0,
            self.options.aspect(),
        );
        let picture = Painter::new(scene, &self.options)?.draw(&camera, &self.options, &|_| ())?;
        std::hint::black_box(picture);
        Ok(start.elapsed())
    }
}
