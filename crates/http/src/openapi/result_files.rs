//! The files of results: each kind has one path `.../{file}`.
//!
//! In: the collected operations, and the names of files as the schema of the parameter `file`. Out: each such operation
//! has
//!
//! 1. `x-files`: of every name what the file is, when it exists, its media type, its schema, and the query parameters
//!    that it takes. `NN` in a name stands for the number of a gate or of a scan, counted from 01.
//! 2. In its answer 200 every media type, with the schemas that are sent under it. Bytes come first: generators of
//!    clients read an answer by its first media type, and all files can be read as bytes.

use crate::resources::files::REPORT_PAGE;
use serde_json::{Map, Value, json};
use ventriform::results::export::dicom::DicomObject;
use ventriform::results::export::fhir::{FHIR_FILE, FHIR_MEDIA_TYPE};
use ventriform::results::export::{Format, seg_nrrd};

/// What is known of files of a kind of result.
struct FileRow {
    /// A name, or a name up to its extension and `.*`.
    names: &'static str,
    /// What the file is.
    description: &'static str,
    /// When a result has it.
    exists: &'static str,
}

const fn row(names: &'static str, description: &'static str, exists: &'static str) -> FileRow {
    FileRow {
        names,
        description,
        exists,
    }
}

const ALWAYS: &str = "always";
const OF_VENTRICLES: &str = "of a left ventricle";
const WITH_LIMITS: &str = "of a left ventricle, with normal limits";
const WITH_STORED_SCAN: &str =
    "made on request, while the volume is stored and it is known whose scan it is";
const STORED_VENTRICLES: &str = "made on request of a left ventricle, while the volume is stored and it is known whose scan it is";
const PAGE: &str = "The report as an HTML page, made on request; it names patient, study and series as far as the key may see them";
const GATE: &str = "of every gate";
const FHIR: FileRow = row(
    FHIR_FILE,
    "The structured report as FHIR R4: a Bundle with a DiagnosticReport and its Observations",
    WITH_STORED_SCAN,
);

const OF_COMPARISON: &str = "of a comparison";
const OF_SEGMENTATION: &str = "of a segmentation";
const OF_BEAT: &str = "of a beat";

const READING_FILES: &[FileRow] = &[
    row("reading.json", "The reading", ALWAYS),
    row(
        REPORT_PAGE,
        "The reading as an HTML page, made on request; it names patient, study and series as far as the key may see them",
        ALWAYS,
    ),
    row("comparison.json", "The report that was read", OF_COMPARISON),
    row("report.json", "The report that was read", OF_SEGMENTATION),
    row("beat.json", "The report that was read", OF_BEAT),
    row("mask.nii.gz", "The mask that was read", OF_SEGMENTATION),
    row("mesh.json", "The mesh that was read", OF_SEGMENTATION),
    row("slices.png", "Slices", "of a comparison or a segmentation"),
    row("polar_stress.svg", "The polar map at stress", OF_COMPARISON),
    row("polar_rest.svg", "The polar map at rest", OF_COMPARISON),
    row("polar_difference.svg", "Rest less stress", OF_COMPARISON),
    row("polar.svg", "The polar map", "of a segmentation or a beat"),
    row("polar_motion.svg", "Motion", OF_BEAT),
    row("polar_thickening.svg", "Thickening", OF_BEAT),
    row("polar_phase.svg", "Phase", OF_BEAT),
    row("curve.svg", "The volume curve", OF_BEAT),
    row(
        "measurements.dcm",
        "Comprehensive 3D SR: the figures that were read, the scores and the impression, verified",
        WITH_STORED_SCAN,
    ),
    FHIR,
];

const SCAN: &str = "of every scan";
const PAIR: &str = "of every scan with the first one, and with the one before it";

const MODEL_FILES: &[FileRow] = &[
    row("mesh.*", "The surface", ALWAYS),
    row("report.json", "The figures of the model", ALWAYS),
    row(REPORT_PAGE, PAGE, ALWAYS),
    row(
        "distance.json",
        "Signed distances of the model's vertices and triangles to the surface of the object",
        ALWAYS,
    ),
    row(
        "mask.dcm",
        "Segmentation: the voxels inside the model",
        WITH_STORED_SCAN,
    ),
    row(
        "contours.dcm",
        "RT Structure Set: the model in the planes of the slices",
        WITH_STORED_SCAN,
    ),
    row("mesh.dcm", "Encapsulated STL: the model", WITH_STORED_SCAN),
    row(
        "surface.dcm",
        "Surface Segmentation: points, normals and triangles",
        WITH_STORED_SCAN,
    ),
];

