//! The answer as a fabric: chains or a chart, densities, yarn counts and colours.
//!
//! In: the best [`Fit`] and the photos. Out: a [`Fabric`] as a designer writes one.
//!
//! Not promised: a size, unless somebody gives the photo's scale; then wales are as dense as those of
//! the fabric that was compared. Nor the count of yarns so thick that they fill their loops.

use glam::DVec3;

use super::fit::{Fit, seen};
use super::view::FaceView;
use crate::plane::{Plane, double, percentile};
use warpknit_core::fabric::lapping::{Chain, Numbering};
use warpknit_core::fabric::yarn::{Color, Count};
use warpknit_core::fabric::{Fabric, Lay, Structure};

/// The name that recognised fabrics get.
const NAME: &str = "captured";
/// Colours of bars that differ by less than this in each of linear red, green and blue are one.
const SAME_COLOR: f64 = 0.08;
/// Blur of a photo in which colours are sought, pixels of a sketch.
const BLUR: usize = 1;
/// How far colours are drawn to the one that all yarns have in common, as a share of what is seen of them.
/// Of a bar that is hardly seen, little is known, and deep bars are darker than their light says. At 0.02 the
/// back bars of some cloths became black.
const COMMON: f64 = 0.1;
/// Share of the lights below the one that shows a yarn's own colour: what is brighter is a highlight.
const TOP: f32 = 0.9;
/// Rounds in which colours are found: enough for lights that are much alike.
const ROUNDS: usize = 200;

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

/// The colour of each yarn system; one for all if they hardly differ.
///
/// What a pixel shows is taken for the sum of all yarns in it and of the ground, each its colour times its
/// light of an even sky.
fn colors(fit: &Fit, views: &[FaceView]) -> Vec<Color> {
    let systems = fit.candidate.fabric.yarn_systems();
    let mut sums = ColorSums::new(systems + views.len());
    for (number, (view, score)) in views.iter().zip(&fit.scores).enumerate() {
        let lights = lights(fit, view, views.len());
        let colors = view.mean_colors(fit.candidate.repeat(), score.frame);
        let [right, down] = score.matched.shift;
        let (width, height) = (lights[0].width, lights[0].height);
        // The grounds of other photos are dark here.
        let mut parts = vec![0.0; systems + views.len()];
        for at in 0..width * height {
            let [x, y] = [(at % width + right) % width, (at / width + down) % height];
            let yarns = parts.iter_mut().zip(&lights[..systems]);
            yarns.for_each(|(part, own)| *part = own.values[at].into());
            parts[systems + number] = lights[systems].values[at].into();
            sums.add(&parts, colors[y * width + x]);
        }
    }
    let all = sums.common(systems);
    let own = sums.solved(systems, Some(all));
    let is_one = own.iter().all(|color| (*color - all).abs().max_element() < SAME_COLOR);
    own.into_iter()
        .map(|own| {
            let linear = if is_one { all } else { own }.min(DVec3::ONE);
            Color::from_linear(linear.as_vec3().into())
        })
        .collect()
}

/// The light of each yarn system and, last, that of the ground, as a photo shows them.
fn lights(fit: &Fit, view: &FaceView, photos: usize) -> Vec<Plane> {
    let sketch = fit.candidate.sketch(seen(view, photos, &fit.candidate));
    let mirrored = fit.is_mirrored.then(|| sketch.mirrored());
    let sketch = mirrored.as_ref().unwrap_or(sketch);
    let light = &sketch.channels[0];
    let mut lightest: Vec<f32> =
        light.values.iter().copied().filter(|light| *light > 0.0).collect();
    let top = percentile(&mut lightest, TOP).max(f32::MIN_POSITIVE);
    let of_yarns = sketch.yarns.iter().map(|yarn| yarn.map(|light| light / top));
    let all = of_yarns.chain([sketch.ground.clone()]);
    all.map(|plane| plane.blurred(BLUR, true)).collect()
}

