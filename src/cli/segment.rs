//! `ventriform segment`: fits a model to a patient's volume.

use super::dicom_args::DicomArgs;
use super::generate::parse_part;
use super::limit_args::LimitArgs;
use super::mesh_args::read_mesh;
use super::normals::{NormalLimitArgs, normals_line};
use super::output::{create_folder, note, write_file};
use super::volume_args::volume_files;
use super::{Bar, FitArgs, UnusableArgument};
use anyhow::{Context, Result, anyhow};
use clap::Args;
use std::path::{Path, PathBuf};
use ventriform::base::progress::{CancelToken, Monitor, Plan};
use ventriform::heart::reader::ReaderProfile;
use ventriform::image::volume::{ReadLimits, VolumeFile};
use ventriform::mesh::files::MeshStatement;
use ventriform::parameters::FitParameters;
use ventriform::results::export::{Format, Part};
use ventriform::runs::advice::Explain;
use ventriform::runs::segmentation::Segmentation;
use ventriform::runs::segmentation::{
    NamedFile, NamedMesh, NamedReader, SegmentationOrder, from_files,
};

/// Fit a model to the left ventricle (or another organ) in a volume
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  ventriform segment scan.nii.gz -o out
  ventriform segment scan.nii.gz --model lv.json -o out
  ventriform segment scan.dcm --model a.json --model b.json -o out --expert mask.nii.gz
  ventriform segment scan.nii.gz --model heart.stl --expert drawn.vtp --mesh-frame ras -o out
  ventriform segment scan.nii.gz --model auto -o out --seed-point 60,70,55 --format ply
Writes mask.nii.gz, labels.nii.gz and labels.seg.nrrd (wall 1, cavity 2), mesh.glb, mesh.stl, mesh.json (or the \
formats given by --format), report.json,
report.html, slices.png, region.nii.gz (the scan about the organ, which the report shows) and, for the
left ventricle, polar.json, polar.svg, polar.png, and mask and mesh of the anatomical wall: mask_anatomical.nii.gz, \
mesh_anatomical.glb, ... (with --edge anatomical:
mask_apparent.nii.gz, mesh_apparent.glb, ...); with --dicom also mask.dcm, contours.dcm, mesh.dcm,
surface.dcm, measurements.dcm, fhir.json (the same as FHIR R4), polar.dcm and page.dcm (the report as one picture).
Of raw projections also projections.png (views, sinogram, linogram)")]
pub struct SegmentArgs {
    /// The volume: NIfTI (.nii, .nii.gz, or a .hdr and .img pair) or DICOM (a multi-frame NM, PET, CT or
    /// MR file, all files of one series, or a zip or folder of them)
    #[arg(value_name = "IN", required = true, num_args = 1..)]
    input: Vec<PathBuf>,
    /// Model to fit: a closed mesh (JSON as `generate` writes it, STL, PLY, OBJ, VTK, VTP, glTF), or auto for
    /// the built-in hearts (repeatable: the fit with the greatest confidence is kept)
    #[arg(long, value_name = "MODEL", default_value = MODEL_AUTO)]
    model: Vec<PathBuf>,
    /// Folder to write to (created if missing)
    #[arg(short, long = "output", value_name = "OUTDIR")]
    output: PathBuf,
    /// Expert's mask to measure the result against: a volume, or a closed mesh
    #[arg(long, value_name = "MASK")]
    expert: Option<PathBuf>,
    /// A reader's profile, as `calibrate` writes it: the wall is drawn as that reader would
    #[arg(long, value_name = "PROFILE")]
    reader: Option<PathBuf>,
    /// Format of the fitted mesh (repeatable)
    #[arg(
        long = "format",
        value_name = "FORMAT",
        value_parser = parse_format,
        default_values = ["glb", "stl", "json"]
    )]
    formats: Vec<Format>,
    /// Also write this part of the wall as an open surface, mesh_PART.glb ... (repeatable; left ventricles only)
    #[arg(long = "part", value_name = "PART", value_parser = parse_part)]
    parts: Vec<Part>,
    #[command(flatten)]
    normals: NormalLimitArgs,
    #[command(flatten)]
    dicom: DicomArgs,
    #[command(flatten)]
    fit: FitArgs,
    #[command(flatten)]
    limits: LimitArgs,
}

/// The word that stands for the built-in hearts.
pub(super) const MODEL_AUTO: &str = FitParameters::AUTO_MODEL;

pub(super) fn parse_format(text: &str) -> Result<Format, String> {
    Format::from_extension(text).ok_or_else(|| {
        let names = Format::ALL.map(Format::extension).join(", ");
        format!("give one of {names}")
    })
}

