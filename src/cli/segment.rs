//! `ventriform segment`: a model fitted to a patient.

use super::Bar;
use crate::deform::DeformParameters;
use crate::deform::localise::Hints;
use crate::deform::template::{Organ, Template};
use crate::export::{self, Format, Metadata};
use crate::geometry::Vec3;
use crate::polar;
use crate::progress::{CancelToken, Monitor};
use crate::segmentation::{
    NamedTemplate, Segmentation, SegmentationParameters, mask_volume, report_json, segment,
};
use crate::volume::nifti::{self, StoredType};
use crate::volume::{self, ReadLimits, ReadOptions, Reading, Volume, VolumeFile};
use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

/// Fits a model to the left ventricle (or another organ) in a volume.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  ventriform segment scan.nii.gz --model lv.json -o out
  ventriform segment scan.dcm --model a.json --model b.json -o out --expert mask.nii.gz
Writes mask.nii.gz, mesh.glb, mesh.stl, mesh.json, report.json and polar.json/.svg/.png")]
pub struct SegmentArgs {
    /// The volume: NIfTI or DICOM NM
    #[arg(value_name = "IN", required = true, num_args = 1..=2)]
    input: Vec<PathBuf>,
    /// The model to fit, a JSON mesh of `generate` (repeatable: the best fit is taken)
    #[arg(long, value_name = "MODEL", required = true)]
    model: Vec<PathBuf>,
    /// The folder to write to (made where missing)
    #[arg(short, long = "output", value_name = "OUTDIR")]
    output: PathBuf,
    /// An expert's mask to measure against
    #[arg(long, value_name = "MASK")]
    expert: Option<PathBuf>,
    /// What the model shows
    #[arg(long, value_enum, default_value_t = OrganName::LeftVentricle)]
    organ: OrganName,
    /// A point in the cavity, LPS millimetres; else it is searched
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, allow_hyphen_values = true)]
    center: Option<Vec3>,
    /// Direction from base to apex, LPS; else it is searched
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, allow_hyphen_values = true)]
    axis: Option<Vec3>,
    /// How far outside the steepest slope the edge is drawn, millimetres. Default: 2.5 for
    /// DICOM NM, whose readers draw wide (measured on one expert mask), else 0
    #[arg(long, value_name = "MM", allow_hyphen_values = true)]
    margin: Option<f64>,
    /// The volume's number in a file that holds several
    #[arg(long, value_name = "N")]
    frame: Option<usize>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum OrganName {
    #[value(alias = "left_ventricle", alias = "lv")]
    LeftVentricle,
    Liver,
    Kidney,
    Generic,
}

impl From<OrganName> for Organ {
    fn from(name: OrganName) -> Self {
        match name {
            OrganName::LeftVentricle => Organ::LeftVentricle,
            OrganName::Liver => Organ::Liver,
            OrganName::Kidney => Organ::Kidney,
            OrganName::Generic => Organ::Generic,
        }
    }
}

fn parse_point(text: &str) -> Result<Vec3, String> {
    let numbers: Vec<f64> = text
        .split(',')
        .map_while(|part| part.trim().parse().ok())
        .collect();
    match numbers[..] {
        [x, y, z] if text.split(',').count() == 3 => Ok(Vec3::new(x, y, z)),
        _ => Err("three numbers are needed, for example 30,-20,5.5".into()),
    }
}

/// Margin of readers of clinical DICOM scans, mm: one expert's mask lies 3 mm outside the
/// steepest slope; 2.5 mm gave the best agreement there.
const DICOM_MARGIN: f64 = 2.5;

/// Runs the command.
///
/// # Errors
/// What reading, fitting or the file system says; nothing is written unless the fit stands.
pub fn run(args: &SegmentArgs) -> Result<()> {
    let bar = Bar::start();
    let monitor = Monitor::new(&bar, CancelToken::new());
    let made = fit_all(args, &monitor);
    bar.finish();
    let (reading, segmentation) = made?;
    write_all(&args.output, &reading.volume, &segmentation)?;
    eprintln!("{}", headline(&segmentation));
    for flag in &segmentation.fit.flags {
        eprintln!("warning: {flag}");
    }
    Ok(())
}

