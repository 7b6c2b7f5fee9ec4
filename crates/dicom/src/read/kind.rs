//! The kind of a DICOM object, and advice on what to send instead of one that holds no volume and none can be made of.

use super::ReadError;
use super::attributes::{Attributes, IMAGE_TYPE, MODALITY, SERIES_TYPE, SOP_CLASS, UNITS, clip};
use dicom_core::dictionary::{UidDictionary, UidDictionaryEntry};
use dicom_dictionary_std::StandardSopClassDictionary;

/// Advice on objects that can be sent.
const READABLE_ADVICE: &str = "Send reconstructed slices: a multi-frame NM image with the Image Type \
    RECON TOMO or RECON GATED TOMO, or its projections (TOMO or GATED TOMO), an Enhanced PET, CT or MR \
    image, all files of one PET, CT or MR series (as several files or as one zip), or a Segmentation.";

/// The objects that hold slices, or of which slices can be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Nuclear Medicine Image with the Image Type RECON TOMO or RECON GATED TOMO: the frames are
    /// ordered by vectors.
    Nuclear {
        /// Whether it holds several gates.
        gated: bool,
    },
    /// Nuclear Medicine Image with the Image Type TOMO or GATED TOMO: the frames are projections acquired around the
    /// patient, ordered by vectors, of which slices can be reconstructed.
    Projections {
        /// Whether it holds several gates.
        gated: bool,
    },
    /// One slice of a PET, CT or MR series.
    Slice,
    /// Enhanced or Legacy Converted Enhanced PET, CT or MR image: every frame has its own position.
    Enhanced,
    /// Segmentation or Label Map Segmentation.
    Segmentation,
}

/// SOP classes of the objects that hold slices, after their common prefix.
const READ_CLASSES: [(&str, Kind); 13] = [
    // Retired; its images state what those of the class after it do.
    ("5", Kind::Nuclear { gated: false }),
    ("20", Kind::Nuclear { gated: false }),
    ("2", Kind::Slice),
    ("4", Kind::Slice),
    ("128", Kind::Slice),
    ("2.1", Kind::Enhanced),
    ("2.2", Kind::Enhanced),
    ("4.1", Kind::Enhanced),
    ("4.4", Kind::Enhanced),
    ("130", Kind::Enhanced),
    ("128.1", Kind::Enhanced),
    ("66.4", Kind::Segmentation),
    ("66.7", Kind::Segmentation),
];

/// Beginning of the SOP classes of stored objects.
const STORAGE_UID_PREFIX: &str = "1.2.840.10008.5.1.4.1.1.";

/// UIDs of the SOP classes that can hold slices.
pub fn classes() -> impl Iterator<Item = String> {
    READ_CLASSES
        .iter()
        .map(|(suffix, _)| format!("{STORAGE_UID_PREFIX}{suffix}"))
}

/// Whether an object of that SOP class is one slice of a series.
pub fn is_slice_class(class: &str) -> bool {
    let suffix = class.strip_prefix(STORAGE_UID_PREFIX).unwrap_or_default();
    READ_CLASSES.contains(&(suffix, Kind::Slice))
}

/// Whether the object is a CT image.
pub fn is_ct(attributes: &Attributes) -> bool {
    is_of(attributes, &["2", "2.1", "2.2"])
}

/// Whether the object is a Nuclear Medicine image.
pub fn is_nuclear(attributes: &Attributes) -> bool {
    is_of(attributes, &["20", "5"])
}

/// Whether the object is of one of these classes, after their common prefix.
fn is_of(attributes: &Attributes, suffixes: &[&str]) -> bool {
    let class = attributes.text(SOP_CLASS);
    let class = class.or_else(|| attributes.media_class.clone());
    let suffix = class
        .as_deref()
        .and_then(|class| class.strip_prefix(STORAGE_UID_PREFIX));
    suffix.is_some_and(|suffix| suffixes.contains(&suffix))
}