const SEGMENTATION_FILES: &[FileRow] = &[
    row(
        "mask.nii.gz",
        "The mask of the wall, on the volume's grid",
        ALWAYS,
    ),
    row(
        "mask_anatomical.nii.gz",
        "The mask of the anatomical wall",
        "of a left ventricle whose `edge` is `apparent`",
    ),
    row(
        "mask_apparent.nii.gz",
        "The mask of the apparent wall",
        "of a left ventricle whose `edge` is `anatomical`",
    ),
    row("labels.nii.gz", "The wall as 1, the cavity as 2", ALWAYS),
    row(
        "labels.seg.nrrd",
        "The same with names and colours, for 3D Slicer",
        ALWAYS,
    ),
    row("mesh.*", "The fitted wall", ALWAYS),
    row(
        "mesh_anatomical.*",
        "The anatomical wall",
        "of a left ventricle whose `edge` is `apparent`",
    ),
    row(
        "mesh_apparent.*",
        "The apparent wall",
        "of a left ventricle whose `edge` is `anatomical`",
    ),
    row("report.json", "The figures of the fit", ALWAYS),
    row(REPORT_PAGE, PAGE, ALWAYS),
    row(
        "slices.png",
        "Three slices with the contour of the fit",
        ALWAYS,
    ),
    row(
        "projections.png",
        "Two views, the sinogram and the linogram of raw projections",
        "of a left ventricle fitted to raw projections",
    ),
    row(
        "region.nii.gz",
        "The scan about the organ, in 256 steps",
        ALWAYS,
    ),
    row("polar.*", "The polar map of uptake", OF_VENTRICLES),
    row(
        "polar_z.*",
        "The polar map of deviations from the normal mean",
        WITH_LIMITS,
    ),
    row(
        "polar_score.*",
        "The polar map of scores, 0 to 4",
        WITH_LIMITS,
    ),
    row(
        "mask.dcm",
        "Segmentation: wall and cavity",
        WITH_STORED_SCAN,
    ),
    row(
        "contours.dcm",
        "RT Structure Set: the fit in the planes of the slices",
        WITH_STORED_SCAN,
    ),
    row(
        "mesh.dcm",
        "Encapsulated STL: the fitted wall",
        WITH_STORED_SCAN,
    ),
    row(
        "surface.dcm",
        "Surface Segmentation: points, normals and triangles",
        WITH_STORED_SCAN,
    ),
    row(
        "measurements.dcm",
        "Comprehensive 3D SR: the figures of `report.json`",
        WITH_STORED_SCAN,
    ),
    FHIR,
    row(
        "polar.dcm",
        "Secondary Capture: the polar map",
        STORED_VENTRICLES,
    ),
    row(
        "page.dcm",
        "Secondary Capture: the report as one picture",
        WITH_STORED_SCAN,
    ),
];

const BEAT_FILES: &[FileRow] = &[
    row("beat.json", "The report", ALWAYS),
    row(REPORT_PAGE, PAGE, ALWAYS),
    row("curve.svg", "The volume curve", ALWAYS),
    row("phase.svg", "The histogram of the wall's phases", ALWAYS),
    row("gates.csv", "The figures of every gate", ALWAYS),
    row("segments.csv", "The figures of every segment", ALWAYS),
    row(
        "polar.*",
        "The polar map of uptake, of the sum of the gates",
        ALWAYS,
    ),
    row(
        "polar_ed.*",
        "The polar map of uptake at end diastole",
        ALWAYS,
    ),
    row(
        "polar_es.*",
        "The polar map of uptake at end systole",
        ALWAYS,
    ),
    row("polar_motion.*", "The polar map of wall motion", ALWAYS),
    row("polar_thickening.*", "The polar map of thickening", ALWAYS),
    row("polar_phase.*", "The polar map of phase", ALWAYS),
    row(
        "polar_z.*",
        "The polar map of deviations from the normal mean",
        "with normal limits",
    ),
    row(
        "polar_score.*",
        "The polar map of scores, 0 to 4",
        "with normal limits",
    ),
    row("mesh.glb", "The beat as an animation", ALWAYS),
    row("mesh_ed.*", "The wall at end diastole", ALWAYS),
    row("mesh_es.*", "The wall at end systole", ALWAYS),
    row(
        "mesh_gateNN.*",
        "The wall in gate NN; all meshes of a beat have the same nodes and triangles",
        GATE,
    ),
    row(
        "labels_gateNN.nii.gz",
        "The wall as 1, the cavity as 2, in gate NN",
        GATE,
    ),
    row(
        "mask_ed.dcm",
        "Segmentation: wall and cavity at end diastole",
        WITH_STORED_SCAN,
    ),
    row(
        "mask_es.dcm",
        "Segmentation: wall and cavity at end systole",
        WITH_STORED_SCAN,
    ),
    row(
        "measurements.dcm",
        "Comprehensive 3D SR: the figures of `beat.json`",
        WITH_STORED_SCAN,
    ),
    FHIR,
];

