//! Warnings and notes of a run, kept for its report.
//!
//! In: warnings and notes, some of them again and again. Out: each text once, to the listener and in
//! [`Messages`]. Frames of a sequence with the same fault share one warning.

use super::clock::{Clock, Message};

/// The warnings and the notes of a run.
#[derive(Clone, Debug, Default)]
pub(super) struct Messages {
    /// What may be wrong with the garment, the fabric or the cloth.
    pub(super) warnings: Vec<String>,
    /// What a person may want to know: sizes, choices, how cloth is shown.
    pub(super) notes: Vec<String>,
}

impl Messages {
    /// Tells the listener the warnings that it has not heard yet.
    pub(super) fn warn(&mut self, texts: impl IntoIterator<Item = String>, clock: &Clock<'_>) {
        for text in unsaid(&mut self.warnings, texts) {
            clock.listener().say(Message::Warning(text));
        }
    }

    /// The same for notes.
    pub(super) fn note(&mut self, texts: impl IntoIterator<Item = String>, clock: &Clock<'_>) {
        for text in unsaid(&mut self.notes, texts) {
            clock.listener().say(Message::Note(text));
        }
    }
}

/// Adds texts that are not known yet, and returns them.
fn unsaid(known: &mut Vec<String>, texts: impl IntoIterator<Item = String>) -> &[String] {
    let first = known.len();
    for text in texts {
        if !known.contains(&text) {
            known.push(text);
        }
    }
    &known[first..]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_said_once() {
        let mut known = Vec::new();
        let texts = |all: &[&str]| all.iter().map(|&text| text.to_owned()).collect::<Vec<_>>();
        assert_eq!(unsaid(&mut known, texts(&["a", "b", "a"])), ["a", "b"]);
        assert_eq!(unsaid(&mut known, texts(&["b", "c"])), ["c"]);
        assert_eq!(known, ["a", "b", "c"]);
    }
}
