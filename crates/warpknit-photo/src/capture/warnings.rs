//! What whoever uses a capture should know, although there is one.

use super::{Captured, Layout, Twist};

/// More unexplained than this is told: yarns are missing, or bend more than cylinders do.
const UNEXPLAINED: f64 = 0.25;
/// The same by what is seen of them, which is less than what was fitted: photos that are told well
/// leave up to .3.
const UNEXPLAINED_BY_SEEN: f64 = 0.4;
/// Light and heights that correlate less have little to do with each other, as on satin.
const CORRELATED: f64 = 0.2;

impl Captured {
    /// What to look at and to mend, a line each.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let Layout { error, seen_error, .. } = self.layout;
        let correlation = self.correlation();
        let unexplained = (error > UNEXPLAINED).then(|| {
            format!(
                "the segments leave {:.0} % of the cell unexplained: look at grid3x3.png, and mend layout.toml",
                100.0 * error
            )
        });
        let by_seen = (error <= UNEXPLAINED && seen_error > UNEXPLAINED_BY_SEEN).then(|| {
            format!(
                "what is seen of the segments leaves {:.0} % of the cell unexplained: look at grid3x3.png, and mend layout.toml, or give a larger cell (--cell) if the cloth repeats after more",
                100.0 * seen_error
            )
        });
        let gleaming = (correlation < CORRELATED).then(|| {
            format!("light and the heights of the segments correlate by {correlation:.2} alone, as on satin, which gleams: don't trust the depth")
        });
        let invalid = (!self.layout.is_valid()).then(|| {
            "the segments lie over each other, or leave much of the cell blank: look at grid3x3.png, and mend layout.toml"
                .to_owned()
        });
        let strands = self.fabric.yarn_systems();
        let runs_across = |&strand: &usize| self.fabric.structure.runs_across(strand);
        let across = (0..strands).filter(runs_across).count();
        let loose = (across == 0 || across == strands).then(|| {
            "all yarns run one way, and nothing holds them together: look at grid3x3.png, and add what is missing to layout.toml, or give a larger cell (--cell) if the cloth repeats after more"
                .to_owned()
        });
        let hidden = self.layout.hidden();
        let hidden = (!hidden.is_empty()).then(|| {
            let numbers = hidden.iter().map(|number| format!("{}", number + 1)).collect::<Vec<_>>().join(", ");
            format!("hidden under others, and left out of the cloth: of layout.toml's segments {numbers}")
        });
        [unexplained, by_seen, gleaming, invalid, loose, hidden, self.twist_warning()]
            .into_iter()
            .flatten()
            .collect()
    }

    fn twist_warning(&self) -> Option<String> {
        let is_narrow = |twist: &Twist| twist.is_guess && twist.fibre_px < Twist::LEAST_PX;
        if self.twists.iter().all(is_narrow) {
            return Some(format!(
                "twist is a guess: fibres are under {} pixels wide",
                Twist::LEAST_PX
            ));
        }
        let guesses = self.twists.iter().filter(|twist| twist.is_guess).count();
        (guesses > 0).then(|| {
            format!("the twist of {guesses} of {} segments is a guess: too few of their fibres are seen", self.twists.len())
        })
    }
}
