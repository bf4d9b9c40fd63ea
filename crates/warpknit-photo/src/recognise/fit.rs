//! Candidates compared with the photos: first as drafts, then the best of them relaxed at the
//! photos' own proportions.
//!
//! In: [`FaceView`]s and [`Candidate`]s. Out: [`Fit`]s, the best first.
//!
//! A cloth and its mirror image compete, and both photos must show the same of the two. What a fit
//! explains is the mean over the photos. Cost: some tens of milliseconds a relaxation: six for the best
//! candidates, two at most for others.

use rayon::prelude::*;

use super::Face;
use super::candidate::{Candidate, proportioned};
use super::compare::Template;
use super::sketch::Raster;
use super::view::{FaceView, Score};
use crate::plane::double;
use warpknit_core::fabric::Fabric;

/// Blurs of sketches that are tried, pixels of theirs. Photos are blurred by themselves, and again
/// before they are sampled. Drafts are tried with the first.
const BLURS: [f64; 4] = [1.2, 0.9, 1.6, 2.0];
/// Yarn diameters that are tried, of the candidate's own. The first, for all, leaves them as they are.
const THICKNESSES: [f64; 6] = [1.0, 0.82, 0.87, 0.93, 1.07, 1.14];
/// Change of a diameter below which another relaxation tells nothing.
const SAME_DIAMETER: f64 = 0.02;
/// Frames in which a draft that fits is tried again once it is relaxed.
const FRAMES: usize = 4;

/// A cloth in the photos.
#[derive(Clone)]
pub(super) struct Fit {
    pub(super) candidate: Candidate,
    pub(super) is_mirrored: bool,
    /// Share of the photos' variance that it explains, the mean of all.
    pub(super) explained: f64,
    /// Its best score in each photo.
    pub(super) scores: Vec<Score>,
    /// The frames that are tried next, of each photo.
    pub(super) frames: Vec<Vec<usize>>,
}

impl Fit {
    /// Share that it explains of what copies of any repeat that was tried have in common, the mean
    /// of all photos. The best repeat counts: one that is too short has less in common.
    pub(super) fn explained_of_common(&self, views: &[FaceView]) -> f64 {
        let each = self
            .scores
            .iter()
            .zip(views)
            .map(|(score, view)| (score.explained / view.most_common().max(1e-9)).min(1.0));
        each.sum::<f64>() / double(self.scores.len().max(1))
    }

    /// The first photo that shows nothing but stripes in its best frame.
    pub(super) fn striped_photo(&self, views: &[FaceView]) -> Option<usize> {
        let repeat = self.candidate.repeat();
        let mut each = self.scores.iter().zip(views);
        each.position(|(score, view)| view.is_striped(repeat, score.frame))
    }

    /// The photo of which it explains least.
    pub(super) fn worst_photo(&self) -> usize {
        let each = self.scores.iter().map(|score| score.explained).enumerate();
        each.min_by(|(_, a), (_, b)| a.total_cmp(b)).map_or(0, |(photo, _)| photo)
    }

    /// Course spacing over wale spacing, the mean of all photos.
    pub(super) fn proportion(&self, views: &[FaceView]) -> f64 {
        let each = self.scores.iter().zip(views).map(|(score, view)| {
            let frame = view.frames[score.frame];
            frame.course() / frame.wale()
        });
        each.sum::<f64>() / double(self.scores.len().max(1))
    }
}

/// Fits candidates as they are, in all frames; the best first.
pub(super) fn fit_all(views: &mut [FaceView], candidates: &[Candidate]) -> Vec<Fit> {
    for view in views.iter_mut() {
        candidates.iter().for_each(|candidate| view.fold(candidate.repeat()));
    }
    let views = &*views;
    let mut fits: Vec<Fit> = candidates
        .par_iter()
        .flat_map_iter(|candidate| both_hands(views, candidate, None))
        .collect();
    sort(&mut fits);
    fits
}

/// Fits candidates in some frames of each photo; the best first.
pub(super) fn fit_in(
    views: &mut [FaceView],
    candidates: &[Candidate],
    frames: &[Vec<usize>],
) -> Vec<Fit> {
    for view in views.iter_mut() {
        candidates.iter().for_each(|candidate| view.fold(candidate.repeat()));
    }
    let views = &*views;
    let mut fits: Vec<Fit> = candidates
        .par_iter()
        .filter_map(|candidate| fit(views, candidate, false, &BLURS[..1], Some(frames)))
        .collect();
    sort(&mut fits);
    fits
}

