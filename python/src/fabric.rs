//! `warpknit.Fabric`.
//!
//! In: a built-in name, chains, or a fabric file. Out: a checked fabric that doesn't change.

use std::ffi::CString;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::path::PathBuf;

use pyo3::exceptions::{PyTypeError, PyUserWarning};
use pyo3::prelude::*;
use pyo3::types::PyType;
use warpknit::fabric::yarn::Count;
use warpknit::fabric::{self, builtin};
use warpknit::pipeline::Densities;

use crate::error::{self, FabricError};

/// The fabric of which chains take the bars, as the command's `--lapping` does.
const BASE: &str = "tricot";

/// A fabric: its bars or feeders, their yarns, and its densities. It never changes.
///
/// Make one with `named`, `from_chains`, `load` or `parse`.
#[pyclass(frozen, module = "warpknit", eq)]
#[derive(Clone, PartialEq)]
pub(crate) struct Fabric {
    pub(crate) fabric: fabric::Fabric,
}

/// One text, or a list of one for each bar, front first.
struct Texts(Vec<String>);

impl FromPyObject<'_, '_> for Texts {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        if let Ok(text) = given.extract::<String>() {
            return Ok(Self(vec![text]));
        }
        let Ok(texts) = given.extract::<Vec<String>>() else {
            return Err(PyTypeError::new_err(
                "must be a text, or a list of texts with one for each bar",
            ));
        };
        Ok(Self(texts))
    }
}

/// The fabric that a user has given: a `Fabric`, or the name of a built-in one.
///
/// # Errors
/// `FabricError` if there is none of that name, `TypeError` for anything else.
pub(crate) fn given(fabric: &Bound<'_, PyAny>) -> PyResult<fabric::Fabric> {
    if let Ok(fabric) = fabric.cast::<Fabric>() {
        return Ok(fabric.get().fabric.clone());
    }
    let Ok(name) = fabric.extract::<String>() else {
        return Err(error::of_type("fabric", fabric, "a Fabric or the name of a built-in one"));
    };
    fabric::Fabric::named(&name).map_err(|error| error::of_fabric(&error, None))
}

/// Warns the Python user in the words of the command, with keywords for its flags.
pub(crate) fn warn(py: Python<'_>, text: &str) -> PyResult<()> {
    let text = error::with_keywords(text);
    // Texts have no zero bytes. One that had would lose what stands behind it.
    let text = CString::new(text.split('\0').next().unwrap_or_default())?;
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)
}

#[pymethods]
impl Fabric {
    /// The built-in fabric of that name, such as "locknit". `Fabric.names()` lists them.
    ///
    /// Raises FabricError if there is none.
    #[staticmethod]
    fn named(name: &str) -> PyResult<Self> {
        let fabric = fabric::Fabric::named(name).map_err(|error| error::of_fabric(&error, None))?;
        Ok(Self { fabric })
    }

