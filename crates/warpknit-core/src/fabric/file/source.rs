//! Values of a fabric file with their places in its text, and the errors about them.
//!
//! In: a value that the TOML reader has found, with its span. Out: the value, or an error that
//! points at it. TOML itself checks types only, so ranges and notations are checked here.

use std::ops::Range;

use toml::Spanned;

use crate::fabric::error::{FabricError, FabricFault};

/// The range of a number: from, to and the unit.
pub(in crate::fabric) type Limits = (f64, f64, &'static str);

pub(in crate::fabric) const DENSITY: Limits = (0.01, 1000.0, "per cm");
pub(super) const GAUGE: Limits = (0.1, 1000.0, "needles an inch");

/// Refuses a value outside its limits (NaN included).
pub(in crate::fabric) fn in_range(
    what: &str,
    value: f64,
    (low, high, unit): Limits,
) -> Result<f64, FabricFault> {
    // A range contains no NaN, so NaN is refused here too.
    if (low..=high).contains(&value) {
        return Ok(value);
    }
    let range = format!("between {low} and {high} {unit}").trim_end().to_owned();
    Err(FabricFault::Range { what: what.to_owned(), value, range })
}

/// A value that comes from no text, to be written.
pub(super) fn unplaced<T>(value: T) -> Spanned<T> {
    Spanned::new(0..0, value)
}

/// The text of the file, into which errors point.
#[derive(Clone, Copy)]
pub(super) struct FileText<'a>(pub(super) &'a str);

impl FileText<'_> {
    /// A number within its limits; `what` names it in the error.
    pub(super) fn number(
        self,
        what: &str,
        number: &Spanned<f64>,
        limits: Limits,
    ) -> Result<f64, FabricError> {
        in_range(what, *number.get_ref(), limits).map_err(|fault| fault.at(self.0, number.span()))
    }

    /// The same for a number that may be left out.
    pub(super) fn optional(
        self,
        what: &str,
        number: Option<&Spanned<f64>>,
        limits: Limits,
    ) -> Result<Option<f64>, FabricError> {
        number.map(|number| self.number(what, number, limits)).transpose()
    }

    /// Puts a fault at the bytes `within` a string. If the string is written with escapes, its
    /// bytes are not those of the file, and the fault is put at the whole string.
    pub(super) fn in_string(
        self,
        string: &Spanned<String>,
        within: Range<usize>,
        fault: FabricFault,
    ) -> FabricError {
        // The span covers the quotes. Inside them the text is found only if it has no escapes.
        let literal = &self.0[string.span()];
        let start =
            literal.find(string.get_ref().as_str()).filter(|_| !string.get_ref().is_empty());
        let span = start.map_or(string.span(), |at| {
            let start = string.span().start + at;
            start + within.start..start + within.end
        });
        fault.at(self.0, span)
    }
}
