//! `ventriform calibrate`: [`ventriform::runs::evaluate::calibration`] on the command line.

use super::Bar;
use super::output::{note, say, write_file};
use super::parameter_args::{FitArgsOf, TableArgs, with_fit};
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;
use ventriform::base::progress::{Monitor, Plan};
use ventriform::heart::reader::{Learnt, ReaderLevel, ReaderOffset};
use ventriform::parameters::CalibrationChoice;
use ventriform::runs::evaluate::calibration::{
    Calibration, CalibrationError, CaseFigures, LEVEL_MARGIN_E_J, MeanJaccards, calibrate, cases_of,
};
use ventriform::runs::evaluate::sample::Sample;

/// Learn how a reader draws the wall, from scans and the reader's masks
#[derive(Debug, Args)]
#[command(after_help = "Example:
  ventriform calibrate cohort -o reader.json
  ventriform segment scan.nii.gz --model auto --reader reader.json -o out
COHORT holds a folder for each case, with spect.nii.gz (or .nii, .dcm) and the reader's mask. Readers are of
two kinds: edge (three distances in millimetres from the fitted wall: endocardium, epicardium, rim) and level
(the share of the polar map's reference that the image has where the reader ends the wall). Both are learnt;
the kind is chosen by figures of masks left out. The profile holds it, drawn towards no change (a level:
towards half) the more the fewer masks there are, and hashes of the files: no names. The table printed says
what the profile is worth: held-out figures are of profiles learnt without the case, in-sample figures are of
the profile that has seen it.")]
pub struct CalibrateArgs {
    /// Folder of the cases
    #[arg(value_name = "COHORT")]
    cohort: PathBuf,
    /// File to write the profile to
    #[arg(short, long = "output", value_name = "FILE")]
    output: PathBuf,
    /// Name of the masks' files, without .nii.gz
    #[arg(long, value_name = "NAME", default_value = "lv_expert_img")]
    mask: String,
    #[command(flatten)]
    fit: FitArgsOf<CalibrationChoice>,
}

/// Runs the command.
///
/// # Errors
/// If no mask can be learnt from, or the profile cannot be written.
pub fn run(args: &CalibrateArgs) -> Result<()> {
    let parameters = with_fit(&TableArgs::default(), &args.fit)?.fit;
    let cases = cases_of(&args.cohort, &args.mask).map_err(|error| CalibrationError::Folder {
        folder: args.cohort.clone(),
        error,
    })?;
    let bar = Bar::over(Plan::SEGMENTATION);
    let made = calibrate(
        &cases,
        &parameters,
        &|share| bar.show("fit", share),
        &Monitor::silent(),
    );
    bar.finish();
    let made = made?;
    write_file(&args.output, made.profile.to_json().as_bytes())?;
    for (case, problem) in &made.problems {
        note!("warning: {case}: {problem}");
    }
    say!("{}", table(&made).trim_end_matches('\n'));
    Ok(())
}

/// Columns of the table of cases: the name, the figure and its decimals.
type Column = (&'static str, fn(&CaseFigures) -> f64, usize);

const TABLE_COLUMNS: [Column; 4] = [
    ("E_J", |f| f.jaccard, 3),
    ("E_CD, voxels", |f| f.contour, 3),
    ("wall, ml", |f| f.wall_ml, 1),
    ("cavity, ml", |f| f.cavity_ml, 1),
];

/// The figures as text: one block for each figure, without a profile, held-out and in-sample.
fn table(made: &Calibration) -> String {
    let masks = made.profile.masks();
    let edge = made.profile.edge.as_str();
    let mut text = format!(
        "profile of {masks} masks, kind {}, from the {edge} wall:\n",
        made.kind().as_str()
    );
    text += &learnt(&made.profile.learnt);
    text += &choice(made);
    let samples = [Sample::HeldOut, Sample::InSample];
    let [held_out, in_sample] = samples.map(Sample::as_str);
    for (what, figure, decimals) in TABLE_COLUMNS {
        text += &format!(
            "{what:<16} {:>10} {held_out:>10} {in_sample:>10}\n",
            "without"
        );
        for row in &made.rows {
            let judged = samples.map(|sample| made.figures(row, sample));
            text += &format!("  {:<14}", row.case);
            for figures in [Some(row.without)].into_iter().chain(judged) {
                let cell = figures.map(|f| format!("{:.decimals$}", figure(&f)));
                text += &format!(" {:>10}", cell.unwrap_or_else(|| "-".into()));
            }
            if what.starts_with("wall") {
                text += &format!("   reader's {:.1}", row.reader_ml);
            }
            text.push('\n');
        }
    }
    for sample in samples {
        text += &gain(made, sample);
    }
    text
}

fn learnt(learnt: &Learnt) -> String {
    match learnt {
        Learnt::Edge(offsets) => {
            let names = [
                "endocardium, outward",
                "epicardium, outward",
                "rim, towards the base",
            ];
            let line = |(name, offset): (&&str, &ReaderOffset)| {
                let ReaderOffset {
                    value,
                    mean,
                    spread,
                } = offset;
                format!("  {name:<22} {value:>6.2} mm (mean {mean:.2}, spread {spread:.2})\n")
            };
            names.iter().zip(offsets).map(line).collect()
        }
        Learnt::Level(ReaderLevel {
            value,
            mean,
            spread,
        }) => format!(
            "  level {value:.3} of the polar map's reference (mean {mean:.3}, spread {spread:.3})\n"
        ),
    }
}

/// Why the profile is of its kind.
fn choice(made: &Calibration) -> String {
    let MeanJaccards {
        without,
        edge,
        level,
    } = made.mean_jaccards();
    let learnt_on = if made.rows.len() > 1 {
        "learnt on the other masks"
    } else {
        "with one mask: no mask left to learn from, so no distances and the usual level"
    };
    format!(
        "  mean E_J, {learnt_on}: by distances {edge:.3}, by a level {level:.3}; without a profile {without:.3}. A \
         level is chosen where it is better by more than {LEVEL_MARGIN_E_J}\n"
    )
}

/// The changes by the profile, as a line.
pub(super) fn gain(made: &Calibration, sample: Sample) -> String {
    let Some(gain) = made.gain(sample) else {
        return format!("E_J, {}: there is one mask only\n", sample.as_str());
    };
    let [low, high] = gain.interval;
    let verdict = if gain.may_be_none() {
        ": not distinguishable from zero"
    } else {
        ""
    };
    format!(
        "E_J, {}: {:+.4} by the profile (95 % interval {low:+.4} to {high:+.4}), better in {} of {}, \
         sign test p = {:.2}{verdict}\n",
        sample.as_str(),
        gain.mean,
        gain.signs[0],
        gain.count,
        gain.p,
    )
}