/// Why an object holds no volume, by the beginning of its SOP class after [`STORAGE_UID_PREFIX`]; the first entry
/// that fits counts.
const OTHER_CLASSES: [(&str, &str); 17] = [
    ("7", "a picture without a position in the patient"),
    ("66.5", "surfaces, not voxels"),
    ("66", "a registration or measurement, not an image"),
    ("481.1", "a projection, not slices"),
    ("481.2", "radiation dose, not an image of the patient"),
    (
        "481.3",
        "contours, not voxels; send the image series that it refers to",
    ),
    ("481", "a treatment plan or record, not an image"),
    (
        "88",
        "a report, not an image; send the image series that it refers to",
    ),
    ("104", "a document or a surface model, not voxels"),
    ("9", "a waveform, not an image"),
    (
        "11",
        "how to present images; send the images that it refers to",
    ),
    ("30", "a map of figures, which is not read"),
    (
        "77",
        "a photograph or microscopy, not slices of the patient",
    ),
    ("6", "ultrasound pictures, not slices"),
    ("3", "ultrasound pictures, not slices"),
    ("12", "projections, not slices"),
    ("1", "projections, not slices"),
];

/// The directory of a medium.
const DIRECTORY_UID: &str = "1.2.840.10008.1.3.10";

impl Kind {
    /// The kind of the object with `attributes`.
    ///
    /// # Errors
    /// [`ReadError::NotVolume`] for objects that hold no slices, [`ReadError::NotSlices`] for
    /// images whose Image Type says so.
    pub fn from_attributes(attributes: &Attributes) -> Result<Self, ReadError> {
        let class = attributes.text(SOP_CLASS);
        let class = class.or_else(|| attributes.media_class.clone());
        let image_type = attributes.texts(IMAGE_TYPE);
        let refuse = |found: String, reason: &'static str| {
            Err(ReadError::NotVolume {
                file: attributes.file.clone(),
                found,
                reason,
                fix: READABLE_ADVICE,
            })
        };
        let Some(class) = class else {
            let found = "a DICOM data set without a SOP Class UID (0008,0016)".into();
            return refuse(found, "it does not say what it holds");
        };
        if class == DIRECTORY_UID {
            let found = "a DICOMDIR (Media Storage Directory)".into();
            return refuse(found, "a list of files; send the image files that it lists");
        }
        let suffix = class.strip_prefix(STORAGE_UID_PREFIX).unwrap_or_default();
        if let Some((_, kind)) = READ_CLASSES.iter().find(|(read, _)| *read == suffix) {
            return match kind {
                Self::Nuclear { .. } => nuclear(attributes, &image_type),
                Self::Segmentation => Ok(Self::Segmentation),
                kind => {
                    check_slices(attributes, &image_type)?;
                    Ok(*kind)
                }
            };
        }
        let name = StandardSopClassDictionary.by_uid(&class);
        let name = name.map_or("object of an unknown SOP class", |entry| entry.name());
        let name = name.trim_end_matches(" Storage");
        let modality = attributes.texts(MODALITY).join("\\");
        let modality = if modality.is_empty() {
            String::new()
        } else {
            format!(", modality {}", clip(&modality))
        };
        let begins = |begin: &str| {
            let rest = suffix.strip_prefix(begin);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        };
        let other = OTHER_CLASSES.iter().find(|(begin, _)| begins(begin));
        let reason = other.map_or("an object of a kind that is not read", |(_, reason)| reason);
        // RT, MR and NM are spoken letter by letter.
        let spelled = ["RT ", "MR ", "NM "]
            .iter()
            .any(|letters| name.starts_with(letters));
        let article = if spelled || name.starts_with(['A', 'E', 'I', 'O', 'o']) {
            "an"
        } else {
            "a"
        };
        refuse(
            format!("{article} {name} ({}{modality})", clip(&class)),
            reason,
        )
    }

    /// What an object of this kind is called.
    pub fn noun(self) -> &'static str {
        match self {
            Self::Nuclear { .. } => "a Nuclear Medicine image",
            Self::Projections { .. } => "Nuclear Medicine projections",
            Self::Slice => "a slice of a PET, CT or MR series",
            Self::Enhanced => "an Enhanced image",
            Self::Segmentation => "a Segmentation",
        }
    }

    /// Whether each file holds one slice.
    pub fn is_single_slice(self) -> bool {
        self == Self::Slice
    }
}

