//! `ventriform resolution`: [`ventriform::runs::evaluate::protocol_resolution`] on the command line.

use super::Bar;
use super::limit_args::LimitArgs;
use super::output::{note, say, write_file};
use super::parameter_args::{FitArgsOf, TableArgs, with_fit};
use super::volume_args::volume_files;
use anyhow::Result;
use clap::Args;
use serde_json::json;
use std::path::PathBuf;
use ventriform::base::progress::{Monitor, Plan};
use ventriform::heart::deform::protocol_resolution::ProtocolResolution;
use ventriform::parameters::ResolutionChoice;
use ventriform::runs::evaluate::protocol_resolution::{
    LearntResolution, ProtocolScan, learn_resolution,
};

/// Learn the resolution of a camera's images from scans of one protocol
#[derive(Debug, Args)]
#[command(after_help = "Example:
  ventriform resolution rest/*.dcm -o resolution.json
  ventriform segment scan.dcm --model auto --resolution 14.2 -o out
Give scans of many people, all of one camera, collimator, reconstruction and filter. One wall that looks thick may be
thick or blurred; of many people's walls most are usual, and that tells how much the images blur: full width at half
maximum of a point, motion and filters included. Stated as --resolution (of segment, beat and compare, on the page and
in the rules of a service), it makes thickness, muscle and volumes more certain. 12 scans or more; people most of whom
have thick walls make the resolution look wider than it is.")]
pub struct ResolutionArgs {
    /// The scans: a file each, or a folder for a series of files
    #[arg(value_name = "SCAN", required = true, num_args = 1..)]
    scans: Vec<PathBuf>,
    /// Also write the resolution, and what each scan tells, to this JSON file
    #[arg(short, long = "output", value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    fit: FitArgsOf<ResolutionChoice>,
    #[command(flatten)]
    limits: LimitArgs,
}

/// Runs the command.
///
/// # Errors
/// If no scan can be learnt from, or the file cannot be written.
pub fn run(args: &ResolutionArgs) -> Result<()> {
    let parameters = with_fit(&TableArgs::default(), &args.fit)?;
    let limits = args.limits.limits()?;
    let scans = (args.scans.iter())
        .map(|path| {
            Ok(ProtocolScan {
                name: path.display().to_string(),
                files: volume_files(std::slice::from_ref(path), &limits)?,
            })
        })
        .collect::<Result<Vec<_>>>()?;
    let bar = Bar::over(Plan::SEGMENTATION);
    let learnt = learn_resolution(
        &scans,
        &parameters,
        &limits,
        &|share| bar.show("fit", share),
        &Monitor::silent(),
    );
    bar.finish();
    let learnt = learnt?;
    if let Some(path) = &args.output {
        let text = serde_json::to_string_pretty(&as_json(&learnt))?;
        write_file(path, format!("{text}\n").as_bytes())?;
    }
    for (name, why) in &learnt.left_out {
        note!("left out: {name}: {why}");
    }
    if learnt.looks.len() < ProtocolResolution::FEW_SCANS {
        note!(
            "warning: {} scans; {} or more tell the resolution",
            learnt.looks.len(),
            ProtocolResolution::FEW_SCANS
        );
    }
    say!("{}", table(&learnt));
    Ok(())
}

fn table(learnt: &LearntResolution) -> String {
    let mut text = format!(
        "{:>13} {:>13} {:>16}  scan\n",
        "apparent, mm", "cavity, ml", "noise length, mm"
    );
    for (name, look) in &learnt.looks {
        let length = look
            .noise_length_mm
            .map_or("-".into(), |mm| format!("{mm:.1}"));
        text += &format!(
            "{:>13.1} {:>13.0} {length:>16}  {name}\n",
            look.apparent_mm, look.cavity_ml
        );
    }
    let found = &learnt.resolution;
    text + &format!(
        "resolution {:.1} mm, standard deviation {:.1} mm, from {} scans (by the noise alone {:.1} mm)\n\
         --resolution {:.1}",
        found.mean_mm,
        found.sd_mm,
        learnt.looks.len(),
        found.by_noise_mm,
        found.mean_mm
    )
}

fn as_json(learnt: &LearntResolution) -> serde_json::Value {
    let rounded = |value: f64| (value * 100.0).round() / 100.0;
    let scans = learnt.looks.iter().map(|(name, look)| {
        json!({
            "scan": name,
            "apparent_thickness_mm": rounded(look.apparent_mm),
            "apparent_cavity_ml": rounded(look.cavity_ml),
            "noise_length_mm": look.noise_length_mm.map(rounded),
        })
    });
    let left_out = learnt.left_out.iter();
    json!({
        "resolution_mm": rounded(learnt.resolution.mean_mm),
        "standard_deviation_mm": rounded(learnt.resolution.sd_mm),
        "by_noise_mm": rounded(learnt.resolution.by_noise_mm),
        "scans": scans.collect::<Vec<_>>(),
        "left_out": left_out.map(|(scan, why)| json!({"scan": scan, "why": why})).collect::<Vec<_>>(),
    })
}
