//! Errors of reading a volume.

use crate::base::geometry::frame::VOXEL_MM;
use crate::base::progress::Cancelled;
use crate::mesh::files::MeshFileError;
use ventriform_dicom::read::ReadError;

/// Problems of a file. [`VolumeError::field`] names the field concerned.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum VolumeError {
    /// No file was given.
    #[error("no file was given")]
    NoFile,
    /// The file has no bytes.
    #[error("{file} is empty")]
    Empty {
        /// The file's name.
        file: String,
    },
    /// A known format that is not supported.
    #[error("{file} is {format}, which is not supported")]
    Unsupported {
        /// The file's name.
        file: String,
        /// The format.
        format: String,
        /// A way to make a readable file of it.
        fix: &'static str,
    },
    /// A DICOM object that holds no volume.
    #[error("{file} is {found}: {reason}")]
    NotVolume {
        /// The file's name.
        file: String,
        /// Name, SOP class and modality of the object.
        found: String,
        /// Its content.
        reason: &'static str,
        /// Advice on files that can be sent.
        fix: &'static str,
    },
    /// Files that do not belong to one DICOM series, or of which some are missing.
    #[error("the {count} DICOM files do not make up one volume: {reason}")]
    NotOneSeries {
        /// Number of files.
        count: usize,
        /// The contradiction.
        reason: String,
    },
    /// An image whose Image Type says that it does not contain reconstructed slices.
    #[error("{file} has the Image Type {image_type}: {reason}")]
    NotSlices {
        /// The file's name.
        file: String,
        /// Image Type (0008,0008), or the value that tells.
        image_type: String,
        /// Its content.
        reason: &'static str,
        /// Advice on files that can be sent.
        fix: &'static str,
    },
    /// The format is unknown.
    #[error("{file} is not in a known volume format: it begins with {start}")]
    Unrecognised {
        /// The file's name.
        file: String,
        /// Its first bytes, escaped.
        start: String,
    },
    /// A header field has an invalid value.
    #[error("{file}: {field} is {value}: {reason}")]
    Field {
        /// The file's name.
        file: String,
        /// Name of the field in its standard.
        field: &'static str,
        /// The invalid value.
        value: String,
        /// Why it is invalid.
        reason: String,
        /// Offset of the field in the unpacked file, if known.
        byte: Option<u64>,
    },
    /// The file is shorter than its header implies.
    #[error(
        "{file} is cut off or its header is wrong: it needs {needed} bytes and has at most {found}"
    )]
    Truncated {
        /// The file's name.
        file: String,
        /// Bytes (unpacked) up to the last voxel.
        needed: u64,
        /// Bytes (unpacked) in the file; for a packed file an upper bound.
        found: u64,
    },
    /// The compressed stream is damaged.
    #[error("{file} is damaged after {byte} unpacked bytes: {reason}")]
    Corrupt {
        /// The file's name.
        file: String,
        /// Bytes unpacked so far.
        byte: u64,
        /// Message of the decoder.
        reason: String,
    },
    /// The file exceeds a limit.
    #[error("{file} has {asked} {what}; the limit is {limit}")]
    TooLarge {
        /// The file's name.
        file: String,
        /// The limited quantity.
        what: &'static str,
        /// Its amount in the file.
        asked: u64,
        /// The limit.
        limit: u64,
    },
    /// The file holds several volumes, and none was chosen.
    #[error(
        "the file holds {frames} frames, of which one must be chosen{}",
        .why.as_ref().map(|why| format!(", since they are no gates of one heart beat: {why}"))
            .unwrap_or_default()
    )]
    FrameNeeded {
        /// Number of volumes; valid numbers are 0..frames.
        frames: usize,
        /// Why they are not summed as gates of one heart beat, if the file says that they are none.
        why: Option<String>,
    },
    /// A file of one volume where the gates of a beat are needed.
    #[error("{file} holds one volume; a beat needs the gates of a study")]
    NotGated {
        /// The file's name.
        file: String,
    },
    /// A file that is given as a gate and does not lie on the first gate's grid, or is of another patient or study.
    #[error("gate {gate} {}: files of one gate each must be one study on one grid", .difference)]
    OtherGate {
        /// The gate, from 1.
        gate: usize,
        /// How it differs, in words that follow the gate.
        difference: String,
    },
    /// The chosen volume does not exist.
    #[error("the file holds {frames} frames, counted from 0; there is no frame {frame}")]
    FrameOutOfRange {
        /// The number given.
        frame: usize,
        /// Number of volumes.
        frames: usize,
    },
    /// A `.hdr` without its `.img`.
    #[error("{file} is a NIfTI header whose voxels are in a second file, which is missing")]
    ImageMissing {
        /// Name of the header file.
        file: String,
    },
    /// Several files that do not form one volume.
    #[error("{place} holds {held}, which are not one volume")]
    NotOneVolume {
        /// Where they were found: a folder, an archive, or what was given.
        place: String,
        /// Numbers of files of each kind.
        held: String,
    },
    /// The value of a voxel exceeds the range of 32-bit floats.
    #[error("{file}: voxel ({}, {}, {}) is {value}, beyond the range of 32-bit \
        floats", .voxel[0], .voxel[1], .voxel[2])]
    Overflow {
        /// The file's name.
        file: String,
        /// Index (i, j, k) of the voxel.
        voxel: [usize; 3],
        /// The value with slope and intercept applied.
        value: f64,
    },
    /// No scan of a heart has voxels of this size.
    #[error(
        "the voxels are {} mm in size, and those of a scan are {} to {} mm",
        .spacing_mm.map(|mm| mm.to_string()).join(" x "),
        VOXEL_MM.start(),
        VOXEL_MM.end()
    )]
    VoxelSize {
        /// Along i, j, k, mm.
        spacing_mm: [f64; 3],
    },
    /// Every voxel is NaN or infinite.
    #[error("{file}: no voxel has a finite value")]
    NoFiniteVoxel {
        /// The file's name.
        file: String,
    },
    /// The file of a mesh holds no closed surface, or one whose size or frame cannot be told.
    #[error("{file}: {error}")]
    Mesh {
        /// The file's name.
        file: String,
        /// Why.
        error: MeshFileError,
    },
    /// A volume of one slice, of which no model can be made.
    #[error("the volume has {} x {} x {} voxels: it is a single slice, of which no model can be \
        made", .shape[0], .shape[1], .shape[2])]
    SingleSlice {
        /// Voxels along i, j, k.
        shape: [usize; 3],
    },
    /// Memory for the voxels could not be allocated.
    #[error("{bytes} bytes of memory for the voxels could not be allocated")]
    Memory {
        /// Bytes needed.
        bytes: u64,
    },
    /// The operating system could not read the file.
    #[error("{file} could not be read: {reason}")]
    Io {
        /// The file's name.
        file: String,
        /// Message of the operating system.
        reason: String,
    },
    /// The caller cancelled the work.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl From<ReadError> for VolumeError {
    fn from(error: ReadError) -> Self {
        match error {
            ReadError::Unsupported { file, format, fix } => Self::Unsupported { file, format, fix },
            ReadError::NotVolume {
                file,
                found,
                reason,
                fix,
            } => Self::NotVolume {
                file,
                found,
                reason,
                fix,
            },
            ReadError::NotSlices {
                file,
                image_type,
                reason,
                fix,
            } => Self::NotSlices {
                file,
                image_type,
                reason,
                fix,
            },
            ReadError::Field {
                file,
                field,
                value,
                reason,
                byte,
            } => Self::Field {
                file,
                field,
                value,
                reason,
                byte,
            },
            ReadError::Truncated {
                file,
                needed,
                found,
            } => Self::Truncated {
                file,
                needed,
                found,
            },
            ReadError::Corrupt { file, byte, reason } => Self::Corrupt { file, byte, reason },
            ReadError::Stopped => Self::Cancelled(Cancelled),
        }
    }
}

