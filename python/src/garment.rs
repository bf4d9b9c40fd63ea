//! `warpknit.Garment`.
//!
//! In: the files that the command reads, or numpy arrays. Out: a garment that doesn't change.
//! Contiguous arrays of the right type are read where they lie.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec2, DVec3};
use numpy::{PyArrayLike2, PyReadonlyArray2, PyUntypedArrayMethods, TypeMustMatch};
use pyo3::prelude::*;
use warpknit::garment::{self, Panel, ReadOptions, Unit};
use warpknit::locate::covered::count_covered;
use warpknit::pipeline;

use crate::error::{self, GarmentError};
use crate::fabric::warn;

/// A garment: panels, flat and draped. It never changes.
///
/// Make one with `load` or `from_arrays`.
#[pyclass(frozen, module = "warpknit")]
pub(crate) struct Garment {
    pub(crate) garment: Arc<garment::Garment>,
    /// The files it was read from, which outputs must not overwrite.
    pub(crate) inputs: Vec<PathBuf>,
}

/// Positions, in whatever type numpy can turn into float64.
type Positions<'py> = PyArrayLike2<'py, f64, numpy::AllowTypeChange>;
/// Faces in the type that needs no conversion.
type Faces<'py> = PyArrayLike2<'py, u32, TypeMustMatch>;

#[pymethods]
impl Garment {
    /// Reads a garment: one file whose UV map is the flat pattern, or a flat and a draped file with
    /// the same faces.
    ///
    /// unit: of the draped file, "mm", "cm", "dm", "m" or "in". Guessed from the size by default.
    /// uv_scale: length of one flat unit, mm. Estimated from the areas by default.
    /// grain: angle by which the wales are turned on the panels, degrees counter-clockwise.
    /// turn: puts the technical face on the other side.
    /// allow_loss: accepts a garment of which over a tenth can't be knitted.
    ///
    /// Raises GarmentError, with the file, the line and what to do. Warns of what can't be knitted.
    #[staticmethod]
    #[pyo3(signature = (flat, draped=None, *, unit=None, uv_scale=None, grain=0.0, turn=false,
                        allow_loss=false))]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn load(
        py: Python<'_>,
        flat: PathBuf,
        draped: Option<PathBuf>,
        unit: Option<&str>,
        uv_scale: Option<f64>,
        grain: f64,
        turn: bool,
        allow_loss: bool,
    ) -> PyResult<Self> {
        let unit = unit.map(named_unit).transpose()?;
        let options = ReadOptions { unit, uv_scale, grain: grain.to_radians(), turn, allow_loss };
        let read = py.detach(|| pipeline::read_garment(&flat, draped.as_deref(), &options));
        let inputs = [Some(flat), draped].into_iter().flatten().collect();
        Self::new(py, read, inputs)
    }

    /// A garment from arrays: vertex i lies at flat[i] on the pattern and at draped[i] on the body.
    ///
    /// flat: (n, 2) float64, mm. draped: (n, 3) float64, mm. faces: (m, 3) indices of vertices.
    /// Faces that share no vertex belong to different panels. C-contiguous float64 positions and
    /// uint32 faces are read without a copy.
    ///
    /// unit: of draped. uv_scale: length of one unit of flat, mm; None estimates it panel by panel,
    /// as for a UV map. grain, turn: as of `load`.
    ///
    /// Raises GarmentError. Warns of what can't be knitted.
    #[staticmethod]
    #[pyo3(signature = (flat, draped, faces, *, unit="mm", uv_scale=Some(1.0), grain=0.0,
                        turn=false),
        text_signature = "(flat, draped, faces, *, unit='mm', uv_scale=1.0, grain=0.0, turn=False)")]
    #[expect(clippy::too_many_arguments, reason = "keywords of Python")]
    fn from_arrays(
        py: Python<'_>,
        flat: &Bound<'_, PyAny>,
        draped: &Bound<'_, PyAny>,
        faces: &Bound<'_, PyAny>,
        unit: &str,
        uv_scale: Option<f64>,
        grain: f64,
        turn: bool,
    ) -> PyResult<Self> {
        let (unit, grain) = (Some(named_unit(unit)?), grain.to_radians());
        let options = ReadOptions { unit, uv_scale, grain, turn, allow_loss: true };
        let (flat, draped) = (positions::<2>("flat", flat)?, positions::<3>("draped", draped)?);
        let (flat, draped) = (rows::<2>("flat", &flat)?, rows::<3>("draped", &draped)?);
        let direct: Option<Faces<'_>> = faces.extract().ok();
        let faces = match &direct {
            Some(faces) => triangles(faces)?,
            None => Cow::Owned(converted(faces)?),
        };
        let flat: &[DVec2] = bytemuck::cast_slice(&flat);
        let draped: &[DVec3] = bytemuck::cast_slice(&draped);
        let made = py.detach(|| {
            let mut garment = garment::Garment::from_arrays_with(flat, draped, &faces, &options)?;
            count_covered(&mut garment, Path::new("arrays"), options.allow_loss)?;
            Ok(garment)
        });
        Self::new(py, made, Vec::new())
    }

    /// Number of panels.
    #[getter]
    fn panels(&self) -> usize {
        self.garment.panels.len()
    }

    /// Number of triangles, usable or not.
    #[getter]
    fn triangles(&self) -> usize {
        self.garment.summary.triangles
    }

    /// Unit of the draped file, given or guessed.
    #[getter]
    fn unit(&self) -> &'static str {
        self.garment.summary.unit
    }

    /// Flat area that is knitted, cm².
    #[getter]
    fn area_cm2(&self) -> f64 {
        self.garment.panels.iter().map(Panel::area).sum::<f64>() / 100.0
    }

    /// Warnings of reading, one line each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.garment.summary.warnings.clone()
    }

    /// What reading mended, one line each.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.garment.summary.all_notes()
    }

    fn __repr__(&self) -> String {
        let (panels, area) = (self.panels(), self.area_cm2());
        format!("<warpknit.Garment of {panels} panels, {area:.0} cm²>")
    }
}