fn fit_all(args: &SegmentArgs, monitor: &Monitor) -> Result<(Reading, Segmentation)> {
    let reading = read(&args.input, args.frame, monitor)?;
    let expert = args
        .expert
        .as_ref()
        .map(|path| read(std::slice::from_ref(path), None, monitor))
        .transpose()?;
    let templates = templates(&args.model, args.organ.into(), monitor)?;
    let margin = match reading.facts.format {
        volume::Format::DicomNm => DICOM_MARGIN,
        _ => 0.0,
    };
    let parameters = SegmentationParameters {
        deform: DeformParameters {
            hints: Hints {
                centre: args.center,
                axis: args.axis,
                region: None,
            },
            margin: args.margin.unwrap_or(margin),
            ..DeformParameters::default()
        },
        ..SegmentationParameters::default()
    };
    let expert = expert.as_ref().map(|e| &e.volume);
    let made = segment(&reading.volume, &templates, &parameters, expert, monitor)?;
    Ok((reading, made))
}

/// Reads one volume.
pub(super) fn read(paths: &[PathBuf], frame: Option<usize>, monitor: &Monitor) -> Result<Reading> {
    let files: Vec<VolumeFile> = paths.iter().map(VolumeFile::at).collect();
    volume::read(
        &files,
        &ReadOptions { frame },
        &ReadLimits::default(),
        monitor,
    )
    .with_context(|| format!("{}", paths[0].display()))
}

/// Reads models and makes them ready.
pub(super) fn templates(
    paths: &[PathBuf],
    organ: Organ,
    monitor: &Monitor,
) -> Result<Vec<NamedTemplate>> {
    paths
        .iter()
        .map(|path| {
            let context = || format!("{}", path.display());
            let bytes = std::fs::read(path).with_context(context)?;
            let mesh = export::read_json::decode(&bytes).with_context(context)?;
            Ok(NamedTemplate {
                name: path
                    .file_stem()
                    .map_or_else(context, |s| s.to_string_lossy().into_owned()),
                template: Template::new(mesh, organ, monitor).with_context(context)?,
            })
        })
        .collect()
}

fn headline(s: &Segmentation) -> String {
    let mut line = format!(
        "{} after {} steps, confidence {:.2}; wall {:.1} ml",
        s.fit.reason.as_str(),
        s.fit.iterations,
        s.fit.confidence,
        s.fit.wall_ml
    );
    if let Some(wall) = &s.fit.wall {
        line += &format!(", cavity {:.1} ml", wall.cavity_ml);
    }
    if let Some(a) = &s.agreement {
        line += &format!("; Jaccard {:.3}, Dice {:.3}", a.jaccard, a.dice);
        if let Some(c) = &a.contours {
            line += &format!(", contour distance {:.3} voxels", c.mean_voxels);
        }
    }
    line
}

fn write_all(folder: &Path, volume: &Volume, segmentation: &Segmentation) -> Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        std::fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))
    };
    let mask = mask_volume(&segmentation.mask, volume);
    write(
        "mask.nii.gz",
        &nifti::write(&mask, StoredType::Uint8, true)?,
    )?;
    let metadata = Metadata::new("Fitted model");
    for (name, format) in [
        ("mesh.glb", Format::Glb),
        ("mesh.stl", Format::Stl),
        ("mesh.json", Format::Json),
    ] {
        let bytes = export::encode(format, &segmentation.fit.mesh, &metadata)?;
        write(name, &bytes)?;
    }
    let report = serde_json::to_vec_pretty(&report_json(segmentation))?;
    write("report.json", &report)?;
    if let Some(map) = &segmentation.polar {
        write("polar.json", &serde_json::to_vec(&polar::json(map))?)?;
        write("polar.svg", polar::svg(map).as_bytes())?;
        write("polar.png", &polar::png(map)?)?;
    }
    Ok(())
}
