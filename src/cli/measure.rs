//! `ventriform measure`: the agreement of two masks.

use super::limit_args::LimitArgs;
use super::mesh_args::MeshArgs;
use super::output::{json, note};
use anyhow::{Error, Result, anyhow};
use clap::Args;
use std::cell::Cell;
use std::path::{Path, PathBuf};
use ventriform::base::progress::Monitor;
use ventriform::image::volume::given_mask::{
    GivenMask, GivenMaskError, MaskAgreement, MaskAgreementError, MaskChoice, MaskLabel, read_mask,
};
use ventriform::image::volume::{VolumeError, VolumeFile};
use ventriform::mesh::files::{MeshFileError, MeshStatement};
use ventriform::results::report::AgreementReport;
use ventriform::runs::advice::Explain;

/// Compare two masks: Jaccard E_J, mean contour distance E_CD, Dice, Hausdorff
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  ventriform measure out/mask.nii.gz expert.nii.gz
  ventriform measure out/mask.nii.gz organs.nii.gz --label 2
  ventriform measure out/mask.nii.gz seg.dcm --label-b 'Left ventricle' --resample
Prints JSON. A mask is a volume of 0 and another value, a label map, a DICOM Segmentation, or
probabilities of which those above 0.5 count. Of several structures one must be named, unless it is
the only segment coded as myocardium. A closed mesh (STL, PLY, OBJ, VTK, VTP, glTF, JSON) is a mask, too:
its inside, voxelised on the grid of the other. Masks of one lattice of voxels are compared however they are
stored; another lattice is refused without --resample.")]
pub struct MeasureArgs {
    /// Mask to judge
    #[arg(value_name = "A")]
    a: PathBuf,
    /// Reference mask
    #[arg(value_name = "B")]
    b: PathBuf,
    /// Structure to compare, of each file that holds several: number of a label or segment, or name of a
    /// segment
    #[arg(long, value_name = "LABEL", allow_hyphen_values = true)]
    label: Option<String>,
    /// Structure of A
    #[arg(long, value_name = "LABEL", allow_hyphen_values = true)]
    label_a: Option<String>,
    /// Structure of B
    #[arg(long, value_name = "LABEL", allow_hyphen_values = true)]
    label_b: Option<String>,
    /// Resample B to the grid of A by the nearest voxel if they are different grids
    #[arg(long)]
    resample: bool,
    #[command(flatten)]
    mesh: MeshArgs,
    #[command(flatten)]
    limits: LimitArgs,
}

/// Runs the command.
///
/// # Errors
/// If a file cannot be read, which structure is meant cannot be told, a mask is empty, or the masks lie
/// on different grids.
pub fn run(args: &MeasureArgs) -> Result<()> {
    let monitor = Monitor::silent();
    let [a, b] = [(&args.a, &args.label_a), (&args.b, &args.label_b)]
        .map(|(path, own)| read(path, own.as_deref(), args.label.as_deref(), args));
    let (a, b) = (a?, b?);
    if let Some(label) = &args.label
        && [&a, &b].iter().all(|read| !read.by_common_label)
        && args.label_a.is_none()
        && args.label_b.is_none()
    {
        let paths = [&args.a, &args.b].map(|path| path.display().to_string());
        return Err(anyhow!(
            "--label {label}: neither {} nor {} has such a structure; leave it out",
            paths[0],
            paths[1]
        ));
    }
    for (path, read) in [(&args.a, &a), (&args.b, &b)] {
        if let Some(structure) = &read.mask.structure {
            note!("{}: {structure} was compared", path.display());
        }
    }
    let made = a.mask.agreement(b.mask, args.resample, &monitor);
    let MaskAgreement {
        agreement,
        resampled,
    } = made.map_err(|error| match error {
        MaskAgreementError::Unplaced {
            of_reference,
            error,
        } => {
            let path = if of_reference { &args.b } else { &args.a };
            anyhow!("{}: {}", path.display(), error.with_advice())
        }
        error => error.into(),
    })?;
    if resampled {
        note!("{}: resampled to the grid of A", args.b.display());
    }
    json(&serde_json::to_string_pretty(
        &AgreementReport::from_agreement(&agreement),
    )?);
    Ok(())
}

/// A mask that was read.
struct ReadMask {
    mask: GivenMask,
    /// Whether the label for both files named its structure.
    by_common_label: bool,
}

/// The error `text` about the file at `path`, which many errors state already.
fn about(path: &Path, text: &str) -> Error {
    let path = path.display().to_string();
    if text.contains(&path) {
        anyhow!("{text}")
    } else {
        anyhow!("{path}: {text}")
    }
}

/// Reads the mask at `path`: the structure `own`, otherwise the one that `common` names, otherwise the
/// only one.
fn read(
    path: &Path,
    own: Option<&str>,
    common: Option<&str>,
    args: &MeasureArgs,
) -> Result<ReadMask> {
    let files = VolumeFile::with_other_half(path);
    let limits = args.limits.limits()?;
    // What is stated counts for the file that does not state it.
    let stated = Cell::new(MeshStatement::from(args.mesh));
    let read = |label: Option<&str>| {
        let label = label.map(|text| {
            let Ok(label) = text.parse::<MaskLabel>();
            label
        });
        let choice = MaskChoice {
            label,
            resample: false,
            mesh: stated.get(),
        };
        read_mask(&files, &choice, &limits, &Monitor::silent())
    };
    let read = |label: Option<&str>| loop {
        match read(label) {
            Err(GivenMaskError::File(VolumeError::Mesh {
                error: MeshFileError::Contradiction { field, .. },
                ..
            })) if stated.get() != MeshStatement::default() => {
                let mut less = stated.get();
                match field {
                    "unit" if less.unit.is_some() => less.unit = None,
                    _ => less.frame = None,
                }
                stated.set(less);
            }
            other => return other,
        }
    };
    let named = read(own.or(common));
    // A file with one structure needs no label for both files.
    let mask = match (named, own) {
        (Err(error @ GivenMaskError::NoSuchStructure { .. }), None) => {
            read(None).map(|mask| (mask, false)).map_err(|_| error)
        }
        (named, _) => named.map(|mask| (mask, own.is_none() && common.is_some())),
    };
    match mask {
        Ok((mask, by_common_label)) => Ok(ReadMask {
            mask,
            by_common_label,
        }),
        Err(error) => Err(about(path, &error.with_advice())),
    }
}
