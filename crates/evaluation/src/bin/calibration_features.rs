//! Writes the table of features from which `scripts/measure/calibrate.py` estimates the constants of
//! `crates/ventriform/src/heart/judge/calibration.rs`.
//!
//! `cargo run --release -p ventriform-evaluation --bin calibration_features -- FOLDER... > features.csv` segments
//! `CASE/spect.nii.gz` of every case in the folders with the built-in hearts, once for each wall, and compares the
//! apparent wall with `lv_expert_img.nii.gz`, the anatomical one with `lv_truth.nii.gz`. One row for each case: the
//! folder's name, the case's, whether there is a heart and how far it moved (mm, by `params.json`), the Jaccard index
//! of both walls, the figures of [`Evidence`], the confidence of the search, and the mean logarithm of the odds over
//! the built-in hearts. A refused scan has only the three figures of its refusal.

use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde_json::Value;
use ventriform::base::progress::Monitor;
use ventriform::heart::deform::WallEdge;
use ventriform::heart::judge::Evidence;
use ventriform::heart::judge::confidence::{log_odds, of_agreement};
use ventriform::image::grid::agreement::compare;
use ventriform::image::locate::{LocateError, NotAHeart};
use ventriform::image::volume::given_mask::{MaskChoice, read_mask};
use ventriform::image::volume::{ReadLimits, VolumeFile};
use ventriform::parameters::FitParameters;
use ventriform::runs::segmentation::{
    Segmentation, SegmentationError, SegmentationOrder, SegmentedVolume, from_files,
};
use ventriform_evaluation::{cases, name_of};

type Result<T> = std::result::Result<T, Box<dyn Error + Send + Sync>>;

/// The columns after those of the case itself.
const FIGURE_COLUMNS: [&str; 17] = [
    "jaccard_apparent",
    "jaccard_anatomical",
    "active",
    "thickness_spread_mm",
    "strain",
    "unroundness",
    "hollowness",
    "cavity_ml",
    "slenderness",
    "offset",
    "dark",
    "beside",
    "agreement",
    "gain",
    "search",
    "log_odds_apparent",
    "log_odds_anatomical",
];

fn main() -> Result<()> {
    let folders = std::env::args().skip(1).map(PathBuf::from);
    let cases = cases(folders, "spect.nii.gz")?;
    let rows: Vec<String> = cases
        .par_iter()
        .map(|(set, case)| row(set, case))
        .collect::<Result<_>>()?;
    println!("set,case,heart,motion_mm,{}", FIGURE_COLUMNS.join(","));
    println!("{}", rows.join("\n"));
    Ok(())
}

fn row(set: &str, case: &Path) -> Result<String> {
    let truth = std::fs::read(case.join("params.json"))?;
    let truth: Value = serde_json::from_slice(&truth)?;
    let motion = truth.pointer("/acquisition/body_motion/dz_mm");
    let motion = motion.and_then(Value::as_f64).unwrap_or(0.0);
    let heart = u8::from(truth["made"] != "none");
    let mut row = format!("{set},{},{heart},{motion:.1}", name_of(case));
    for figure in figures(case)? {
        row.push(',');
        if let Some(figure) = figure {
            write!(row, "{figure:.5}")?;
        }
    }
    Ok(row)
}

/// The values of [`FIGURE_COLUMNS`] as far as the case has them.
fn figures(case: &Path) -> Result<[Option<f64>; FIGURE_COLUMNS.len()]> {
    let mut figures = [None; FIGURE_COLUMNS.len()];
    let both = [WallEdge::Apparent, WallEdge::Anatomical];
    let [apparent, anatomical] = match both.map(|edge| segmented(case, edge)) {
        [Ok(apparent), Ok(anatomical)] => [apparent, anatomical],
        [Err(error), _] | [_, Err(error)] => {
            if let SegmentationError::NotFound(LocateError::NoHeart { reason, .. }) = error
                && let NotAHeart::Unseen {
                    hollowness,
                    agreement,
                    search,
                    ..
                } = reason
            {
                (figures[6], figures[12]) = (Some(hollowness), Some(agreement));
                figures[14] = Some(search);
            }
            return Ok(figures);
        }
    };
    figures[0] = Some(jaccard(&apparent, &case.join("lv_expert_img.nii.gz"))?);
    figures[1] = Some(jaccard(&anatomical, &case.join("lv_truth.nii.gz"))?);
    let made = &apparent.segmentation;
    let Some(e) = &made.fit.judgement.evidence else {
        return Ok(figures);
    };
    let own = [
        e.active,
        e.thickness_spread,
        e.strain,
        e.unroundness,
        e.hollowness,
        e.cavity_ml,
        e.slenderness,
        e.offset,
        e.dark,
        e.beside,
    ];
    for (figure, value) in figures[2..].iter_mut().zip(own) {
        *figure = Some(value);
    }
    figures[12] = e.views.map(|views| views.agreement);
    figures[13] = e.views.map(|views| views.gain);
    figures[14] = made.fit.model.localisation.as_ref().map(|l| l.confidence);
    for (figure, edge) in figures[15..].iter_mut().zip(both) {
        *figure = Some(mean_log_odds(made, edge));
    }
    Ok(figures)
}

fn segmented(
    case: &Path,
    edge: WallEdge,
) -> std::result::Result<SegmentedVolume, SegmentationError> {
    let mut parameters = FitParameters::default();
    parameters.deform.edge = edge;
    let files = [VolumeFile::at(case.join("spect.nii.gz"))];
    let order = SegmentationOrder::of_built_in_hearts(&files, &parameters);
    from_files(&order, &ReadLimits::default(), &Monitor::silent())
}

fn jaccard(segmented: &SegmentedVolume, mask: &Path) -> Result<f64> {
    let (monitor, limits) = (Monitor::silent(), ReadLimits::default());
    let scan = &segmented.reading.volume;
    let file = [VolumeFile::at(mask)];
    let mask = read_mask(&file, &MaskChoice::default(), &limits, &monitor)?;
    let mask = mask.on((scan.shape, &scan.frame), false, &monitor)?.mask;
    let made = &segmented.segmentation.mask;
    Ok(compare(made, &mask, scan.frame.spacing(), &monitor)?.jaccard)
}

/// The mean over the built-in hearts of the logarithm of the odds of a good fit, one that failed having no chance.
fn mean_log_odds(made: &Segmentation, edge: WallEdge) -> f64 {
    let chance = |evidence: &Option<Evidence>| evidence.map_or(0.0, |e| of_agreement(&e, edge));
    let fitted = made.candidates.iter().map(|c| chance(&c.evidence));
    let chances = fitted.chain(made.refused.iter().map(|_| 0.0));
    let (sum, count) = chances.fold((0.0, 0.0), |(sum, count), chance| {
        (sum + log_odds(chance), count + 1.0)
    });
    sum / count
}
