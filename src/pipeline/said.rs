//! What a run has said to a person, kept for its report.
//!
//! In: warnings and notes, some of them again and again. Out: each once, to the listener and in [`Said`].

use super::clock::{Clock, Message};

/// The warnings and the notes of a run.
#[derive(Clone, Debug, Default)]
pub(super) struct Said {
    /// What may be wrong with the garment, the fabric or the cloth.
    pub(super) warnings: Vec<String>,
    /// What a person may want to know: sizes, choices, how cloth is shown.
    pub(super) notes: Vec<String>,
}

impl Said {
    /// Tells the listener the warnings that it has not heard yet.
    pub(super) fn warn(&mut self, texts: impl IntoIterator<Item = String>, clock: &Clock<'_>) {
        for text in fresh(&mut self.warnings, texts) {
            clock.listener().say(Message::Warning(text));
        }
    }

    /// The same for notes.
    pub(super) fn note(&mut self, texts: impl IntoIterator<Item = String>, clock: &Clock<'_>) {
        for text in fresh(&mut self.notes, texts) {
            clock.listener().say(Message::Note(text));
        }
    }
}

/// Adds texts that are not known yet, and returns them.
fn fresh(known: &mut Vec<String>, texts: impl IntoIterator<Item = String>) -> &[String] {
    let first = known.len();
    for text in texts {
        if !known.contains(&text) {
            known.push(text);
        }
    }
    &known[first..]
}