/// The values of an Image Type that were written as one text: a list with brackets, quotes or commas as programming
/// languages print it. `None` for anything else.
pub fn unlisted(image_type: &str) -> Option<String> {
    const FIRST_VALUES: [&str; 2] = ["ORIGINAL", "DERIVED"];
    let text = image_type.trim_matches(['\0', ' ']);
    if text.contains('\\') {
        return None;
    }
    let inner = text.trim_matches(['[', ']', '(', ')', '{', '}']);
    let separators = [',', ';', '|', '/'];
    let separator = separators.into_iter().find(|c| inner.contains(*c))?;
    let values = inner.split(separator);
    let values: Vec<&str> = values
        .map(|value| value.trim_matches(['\'', '"', '`', ' ', '[', ']']))
        .collect();
    let known = values
        .first()
        .is_some_and(|first| FIRST_VALUES.contains(first));
    known.then(|| values.join("\\"))
}

/// Refuses PET, CT and MR images that hold something else than slices of the scan.
fn check_slices(attributes: &Attributes, image_type: &[String]) -> Result<(), ReadError> {
    let others = [
        (
            "LOCALIZER",
            "it is a projection for planning, not a slice",
            "Send the slices of the scan: all files of one series.",
        ),
        (
            "MOSAIC",
            "it shows many slices side by side in one picture",
            "Export the series again with one image for each slice, or as an Enhanced image.",
        ),
        (
            "TRANSMISSION",
            "it is a transmission map, which shows attenuation and no uptake",
            "Send the images of the emission scan.",
        ),
    ];
    for (value, reason, fix) in others {
        if image_type.iter().any(|given| given == value) {
            return Err(ReadError::NotSlices {
                file: attributes.file.clone(),
                image_type: value.into(),
                reason,
                fix,
            });
        }
    }
    let refuse = |found: String, reason| {
        Err(ReadError::NotVolume {
            file: attributes.file.clone(),
            found,
            reason,
            fix: READABLE_ADVICE,
        })
    };
    let series_type = attributes.texts(SERIES_TYPE);
    if series_type.iter().any(|value| value == "REPROJECTION") {
        let found = format!("an image with the {} REPROJECTION", SERIES_TYPE.name);
        return refuse(found, "it is a projection, not a slice");
    }
    match attributes.text(UNITS).as_deref() {
        Some(units @ ("1CM" | "CM-1")) => refuse(
            format!("an image with the {} {units}", UNITS.name),
            "it is a transmission map, which shows attenuation and no uptake",
        ),
        _ => Ok(()),
    }
}

/// The kind of a Nuclear Medicine Image by value 3 of its Image Type.
fn nuclear(attributes: &Attributes, image_type: &[String]) -> Result<Kind, ReadError> {
    if image_type.is_empty() {
        return Err(attributes.missing(IMAGE_TYPE));
    }
    let shown = image_type.get(2).map_or("", String::as_str);
    let is_map = shown.contains("TOMO") && image_type.iter().any(|v| v == "TRANSMISSION");
    let named = if shown.is_empty() || is_map {
        image_type.join("\\")
    } else {
        shown.to_owned()
    };
    let refuse = |reason| {
        Err(ReadError::NotSlices {
            file: attributes.file.clone(),
            image_type: clip(&named),
            reason,
            fix: "Give the reconstructed slices (Image Type RECON TOMO or RECON GATED TOMO), or the projections that \
                  they are made of (TOMO or GATED TOMO).",
        })
    };
    if is_map {
        return refuse(
            "it is a transmission map, which shows attenuation and no uptake; send the emission \
             images",
        );
    }
    match shown {
        "RECON TOMO" => Ok(Kind::Nuclear { gated: false }),
        "RECON GATED TOMO" => Ok(Kind::Nuclear { gated: true }),
        "TOMO" => Ok(Kind::Projections { gated: false }),
        "GATED TOMO" => Ok(Kind::Projections { gated: true }),
        "STATIC" | "DYNAMIC" | "GATED" | "WHOLE BODY" => {
            refuse("its frames are planar images, not slices")
        }
        _ => refuse("only RECON TOMO, RECON GATED TOMO, TOMO and GATED TOMO are or become slices"),
    }
}
