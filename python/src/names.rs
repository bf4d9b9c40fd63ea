//! Words that Python users write, such as `"front"`, as the library's types.
//!
//! In: a word. Out: the variant that the command's flag of that name means, or an error that lists
//! the words.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use warpknit::drape::strands::Edge;
use warpknit::map::Mapping;
use warpknit::render::View;
use warpknit::render::scene::Shape;

const MAPPINGS: [(&str, Mapping); 3] =
    [("relaxed", Mapping::Relaxed), ("smooth", Mapping::Smooth), ("frame", Mapping::Frame)];
const EDGES: [(&str, Edge); 2] = [("clip", Edge::Clip), ("drop", Edge::Drop)];
const VIEWS: [(&str, View); 6] = [
    ("front", View::Front),
    ("back", View::Back),
    ("left", View::Left),
    ("right", View::Right),
    ("top", View::Top),
    ("iso", View::Iso),
];
const SHAPES: [(&str, Shape); 2] = [("tube", Shape::Tube), ("ribbon", Shape::Ribbon)];

/// The mapping of that name.
pub(crate) fn mapping(name: &str) -> PyResult<Mapping> {
    find("mapping", name, &MAPPINGS)
}

/// The treatment of panels' edges of that name.
pub(crate) fn edge(name: &str) -> PyResult<Edge> {
    find("edge", name, &EDGES)
}

/// The view of that name.
pub(crate) fn view(name: &str) -> PyResult<View> {
    find("view", name, &VIEWS)
}

/// The shape of that name.
pub(crate) fn shape(name: &str) -> PyResult<Shape> {
    find("shape", name, &SHAPES)
}

fn find<T: Copy>(what: &str, name: &str, known: &[(&str, T)]) -> PyResult<T> {
    let found = known.iter().find(|(word, _)| *word == name);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let words: Vec<_> = known.iter().map(|(word, _)| *word).collect();
        PyValueError::new_err(format!("there is no {what} {name:?}: use {}", words.join(", ")))
    })
}