    /// The names of all built-in fabrics.
    #[staticmethod]
    fn names() -> Vec<&'static str> {
        builtin::names().collect()
    }

    /// A warp knit of these chains, front bar first: Fabric.from_chains(["2-3/1-0//", "1-0/1-2//"]).
    /// One text is the chain of a single bar, or has " + " between those of several.
    ///
    /// threading: marks such as "I." for all bars, or a list of one for each bar. Full by default.
    /// yarn: a count such as "44 dtex", "20 den", "4.4 tex" or "40 Nm", or a list of one for each
    ///     bar. Where no densities are given, they follow the diameter of the thickest yarn.
    /// wales_per_cm, courses_per_cm: densities of the finished cloth. One alone scales the other.
    ///
    /// Raises FabricError. Warns if yarns and densities don't fit.
    #[staticmethod]
    #[pyo3(signature = (chains, threading=None, yarn=Texts(vec!["44 dtex".to_owned()]), *,
                        wales_per_cm=None, courses_per_cm=None),
           text_signature = "(chains, threading=None, yarn='44 dtex', *, wales_per_cm=None, courses_per_cm=None)")]
    fn from_chains(
        py: Python<'_>,
        chains: Texts,
        threading: Option<Texts>,
        yarn: Texts,
        wales_per_cm: Option<f64>,
        courses_per_cm: Option<f64>,
    ) -> PyResult<Self> {
        let Texts(chains) = chains;
        if chains.is_empty() {
            return Err(FabricError::new_err(
                "there are no chains: give one for each guide bar, such as \"1-0/1-2//\"",
            ));
        }
        let refuse = |error| error::of_fabric(&error, None);
        let counts = yarn.0.iter().map(|text| text.parse::<Count>()).collect::<Result<Vec<_>, _>>();
        let counts = counts.map_err(|error| FabricError::new_err(error.to_string()))?;
        let threadings = threading.map_or_else(Vec::new, |threading| threading.0);
        let base = fabric::Fabric::named(BASE).map_err(refuse)?;
        let knit = base.with_chains(&chains, &threadings).map_err(refuse)?;
        let bars = knit.yarn_systems();
        if threadings.len() > bars {
            return Err(FabricError::new_err(format!(
                "threading has {} marks for {bars} chains: give one for each chain, or one for all",
                threadings.len()
            )));
        }
        let densities = Densities { wales_per_cm, courses_per_cm };
        let (fabric, misfit) = densities.of_counts(knit, &counts).map_err(refuse)?;
        if let Some(misfit) = misfit {
            warn(py, &misfit)?;
        }
        Ok(Self { fabric })
    }

    /// The fabric of a TOML file, as `warpknit fabrics NAME` prints them.
    ///
    /// Raises FabricError, with the file's line.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        let name = path.display().to_string();
        let fabric = fabric::Fabric::read(&path);
        let fabric = fabric.map_err(|error| error::of_fabric(&error, Some(&name)))?;
        Ok(Self { fabric })
    }

    /// The fabric of a TOML text: Fabric.parse(fabric.to_toml()) == fabric.
    #[staticmethod]
    fn parse(text: &str) -> PyResult<Self> {
        let fabric = fabric::Fabric::parse(text);
        let fabric = fabric.map_err(|error| error::of_fabric(&error, Some("text")))?;
        Ok(Self { fabric })
    }

    /// The same yarns at other densities, enlarged in proportion to the wale spacing: for cloth
    /// whose loops are to be seen. One density alone scales the other.
    #[pyo3(signature = (wales_per_cm=None, courses_per_cm=None))]
    fn at_densities(
        &self,
        wales_per_cm: Option<f64>,
        courses_per_cm: Option<f64>,
    ) -> PyResult<Self> {
        let fabric = Densities { wales_per_cm, courses_per_cm }.of_fabric(self.fabric.clone());
        let fabric = fabric.map_err(|error| error::of_fabric(&error, None))?;
        Ok(Self { fabric })
    }

    /// Equal fabrics have equal hashes.
    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.fabric.to_string().hash(&mut hasher);
        hasher.finish()
    }

    /// The fabric as TOML, to be edited and read again.
    fn to_toml(&self) -> String {
        self.fabric.to_string()
    }

    /// Its name.
    #[getter]
    fn name(&self) -> &str {
        &self.fabric.name
    }

    /// One line about it.
    #[getter]
    fn about(&self) -> &str {
        &self.fabric.about
    }

    /// Wales per cm.
    #[getter]
    fn wales_per_cm(&self) -> f64 {
        self.fabric.wales_per_cm
    }

    /// Courses per cm.
    #[getter]
    fn courses_per_cm(&self) -> f64 {
        self.fabric.courses_per_cm
    }

    /// The chain of each bar, or the course of each feeder, front first.
    #[getter]
    fn lappings(&self) -> Vec<String> {
        (0..self.fabric.yarn_systems()).map(|system| self.fabric.lapping(system)).collect()
    }

    /// The colour of each bar's yarn, "#rrggbb", front first.
    #[getter]
    fn colors(&self) -> Vec<String> {
        self.fabric.yarns().map(|yarn| yarn.color.to_string()).collect()
    }

    /// Warnings about the lapping, one line each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.fabric.warnings()
    }

    fn __repr__(&self) -> String {
        let fabric::Fabric { name, wales_per_cm, courses_per_cm, .. } = &self.fabric;
        format!("<warpknit.Fabric {name:?}, {wales_per_cm:.2} x {courses_per_cm:.2} per cm>")
    }

    /// Pickles by its TOML, so that a fabric can be sent to other processes.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<(Py<PyAny>, (String, f64))> {
        let kind: Bound<'_, PyType> = slf.get_type();
        let fabric = &slf.get().fabric;
        Ok((kind.getattr("_from_toml")?.unbind(), (fabric.to_string(), fabric.enlargement)))
    }

    #[staticmethod]
    fn _from_toml(text: &str, enlargement: f64) -> PyResult<Self> {
        let mut fabric = Self::parse(text)?;
        fabric.fabric.enlargement = enlargement;
        Ok(fabric)
    }
}