impl VolumeError {
    /// The name of the file, or the place of the files, that it is about.
    pub(super) fn file_mut(&mut self) -> Option<&mut String> {
        match self {
            Self::Empty { file }
            | Self::Unsupported { file, .. }
            | Self::NotVolume { file, .. }
            | Self::NotSlices { file, .. }
            | Self::Unrecognised { file, .. }
            | Self::Field { file, .. }
            | Self::Truncated { file, .. }
            | Self::Corrupt { file, .. }
            | Self::TooLarge { file, .. }
            | Self::NotGated { file }
            | Self::ImageMissing { file }
            | Self::Overflow { file, .. }
            | Self::NoFiniteVoxel { file }
            | Self::Mesh { file, .. }
            | Self::Io { file, .. }
            | Self::NotOneVolume { place: file, .. } => Some(file),
            _ => None,
        }
    }

    /// The header field or request parameter that the error is about.
    pub fn field(&self) -> Option<&'static str> {
        match self {
            VolumeError::Field { field, .. } => Some(field),
            VolumeError::NotSlices { .. } => Some("Image Type (0008,0008)"),
            VolumeError::FrameNeeded { .. } | VolumeError::FrameOutOfRange { .. } => Some("frame"),
            _ => None,
        }
    }

    /// The error without what the file says in words: values that are texts, names of series, first bytes. Numbers,
    /// UIDs of known form and the standard's own terms stay. For records that outlive the file, or that others read.
    #[must_use]
    pub fn without_header_text(&self) -> Self {
        let mut error = self.clone();
        match &mut error {
            VolumeError::Field { value, .. } if !is_told(value) => *value = untold(value),
            VolumeError::NotSlices { image_type, .. } if !image_type.split('\\').all(is_term) => {
                *image_type = untold(image_type);
            }
            // SOP class and modality follow in parentheses.
            VolumeError::NotVolume { found: text, .. }
            | VolumeError::Unsupported { format: text, .. } => {
                if let Some((name, said)) = text.rsplit_once(" (")
                    && !said
                        .trim_end_matches(')')
                        .chars()
                        .all(|c| c.is_ascii_hexdigit() || c == ',')
                {
                    *text = name.to_owned();
                }
            }
            VolumeError::NotOneSeries { reason, .. } => {
                // The series are listed after a colon, unless that is within a value.
                let listed = reason.split_once(" series: ");
                match listed.filter(|(count, _)| !count.contains('"')) {
                    Some((count, _)) => {
                        *reason = format!("{count} series; send the files of one of them alone");
                    }
                    None => *reason = without_values(reason).unwrap_or_else(|| reason.clone()),
                }
            }
            VolumeError::OtherGate { difference, .. } => {
                if let Some(told) = without_values(difference) {
                    *difference = told;
                }
            }
            // Of a contradiction; the words of this program may be in quotes, too.
            VolumeError::FrameNeeded { why: Some(why), .. } if why.contains(" is \"") => {
                if let Some(told) = without_values(why) {
                    *why = told;
                }
            }
            VolumeError::Unrecognised { start, .. } => *start = "other bytes".to_owned(),
            VolumeError::Mesh { error, .. } => *error = error.without_text(),
            _ => {}
        }
        error
    }
}

