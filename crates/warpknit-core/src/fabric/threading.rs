//! Threadings: which guides of a bar carry a yarn.
//!
//! In: marks such as `I.`. Out: a [`Threading`], repeated without end; or a [`ThreadingError`] with
//! the byte span of the fault. Wefts and feeders have threadings too; their marks stand for
//! courses.

use std::fmt;
use std::ops::Range;

use crate::ids::index32;

/// Which guides of a bar carry a yarn, repeated across; for wefts and feeders, which courses get
/// one.
///
/// ```
/// use warpknit_core::fabric::threading::Threading;
/// let half_set = Threading::parse("I.").unwrap();
/// assert!(half_set.carries(0) && !half_set.carries(1) && half_set.carries(-2));
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Threading(Vec<bool>);

impl Threading {
    /// Every guide threaded.
    #[must_use]
    pub fn full() -> Self {
        Self(vec![true])
    }

    /// Reads marks, one a guide: `I`, `1` or `|` threaded, `.`, `0` or `*` empty.
    ///
    /// # Errors
    /// An unknown mark, or no threaded guide at all.
    pub fn parse(text: &str) -> Result<Self, ThreadingError> {
        let marks =
            text.char_indices().filter(|(_, c)| !c.is_whitespace()).map(|(at, c)| match c {
                'I' | '1' | '|' => Ok(true),
                '.' | '0' | '*' => Ok(false),
                other => Err(ThreadingError {
                    fault: ThreadingFault::UnknownMark(other),
                    span: at..at + other.len_utf8(),
                }),
            });
        let marks = marks.collect::<Result<Vec<_>, _>>()?;
        if marks.contains(&true) {
            Ok(Self(marks))
        } else {
            Err(ThreadingError { fault: ThreadingFault::NoYarn, span: 0..text.len() })
        }
    }

    /// Whether guide `k` carries a yarn; the first mark is guide 0.
    #[must_use]
    pub fn carries(&self, guide: i64) -> bool {
        // Guides left of guide 0 have negative numbers, and marks repeat that way as well.
        let repeat = i64::try_from(self.0.len()).expect("marks fit in memory");
        self.0[usize::try_from(guide.rem_euclid(repeat)).expect("a remainder is not negative")]
    }

    /// The same threading counted the other way from guide 0.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        // Guide k becomes guide -k: the first mark stays, the others run backward.
        let (first, others) = self.0.split_first().expect("a threading has a mark");
        Self(std::iter::once(*first).chain(others.iter().rev().copied()).collect())
    }

    /// Share of the guides that carry a yarn.
    #[must_use]
    pub fn share(&self) -> f64 {
        let threaded = self.0.iter().filter(|carries| **carries).count();
        f64::from(index32(threaded)) / f64::from(index32(self.0.len()))
    }

    /// Guides in one repeat.
    #[must_use]
    pub fn repeat(&self) -> usize {
        self.0.len()
    }
}

impl fmt::Display for Threading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|&threaded| f.write_str(if threaded { "I" } else { "." }))
    }
}

/// A fault in a threading, and its place.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{fault}")]
pub struct ThreadingError {
    /// The fault.
    pub fault: ThreadingFault,
    /// The bytes of the text that are to blame.
    pub span: Range<usize>,
}

/// The faults that a threading can have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ThreadingFault {
    /// An unknown mark.
    #[error("'{0}' is no threading mark: use I for a threaded guide and . for an empty one")]
    UnknownMark(char),
    /// Every guide empty.
    #[error(
        "a bar without a threaded guide knits nothing: use I for a threaded guide and . for an \
         empty one"
    )]
    NoYarn,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_read_in_all_spellings_and_faults_have_their_span() {
        assert_eq!(Threading::parse("I 1|.0*").unwrap().to_string(), "III...");
        assert_eq!(
            Threading::parse("I.é").unwrap_err(),
            ThreadingError { fault: ThreadingFault::UnknownMark('é'), span: 2..4 }
        );
        assert_eq!(
            Threading::parse("..").unwrap_err(),
            ThreadingError { fault: ThreadingFault::NoYarn, span: 0..2 }
        );
        assert!(Threading::parse("").is_err());
    }

    #[test]
    fn guides_repeat_both_ways_and_mirror_about_guide_0() {
        let threading = Threading::parse("II.").unwrap();
        let mirror = threading.mirrored();
        for guide in -7..7 {
            assert_eq!(threading.carries(guide), threading.carries(guide + 3));
            assert_eq!(threading.carries(guide), mirror.carries(-guide));
        }
    }
}
