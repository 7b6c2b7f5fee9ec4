//! `ventriform phantom`: simulated scans with the true mask of the wall.

use super::Bar;
use super::output::{create_folder, note, write_file};
use anyhow::Result;
use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};
use ventriform::base::progress::{CancelToken, Monitor};
use ventriform::image::volume::Volume;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{
    PerfusionDefect, PhantomBeat, PhantomParameters, healthy_person, phantom, phantom_gates,
};
use ventriform::runs::examples::{
    DEFECTS_OF_A_PAIR, SIMULATED_NOTE, simulated_projections, simulated_slices,
};

/// Simulate a SPECT scan, with the true mask of the wall
#[derive(Debug, Args)]
#[command(after_help = "Example:
  ventriform phantom -o phantom --spacing 2 --seed 7 --defect 8:0.7
  ventriform phantom -o moved --motion 20
  ventriform phantom -o infarct --defect 3:1 --defect 9:1 --right-ventricle 1.2
writes phantom/spect.nii.gz, phantom/lv_truth.nii.gz and phantom/params.json
  ventriform phantom -o gated --gates 8 --ejection-fraction 45
writes the gates as gated/spect.nii.gz, with gated/lv_truth_ed.nii.gz and gated/lv_truth_es.nii.gz
  ventriform phantom -o pair --pair --defect 7:0.6 --defect 13:0.6
writes pair/stress and pair/rest, each with the files above: the defects are there at stress alone
  ventriform phantom -o raw --size 64 --spacing 6.4 --projections --motion 12
writes also raw/raw.dcm, the projections of a gamma camera, for `segment`, `reconstruct` ...
  ventriform phantom -o healthy --normal --seed 5