/// Sums for the colours of some parts by least squares.
struct ColorSums {
    /// Sums of products of the lights of each part with each.
    products: Vec<Vec<f64>>,
    /// Sums of the lights of each part with what is seen.
    seen: Vec<DVec3>,
}

impl ColorSums {
    fn new(parts: usize) -> Self {
        Self { products: vec![vec![0.0; parts]; parts], seen: vec![DVec3::ZERO; parts] }
    }

    /// Adds a pixel: the light of each part, and what is seen.
    fn add(&mut self, parts: &[f64], seen: DVec3) {
        for ((row, own), sum) in self.products.iter_mut().zip(parts).zip(&mut self.seen) {
            row.iter_mut().zip(parts).for_each(|(product, other)| *product += own * other);
            *sum += *own * seen;
        }
    }

    /// The colour that the first `yarns` parts have in common.
    fn common(&self, yarns: usize) -> DVec3 {
        let count = self.seen.len() - yarns + 1;
        let group = |part: usize| (part + 1).saturating_sub(yarns);
        let mut sums = Self::new(count);
        for (row, products) in self.products.iter().enumerate() {
            sums.seen[group(row)] += self.seen[row];
            for (column, product) in products.iter().enumerate() {
                sums.products[group(row)][group(column)] += product;
            }
        }
        sums.solved(1, None)[0]
    }

    /// The colours of the first `yarns` parts, drawn to one if there is one. Nothing is darker than black
    /// (Gauss and Seidel's method, projected).
    fn solved(&self, yarns: usize, common: Option<DVec3>) -> Vec<DVec3> {
        let seen_of_all: f64 = (0..yarns).map(|part| self.products[part][part]).sum();
        let pull = if common.is_some() { COMMON * seen_of_all / double(yarns.max(1)) } else { 0.0 };
        let common = common.unwrap_or(DVec3::ZERO);
        let mut colors = vec![common; self.seen.len()];
        for _ in 0..ROUNDS {
            for part in 0..colors.len() {
                let row = &self.products[part];
                let pull = if part < yarns { pull } else { 0.0 };
                let others: DVec3 =
                    row.iter().zip(&colors).map(|(product, color)| *product * *color).sum();
                let rest = self.seen[part] - others + row[part] * colors[part] + pull * common;
                let weight = (row[part] + pull).max(f64::MIN_POSITIVE);
                colors[part] = (rest / weight).max(DVec3::ZERO);
            }
        }
        colors.truncate(yarns);
        colors
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_of_neighbours_are_told_from_each_other() {
        let truth = [DVec3::new(0.8, 0.7, 0.5), DVec3::new(0.1, 0.2, 0.4), DVec3::ONE];
        let mut sums = ColorSums::new(3);
        for at in 0..100 {
            let [first, second] = [7, 13].map(|step| f64::from(at * step % 17) / 17.0);
            let parts = [0.8 * first * second, first * (1.0 - second), 1.0 - first];
            sums.add(&parts, parts.iter().zip(truth).map(|(part, color)| *part * color).sum());
        }
        let common = sums.common(2);
        let found = sums.solved(2, Some(common));
        for (found, truth) in found.iter().zip(truth) {
            // Each is drawn to the one of both by a tenth of what is seen.
            assert!(found.distance(truth) < 0.15, "{found} {truth}");
        }
    }

    #[test]
    fn a_yarn_that_is_never_seen_has_the_colour_of_the_others() {
        let mut sums = ColorSums::new(3);
        for light in (1..9).map(|at| 0.1 * f64::from(at)) {
            sums.add(&[light, 0.0, 0.1], DVec3::splat(0.5 * light));
        }
        let common = sums.common(2);
        for color in sums.solved(2, Some(common)) {
            assert!(color.distance(DVec3::splat(0.5)) < 1e-6, "{color}");
        }
    }
}