/// The name of the attribute that files contradict each other on, without the values, which follow it in quotes; `None`
/// if nothing is quoted.
fn without_values(reason: &str) -> Option<String> {
    let (told, _) = reason.split_once('"')?;
    let told = told.trim_end();
    let told = told.strip_suffix(" is").unwrap_or(told);
    Some(format!("{told} differs"))
}

/// Words of this program in the place of a value.
const OWN_WORDS: [&str; 10] = [
    "missing",
    "contradictory",
    "present",
    "given too often",
    "in one piece",
    "in fragments",
    "in more fragments",
    "not finite",
    "not linear",
    "empty",
];

/// Whether a value is no text of the file: a number or several, a UID, or words of this program.
fn is_told(value: &str) -> bool {
    let is_number = |c: char| c.is_ascii_digit() || " .,+-()[]\\".contains(c);
    let numbers = value.split(is_number).filter(|rest| !rest.is_empty());
    OWN_WORDS.contains(&value)
        || numbers
            .clone()
            .all(|rest| ["e", "E", "NaN", "inf", "bytes", "long", "intercept"].contains(&rest))
        || (value.starts_with('(')
            && value
                .chars()
                .all(|c| c.is_ascii_hexdigit() || " (),".contains(c)))
}

/// What stands for a text.
fn untold(value: &str) -> String {
    format!("a text of {} characters", value.chars().count())
}

