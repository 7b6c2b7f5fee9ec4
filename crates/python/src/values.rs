//! Python's values as parameters, and the tables of parameters for Python.

use crate::errors::{exception, refused};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString};
use serde_json::{Map, Number, Value};
use ventriform::parameters::{
    BEAT_SPECS, BeatChoice, BesideFit, COMPARISON_SPECS, CalibrationChoice, ComparisonChoice,
    FIT_SPECS, Kind, MODEL_SPECS, NORMALS_SPECS, NormalsChoice, ParameterError, ParameterSpec,
    Parameters, RECONSTRUCTION_SPECS, SERIAL_SPECS, SerialChoice, WithFit,
};
use ventriform::runs::advice::Explain;

/// Most numbers that a value may have: a box has six.
const MOST_NUMBERS: usize = 64;

/// Parameters by name, as JSON. Those that are `None` are left out.
pub fn given(parameters: &Bound<'_, PyDict>) -> PyResult<Map<String, Value>> {
    let mut map = Map::new();
    for (name, value) in parameters {
        if value.is_none() {
            continue;
        }
        let name: String = name.extract()?;
        let value = to_json(&name, &value)?;
        map.insert(name, value);
    }
    Ok(map)
}

/// The parameters of one table.
pub fn table<P: Parameters>(parameters: &Bound<'_, PyDict>) -> PyResult<P> {
    checked(parameters, P::from_json)
}

/// The parameters of work with a fit.
pub fn with_fit<C: BesideFit>(parameters: &Bound<'_, PyDict>) -> PyResult<WithFit<C>> {
    checked(parameters, WithFit::from_json)
}

fn checked<T>(
    parameters: &Bound<'_, PyDict>,
    check: impl Fn(&Map<String, Value>) -> Result<T, ParameterError>,
) -> PyResult<T> {
    check(&given(parameters)?).map_err(|error| exception(parameters.py(), &error.explain()))
}

fn to_json(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Value> {
    let py = value.py();
    let refuse = |reason: String| {
        let fix = "Give a number, a word, true or false, or a sequence of numbers.";
        exception(py, &refused(name, reason, fix))
    };
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(Value::String(text.extract()?));
    }
    if value.is_instance_of::<PyBool>() {
        return Ok(Value::Bool(value.extract()?));
    }
    // NumPy's true is no bool of Python.
    if ["bool", "bool_"].contains(&&*value.get_type().name()?.to_string()) {
        return Ok(Value::Bool(value.is_truthy()?));
    }
    if let Some(number) = number(value)? {
        return Ok(number);
    }
    let Ok(items) = value.try_iter() else {
        return Err(refuse(format!(
            "`{name}` is a {}",
            value.get_type().name()?
        )));
    };
    let mut numbers = Vec::new();
    for item in items {
        let item = item?;
        match number(&item)? {
            Some(number) if numbers.len() < MOST_NUMBERS => numbers.push(number),
            Some(_) => {
                return Err(refuse(format!(
                    "`{name}` has more than {MOST_NUMBERS} numbers"
                )));
            }
            None => {
                return Err(refuse(format!(
                    "`{name}` holds a {}",
                    item.get_type().name()?
                )));
            }
        }
    }
    Ok(Value::Array(numbers))
}

/// A number as JSON; `None` for values that are none. Numbers that no JSON has become words, which no range holds.
fn number(value: &Bound<'_, PyAny>) -> PyResult<Option<Value>> {
    // Arrays of one number are sequences.
    let has = |method: &str| Ok::<_, PyErr>(value.hasattr(method)? && !value.hasattr("__len__")?);
    if value.is_instance_of::<PyInt>() || has("__index__")? {
        let whole = value.extract::<i64>().map(Value::from);
        let whole = whole.or_else(|_| value.extract::<u64>().map(Value::from));
        let beyond = || Ok(Value::String(value.str()?.extract()?));
        return whole.or_else(|_: PyErr| beyond()).map(Some);
    }
    if value.is_instance_of::<PyFloat>() || has("__float__")? {
        let x: f64 = value.extract()?;
        let finite = Number::from_f64(x).map(Value::Number);
        return Ok(Some(finite.unwrap_or_else(|| Value::String(x.to_string()))));
    }
    Ok(None)
}

/// For each command with a table its rows: name, kind, default and help.
#[pyfunction]
pub fn parameter_tables(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let tables = PyDict::new(py);
    tables.set_item("generate", rows(py, MODEL_SPECS)?)?;
    tables.set_item("segment", rows(py, FIT_SPECS)?)?;
    tables.set_item("reconstruct", rows(py, RECONSTRUCTION_SPECS)?)?;
    let calibrate = rows(py, WithFit::<CalibrationChoice>::fit_specs())?;
    tables.set_item("calibrate", calibrate)?;
    let beat = rows(py, BEAT_SPECS)?;
    extend(&beat, &rows(py, WithFit::<BeatChoice>::fit_specs())?)?;
    tables.set_item("beat", beat)?;
    let compare = rows(py, COMPARISON_SPECS)?;
    extend(
        &compare,
        &rows(py, WithFit::<ComparisonChoice>::fit_specs())?,
    )?;
    tables.set_item("compare", compare)?;
    let serial = rows(py, SERIAL_SPECS)?;
    extend(&serial, &rows(py, WithFit::<SerialChoice>::fit_specs())?)?;
    tables.set_item("serial", serial)?;
    let normals = rows(py, NORMALS_SPECS)?;
    extend(&normals, &rows(py, WithFit::<NormalsChoice>::fit_specs())?)?;
    tables.set_item("normals", normals)?;
    Ok(tables)
}

fn extend(list: &Bound<'_, PyList>, more: &Bound<'_, PyList>) -> PyResult<()> {
    more.iter().try_for_each(|row| list.append(row))
}

/// The rows of a table, without ids of what a service stores.
fn rows<'py, P: Parameters>(
    py: Python<'py>,
    specs: impl IntoIterator<Item = &'static ParameterSpec<P>>,
) -> PyResult<Bound<'py, PyList>> {
    let list = PyList::empty(py);
    for spec in specs {
        let row = PyDict::new(py);
        row.set_item("name", spec.name)?;
        row.set_item("default", spec.default)?;
        row.set_item("summary", spec.summary)?;
        match spec.kind {
            Kind::Stored { .. } => continue,
            Kind::Integer { min, max } => {
                row.set_item("kind", "integer")?;
                row.set_item("range", (min, max))?;
            }
            Kind::Number { min, max } => {
                row.set_item("kind", "number")?;
                row.set_item("range", (min, max))?;
            }
            Kind::Switch => row.set_item("kind", "switch")?,
            Kind::Choice(words) => {
                row.set_item("kind", "choice")?;
                row.set_item("words", words)?;
            }
            Kind::Direction(words) => {
                row.set_item("kind", "direction")?;
                row.set_item("words", words)?;
            }
            Kind::Integers { count } => {
                row.set_item("kind", "integers")?;
                row.set_item("count", count)?;
            }
            Kind::Numbers { count } => {
                row.set_item("kind", "numbers")?;
                row.set_item("count", count)?;
            }
            Kind::Points { most } => {
                row.set_item("kind", "points")?;
                row.set_item("most", most)?;
            }
            Kind::Text { example, .. } => {
                row.set_item("kind", "text")?;
                row.set_item("example", example)?;
            }
        }
        list.append(row)?;
    }
    Ok(list)
}
