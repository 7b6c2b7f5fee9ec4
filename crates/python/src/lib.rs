//! The library for Python: the module `ventriform._native`, on which `python/ventriform` stands.
//!
//! In: paths, bytes and NumPy arrays; parameters by the names of the library's tables. Out: arrays, the bytes of files
//! as the command writes them, and reports as JSON. The part in Python (`python/ventriform`) makes these into objects
//! with names, types and units.
//!
//! 1. `values`: Python's values become parameters, and the tables of parameters become Python's.
//! 2. `errors`: a failure becomes an exception with field, reason and fix.
//! 3. `run`: work runs on threads of its own without the interpreter's lock, and ends when a signal arrives.
//! 4. `volumes`, `models`: volumes and models that Python holds.
//! 5. `given`, `files`: what work is given beside its parameters, and the files of its results.
//! 6. `fits`, `masks`, `cohorts`, `phantoms`: the commands; `figures`: what notebooks show of their reports.
//!
//! Guaranteed: no panic crosses the border, and files have the bytes that the command would write.

mod arrays;
mod cohorts;
mod errors;
mod figures;
mod files;
mod fits;
mod given;
mod masks;
mod models;
mod phantoms;
mod run;
mod values;
mod volumes;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::cohorts::{build_normals, calibrate, evaluate};
    #[pymodule_export]
    use super::figures::headlines;
    #[pymodule_export]
    use super::fits::{beat, compare, segment, serial_comparison};
    #[pymodule_export]
    use super::masks::measure;
    #[pymodule_export]
    use super::models::{NativeModel, generate};
    #[pymodule_export]
    use super::phantoms::phantom;
    #[pymodule_export]
    use super::values::parameter_tables;
    #[pymodule_export]
    use super::volumes::{NativeVolume, reconstruct};
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
