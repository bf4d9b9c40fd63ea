//! From a photo of a knit to its chain notation or its chart.
//!
//! In: a photo of a knit's back, or of its face, or both. Out: a [`Recognition`]: the cloths that
//! explain the photos best, with what they explain. No training data: candidates are laid out,
//! relaxed, drawn and compared.

mod candidate;
mod compare;
mod fit;
mod frames;
mod same;
mod sketch;
mod unfold;
mod view;

use image::RgbImage;

pub use candidate::grid;
use candidate::warp_knits;
use fit::{distinct, fit_all, refine};
pub use same::ClothKey;
use view::FaceView;
use warpknit_core::fabric::Fabric;

/// The face of a cloth that a photo shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Face {
    /// The technical face: loops.
    Front,
    /// The technical back: underlaps.
    Back,
}

/// A cloth that explains the photos.
#[derive(Clone, Debug)]
pub struct Ranked {
    /// The cloth.
    pub fabric: Fabric,
    /// Whether the photos show its mirror image.
    pub is_mirrored: bool,
    /// Share of the photos' variance that it explains.
    pub explained: f64,
    /// The same of what all copies of its repeat have in common.
    pub common: f64,
}

/// Drafts that are worth to be relaxed, and of these, those whose yarns are fitted.
const RELAXED: usize = 12;
const FITTED: usize = 5;

/// Ranks the catalogue.
pub fn rank(photos: &[(&RgbImage, Face)]) -> [Vec<Ranked>; 2] {
    let mut views: Vec<FaceView> =
        photos.iter().map(|(photo, face)| FaceView::new(photo, *face)).collect();
    let drafts = distinct(fit_all(&mut views, warp_knits()), usize::MAX);
    let refined = refine(&mut views, &drafts[..RELAXED.min(drafts.len())], FITTED);
    [drafts, refined].map(|fits| {
        fits.into_iter()
            .map(|fit| {
                let common: f64 = fit
                    .scores
                    .iter()
                    .zip(&views)
                    .map(|(score, view)| view.common(fit.candidate.repeat(), score.frame))
                    .sum::<f64>()
                    / photos.len() as f64;
                Ranked {
                    fabric: fit.candidate.fabric,
                    is_mirrored: fit.is_mirrored,
                    explained: fit.explained,
                    common: fit.explained / common,
                }
            })
            .collect()
    })
}
