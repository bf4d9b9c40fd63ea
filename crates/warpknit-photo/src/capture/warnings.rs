//! What a person should check about a capture that succeeded.
//!
//! In: a [`Captured`]. Out: a line of text for each finding.

use super::{Captured, Hypothesis, Layout, Twist};

/// Share of the variance that may stay unexplained without a warning. More means that yarns are
/// missing, or bend more than cylinders do.
const UNEXPLAINED: f64 = 0.25;
/// The same for the visible parts, which explain less than the fitted segments. Photos that are
/// captured well leave up to 0.3.
const UNEXPLAINED_BY_VISIBLE: f64 = 0.4;
/// The least length of a repeat in which strands of no known structure are believed, pixels. In two
/// real photos of 3 and 4 they were guesses; a weave of 7 was right.
pub const LEAST_CELL: f64 = 6.0;
/// Correlation of light and heights below which they have little to do with each other, as on
/// satin.
const MIN_CORRELATION: f64 = 0.2;

impl Captured {
    /// What to look at and to mend, one line each.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        [
            self.size_warning(),
            self.error_warning(),
            self.visible_error_warning(),
            self.correlation_warning(),
            self.validity_warning(),
            self.direction_warning(),
            self.hidden_warning(),
            self.twist_warning(),
        ]
        .into_iter()
        .flatten()
        .collect()
    }

    fn size_warning(&self) -> Option<String> {
        let is_guess = self.layout.hypothesis != Hypothesis::Woven;
        (is_guess && self.unit.lattice.shorter() < LEAST_CELL).then(|| {
            format!(
                "not sure: the cell is too small to see yarns in ({LEAST_CELL} pixels each way are \
                 needed), so that these are a guess; take the cloth nearer"
            )
        })
    }

    fn error_warning(&self) -> Option<String> {
        let error = self.layout.error;
        (error > UNEXPLAINED).then(|| {
            format!(
                "the segments leave {:.0} % of the cell unexplained: look at grid3x3.png, and \
                 mend layout.toml",
                100.0 * error
            )
        })
    }

    fn visible_error_warning(&self) -> Option<String> {
        let Layout { error, visible_error, .. } = self.layout;
        (error <= UNEXPLAINED && visible_error > UNEXPLAINED_BY_VISIBLE).then(|| {
            format!(
                "what is seen of the segments leaves {:.0} % of the cell unexplained: look at \
                 grid3x3.png, and mend layout.toml, or give a larger cell (--cell) if the cloth \
                 repeats after more",
                100.0 * visible_error
            )
        })
    }

    fn correlation_warning(&self) -> Option<String> {
        let correlation = self.correlation();
        (correlation < MIN_CORRELATION).then(|| {
            format!(
                "light and the heights of the segments correlate by {correlation:.2} alone, as on \
                 satin, which gleams: don't trust the depth"
            )
        })
    }

    fn validity_warning(&self) -> Option<String> {
        (!self.layout.is_valid()).then(|| {
            "the segments lie over each other, or leave much of the cell blank: look at \
             grid3x3.png, and mend layout.toml"
                .to_owned()
        })
    }

    /// A cloth needs yarns in two directions.
    fn direction_warning(&self) -> Option<String> {
        let strands = self.fabric.yarn_systems();
        let across =
            (0..strands).filter(|&strand| self.fabric.structure.runs_across(strand)).count();
        (across == 0 || across == strands).then(|| {
            "all yarns run one way, and nothing holds them together: look at grid3x3.png, and add \
             what is missing to layout.toml, or give a larger cell (--cell) if the cloth repeats \
             after more"
                .to_owned()
        })
    }

    fn hidden_warning(&self) -> Option<String> {
        let hidden = self.layout.hidden();
        (!hidden.is_empty()).then(|| {
            let numbers: Vec<String> =
                hidden.iter().map(|number| format!("{}", number + 1)).collect();
            format!(
                "hidden under others, and left out of the cloth: of layout.toml's segments {}",
                numbers.join(", ")
            )
        })
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
            format!(
                "the twist of {guesses} of {} segments is a guess: too few of their fibres are \
                 seen",
                self.twists.len()
            )
        })
    }
}