writes 30 healthy hearts (--cases) and healthy/cohort.csv, from which `ventriform normals build` makes limits for \
tests. They are
simulated, not patients: such limits say so, and are not for patients.")]
pub struct PhantomArgs {
    /// Folder to write to (created if missing)
    #[arg(short, long = "output", value_name = "DIR", default_value = "phantom")]
    output: PathBuf,
    /// Simulated healthy hearts that differ as people do, with a cohort.csv for `normals build`: simulated, not
    /// patients
    #[arg(long, conflicts_with_all = ["defect", "motion"])]
    normal: bool,
    /// Number of healthy hearts, with --normal [default: 30]
    #[arg(long, value_name = "N", requires = "normal", value_parser = clap::value_parser!(u32).range(1..=500))]
    cases: Option<u32>,
    /// Gates of a heart that beats, 4 to 32
    #[arg(long, value_name = "N", conflicts_with_all = ["normal", "projections"])]
    gates: Option<u32>,
    /// Ejection fraction, per cent, with --gates [default: 60]
    #[arg(long, value_name = "PERCENT", requires = "gates")]
    ejection_fraction: Option<f64>,
    /// One heart at stress and at rest: defects (by default 7:0.6, 8:0.6, 13:0.6 and 14:0.6) are there at stress
    #[arg(long, conflicts_with = "normal")]
    pair: bool,
    /// A defect at rest, as with --defect: what is as severe at stress is fixed (repeatable)
    #[arg(long, value_name = "SEGMENT:SEVERITY", value_parser = parse_defect, requires = "pair")]
    rest_defect: Vec<PerfusionDefect>,
    /// Also write spect.dcm: the slices as a DICOM NM image, of a patient whose name says that it is simulated
    #[arg(long, conflicts_with = "normal")]
    dicom: bool,
    /// Voxels along each axis [default: 128, with --normal or --gates 64]
    #[arg(long, value_name = "N")]
    size: Option<usize>,
    /// Distance between voxel centres, millimetres [default: 3.2, with --normal or --gates 6.4]
    #[arg(long, value_name = "MM")]
    spacing: Option<f64>,
    /// Counting noise: standard deviation divided by the mean in healthy wall; 0 for none
    #[arg(long, value_name = "X", default_value_t = 0.05)]
    noise: f64,
    /// Uptake of the liver relative to healthy wall; above 1 it is brighter than the heart
    #[arg(long, value_name = "X", default_value_t = 0.5)]
    liver: f64,
    /// Uptake of the right ventricle's wall relative to healthy wall; 0 leaves it out
    #[arg(long, value_name = "X", default_value_t = 0.3)]
    right_ventricle: f64,
    /// How far the patient moves towards the head half-way through the scan, millimetres; the true
    /// mask keeps the first place
    #[arg(
        long,
        value_name = "MM",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    motion: f64,
    /// Heads of the camera, 1 or 2 at a right angle: which views are after the motion
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    heads: u8,
    /// Also write raw.dcm: the projections that a gamma camera counts, as a DICOM NM image (TOMO)
    #[arg(long, conflicts_with = "normal")]
    projections: bool,
    /// Counts of all projections together, millions
    #[arg(long, value_name = "M", default_value_t = 8.0, value_parser = parse_counts)]
    counts: f64,
    /// A perfusion defect: AHA segment 1 to 17 (1 to 6 are basal) and severity 0 to 1 (repeatable)
    #[arg(long, value_name = "SEGMENT:SEVERITY", value_parser = parse_defect)]
    defect: Vec<PerfusionDefect>,
    /// Seed of the random numbers for shape and noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

fn parse_counts(text: &str) -> Result<f64, String> {
    let millions: Option<f64> = text.parse().ok();
    let millions = millions.filter(|millions| (0.01..=1000.0).contains(millions));
    millions.ok_or_else(|| "give millions of counts, 0.01 to 1000".into())
}

fn parse_defect(text: &str) -> Result<PerfusionDefect, String> {
    let parts = text.split_once(':');
    parts
        .and_then(|(segment, severity)| {
            Some(PerfusionDefect {
                segment: segment.parse().ok()?,
                severity: severity.parse().ok()?,
            })
        })
        .ok_or_else(|| "give SEGMENT:SEVERITY, for example 8:0.7".into())
}

/// Runs the command.
///
/// # Errors
/// If a parameter is out of range or a file cannot be written.
pub fn run(args: &PhantomArgs) -> Result<()> {
    let coarse = args.normal || args.gates.is_some();
    let parameters = PhantomParameters {
        shape: [args.size.unwrap_or(if coarse { 64 } else { 128 }); 3],
        spacing_mm: [args.spacing.unwrap_or(if coarse { 6.4 } else { 3.2 }); 3],
        noise: args.noise,
        liver: args.liver,
        right_ventricle: args.right_ventricle,
        motion_mm: args.motion,
        heads: args.heads,
        defects: args.defect.clone(),
        seed: args.seed,
        ..PhantomParameters::default()
    };
    if args.normal {
        return healthy(args, &parameters);
    }
    if !args.pair {
        let names = scan(args, &args.output, &parameters, None)?;
        note!("Written: {names} in {}", args.output.display());
        return Ok(());
    }
    let at_stress = match &parameters.defects[..] {
        [] => DEFECTS_OF_A_PAIR.to_vec(),
        given => given.to_vec(),
    };
    for (role, defects, number) in [
        ("stress", at_stress, 0),
        ("rest", args.rest_defect.clone(), 1),
    ] {
        let parameters = PhantomParameters {
            defects,
            scan: number,
            ..parameters.clone()
        };
        let folder = args.output.join(role);
        let names = scan(args, &folder, &parameters, Some(role))?;
        note!("Written: {names} in {}", folder.display());
    }
    Ok(())
}

/// Writes the scan of these parameters to a folder; the names of its files.
fn scan(
    args: &PhantomArgs,
    folder: &Path,
    parameters: &PhantomParameters,
    role: Option<&str>,
) -> Result<String> {
    create_folder(folder)?;
    let at = |name: &str| folder.join(name);
    let bar = Bar::start();
    let monitor = Monitor::new(&bar, CancelToken::new());
    let mut facts = serde_json::to_value(parameters)?;
    let mut names = vec!["spect.nii.gz"];
    let (volumes, gate_ms) = match args.gates {
        None => {
            let made = phantom(parameters, &monitor);
            bar.finish();
            let made = made?;
            write_volume(&at("spect.nii.gz"), &made.volume, StoredType::Int16)?;
            write_volume(&at("lv_truth.nii.gz"), &made.truth, StoredType::Uint8)?;
            names.push("lv_truth.nii.gz");
            (vec![made.volume], None)
        }
        Some(gates) => {
            let usual = PhantomBeat::default();
            let beat = PhantomBeat {
                gates,
                ejection_fraction_percent: (args.ejection_fraction)
                    .unwrap_or(usual.ejection_fraction_percent),
                ..usual
            };
            let made = phantom_gates(parameters, &beat, &monitor);
            bar.finish();
            let made = made?;
            let ends = made.ends();
            for (name, gate) in ["lv_truth_ed.nii.gz", "lv_truth_es.nii.gz"]
                .iter()
                .zip(ends)
            {
                write_volume(&at(name), &made.gates[gate].truth, StoredType::Uint8)?;
                names.push(name);
            }
            let [edv_ml, esv_ml] = ends.map(|gate| made.volumes_ml[gate]);
            facts["beat"] = json!({
                "gates": gates,
                "rr_ms": beat.rr_ms,
                "volumes_ml": made.volumes_ml,
                "edv_ml": edv_ml,
                "esv_ml": esv_ml,
                "ejection_fraction_percent": 100.0 * (1.0 - esv_ml / edv_ml),
            });
            let volumes: Vec<Volume> = made.gates.into_iter().map(|gate| gate.volume).collect();
            let bytes = nifti::write_gates(&volumes, Some(beat.gate_ms()), true)?;
            write_file(&at("spect.nii.gz"), &bytes)?;
            (volumes, Some(beat.gate_ms()))
        }
    };
    let text = serde_json::to_string_pretty(&facts)?;
    write_file(&at("params.json"), text.as_bytes())?;
    if args.dicom {
        let bytes = simulated_slices(parameters, &volumes, gate_ms, role)?;
        write_file(&at("spect.dcm"), &bytes)?;
        names.push("spect.dcm");
    }
    if args.projections {
        let heads = usize::from(args.heads);
        let bytes = simulated_projections(parameters, args.counts, heads, &Monitor::silent())?;
        write_file(&at("raw.dcm"), &bytes)?;
        names.push("raw.dcm");
    }
    Ok(format!("{} and params.json", names.join(", ")))
}

/// Healthy hearts of as many seeds as asked for, and the table of who they are.
fn healthy(args: &PhantomArgs, base: &PhantomParameters) -> Result<()> {
    create_folder(&args.output)?;
    let mut table = String::from("case,file,sex,protocol,tracer,attenuation_corrected,healthy\n");
    for number in 0..args.cases.unwrap_or(30) {
        let person = healthy_person(args.seed.wrapping_add(u64::from(number)), base);
        let made = phantom(&person.parameters, &Monitor::silent())?;
        let case = format!("n{number:03}");
        let folder = args.output.join(&case);
        create_folder(&folder)?;
        write_volume(
            &folder.join("spect.nii.gz"),
            &made.volume,
            StoredType::Int16,
        )?;
        let mut facts = serde_json::to_value(&made.parameters)?;
        facts["people"] = SIMULATED_NOTE.into();
        write_file(
            &folder.join("params.json"),
            serde_json::to_string_pretty(&facts)?.as_bytes(),
        )?;
        let sex = if person.female { "F" } else { "M" };
        table += &format!("{case},{case}/spect.nii.gz,{sex},phantom,{PEOPLE_TRACER},no,yes\n");
    }
    write_file(&args.output.join("cohort.csv"), table.as_bytes())?;
    note!(
        "Written: {} healthy hearts ({SIMULATED_NOTE}) and cohort.csv in {}",
        args.cases.unwrap_or(30),
        args.output.display()
    );
    Ok(())
}

/// The tracer of the table, by which limits know that their people are simulated.
const PEOPLE_TRACER: &str = "none (simulated)";

fn write_volume(path: &Path, volume: &Volume, stored: StoredType) -> Result<()> {
    write_file(path, &nifti::write(volume, stored, true)?)
}
