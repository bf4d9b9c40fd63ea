//! What lies behind the cloth of a photo.
//!
//! In: photos and cloths that they may show. Out: for each photo a [`Ground`], and the cloths' [`Fit`]s on these.
//! Nets and laces lie on white paper or before a window as often as on something dark.
//!
//! Method: a photo's ground is light if the cloth that fits best explains clearly more with a light of the
//! ground than with one of the other bars. Cost: that of comparing all cloths twice, or three times where two
//! photos lie on different grounds.

use super::candidate::Candidate;
use super::fit::{Fit, fit_all};
use super::sketch::Ground;
use super::view::FaceView;

/// How many times as much light ground must explain. A locknit on paper has 1.9. With this as many
/// two-bar cloths on dark ground are right as without light ground.
const CLEARLY: f64 = 1.15;

/// Fits candidates as they are, in all frames, and finds out on what ground the cloth of each photo lies;
/// the best first.
pub(super) fn fit_on_grounds(views: &mut [FaceView], candidates: &[Candidate]) -> Vec<Fit> {
    let [dark, light] = [Ground::Dark, Ground::Light].map(|ground| {
        views.iter_mut().for_each(|view| view.ground = ground);
        fit_all(views, candidates)
    });
    let best = |fits: &[Fit], photo: usize| {
        fits.iter().map(|fit| fit.scores[photo].explained).fold(0.0, f64::max)
    };
    let is_light: Vec<bool> =
        (0..views.len()).map(|photo| best(&light, photo) > CLEARLY * best(&dark, photo)).collect();
    for (view, is_light) in views.iter_mut().zip(&is_light) {
        view.ground = if *is_light { Ground::Light } else { Ground::Dark };
    }
    match (is_light.contains(&true), is_light.contains(&false)) {
        (true, false) => light,
        (false, _) => dark,
        (true, true) => fit_all(views, candidates),
    }
}
