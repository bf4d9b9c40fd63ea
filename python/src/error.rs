//! The library's errors as Python exceptions. Their texts are those that the command prints, with its
//! flags as keywords.
//!
//! In: an error of the library. Out: `GarmentError` or `FabricError`, both of them `ValueError`s;
//! `OSError` where a file can't be written, `MemoryError` where cloth doesn't fit, and `ValueError`
//! for the rest.

use std::error::Error;
use std::io;

use pyo3::create_exception;
use pyo3::exceptions::{PyMemoryError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use warpknit::export::ExportError;
use warpknit::pipeline::RunError;
use warpknit::{fabric, garment};

create_exception!(
    warpknit,
    GarmentError,
    PyValueError,
    "A garment that can't be read or knitted. Its text names the file, the line and what to do."
);
create_exception!(
    warpknit,
    FabricError,
    PyValueError,
    "A fabric that can't be read or knitted. Its text names the file, the line and what to do."
);

/// A text of the command for Python: `--wales-per-cm` is `wales_per_cm`, but not in a command that is
/// quoted in backquotes.
pub(crate) fn with_keywords(text: &str) -> String {
    let text = text
        .replace("`warpknit fabrics`", "`Fabric.names()`")
        .replace("a file's name ends in .toml", "`Fabric.load` reads files")
        .replace(" with -o", "");
    let parts = text.split('`').enumerate().map(|(at, part)| match at % 2 {
        0 => part.split(' ').map(keyword).collect::<Vec<_>>().join(" "),
        _ => part.to_owned(),
    });
    parts.collect::<Vec<_>>().join("`")
}

/// A word that may be a flag, as a keyword.
fn keyword(word: &str) -> String {
    match word.trim_start_matches('(').strip_prefix("--") {
        Some(flag) if flag.starts_with(|letter: char| letter.is_ascii_lowercase()) => {
            word.replacen("--", "", 1).replace('-', "_")
        }
        _ => word.to_owned(),
    }
}

/// An error and its causes in one line.
pub(crate) fn line(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        text = format!("{text}: {cause}");
        next = cause.source();
    }
    with_keywords(&text)
}

/// The exception for an argument of a wrong type.
pub(crate) fn of_type(name: &str, given: &Bound<'_, PyAny>, wanted: &str) -> PyErr {
    match given.get_type().name() {
        Ok(kind) => PyTypeError::new_err(format!("{name} is of type {kind}, but must be {wanted}")),
        Err(error) => error,
    }
}

/// The exception for an error of a garment.
pub(crate) fn of_garment(error: &garment::GarmentError) -> PyErr {
    GarmentError::new_err(line(error))
}

/// The exception for an error in a fabric. `file` is the fabric file, if it is of one.
pub(crate) fn of_fabric(error: &fabric::FabricError, file: Option<&str>) -> PyErr {
    let text = with_keywords(&error.to_string());
    FabricError::new_err(match (file, &error.place) {
        (Some(file), Some(place)) => format!("{file}:{}: {text}", place.line),
        (Some(file), None) => format!("{file}: {text}"),
        (None, _) => text,
    })
}

/// The exception for an error of a run.
pub(crate) fn of_run(error: &RunError) -> PyErr {
    let text = line(error);
    match error {
        RunError::Garment(_) | RunError::NoYarn | RunError::TooLargeGarment { .. } => {
            GarmentError::new_err(text)
        }
        RunError::Fabric(_)
        | RunError::RunIn(_)
        | RunError::Layout { .. }
        | RunError::Enlarged { .. }
        | RunError::Maps(_)
        | RunError::MapsOfBar { .. } => FabricError::new_err(text),
        RunError::Export(error) => of_export(error),
        RunError::NoMemory { .. } => PyMemoryError::new_err(text),
        _ => PyValueError::new_err(text),
    }
}

/// The exception for an error of writing.
pub(crate) fn of_export(error: &ExportError) -> PyErr {
    match error {
        ExportError::Io { source, .. } => io::Error::new(source.kind(), line(error)).into(),
        _ => PyValueError::new_err(line(error)),
    }
}
