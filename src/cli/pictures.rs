//! The pictures of a run: from the scene to `.png`, one or all around.

use std::path::Path;

use anyhow::{Context, Result};
use glam::{DVec3, Vec3};
use warpknit::export::{Output, png};
use warpknit::fabric::Fabric;
use warpknit::fabric::yarn::Yarn;
use warpknit::photo::yarn::read_maps;
use warpknit::render::maps::Maps;
use warpknit::render::scene::{Bounds, Scene, Shape};
use warpknit::render::{self, Camera, Choice, Painter};
use warpknit::render::{cloth, fibres as near};
use warpknit::tile::Tile;

use super::args::Shared;
use super::clock::{Clock, Task};
use super::job::Fibres;

/// Widths of pictures that fit a yarn, in thicknesses of the yarn: from hardly any fuzz to loops
/// that stand far off.
const FITTING_WIDTHS: (f64, f64) = (0.8, 4.0);
/// Points on each rim of the drum around a scene, which a camera on a turntable must see whole.
const RIM: u32 = 64;

/// What drew, and where the pictures wait for their names.
pub(super) struct Pictures {
    pub(super) drawn_by: String,
    /// Why it was not what was asked for.
    pub(super) notice: Option<String>,
    pub(super) files: Vec<Output>,
}

/// The pictures of a fabric's yarns, as large as the yarns really are.
#[derive(Debug, Default)]
pub(super) struct Textures {
    maps: Vec<Maps>,
    /// Each bar's place in `maps`, the last one for all bars after it too.
    of_bars: Vec<Option<u16>>,
}

impl Textures {
    /// Those that the arguments ask for, for all bars; else those that the fabric names.
    ///
    /// Where nothing says how wide a picture is, it fits the yarn that wears it, the thickest if
    /// all do.
    pub(super) fn of(shared: &Shared, fabric: &Fabric) -> Result<Self> {
        let thickest = 2.0 * fabric.radius() / fabric.enlargement;
        match &shared.drawing.texture {
            Some(path) => Ok(Self::for_all(read_maps(path, thickest, None)?)),
            None => Self::named_by(fabric, thickest),
        }
    }

    /// One yarn's pictures for all bars.
    pub(super) fn for_all(maps: Maps) -> Self {
        Self { maps: vec![maps], of_bars: vec![Some(0)] }
    }

    /// Those that a fabric whose yarns are `thickest` mm thick at the most names, each read once.
    fn named_by(fabric: &Fabric, thickest: f64) -> Result<Self> {
        let mut textures = Self::default();
        let mut worn: Vec<&Yarn> = Vec::new();
        for ((own, thickness), number) in fabric.yarns().zip(fabric.thickness()).zip(1..) {
            let Some(path) = &own.texture else {
                textures.of_bars.push(None);
                continue;
            };
            let place = worn.iter().position(|yarn| *yarn == own).unwrap_or(worn.len());
            if place == worn.len() {
                let maps = read_maps(path, thickest * thickness, own.texture_length);
                textures.maps.push(maps.with_context(|| format!("the yarn of bar {number}"))?);
                worn.push(own);
            }
            textures.of_bars.push(u16::try_from(place).ok());
        }
        Ok(textures)
    }

    /// What is odd about ribbons as wide as the pictures say in place of a fabric's yarns, for the
    /// first such bar.
    pub(super) fn misfit(&self, fabric: &Fabric) -> Option<String> {
        fabric.thickness().into_iter().enumerate().find_map(|(bar, thickness)| {
            let shown = f64::from(self.maps[usize::from(self.of_bar(bar)?)].width);
            let thick = 2.0 * thickness * fabric.radius() / fabric.enlargement;
            let (least, most) = FITTING_WIDTHS;
            let message = || {
                format!(
                    "bar {}: its pictures are of a yarn {shown:.2} mm wide with its fuzz, but its yarns are {thick:.2} mm thick; ribbons are as wide as the \
                     pictures: width_mm in their yarn.toml says how wide",
                    bar + 1
                )
            };
            (!(least * thick..=most * thick).contains(&shown)).then(message)
        })
    }

    /// How many different yarns have pictures.
    pub(super) fn count(&self) -> usize {
        self.maps.len()
    }

    fn of_bar(&self, bar: usize) -> Option<u16> {
        self.of_bars.get(bar).or(self.of_bars.last()).copied().flatten()
    }
}

/// The scene that a fabric's yarns go into, the thickest of that radius, with their pictures: those
/// are as much enlarged as the cloth.
pub(super) fn scene(shape: Shape, fabric: &Fabric, radius: f64, textures: &Textures) -> Scene {
    let looks = cloth::looks(fabric, radius);
    #[expect(clippy::cast_possible_truncation, reason = "a length in mm needs no more")]
    let enlargement = fabric.enlargement as f32;
    let enlarged = |maps: &Maps| Maps {
        length: enlargement * maps.length,
        width: enlargement * maps.width,
        ..maps.clone()
    };
    Scene::wearing(shape, looks, textures.maps.iter().map(enlarged).collect(), |bar| {
        textures.of_bar(bar)
    })
}