/// Relaxes the fabrics of some fits at the photos' proportions: the best `thick` with yarns of several
/// diameters, all others with their own and with the one that suits the best.
pub(super) fn refine(views: &mut [FaceView], fits: &[Fit], thick: usize) -> Vec<Fit> {
    for view in views.iter_mut() {
        fits.iter().for_each(|fit| view.fold(fit.candidate.repeat()));
    }
    let views = &*views;
    let [as_it_is, others @ ..] = THICKNESSES;
    let mut first: Vec<Fit> =
        fits.par_iter().filter_map(|fit| relaxed(views, fit, as_it_is)).collect();
    sort(&mut first);
    let rest = first.split_off(thick.min(first.len()));
    let mut all: Vec<Fit> = first.into_par_iter().map(|fit| best_of(views, fit, &others)).collect();
    sort(&mut all);
    // A photo's yarns have one diameter, whatever their lapping.
    let diameter = all.first().map(|best| relative_diameter(&best.candidate.fabric));
    all.par_extend(rest.into_par_iter().map(|fit| {
        let own = relative_diameter(&fit.candidate.fabric);
        let thickness = diameter.map_or(as_it_is, |diameter| diameter / own);
        let is_other = (thickness - as_it_is).abs() > SAME_DIAMETER;
        let thickness = thickness.clamp(others[0], others[others.len() - 1]);
        if is_other { best_of(views, fit, &[thickness]) } else { fit }
    }));
    sort(&mut all);
    all
}

/// Diameter of a fabric's thickest yarn over its wale spacing.
fn relative_diameter(fabric: &Fabric) -> f64 {
    2.0 * fabric.radius() / fabric.wale_spacing()
}

/// A fit with its fabric relaxed at the photos' proportion. Its yarns are so many times as thick, and
/// as flat as suits the photos best.
fn relaxed(views: &[FaceView], fit: &Fit, thickness: f64) -> Option<Fit> {
    let fabric = proportioned(&fit.candidate.fabric, fit.proportion(views), thickness);
    let candidates = Candidate::relaxed_and_spread(&fabric).into_iter();
    candidates
        .filter_map(|candidate| both_hands(views, &candidate, Some(fit)).into_iter().next())
        .reduce(better)
}

/// The best of a fit and of the same with other thicknesses.
fn best_of(views: &[FaceView], fit: Fit, thicknesses: &[f64]) -> Fit {
    let others: Vec<Fit> =
        thicknesses.iter().filter_map(|&thickness| relaxed(views, &fit, thickness)).collect();
    others.into_iter().fold(fit, better)
}

/// The one of two fits that explains more.
fn better(one: Fit, other: Fit) -> Fit {
    if other.explained > one.explained { other } else { one }
}

/// The best first.
pub(super) fn sort(fits: &mut [Fit]) {
    fits.sort_by(|a, b| b.explained.total_cmp(&a.explained));
}

/// The fits of a candidate and of its mirror image, if that is another cloth.
fn both_hands(views: &[FaceView], candidate: &Candidate, before: Option<&Fit>) -> Vec<Fit> {
    let hands = if candidate.is_handed { &[false, true][..] } else { &[false] };
    let hands = hands.iter().filter(|hand| before.is_none_or(|fit| fit.is_mirrored == **hand));
    let blurs = if before.is_some() { &BLURS[..] } else { &BLURS[..1] };
    let frames = before.map(|fit| &fit.frames[..]);
    hands.filter_map(|&is_mirrored| fit(views, candidate, is_mirrored, blurs, frames)).collect()
}

/// The face that a photo shows if it shows a candidate. A weft knit whose one photo is given is
/// taken to be shown from its face: reverse jersey is a cloth of its own.
pub(super) fn seen(view: &FaceView, photos: usize, candidate: &Candidate) -> Face {
    if photos == 1 && candidate.key.is_none() { Face::Front } else { view.face }
}

/// The fit of a candidate or of its mirror image.
fn fit(
    views: &[FaceView],
    candidate: &Candidate,
    is_mirrored: bool,
    blurs: &[f64],
    among: Option<&[Vec<usize>]>,
) -> Option<Fit> {
    let (mut scores, mut frames, mut explained) = (Vec::new(), Vec::new(), 0.0);
    for (at, view) in views.iter().enumerate() {
        let sketch = candidate.sketch(seen(view, views.len(), candidate));
        let mirrored = is_mirrored.then(|| sketch.mirrored());
        let sketch = mirrored.as_ref().unwrap_or(sketch);
        let raster = Raster::fine(sketch.repeat);
        let mut best: Vec<Score> = Vec::new();
        for blur in blurs {
            let template: Template = view.template(sketch, *blur)?;
            let own = match among {
                Some(among) => view.scores(&template, raster, among[at].iter().copied()),
                None => view.scores(&template, raster, 0..view.frames.len()),
            };
            if best
                .first()
                .is_none_or(|best| own.first().is_some_and(|own| own.explained > best.explained))
            {
                best = own;
            }
        }
        explained += best.first()?.explained / double(views.len());
        frames.push(best.iter().take(FRAMES).map(|score| score.frame).collect());
        scores.push(best[0]);
    }
    Some(Fit { candidate: candidate.clone(), is_mirrored, explained, scores, frames })
}

/// The fabrics of fits that are different cloths, the best first.
pub(super) fn distinct(fits: Vec<Fit>, most: usize) -> Vec<Fit> {
    let mut kept: Vec<Fit> = Vec::new();
    for fit in fits {
        let is_known = |other: &Fit| {
            other.candidate.key == fit.candidate.key
                && (fit.candidate.key.is_some()
                    || other.candidate.fabric.name == fit.candidate.fabric.name)
        };
        if !kept.iter().any(is_known) {
            kept.push(fit);
            if kept.len() == most {
                break;
            }
        }
    }
    kept
}