impl Garment {
    /// A garment as read, of whose faults the user is warned.
    fn new(
        py: Python<'_>,
        read: Result<garment::Garment, garment::GarmentError>,
        inputs: Vec<PathBuf>,
    ) -> PyResult<Self> {
        let garment = read.map_err(|error| error::of_garment(&error))?;
        for warning in &garment.summary.warnings {
            warn(py, warning)?;
        }
        Ok(Self { garment: Arc::new(garment), inputs })
    }
}

/// The unit of that name.
fn named_unit(name: &str) -> PyResult<Unit> {
    name.parse::<Unit>().map_err(|error| GarmentError::new_err(error.to_string()))
}

/// A table of numbers, of whatever array or list holds one.
fn positions<'py, const WIDTH: usize>(
    name: &str,
    array: &Bound<'py, PyAny>,
) -> PyResult<Positions<'py>> {
    array.extract().map_err(|_not_a_table| {
        GarmentError::new_err(format!(
            "the arrays hold no garment: {name} must be numbers in the shape (n, {WIDTH})"
        ))
    })
}

/// The numbers of an array of `WIDTH` columns, in place where it is contiguous.
fn rows<'a, const WIDTH: usize>(
    name: &str,
    array: &'a PyReadonlyArray2<'_, f64>,
) -> PyResult<Cow<'a, [f64]>> {
    let shape = array.shape();
    if shape[1] != WIDTH {
        return Err(GarmentError::new_err(format!(
            "the arrays hold no garment: {name} has the shape ({}, {}), but must have (n, {WIDTH})",
            shape[0], shape[1]
        )));
    }
    // `as_slice` also takes columns in a row: the memory order must be that of C.
    match array.as_slice() {
        Ok(slice) if array.is_c_contiguous() => Ok(Cow::Borrowed(slice)),
        _ => Ok(Cow::Owned(array.as_array().iter().copied().collect())),
    }
}

/// The triangles of a uint32 array, in place where it is contiguous.
fn triangles<'a>(array: &'a PyReadonlyArray2<'_, u32>) -> PyResult<Cow<'a, [[u32; 3]]>> {
    check_faces(array.shape())?;
    match array.as_slice() {
        Ok(slice) if array.is_c_contiguous() => Ok(Cow::Borrowed(bytemuck::cast_slice(slice))),
        _ => {
            let rows = array.as_array();
            Ok(Cow::Owned(rows.rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect()))
        }
    }
}

/// The triangles of any other array or list of whole numbers.
fn converted(faces: &Bound<'_, PyAny>) -> PyResult<Vec<[u32; 3]>> {
    // Without a change of type floats would be cut to whole numbers: numpy refuses that here.
    let numpy = faces.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (faces,))?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if kind != "i" && kind != "u" {
        return Err(GarmentError::new_err(
            "the arrays hold no garment: faces must be whole numbers, indices of vertices from 0",
        ));
    }
    let array: PyReadonlyArray2<'_, i64> =
        array.call_method1("astype", ("int64",))?.extract().map_err(|_not_two| face_shape(&[]))?;
    check_faces(array.shape())?;
    let index = |value: &i64| {
        u32::try_from(*value).map_err(|_range| {
            GarmentError::new_err(format!(
                "the arrays hold no garment: faces name vertex {value}: count vertices from 0"
            ))
        })
    };
    let rows = array.as_array();
    let rows = rows.rows().into_iter();
    rows.map(|row| Ok([index(&row[0])?, index(&row[1])?, index(&row[2])?])).collect()
}

fn check_faces(shape: &[usize]) -> PyResult<()> {
    if shape[1] == 3 { Ok(()) } else { Err(face_shape(shape)) }
}

fn face_shape(shape: &[usize]) -> PyErr {
    let found = shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    let not = if found.is_empty() { found } else { format!(", not ({found})") };
    GarmentError::new_err(format!(
        "the arrays hold no garment: faces must have the shape (m, 3){not}: triangulate the mesh"
    ))
}
