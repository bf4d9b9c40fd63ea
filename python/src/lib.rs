//! The Python package `warpknit`: the library's garments, fabrics and yarns as Python classes.
//!
//! In: files, names and numpy arrays. Out: numpy arrays, files and pictures, made by the facade
//! crate `warpknit`; nothing is computed here. Arrays that Rust made are handed to numpy as they
//! are, without a copy, and can't be written to. The interpreter's lock is released during all
//! work of more than some milliseconds.
//!
//! Not promised: work that ends at once on Ctrl-C. A drape looks for it between blocks of yarns.

mod error;
mod fabric;
mod garment;
mod laid;
mod names;
mod picture;
mod run;
mod work;
mod yarns;

use pyo3::prelude::*;

/// Knits warp-knit fabric, yarn by yarn, onto a garment. Lengths are in mm.
#[pymodule]
fn _warpknit(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("__version__", warpknit::VERSION)?;
    module.add("GarmentError", py.get_type::<error::GarmentError>())?;
    module.add("FabricError", py.get_type::<error::FabricError>())?;
    module.add_class::<fabric::Fabric>()?;
    module.add_class::<garment::Garment>()?;
    module.add_class::<yarns::Yarns>()?;
    module.add_function(wrap_pyfunction!(run::drape, module)?)?;
    module.add_function(wrap_pyfunction!(run::swatch, module)?)?;
    Ok(())
}