const COMPARISON_FILES: &[FileRow] = &[
    row("comparison.json", "The report", ALWAYS),
    row(
        REPORT_PAGE,
        "The report as an HTML page, made on request; it names patient, study and series of the scan at stress as far as the key may see them",
        ALWAYS,
    ),
    row("slices.png", "Slices of stress above those of rest", ALWAYS),
    row("segments.csv", "The figures of every segment", ALWAYS),
    row(
        "polar_stress.*",
        "The polar map of uptake at stress",
        ALWAYS,
    ),
    row("polar_rest.*", "The polar map of uptake at rest", ALWAYS),
    row(
        "polar_difference.*",
        "The polar map of the difference",
        ALWAYS,
    ),
    row(
        "polar_z_stress.*",
        "Deviations from the normal mean at stress",
        "with normal limits",
    ),
    row(
        "polar_z_rest.*",
        "Deviations from the normal mean at rest",
        "with normal limits",
    ),
    row(
        "polar_score_stress.*",
        "Scores at stress, 0 to 4",
        "with normal limits",
    ),
    row(
        "polar_score_rest.*",
        "Scores at rest, 0 to 4",
        "with normal limits",
    ),
    row("mesh_stress.*", "The wall at stress", ALWAYS),
    row("mesh_rest.*", "The wall at rest", ALWAYS),
    row(
        "region_stress.nii.gz",
        "The image about the heart at stress, in 256 steps",
        ALWAYS,
    ),
    row(
        "region_rest.nii.gz",
        "The image about the heart at rest, in 256 steps",
        ALWAYS,
    ),
    row(
        "measurements.dcm",
        "Comprehensive 3D SR: the figures of `comparison.json`",
        WITH_STORED_SCAN,
    ),
    FHIR,
    row(
        "page.dcm",
        "Secondary Capture: the report as one picture",
        WITH_STORED_SCAN,
    ),
    row(
        "polar_stress.dcm",
        "Secondary Capture: the polar map at stress",
        WITH_STORED_SCAN,
    ),
    row(
        "polar_rest.dcm",
        "Secondary Capture: the polar map at rest",
        WITH_STORED_SCAN,
    ),
    row(
        "polar_difference.dcm",
        "Secondary Capture: the polar map of the difference",
        WITH_STORED_SCAN,
    ),
];

const SERIAL_FILES: &[FileRow] = &[
    row("serial.json", "The report", ALWAYS),
    row(
        REPORT_PAGE,
        "The report as an HTML page, made on request; it names patient, study and series of the first scan, and the dates of all, as far as the key may see them",
        ALWAYS,
    ),
    row("trend.svg", "The figures of all scans, drawn", ALWAYS),
    row("figures.csv", "The figures of all scans", ALWAYS),
    row("changes.csv", "What changed between scans", ALWAYS),
    row(
        "segments.csv",
        "The segments in every pair of scans",
        ALWAYS,
    ),
    row("mesh_scan01.*", "The wall in the first scan", ALWAYS),
    row("mesh_scanNN.*", "The wall in scan NN", SCAN),
    row(
        "polar_scanNN.svg",
        "The polar map of uptake in scan NN, drawn",
        SCAN,
    ),
    row("polar_scanNN.png", "The same as pixels", SCAN),
    row("polar_scanNN.json", "The same as numbers", SCAN),
    row(
        "region_scanNN.nii.gz",
        "The image about the heart in scan NN, in 256 steps",
        SCAN,
    ),
    row(
        "polar_change_NN_NN.svg",
        "The polar map of the change between two scans, earlier less later, drawn",
        PAIR,
    ),
    row("polar_change_NN_NN.png", "The same as pixels", PAIR),
    row("polar_change_NN_NN.json", "The same as numbers", PAIR),
    row(
        "measurements.dcm",
        "Comprehensive 3D SR: the figures of every scan and what changed",
        WITH_STORED_SCAN,
    ),
    FHIR,
];

const NORMALS_FILES: &[FileRow] = &[row(
    "normals.json",
    "The limits, as `ventriform segment --normals` takes them",
    ALWAYS,
)];

const READER_FILES: &[FileRow] = &[row(
    "profile.json",
    "The profile, as `ventriform segment --reader` takes it",
    ALWAYS,
)];

