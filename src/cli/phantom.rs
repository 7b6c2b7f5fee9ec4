//! `ventriform phantom`: a simulated scan with its true mask.

use super::Bar;
use super::output::{create_folder, note, write_file};
use anyhow::Result;
use clap::Args;
use std::path::{Path, PathBuf};
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::{CancelToken, Monitor};
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{
    PerfusionDefect, PhantomParameters, healthy_person, phantom, phantom_projections,
};
use ventriform::image::volume::{Provenance, Volume};
use ventriform::results::export::dicom::{Moment, SourceScan, derived_uid, nuclear_projections};

/// Simulate a SPECT scan, with the true mask of the wall
#[derive(Debug, Args)]
#[command(after_help = "Example:
  ventriform phantom -o phantom --spacing 2 --seed 7 --defect 8:0.7
  ventriform phantom -o moved --motion 20
  ventriform phantom -o infarct --defect 3:1 --defect 9:1 --right-ventricle 1.2
writes phantom/spect.nii.gz, phantom/lv_truth.nii.gz and phantom/params.json
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
    /// Voxels along each axis [default: 128, with --normal 64]
    #[arg(long, value_name = "N")]
    size: Option<usize>,
    /// Distance between voxel centres, millimetres [default: 3.2, with --normal 6.4]
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
    let parameters = PhantomParameters {
        shape: [args.size.unwrap_or(if args.normal { 64 } else { 128 }); 3],
        spacing_mm: [args.spacing.unwrap_or(if args.normal { 6.4 } else { 3.2 }); 3],
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
    let bar = Bar::start();
    let made = phantom(&parameters, &Monitor::new(&bar, CancelToken::new()));
    bar.finish();
    let made = made?;
    create_folder(&args.output)?;
    let at = |name: &str| args.output.join(name);
    write_volume(&at("spect.nii.gz"), &made.volume, StoredType::Int16)?;
    write_volume(&at("lv_truth.nii.gz"), &made.truth, StoredType::Uint8)?;
    let text = serde_json::to_string_pretty(&made.parameters)?;
    write_file(&at("params.json"), text.as_bytes())?;
    if args.projections {
        write_file(&at("raw.dcm"), &raw(args, &parameters)?)?;
    }
    note!(
        "Written: spect.nii.gz, lv_truth.nii.gz{} and params.json in {}",
        if args.projections { ", raw.dcm" } else { "" },
        args.output.display()
    );
    Ok(())
}

/// The projections of the phantom as a DICOM file, of a patient of its own.
fn raw(args: &PhantomArgs, parameters: &PhantomParameters) -> Result<Vec<u8>> {
    let projections = phantom_projections(parameters, args.counts, &Monitor::silent())?;
    let text = serde_json::to_string(parameters)?;
    let made = Moment {
        date: "20000101".into(),
        time: "000000".into(),
    };
    let whose = Provenance {
        patient_id: Some(format!("PHANTOM{}", args.seed)),
        patient_name: Some("Phantom^Simulated".into()),
        study_uid: Some(derived_uid(&[b"phantom", text.as_bytes()])),
        ..Provenance::default()
    };
    let shape = projections.shape();
    let frame = VoxelToPatient::centred(shape, [projections.pixel_mm; 3], Vec3::zeros())?;
    let scan = SourceScan::new(whose, frame, shape, false, made);
    let heads = usize::from(args.heads);
    Ok(nuclear_projections(
        &scan,
        &projections,
        heads,
        PEOPLE_NOTE,
    )?)
}

/// The description of the simulated healthy people in their files.
const PEOPLE_NOTE: &str = "simulated, not patients";

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
        facts["people"] = PEOPLE_NOTE.into();
        write_file(
            &folder.join("params.json"),
            serde_json::to_string_pretty(&facts)?.as_bytes(),
        )?;
        let sex = if person.female { "F" } else { "M" };
        table += &format!("{case},{case}/spect.nii.gz,{sex},phantom,{PEOPLE_TRACER},no,yes\n");
    }
    write_file(&args.output.join("cohort.csv"), table.as_bytes())?;
    note!(
        "Written: {} healthy hearts ({PEOPLE_NOTE}) and cohort.csv in {}",
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
