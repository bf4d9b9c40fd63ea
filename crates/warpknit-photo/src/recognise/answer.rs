//! The answer as a fabric: chains or a chart, densities, yarn counts and colours.
//!
//! In: the best [`Fit`] and the photos. Out: a [`Fabric`] as a designer writes one.
//!
//! Not promised: a size, unless somebody gives the photo's scale; then wales are as dense as those of
//! the fabric that was compared. Nor the count of yarns so thick that they fill their loops.

use glam::DVec3;

use super::candidate::Candidate;
use super::fit::{Fit, seen};
use super::sketch::NONE;
use super::view::FaceView;
use crate::plane::double;
use warpknit_core::fabric::lapping::{Chain, Numbering};
use warpknit_core::fabric::yarn::{Color, Count};
use warpknit_core::fabric::{Fabric, Lay, Structure};

/// The name that recognised fabrics get.
const NAME: &str = "captured";
/// Colours of bars that differ by less than this in each of linear red, green and blue are one.
const SAME_COLOR: f64 = 0.06;
/// The share of a bar's lightest pixels whose mean is its colour. The others lie in the shade.
const LIGHTEST: f64 = 0.3;

/// The fabric that a fit shows. `pixels_per_mm` is the scale of the first photo.
pub(super) fn fabric(fit: &Fit, views: &[FaceView], pixels_per_mm: Option<f64>) -> Fabric {
    let mut fabric = fit.candidate.fabric.clone();
    if fit.is_mirrored {
        mirror(&mut fabric);
    }
    let frame = views[0].frames[fit.scores[0].frame];
    if let Some(pixels_per_mm) = pixels_per_mm {
        let wales_per_cm = 10.0 * pixels_per_mm / frame.wale();
        let times = fabric.wales_per_cm / wales_per_cm;
        if let Ok(scaled) = fabric.clone().at_scale(times) {
            fabric = scaled;
            for yarn in fabric.structure.yarns_mut() {
                yarn.count = Count::from_tex(yarn.count.tex() * times.powi(2));
            }
        }
    }
    let colors = colors(fit, views);
    for (yarn, color) in fabric.structure.yarns_mut().zip(colors) {
        yarn.color = color;
    }
    let rounded = |density: f64| (1e3 * density).round() / 1e3;
    fabric.wales_per_cm = rounded(fabric.wales_per_cm);
    fabric.courses_per_cm = rounded(fabric.courses_per_cm);
    NAME.clone_into(&mut fabric.name);
    fabric.about = String::new();
    fabric
}

/// Turns a warp knit into its mirror image. Full bars keep their drive on the right.
fn mirror(fabric: &mut Fabric) {
    let Structure::Warp(knit) = &mut fabric.structure else { return };
    let all_full = knit.bars.iter().all(|bar| bar.threading.repeat() == 1 || bar.chain().is_none());
    for bar in &mut knit.bars {
        let Lay::Lapping(chain) = &bar.lay else { continue };
        let mirrored = chain.mirrored();
        let upright = all_full.then(|| from_gap_0(&mirrored)).flatten();
        bar.lay = Lay::Lapping(upright.unwrap_or(mirrored));
        bar.threading = bar.threading.mirrored();
    }
}

/// A chain moved so that its lowest gap is 0.
fn from_gap_0(chain: &Chain) -> Option<Chain> {
    let (low, _) = chain.gaps();
    let laps = chain.laps().iter().map(|lap| format!("{}-{}", lap.from - low, lap.to - low));
    Chain::parse(&laps.collect::<Vec<_>>().join("/"), Numbering::Tricot).ok()
}

/// The colour of each yarn system where it is seen; one for all if they hardly differ.
fn colors(fit: &Fit, views: &[FaceView]) -> Vec<Color> {
    let systems = fit.candidate.fabric.yarn_systems();
    let mut samples: Vec<Vec<(f32, DVec3)>> = vec![Vec::new(); systems];
    for (view, score) in views.iter().zip(&fit.scores) {
        let colors = view.mean_colors(fit.candidate.repeat(), score.frame);
        collect(&fit.candidate, fit, view, views.len(), score.matched.shift, &colors, &mut samples);
    }
    let means: Vec<Option<DVec3>> = samples.iter_mut().map(|own| lightest(own)).collect();
    let known: Vec<DVec3> = means.iter().flatten().copied().collect();
    let all = known.iter().sum::<DVec3>() / double(known.len().max(1));
    let is_one = known.iter().all(|color| (*color - all).abs().max_element() < SAME_COLOR);
    means
        .into_iter()
        .map(|own| {
            let linear = own.filter(|_| !is_one).unwrap_or(all).clamp(DVec3::ZERO, DVec3::ONE);
            Color::from_linear(linear.as_vec3().into())
        })
        .collect()
}

/// Adds the colours of each system's pixels, with the light that the sketch has there.
fn collect(
    candidate: &Candidate,
    fit: &Fit,
    view: &FaceView,
    photos: usize,
    shift: [usize; 2],
    colors: &[DVec3],
    samples: &mut [Vec<(f32, DVec3)>],
) {
    let sketch = candidate.sketch(seen(view, photos, candidate));
    let mirrored = fit.is_mirrored.then(|| sketch.mirrored());
    let sketch = mirrored.as_ref().unwrap_or(sketch);
    let (width, height) = (sketch.channels[0].width, sketch.channels[0].height);
    for (at, system) in sketch.systems.iter().enumerate().filter(|(_, system)| **system != NONE) {
        let [x, y] = [(at % width + shift[0]) % width, (at / width + shift[1]) % height];
        if let Some(own) = samples.get_mut(usize::from(*system)) {
            own.push((sketch.channels[0].values[at], colors[y * width + x]));
        }
    }
}

/// The mean colour of the lightest samples.
fn lightest(samples: &mut [(f32, DVec3)]) -> Option<DVec3> {
    samples.sort_by(|a, b| b.0.total_cmp(&a.0));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
    let count = (LIGHTEST * double(samples.len())).ceil() as usize;
    (count > 0)
        .then(|| samples[..count].iter().map(|(_, color)| *color).sum::<DVec3>() / double(count))
}