const TEMPLATE_FILES: &[FileRow] = &[row("mesh.*", "The mesh", ALWAYS)];

/// The rows of the results whose paths begin with `folder`.
fn rows_of(folder: &str) -> &'static [FileRow] {
    match folder.split('/').nth(2).unwrap_or_default() {
        "models" => MODEL_FILES,
        "segmentations" => SEGMENTATION_FILES,
        "beats" => BEAT_FILES,
        "comparisons" => COMPARISON_FILES,
        "serials" => SERIAL_FILES,
        "readings" => READING_FILES,
        "normals" => NORMALS_FILES,
        "readers" => READER_FILES,
        "templates" => TEMPLATE_FILES,
        _ => &[],
    }
}

/// The row of the file `name`.
fn row_of(rows: &'static [FileRow], name: &str) -> Option<&'static FileRow> {
    let stem = name.split_once('.').map_or(name, |(stem, _)| stem);
    let exact = rows.iter().find(|row| row.names == name);
    exact.or_else(|| {
        rows.iter()
            .find(|row| row.names.strip_suffix(".*") == Some(stem))
    })
}

/// Describes the files of every path `.../{file}`.
pub fn describe(document: &mut Value) {
    let mut paths = document["paths"].take();
    for (path, item) in paths.as_object_mut().into_iter().flatten() {
        if let Some(folder) = path.strip_suffix("/{file}") {
            let operation = &mut item["get"];
            let names = names_of(&document["components"]["schemas"], operation, folder);
            let table = table(folder, &names, operation);
            describe_answer(operation, &table);
            operation["x-files"] = table.into();
        }
    }
    document["paths"] = paths;
}

/// The names that the parameter `file` may have. Its schema lists them; names of gates are in the rows.
fn names_of(schemas: &Value, operation: &Value, folder: &str) -> Vec<String> {
    let parameters = operation["parameters"].as_array().into_iter().flatten();
    let file = parameters
        .into_iter()
        .find(|parameter| parameter["name"] == "file");
    let reference = file.and_then(|file| file["schema"]["$ref"].as_str());
    let schema = reference.and_then(|text| schemas.get(text.rsplit('/').next()?));
    let listed = schema.map_or(&Value::Null, |schema| match &schema["oneOf"] {
        Value::Array(forms) => &forms[0]["enum"],
        _ => &schema["enum"],
    });
    let listed = listed.as_array().into_iter().flatten();
    let listed = listed.filter_map(Value::as_str).map(str::to_owned);
    let of_gates = rows_of(folder)
        .iter()
        .filter(|row| row.names.contains("NN"))
        .flat_map(|row| match row.names.strip_suffix(".*") {
            Some(stem) => Format::ALL
                .map(|one| format!("{stem}.{}", one.extension()))
                .to_vec(),
            None => vec![row.names.to_owned()],
        });
    listed.chain(of_gates).collect()
}

/// `x-files` of an operation.
fn table(folder: &str, names: &[String], operation: &Value) -> Map<String, Value> {
    let taken = operation["parameters"].as_array().into_iter().flatten();
    let taken: Vec<&str> = taken
        .filter_map(|parameter| parameter["name"].as_str())
        .collect();
    let mut table = Map::new();
    for name in names {
        let row = row_of(rows_of(folder), name);
        let mut facts = json!({
            "description": row.map(|row| row.description),
            "exists": row.map(|row| row.exists),
            "mediaType": media_type_of(name),
            "schema": schema_of(folder, name),
        });
        let parameters = parameters_of(folder, name);
        let parameters: Vec<_> = parameters
            .iter()
            .copied()
            .filter(|name| taken.contains(name))
            .collect();
        if !parameters.is_empty() {
            facts["parameters"] = json!(parameters);
        }
        table.insert(name.clone(), facts);
    }
    table
}

/// The query parameters that a file may have.
fn parameters_of(folder: &str, name: &str) -> &'static [&'static str] {
    // The animation of a beat is one file, whole.
    let whole = folder.starts_with("/v1/beats") && name == "mesh.glb";
    if media_type_of(name) == DicomObject::MEDIA_TYPE || name == REPORT_PAGE {
        &["deidentify"]
    } else if name.starts_with("mesh") && !whole {
        &["part"]
    } else {
        &[]
    }
}

