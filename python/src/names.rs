//! Words that Python users write, such as `"front"`, as the library's types.
//!
//! In: a word. Out: the variant that the command's flag of that name means, or an error that lists
//! the words.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use warpknit::drape::strands::Edge;
use warpknit::export::glb::{Nodes, Precision};
use warpknit::export::{FileUnit, InpDialect, UpAxis, UsdCurves};
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
const FILE_UNITS: [(&str, FileUnit); 3] =
    [("mm", FileUnit::Mm), ("cm", FileUnit::Cm), ("m", FileUnit::M)];
const UPS: [(&str, UpAxis); 2] = [("y", UpAxis::Y), ("z", UpAxis::Z)];
const USD_CURVES: [(&str, UsdCurves); 2] =
    [("bezier", UsdCurves::Bezier), ("linear", UsdCurves::Linear)];
const INPS: [(&str, InpDialect); 2] =
    [("calculix", InpDialect::Calculix), ("abaqus", InpDialect::Abaqus)];
const GLB_PRECISIONS: [(&str, Precision); 2] =
    [("u16", Precision::Quantised), ("f32", Precision::F32)];
const NODES: [(&str, Nodes); 2] = [("bar", Nodes::Bar), ("yarn", Nodes::Yarn)];
const NPZ_PRECISIONS: [(&str, bool); 2] = [("f64", false), ("f32", true)];

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

/// The unit of `.ply` and `.obj` of that name.
pub(crate) fn file_unit(name: &str) -> PyResult<FileUnit> {
    find("file_unit", name, &FILE_UNITS)
}

/// The upright axis of that name.
pub(crate) fn up(name: &str) -> PyResult<UpAxis> {
    find("axis up", name, &UPS)
}

/// The curves of USD of that name.
pub(crate) fn usd_curves(name: &str) -> PyResult<UsdCurves> {
    find("usd_curves", name, &USD_CURVES)
}

/// The keywords of `.inp` of that name.
pub(crate) fn inp(name: &str) -> PyResult<InpDialect> {
    find("inp", name, &INPS)
}

/// The numbers of a `.glb` of that name.
pub(crate) fn glb_precision(name: &str) -> PyResult<Precision> {
    find("glb_precision", name, &GLB_PRECISIONS)
}

/// What has a node in a `.glb`, by its name.
pub(crate) fn nodes(name: &str) -> PyResult<Nodes> {
    find("nodes", name, &NODES)
}

/// Whether floats of an `.npz` of that name have 32 bits.
pub(crate) fn npz_is_single(name: &str) -> PyResult<bool> {
    find("npz_precision", name, &NPZ_PRECISIONS)
}

fn find<T: Copy>(what: &str, name: &str, known: &[(&str, T)]) -> PyResult<T> {
    let found = known.iter().find(|(word, _)| *word == name);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let words: Vec<_> = known.iter().map(|(word, _)| *word).collect();
        PyValueError::new_err(format!("there is no {what} {name:?}: use {}", words.join(", ")))
    })
}