/// Whether a value of Image Type is a term of the standard that tells the kind of image.
fn is_term(value: &str) -> bool {
    const TERMS: [&str; 22] = [
        "",
        "ORIGINAL",
        "DERIVED",
        "PRIMARY",
        "SECONDARY",
        "STATIC",
        "DYNAMIC",
        "GATED",
        "WHOLE BODY",
        "TOMO",
        "GATED TOMO",
        "RECON TOMO",
        "RECON GATED TOMO",
        "EMISSION",
        "TRANSMISSION",
        "LOCALIZER",
        "MOSAIC",
        "AXIAL",
        "REPROJECTION",
        "VOLUME",
        "NONE",
        "OTHER",
    ];
    TERMS.contains(&value)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a header says of a person.
    const MARK: &str = "Zzyzx^Maria";

    #[test]
    fn no_error_keeps_a_text_of_the_file() {
        let file = || "volume.dcm".to_owned();
        let field = |value: &str| VolumeError::Field {
            file: file(),
            field: "Rescale Slope (0028,1053)",
            value: value.to_owned(),
            reason: "1 decimal number(s) expected".into(),
            byte: None,
        };
        let errors = [
            field(MARK),
            field(&format!("1.5\\{MARK}")),
            VolumeError::NotSlices {
                file: file(),
                image_type: MARK.into(),
                reason: "it is no slice",
                fix: "",
            },
            VolumeError::NotVolume {
                file: file(),
                found: format!("a CT Image (1.2.{MARK}, modality {MARK})"),
                reason: "an object of a kind that is not read",
                fix: "",
            },
            VolumeError::Unsupported {
                file: file(),
                format: format!("a DICOM file in an unknown transfer syntax ({MARK})"),
                fix: "",
            },
            VolumeError::NotOneSeries {
                count: 4,
                reason: format!(
                    "they belong to 2 series: number {MARK} \"{MARK}\" (UID 1.2, 4 files); send them"
                ),
            },
            VolumeError::Unrecognised {
                file: file(),
                start: MARK.into(),
            },
            VolumeError::NotOneSeries {
                count: 2,
                reason: format!(
                    "Patient's Name (0010,0010) is \"{MARK}\" in a.dcm, and \"{MARK} series: \" in 3 files, such as \
                     b.dcm"
                ),
            },
            VolumeError::NotOneSeries {
                count: 2,
                reason: format!(
                    "they say that they are gates, but not of one scan: Study ID (0020,0010) is \"{MARK}\" in a.dcm, \
                     and \"\" in b.dcm; they differ in Tracer too"
                ),
            },
            VolumeError::OtherGate {
                gate: 2,
                difference: format!(
                    "is of another scan: Patient ID (0010,0020) is \"{MARK}\", and \"7\""
                ),
            },
        ];
        for error in errors {
            let told = error.without_header_text().to_string();
            assert!(
                error.to_string().contains(MARK) && !told.contains("Zzyzx"),
                "{told}"
            );
        }
        let kept = [
            "1.5\\2",
            "[0.0, -1e-3]",
            "missing",
            "12",
            "(0054,0080) (0054,0050)",
            "70000 bytes long",
        ];
        for value in kept {
            assert_eq!(field(value).without_header_text(), field(value));
        }
        let people = VolumeError::FrameNeeded {
            frames: 8,
            why: Some("the names of the files say that they are something else (\"case\")".into()),
        };
        assert_eq!(people.without_header_text(), people);
        let recon = VolumeError::NotVolume {
            file: file(),
            found: "a DICOM data set without a SOP Class UID (0008,0016)".into(),
            reason: "it does not say what it holds",
            fix: "",
        };
        assert_eq!(recon.without_header_text(), recon);
    }
}
