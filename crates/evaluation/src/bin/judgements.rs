//! Prints what is found in each scan, and how it is judged.
//!
//! `cargo run --release -p ventriform-evaluation --bin judgements -- FOLDER... > TABLE` segments `CASE/spect.nii.gz` of every
//! case in the folders. TABLE has a row for each: the folder's name, the case's, `found` or `refused`, the distance of
//! the mask's middle from that of the true wall (`lv_truth.nii.gz`, of a refused scan of the place that was refused),
//! mm, the Jaccard index of the apparent wall with `lv_expert_img.nii.gz`, the search's correlation and confidence, the
//! judgement's confidence, the chance of motion, the projections' agreement and gain, the source of the patient's
//! orientation, the flags, and the reason of a refusal. What a case does not have is empty.
//! `scripts/measure/flag_rates.py` counts them.

use std::path::Path;

use rayon::prelude::*;
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::Monitor;
use ventriform::heart::judge::confidence::of_motion;
use ventriform::heart::judge::{Evidence, Flag};
use ventriform::image::grid::agreement::compare;
use ventriform::image::grid::voxelise::Mask;
use ventriform::image::locate::LocateError;
use ventriform::image::volume::given_mask::{GivenMask, MaskChoice, read_mask};
use ventriform::image::volume::{ReadLimits, VolumeFile};
use ventriform::parameters::FitParameters;
use ventriform::runs::segmentation::{
    SegmentationError, SegmentationOrder, SegmentedVolume, from_files,
};
use ventriform_evaluation::walls::Result;
use ventriform_evaluation::{cases, name_of};

const COLUMNS: &str = "set,case,result,off_mm,jaccard,correlation,search,confidence,motion,agreement,gain,orientation,flags,reason";

fn main() -> Result<()> {
    let folders = std::env::args().skip(1).map(Into::into);
    let cases = cases(folders, "spect.nii.gz")?;
    let rows: Vec<String> = cases
        .par_iter()
        .map(|(set, case)| row(set, case))
        .collect::<Result<_>>()?;
    println!("{COLUMNS}");
    rows.iter().for_each(|row| println!("{row}"));
    Ok(())
}

fn row(set: &str, case: &Path) -> Result<String> {
    let parameters = FitParameters::default();
    let files = [VolumeFile::at(case.join("spect.nii.gz"))];
    let order = SegmentationOrder::of_built_in_hearts(&files, &parameters);
    let own = match from_files(&order, &ReadLimits::default(), &Monitor::silent()) {
        Ok(made) => of_found(case, &made)?,
        Err(error) => of_refused(case, &error)?,
    };
    Ok(format!("{set},{},{own}", name_of(case)))
}

fn of_found(case: &Path, made: &SegmentedVolume) -> Result<String> {
    let mask = &made.segmentation.mask;
    let frame = &made.reading.volume.frame;
    let off = middle(case)?
        .zip(middle_of(mask, frame))
        .map(|(a, b)| (a - b).norm());
    let drawn = given(case, "lv_expert_img.nii.gz")?;
    let jaccard = match drawn {
        Some(drawn) => {
            let scan = &made.reading.volume;
            let drawn = drawn
                .on((scan.shape, &scan.frame), false, &Monitor::silent())?
                .mask;
            let spacing = scan.frame.spacing();
            Some(compare(mask, &drawn, spacing, &Monitor::silent())?.jaccard)
        }
        None => None,
    };
    let fit = &made.segmentation.fit;
    let (model, judgement) = (&fit.model, &fit.judgement);
    let found = model.localisation.as_ref();
    let evidence: Option<&Evidence> = judgement.evidence.as_ref();
    let views = evidence.and_then(|e| e.views);
    let source = model.patient_orientation.map_or("", |o| o.source.as_str());
    let flags: Vec<&str> = judgement.flags.iter().map(Flag::code).collect();
    Ok(format!(
        "found,{},{},{},{},{:.3},{},{},{},{source},{},{}",
        number(off),
        number(jaccard),
        number(found.map(|l| l.correlation)),
        number(found.map(|l| l.confidence)),
        judgement.confidence,
        number(evidence.map(of_motion)),
        number(views.map(|v| v.agreement)),
        number(views.map(|v| v.gain)),
        flags.join("+"),
        implausible(&judgement.flags).join("; "),
    ))
}

/// What is implausible.
fn implausible(flags: &[Flag]) -> Vec<String> {
    let measure = |flag: &Flag| match flag {
        Flag::ImplausibleShape { what, value, .. } => Some(format!("{what} {value:.2}")),
        _ => None,
    };
    flags.iter().filter_map(measure).collect()
}

fn of_refused(case: &Path, error: &SegmentationError) -> Result<String> {
    let mut off = None;
    let mut correlated = None;
    if let SegmentationError::NotFound(LocateError::NoHeart {
        centre,
        correlation,
        ..
    }) = error
    {
        off = middle(case)?.map(|truth| (truth - Vec3::from(*centre)).norm());
        correlated = Some(*correlation);
    }
    let reason = error.to_string().replace(',', ";").replace('\n', " ");
    let [off, correlated] = [off, correlated].map(number);
    Ok(format!("refused,{off},,{correlated},,,,,,,,{reason}"))
}

fn number(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| format!("{value:.3}"))
}

fn given(case: &Path, name: &str) -> Result<Option<GivenMask>> {
    let path = case.join(name);
    if !path.exists() {
        return Ok(None);
    }
    let (limits, monitor) = (ReadLimits::default(), Monitor::silent());
    Ok(Some(read_mask(
        &[VolumeFile::at(path)],
        &MaskChoice::default(),
        &limits,
        &monitor,
    )?))
}

/// The middle of the true wall, LPS mm.
fn middle(case: &Path) -> Result<Option<Vec3>> {
    Ok(given(case, "lv_truth.nii.gz")?.and_then(|given| middle_of(&given.mask, &given.frame)))
}

fn middle_of(mask: &Mask, frame: &VoxelToPatient) -> Option<Vec3> {
    let [nx, ny, _] = mask.shape;
    let (mut sum, mut count) = (Vec3::zeros(), 0.0);
    for v in (0..mask.voxels.len()).filter(|v| mask.voxels[*v]) {
        let index = [v % nx, v / nx % ny, v / (nx * ny)];
        sum += frame.to_patient(&Vec3::from(index.map(|i| i as f64)));
        count += 1.0;
    }
    (count > 0.0).then(|| sum / count)
}