/// Draws the scene, or a tile of the picture, and writes it to `paths`: each place's frames in a
/// row. The camera sees all of `seen`, or all of the scene, with its fibres where they show.
pub(super) fn draw(
    scene: &Scene,
    fibres: Option<&Fibres>,
    shared: &Shared,
    tile: Option<Tile>,
    seen: Option<&[Vec3]>,
    paths: &[&Path],
    clock: &mut Clock,
) -> Result<Pictures> {
    clock.begin(Task::Render, 0.0);
    let mut options = options(shared);
    if let Some(tile) = tile {
        options.rows = Some(tile.share(options.height));
        // What one machine draws and another one draws must fit together, whichever has an adapter.
        if options.renderer == Choice::Auto {
            options.renderer = Choice::Cpu;
        }
    }
    let count = shared.drawing.turntable.unwrap_or(1);
    let (mut far, mut drawn_by, mut notice) = (None, String::new(), None);
    let mut files = Vec::new();
    for frame in 0..count {
        clock.begin(Task::Render, f64::from(frame) / f64::from(count));
        let shown = clock.progress();
        let progress = |done: f32| shown((frame as f32 + done) / count as f32);
        let camera = camera(scene, seen, shared, options.aspect(), frame);
        let size = [options.width, options.height];
        let spun = fibres
            .and_then(|fibres| near::scene(scene, &fibres.bundles, fibres.near, &camera, size));
        let mut drawn = |painter: &mut Painter<'_>| {
            let picture = painter.draw(&camera, &options, &progress)?;
            painter.name().clone_into(&mut drawn_by);
            notice = painter.notice().map(str::to_owned).or(notice.take());
            anyhow::Ok(picture)
        };
        // Yarns are made ready once; fibres are those that this camera sees.
        let picture = match (&spun, &mut far) {
            (Some(spun), _) => drawn(&mut Painter::new(spun, &options)?)?,
            (None, Some(far)) => drawn(far)?,
            (None, None) => drawn(far.insert(Painter::new(scene, &options)?))?,
        };
        clock.begin(Task::Compress, 1.0);
        for path in paths.iter().skip(frame as usize).step_by(count as usize) {
            files.push(png::write(path, &picture)?);
        }
    }
    Ok(Pictures { drawn_by, notice, files })
}

/// How the arguments want pictures to be.
pub(super) fn options(shared: &Shared) -> render::Options {
    let drawing = &shared.drawing;
    let defaults = render::Options::default();
    let mut options = render::Options {
        width: shared.size.0,
        height: shared.size.1,
        renderer: drawing.renderer.into(),
        spp: drawing.spp,
        samples: drawing.samples,
        st: shared.st.unwrap_or(defaults.st),
        sr: shared.sr.unwrap_or(defaults.sr),
        lod: drawing.lod.is_on(),
        ..defaults
    };
    if let Some(background) = shared.background {
        options.background = background;
    }
    options
}

/// The camera of a frame.
fn camera(
    scene: &Scene,
    seen: Option<&[Vec3]>,
    shared: &Shared,
    aspect: f64,
    frame: u32,
) -> Camera {
    let fov = shared.fov.to_radians();
    let Some(count) = shared.drawing.turntable else {
        return still(shared, seen.unwrap_or(&scene.positions), fov, aspect);
    };
    let Some(bounds) = scene.bounds() else { return still(shared, &[], fov, aspect) };
    let angle = std::f64::consts::TAU * f64::from(frame) / f64::from(count);
    still(shared, &drum(&scene.positions, &bounds), fov, aspect)
        .turned_about(bounds.centre().as_dvec3(), angle)
}

/// A camera that stands where the arguments say, or where it sees all of `points`.
fn still(shared: &Shared, points: &[Vec3], fov: f64, aspect: f64) -> Camera {
    match (shared.eye, shared.look_at) {
        (Some(eye), Some(target)) => Camera::look_at(eye, target, fov, shared.zoom),
        _ => Camera::view(shared.view.into(), points, fov, shared.zoom, aspect),
    }
}

/// The rims of the upright drum around all points: what a turning scene sweeps.
fn drum(points: &[Vec3], bounds: &Bounds) -> Vec<Vec3> {
    let centre = bounds.centre();
    let farthest = points
        .iter()
        .map(|point| (*point - centre).with_y(0.0).length_squared())
        .filter(|length| length.is_finite());
    let radius = f64::from(farthest.fold(0.0, f32::max).sqrt());
    let rim = |height: f32| {
        (0..RIM).map(move |step| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(step) / f64::from(RIM)).sin_cos();
            let around = DVec3::new(cos, 0.0, sin) * radius;
            centre.with_y(height) + around.as_vec3()
        })
    };
    rim(bounds.min.y).chain(rim(bounds.max.y)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_drum_holds_all_that_turns() {
        let points = [Vec3::new(3.0, -1.0, 0.0), Vec3::new(-1.0, 5.0, 2.0)];
        let bounds = Bounds { min: Vec3::new(-1.0, -1.0, 0.0), max: Vec3::new(3.0, 5.0, 2.0) };
        let drum = drum(&points, &bounds);
        let centre = bounds.centre();
        for point in points {
            let reach = (point - centre).with_y(0.0).length();
            assert!(drum.iter().all(|rim| (*rim - centre).with_y(0.0).length() > reach - 1e-4));
        }
    }
}
