//! `measure`: the agreement of two masks.

use crate::errors::{Stopped, broken, stopped};
use crate::run::{How, run};
use crate::volumes::NativeVolume;
use pyo3::prelude::*;
use ventriform::base::progress::{Monitor, Plan};
use ventriform::image::volume::given_mask::{
    GivenMask, GivenMaskError, MaskAgreementError, MaskChoice, MaskLabel, read_mask,
};
use ventriform::image::volume::{ReadLimits, VolumeFile};
use ventriform::mesh::files::{MeshFrame, MeshStatement, MeshUnit};
use ventriform::results::report::AgreementReport;

/// The figures as JSON, the structures that were compared, and whether the reference was resampled.
type Measured = (String, [Option<String>; 2], bool);

/// Compares the mask with the reference. `labels` are those of both, of the mask and of the reference.
#[pyfunction]
#[pyo3(signature = (mask, reference, labels, resample, mesh, how))]
pub fn measure(
    py: Python<'_>,
    mask: Py<NativeVolume>,
    reference: Py<NativeVolume>,
    labels: [Option<String>; 3],
    resample: bool,
    mesh: [Option<String>; 2],
    how: How<'_>,
) -> PyResult<Measured> {
    let (a, b) = (&mask.get().files, &reference.get().files);
    let [unit, frame] = mesh;
    let stated = MeshStatement {
        unit: unit.as_deref().and_then(MeshUnit::named),
        frame: frame.as_deref().and_then(MeshFrame::named),
    };
    run(py, Plan::SEGMENTATION, &how, |monitor| {
        let [common, own_a, own_b] = labels.each_ref().map(Option::as_deref);
        let a = read(a, [own_a, common], stated, monitor)?;
        let b = read(b, [own_b, common], stated, monitor)?;
        let structures = [a.structure.clone(), b.structure.clone()];
        let made = a
            .agreement(b, resample, monitor)
            .map_err(|error| match error {
                MaskAgreementError::Unplaced { error, .. } => stopped(&error),
                error => Stopped::Failed(broken(error)),
            })?;
        let figures = serde_json::to_string(&AgreementReport::from_agreement(&made.agreement));
        let figures = figures.map_err(|error| Stopped::Failed(broken(error)))?;
        Ok((figures, structures, made.resampled))
    })
}

/// Reads a mask: the structure of its own label, otherwise of the common one, which a file with one structure does not
/// need.
fn read(
    files: &[VolumeFile],
    [own, common]: [Option<&str>; 2],
    mesh: MeshStatement,
    monitor: &Monitor<'_>,
) -> Result<GivenMask, Stopped> {
    let read = |label: Option<&str>| {
        let label = label.map(|text| {
            let Ok(label) = text.parse::<MaskLabel>();
            label
        });
        let choice = MaskChoice {
            label,
            resample: false,
            mesh,
        };
        read_mask(files, &choice, &ReadLimits::default(), monitor)
    };
    let named = read(own.or(common));
    let mask = match (named, own) {
        (Err(error @ GivenMaskError::NoSuchStructure { .. }), None) => {
            read(None).map_err(|_| error)
        }
        (named, _) => named,
    };
    mask.map_err(|error| stopped(&error))
}
