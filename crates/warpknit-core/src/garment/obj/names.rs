//! Object and group names of faces.
//!
//! In: `o` and `g` records. Out: the [`Label`] of each face. A name is stored only once a face has
//! it: a file may hold millions of names without faces.

use std::collections::HashMap;

use super::Label;
use super::records::tokens;
use crate::ids::index32;

/// The names in force, and all names that faces have had.
#[derive(Debug, Default)]
pub(super) struct Names {
    object: Name,
    group: Name,
    /// Index of each name in `names`.
    known: HashMap<String, u32>,
    pub(super) names: Vec<String>,
    pub(super) labels: Vec<Label>,
    /// Whether a name has been written since the last face.
    changed: bool,
}

/// The name of the following faces.
#[derive(Debug, Default)]
enum Name {
    #[default]
    None,
    Written(String),
    /// Its index in [`Names::names`].
    Kept(u32),
}

impl Names {
    /// Names the object of the following faces, from the rest of an `o` record.
    pub(super) fn object(&mut self, rest: &[u8]) {
        self.object = Name::from_record(rest);
        self.changed = true;
    }

    /// Names the group of the following faces, from the rest of a `g` record.
    pub(super) fn group(&mut self, rest: &[u8]) {
        self.group = Name::from_record(rest);
        self.changed = true;
    }

    /// The index in `labels` of the names in force, for a face.
    #[inline]
    pub(super) fn label(&mut self) -> u32 {
        if self.changed || self.labels.is_empty() {
            self.changed = false;
            let object = self.object.keep(&mut self.known, &mut self.names);
            let group = self.group.keep(&mut self.known, &mut self.names);
            let label = Label { object, group };
            if self.labels.last() != Some(&label) {
                self.labels.push(label);
            }
        }
        index32(self.labels.len() - 1)
    }
}

impl Name {
    /// The name written in an `o` or `g` record, blanks normalised.
    fn from_record(rest: &[u8]) -> Self {
        let words: Vec<_> = tokens(rest).map(String::from_utf8_lossy).collect();
        Self::Written(words.join(" "))
    }

    /// The index of the name, for a face that has it. The first such face stores it.
    fn keep(&mut self, known: &mut HashMap<String, u32>, names: &mut Vec<String>) -> Option<u32> {
        if let Self::Written(name) = self {
            let next = index32(names.len());
            let index = *known.entry(std::mem::take(name)).or_insert_with_key(|name| {
                names.push(name.clone());
                next
            });
            *self = Self::Kept(index);
        }
        match self {
            Self::Kept(index) => Some(*index),
            _ => None,
        }
    }
}