/// States every media type of the files in the answer 200, and leaves out 406: the name says the format, so that
/// `Accept` is not looked at.
fn describe_answer(operation: &mut Value, table: &Map<String, Value>) {
    let mut by_type: Vec<(String, Vec<Value>)> = Vec::new();
    for facts in table.values() {
        let media_type = facts["mediaType"].as_str().unwrap_or_default();
        let schema = facts["schema"].clone();
        match by_type.iter_mut().find(|(known, _)| known == media_type) {
            Some((_, schemas)) if schemas.contains(&schema) => {}
            Some((_, schemas)) => schemas.push(schema),
            None => by_type.push((media_type.to_owned(), vec![schema])),
        }
    }
    by_type.sort_by_key(|(media_type, schemas)| {
        let bytes = schemas[0]["format"] == "binary";
        (!bytes, media_type.clone())
    });
    let content: Map<String, Value> = by_type
        .into_iter()
        .map(|(media_type, mut schemas)| {
            let schema = match schemas.len() {
                1 => schemas.remove(0),
                _ => json!({ "anyOf": schemas }),
            };
            (media_type, json!({ "schema": schema }))
        })
        .collect();
    if let Some(answers) = operation["responses"].as_object_mut() {
        answers.shift_remove("406");
    }
    operation["responses"]["200"]["content"] = content.into();
}

/// The media type of a product's file.
fn media_type_of(name: &str) -> &'static str {
    let extension = name.rsplit('.').next().unwrap_or_default();
    match extension {
        "dcm" => DicomObject::MEDIA_TYPE,
        "json" if name == FHIR_FILE => FHIR_MEDIA_TYPE,
        "gz" => "application/gzip",
        "nrrd" => seg_nrrd::MEDIA_TYPE,
        "html" => "text/html",
        "csv" => "text/csv",
        "png" => "image/png",
        "svg" => "image/svg+xml",
        _ => Format::ALL
            .into_iter()
            .find(|format| format.extension() == extension)
            .map_or("application/octet-stream", Format::media_type),
    }
}

/// The schema of a product's file.
fn schema_of(folder: &str, name: &str) -> Value {
    match (name, media_type_of(name)) {
        (FHIR_FILE, _) => reference("FhirBundle"),
        ("beat.json", _) => reference("BeatReport"),
        ("comparison.json", _) => reference("ComparisonReport"),
        ("serial.json", _) => reference("SerialReport"),
        ("reading.json", _) => reference("ReadingReport"),
        ("report.json", _) if folder.starts_with("/v1/models") => reference("ModelReport"),
        // Of a segmentation, or kept by a reading of one.
        ("report.json", _) => reference("SegmentationReport"),
        ("distance.json", _) => reference("Closeness"),
        (
            "polar.json" | "polar_ed.json" | "polar_es.json" | "polar_stress.json"
            | "polar_rest.json",
            _,
        ) => reference("PolarMap"),
        (map, "application/json") if map.starts_with("polar_scan") => reference("PolarMap"),
        (figure, "application/json") if figure.starts_with("polar_") => reference("PolarFigure"),
        ("normals.json", _) => reference("NormalLimits"),
        ("profile.json", _) => reference("ReaderProfile"),
        (mesh, "application/json") if mesh.starts_with("mesh") => reference("MeshDocument"),
        (_, "model/gltf+json") => json!({"type": "object"}),
        (_, "text/html" | "image/svg+xml") => json!({"type": "string"}),
        _ => binary(),
    }
}

/// A reference to a schema of the document.
fn reference(schema: &str) -> Value {
    json!({"$ref": format!("#/components/schemas/{schema}")})
}

/// The schema of the reports below `path`.
pub fn report_of(path: &str) -> Value {
    if path.starts_with("/v1/segmentations") {
        reference("SegmentationReport")
    } else if path.starts_with("/v1/beats") {
        reference("BeatReport")
    } else if path.starts_with("/v1/comparisons") {
        reference("ComparisonReport")
    } else if path.starts_with("/v1/serials") {
        reference("SerialReport")
    } else if path.starts_with("/v1/readings") {
        reference("ReadingReport")
    } else {
        reference("ModelReport")
    }
}

/// Bytes.
pub fn binary() -> Value {
    json!({"type": "string", "format": "binary", "contentMediaType": "application/octet-stream"})
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_has_one_row_and_every_row_a_file() {
        let document = crate::router::document();
        for (path, item) in document["paths"].as_object().unwrap() {
            let Some(folder) = path.strip_suffix("/{file}") else {
                continue;
            };
            let files = item["get"]["x-files"].as_object().unwrap();
            for (name, facts) in files {
                assert!(facts["description"].is_string(), "{path}: {name}");
                assert!(facts["exists"].is_string(), "{path}: {name}");
            }
            for row in rows_of(folder) {
                let used = files.keys().any(|name| {
                    row_of(rows_of(folder), name).is_some_and(|one| std::ptr::eq(one, row))
                });
                assert!(used, "{path}: {}", row.names);
            }
        }
    }
}
