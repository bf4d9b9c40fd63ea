//! What is seen between the yarns of the front bar in a photo.
//!
//! In: photos and cloths that they may show. Out: for each photo a [`Ground`], and the cloths' [`Fit`]s
//! on these. Nets and laces lie on white paper or before a window as often as on something dark, and
//! bars have colours of their own.
//!
//! Method: a photo's ground is light, or its bars have several colours, if the cloth that fits best
//! explains clearly more with the light of the ground, or of the other bars, than with one that is
//! dimmer in the depth. All photos are of one cloth: colours that one shows clearly are the others'
//! too. Cost: that of comparing all cloths three times, or four times where two photos differ.

use super::candidate::Candidate;
use super::fit::{Fit, fit_all};
use super::sketch::Ground;
use super::view::FaceView;

/// How many times as much light ground must explain. A locknit on paper has 1.9. With this as many
/// two-bar cloths on dark ground are right as without light ground.
const CLEARLY_LIGHT: f64 = 1.15;
/// How many times as much bars of another colour must explain. The face of a locknit of two colours
/// has 1.14 to 1.18, and hard photos of two-bar cloths of one colour have up to 1.06.
const CLEARLY_COLORED: f64 = 1.08;

/// Fits candidates as they are, in all frames, and finds out on what ground the cloth of each photo lies;
/// the best first.
pub(super) fn fit_on_grounds(views: &mut [FaceView], candidates: &[Candidate]) -> Vec<Fit> {
    let [dark, bars, light] = [Ground::Dark, Ground::Bars, Ground::Light].map(|ground| {
        views.iter_mut().for_each(|view| view.ground = ground);
        fit_all(views, candidates)
    });
    let best = |fits: &[Fit], photo: usize| {
        fits.iter().map(|fit| fit.scores[photo].explained).fold(0.0, f64::max)
    };
    let shares: Vec<[f64; 3]> = (0..views.len())
        .map(|photo| [&dark, &bars, &light].map(|fits| best(fits, photo)))
        .collect();
    let is_colored = shares.iter().any(|[dark, bars, _]| *bars > CLEARLY_COLORED * dark);
    for (view, [dark, _, light]) in views.iter_mut().zip(shares) {
        view.ground = if light > CLEARLY_LIGHT * dark {
            Ground::Light
        } else if is_colored {
            Ground::Bars
        } else {
            Ground::Dark
        };
    }
    let first = views[0].ground;
    if views.iter().any(|view| view.ground != first) {
        return fit_all(views, candidates);
    }
    match first {
        Ground::Dark => dark,
        Ground::Bars => bars,
        Ground::Light => light,
    }
}
