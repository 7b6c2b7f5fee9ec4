//! DICOM objects of a stored beat.
//!
//! The walls at both ends are the stored labels of their gates, and each end refers to the frames of its gate in the
//! kept upload.

use super::super::failures::broken_result;
use super::super::upload::UploadFacts;
use super::{scan, stored};
use crate::base::records::{Failure, Product};
use crate::items::{StoredItem, StoredResult};
use ventriform::image::volume::ReadLimits;
use ventriform::results::export::dicom::{
    BeatEnd, BeatObject, DicomBeat, EndWall, SignedReading, Structure,
};
use ventriform::results::report::{BeatReport, BeatSummary};
use ventriform::runs::advice::Explain;
use ventriform::runs::gated::{end_mesh, gate_labels};

const REPORT_FILE: &str = "beat.json";

/// The names of the files of `product` of which `object` is made.
pub fn source_files(object: BeatObject, product: &Product) -> Vec<String> {
    let mut names = vec![REPORT_FILE.to_owned()];
    if let BeatObject::Mask(end) = object {
        names.push(mesh_file(end));
        let summary = serde_json::from_value::<BeatSummary>(product.summary.clone().into());
        names.extend(summary.ok().map(|summary| {
            gate_labels(end.pick([summary.end_diastole_gate, summary.end_systole_gate]))
        }));
    }
    names
}

fn mesh_file(end: BeatEnd) -> String {
    format!("{}.json", end_mesh(end))
}

/// The bytes of one object.
///
/// # Errors
/// As [`super::object`].
pub fn object(
    result: &StoredResult,
    object: BeatObject,
    reading: Option<SignedReading<'_>>,
    secret: Option<&[u8]>,
    limits: &ReadLimits,
) -> Result<Vec<u8>, Failure> {
    let facts =
        UploadFacts::from_volume(&result.source.volume).map_err(|error| broken_result(&error))?;
    let bytes = stored::required(&result.files, REPORT_FILE)?;
    let report: BeatReport = stored::report(&bytes)?;
    let text = stored::report_text(&bytes)?;
    let scan = |end: BeatEnd| {
        let number = end.gate(&report);
        let gate = report.gates.iter().find(|gate| gate.gate == number);
        let gate = gate.ok_or_else(|| broken_result(&format!("there is no gate {number}")))?;
        scan::source(
            (&result.source, result.made_at),
            &facts,
            Some(gate.frame),
            secret,
            limits,
        )
    };
    let scans = [scan(BeatEnd::Diastole)?, scan(BeatEnd::Systole)?];
    let beat = DicomBeat::new(
        Structure::from_organ("left_ventricle"),
        &scans,
        &report,
        &text,
    )
    .with_reading(reading);
    let made = match object {
        BeatObject::Mask(end) => {
            let labels = gate_labels(end.gate(&report));
            let wall = wall(
                &result.files,
                (&mesh_file(end), &labels),
                facts.shape,
                limits,
            )?;
            beat.mask(end, &wall)
        }
        BeatObject::Measurements => beat.measurements(),
    };
    made.map_err(|error| error.explain())
}

/// The wall of the gate with these files of mesh and labels.
fn wall(
    item: &StoredItem,
    (mesh, labels): (&str, &str),
    shape: [usize; 3],
    limits: &ReadLimits,
) -> Result<EndWall, Failure> {
    let volume = stored::voxels(item, labels, shape, limits)?;
    let label = |label: f32| stored::mask(&volume, |value| (value - label).abs() < 0.5);
    Ok(EndWall {
        wall: label(1.0),
        cavity: label(2.0),
        mesh: stored::mesh(item, mesh)?,
    })
}