/// Runs the command.
///
/// # Errors
/// If a file cannot be read, the model cannot be fitted, or a file cannot be written. Nothing is
/// written unless the fit is complete.
pub fn run(args: &SegmentArgs) -> Result<()> {
    let parameters = args.fit.parameters().map_err(UnusableArgument::from)?;
    let limits = args.limits.limits()?;
    let volume = volume_files(&args.input, &limits)?;
    let dicom = args.dicom.order(&volume, parameters.frame, &limits)?;
    let whose = args.dicom.whose(&volume, parameters.frame, &limits)?;
    let stated = parameters.mask.mesh;
    let expert = args.expert.as_ref().map(VolumeFile::with_other_half);
    let (auto, models) = chosen_models(&args.model, &stated, &limits)?;
    let normals = args.normals.limits(&parameters)?;
    let order = SegmentationOrder {
        volume: &volume,
        expert: expert.as_ref().map(|files| &files[..]),
        auto,
        models,
        reader: args.reader.as_deref().map(reader).transpose()?,
        normals: normals.as_ref(),
        parameters: &parameters,
    };
    let bar = Bar::over(Plan::SEGMENTATION);
    let monitor = Monitor::new(&bar, CancelToken::new());
    let made = from_files(&order, &limits, &monitor)
        .map_err(|error| anyhow!(error.with_advice()))
        .and_then(|made| Ok((made.files(&args.formats, None, &monitor)?, made)));
    bar.finish();
    let (mut files, made) = made?;
    for part in &args.parts {
        let cut = made.part_files(*part, &args.formats, &monitor)?;
        if cut.is_empty() {
            return Err(anyhow!(
                "the fitted mesh has no {}: only those of left ventricles have parts; leave out --part",
                part.as_str()
            ));
        }
        files.extend(cut);
    }
    files.push(made.page(&files, whose.as_ref()));
    if let Some(order) = dicom {
        let scan = order.source_scan(&made);
        let objects = made.dicom_files(&scan);
        files.extend(objects.map_err(|error| anyhow!(error.with_advice()))?);
    }
    write_all(&args.output, &files)?;
    note!("{}", headline(&made.segmentation));
    if let Some(perfusion) = &made.perfusion {
        note!("{}", normals_line(perfusion));
        for flag in &perfusion.flags {
            note!("warning: {flag}");
        }
    }
    for warning in made.warnings() {
        note!("warning: {warning}");
    }
    for flag in &made.segmentation.fit.judgement.flags {
        note!("warning: {flag}");
    }
    Ok(())
}

/// Whether the built-in hearts are among the models that were given, and the others, read.
pub(super) fn chosen_models(
    given: &[PathBuf],
    stated: &MeshStatement,
    limits: &ReadLimits,
) -> Result<(bool, Vec<NamedMesh>)> {
    let is_auto = |model: &&PathBuf| model.as_os_str() == MODEL_AUTO;
    let named = given.iter().filter(|model| !is_auto(model));
    let models = named.map(|path| mesh(path, stated, limits));
    Ok((
        given.iter().any(|model| is_auto(&model)),
        models.collect::<Result<_>>()?,
    ))
}

/// Reads a model.
fn mesh(path: &Path, stated: &MeshStatement, limits: &ReadLimits) -> Result<NamedMesh> {
    let stem = path.file_stem().unwrap_or(path.as_os_str());
    Ok(NamedMesh {
        name: stem.to_string_lossy().into_owned(),
        mesh: read_mesh(path, stated, limits)?,
        required: true,
    })
}

/// Reads a reader's profile.
fn reader(path: &Path) -> Result<NamedReader> {
    let context = || format!("{}", path.display());
    let bytes = std::fs::read(path).with_context(context)?;
    let profile = ReaderProfile::from_json(&bytes)
        .map_err(|error| anyhow!(error.with_advice()))
        .with_context(context)?;
    let stem = path.file_stem();
    Ok(NamedReader {
        name: stem.map_or_else(context, |s| s.to_string_lossy().into_owned()),
        profile,
    })
}

fn headline(s: &Segmentation) -> String {
    let mut line = format!(
        "{} after {} steps, confidence {:.2}; wall {:.1} ml",
        s.fit.model.reason.as_str(),
        s.fit.model.iterations,
        s.fit.judgement.confidence,
        s.fit.model.wall_ml
    );
    if let Some(wall) = &s.fit.model.wall {
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

pub(super) fn write_all(folder: &Path, files: &[NamedFile]) -> Result<()> {
    create_folder(folder)?;
    for file in files {
        write_file(&folder.join(&file.name), &file.bytes)?;
    }
    Ok(())
}
