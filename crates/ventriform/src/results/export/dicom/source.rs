//! The scan that the objects belong to: its identity, its grid and its images.

use super::DicomError;
use super::codes::SOURCE_FOR_PROCESSING;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::text::is_printable;
use crate::image::volume::{Provenance, is_date, is_uid};
use serde::{Deserialize, Serialize};
use ventriform_dicom::tags;
use ventriform_dicom::write::data_set::{DataSet, reference};
use ventriform_dicom::write::uid::derived;

/// A date and a time as DICOM writes them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Moment {
    /// `YYYYMMDD`.
    pub date: String,
    /// `HHMMSS`.
    pub time: String,
}

/// Identity that a person gives for a scan whose file has none, or in place of one.
#[derive(Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StatedIdentity {
    /// Patient ID.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub patient_id: Option<String>,
    /// Patient's Name, components separated by `^`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub patient_name: Option<String>,
    /// Patient's Birth Date, `YYYYMMDD`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub patient_birth_date: Option<String>,
    /// Patient's Sex: `M`, `F` or `O`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub patient_sex: Option<String>,
    /// Study Instance UID.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub study_uid: Option<String>,
    /// Study Date, `YYYYMMDD`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub study_date: Option<String>,
    /// Study ID.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub study_id: Option<String>,
    /// Accession Number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accession_number: Option<String>,
    /// Referring Physician's Name, components separated by `^`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub referring_physician: Option<String>,
    /// Frame of Reference UID.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame_of_reference_uid: Option<String>,
}

/// Parameters of the removal of the patient's identity from objects.
#[derive(Clone, PartialEq, Eq)]
pub struct Deidentification {
    /// Secret from which the new UIDs are derived: objects made with the same secret from the same
    /// study still belong together, and nobody without it can find the original UIDs.
    pub secret: Vec<u8>,
}

/// The scan that results belong to.
#[derive(Clone)]
pub struct SourceScan {
    /// Patient, study, series and instances.
    provenance: Provenance,
    /// Voxel indices to LPS mm.
    pub(super) frame: VoxelToPatient,
    /// Voxels along i, j, k.
    pub(super) shape: [usize; 3],
    /// When the results were made.
    made: Moment,
    /// Whether the position in the patient is known.
    placed: bool,
    deidentified: bool,
}

/// The DICOM images that a volume was read from.
pub(super) struct SourceImages<'a> {
    pub series: &'a str,
    class: &'a str,
    instances: Vec<&'a str>,
}

impl<'a> SourceImages<'a> {
    /// SOP Class and SOP Instance UID of every instance.
    pub fn instances(&self) -> impl Iterator<Item = (&'a str, &'a str)> {
        self.instances.iter().map(|uid| (self.class, *uid))
    }

    /// A reference to every instance.
    pub fn references(&self) -> Vec<DataSet> {
        let all = self.instances();
        all.map(|(class, uid)| reference(class, uid)).collect()
    }

    /// The same, naming them as what the result was computed from.
    pub fn processed(&self) -> Vec<DataSet> {
        let all = self.references().into_iter();
        all.map(for_processing).collect()
    }
}

/// Adds to a reference that the result was computed from what it names.
pub(super) fn for_processing(mut reference: DataSet) -> DataSet {
    reference.code(
        tags::PURPOSE_OF_REFERENCE_CODE_SEQUENCE,
        SOURCE_FOR_PROCESSING,
    );
    reference
}

impl StatedIdentity {
    /// The names of all fields.
    pub const FIELD_NAMES: [&str; 10] = [
        "patient_id",
        "patient_name",
        "patient_birth_date",
        "patient_sex",
        "study_uid",
        "study_date",
        "study_id",
        "accession_number",
        "referring_physician",
        "frame_of_reference_uid",
    ];

    /// Checks every value that is given.
    ///
    /// # Errors
    /// [`DicomError::Identity`] for a value that DICOM does not allow.
    pub fn check(&self) -> Result<(), DicomError> {
        for (field, stated, _) in self.beside(&mut Provenance::default()) {
            if let Some(value) = stated {
                check(field, value)?;
            }
        }
        Ok(())
    }

    /// The name and value of each field, and where `provenance` has it.
    fn beside<'a>(
        &'a self,
        provenance: &'a mut Provenance,
    ) -> [(&'static str, &'a Option<String>, &'a mut Option<String>); 10] {
        let p = provenance;
        [
            ("patient_id", &self.patient_id, &mut p.patient_id),
            ("patient_name", &self.patient_name, &mut p.patient_name),
            (
                "patient_birth_date",
                &self.patient_birth_date,
                &mut p.patient_birth_date,
            ),
            ("patient_sex", &self.patient_sex, &mut p.patient_sex),
            ("study_uid", &self.study_uid, &mut p.study_uid),
            ("study_date", &self.study_date, &mut p.study_date),
            ("study_id", &self.study_id, &mut p.study_id),
            (
                "accession_number",
                &self.accession_number,
                &mut p.accession_number,
            ),
            (
                "referring_physician",
                &self.referring_physician,
                &mut p.referring_physician,
            ),
            (
                "frame_of_reference_uid",
                &self.frame_of_reference_uid,
                &mut p.frame_of_reference_uid,
            ),
        ]
    }
}

/// The fields of a scan that its objects state or refer to.
const CARRIED_FIELDS: [&str; 15] = [
    "patient_name",
    "patient_id",
    "patient_birth_date",
    "patient_sex",
    "study_uid",
    "study_date",
    "study_time",
    "study_id",
    "accession_number",
    "referring_physician",
    "series_uid",
    "frame_of_reference_uid",
    "sop_class_uid",
    "sop_instance_uid",
    "position_reference_indicator",
];

/// Checks that everything about a scan that its objects would state could be decoded.
///
/// # Errors
/// [`DicomError::Undecoded`].
pub fn legible(scan: &Provenance) -> Result<(), DicomError> {
    let lost = |field: &&str| scan.undecoded.iter().any(|lost| lost == field);
    match CARRIED_FIELDS.into_iter().find(lost) {
        Some(field) => Err(DicomError::Undecoded { field }),
        None => Ok(()),
    }
}

/// Completes the identity of a scan by what a person states. Whether all of it is [`legible`] is left
/// open: without the patient's identity it need not be.
///
/// # Errors
/// [`DicomError::NoIdentity`] if neither names the study, or if no file and no person names the
/// patient; [`DicomError::Contradiction`] if a person states another value than the file;
/// [`DicomError::Identity`] for a value that DICOM does not allow.
pub fn identity(
    file: Option<&Provenance>,
    stated: &StatedIdentity,
) -> Result<Provenance, DicomError> {
    stated.check()?;
    let mut whole = file.cloned().unwrap_or_default();
    whole.fit();
    let mut undecoded = std::mem::take(&mut whole.undecoded);
    for (field, stated, known) in stated.beside(&mut whole) {
        let Some(value) = stated else { continue };
        undecoded.retain(|lost| lost != field);
        match known {
            Some(known) if known != value => return Err(DicomError::Contradiction { field }),
            _ => *known = Some(value.clone()),
        }
    }
    whole.undecoded = undecoded;
    if file.is_none() && whole.patient_id.is_none() {
        return Err(DicomError::NoIdentity {
            field: "patient_id",
        });
    }
    if whole.study_uid.is_none() {
        return Err(DicomError::NoIdentity { field: "study_uid" });
    }
    Ok(whole)
}

fn check(field: &'static str, value: &str) -> Result<(), DicomError> {
    let plain = |longest: usize| {
        let length = value.chars().count();
        (1..=longest).contains(&length) && value.chars().all(|c| is_printable(c) && c != '\\')
    };
    let (valid, expected) = match field {
        "study_uid" | "frame_of_reference_uid" => (
            is_uid(value),
            "a UID: numbers separated by dots, at most 64 characters",
        ),
        "patient_birth_date" | "study_date" => (is_date(value), "a date as YYYYMMDD"),
        "patient_sex" => (["M", "F", "O"].contains(&value), "M, F or O"),
        "study_id" | "accession_number" => (
            plain(16),
            "1 to 16 printable characters without a backslash",
        ),
        _ => (
            plain(64),
            "1 to 64 printable characters without a backslash",
        ),
    };
    if valid {
        Ok(())
    } else {
        Err(DicomError::Identity { field, expected })
    }
}

impl SourceScan {
    /// A scan with the identity `provenance` on the grid `shape` at `frame`. `placed` says whether
    /// that position is known: objects of a scan whose position is assumed do not claim the
    /// scan's Frame of Reference.
    pub fn new(
        mut provenance: Provenance,
        frame: VoxelToPatient,
        shape: [usize; 3],
        placed: bool,
        made: Moment,
    ) -> Self {
        // Where a scan comes from does not matter: an object states nothing that is no value of its VR.
        provenance.put_right();
        provenance.fit();
        Self {
            provenance,
            frame,
            shape,
            made,
            placed,
            deidentified: false,
        }
    }

    /// The scan without the identity of the patient, after the Basic Application Level
    /// Confidentiality Profile (PS3.15 annex E): the patient's data are emptied, or replaced by
    /// `stated`, dates and descriptions removed, UIDs replaced consistently.
    #[must_use]
    pub fn deidentified(self, how: &Deidentification, stated: &StatedIdentity) -> Self {
        let old = self.provenance;
        let replaced = |uid: &String| derived(&[b"de-identified", &how.secret, uid.as_bytes()]);
        let uid = |uid: &Option<String>| uid.as_ref().map(replaced);
        Self {
            provenance: Provenance {
                patient_name: stated.patient_name.clone(),
                patient_id: stated.patient_id.clone(),
                study_uid: uid(&old.study_uid),
                series_uid: uid(&old.series_uid),
                frame_of_reference_uid: uid(&old.frame_of_reference_uid),
                sop_instance_uid: uid(&old.sop_instance_uid),
                instance_uids: old.instance_uids.iter().map(replaced).collect(),
                // What an object is does not identify anybody.
                sop_class_uid: old.sop_class_uid,
                modality: old.modality,
                slice_frames: old.slice_frames,
                ..Provenance::default()
            },
            made: Moment {
                date: "19000101".into(),
                time: "000000".into(),
            },
            deidentified: true,
            ..self
        }
    }

    /// What a picture may name of the scan; `None` of a scan without identity.
    pub fn shown(&self) -> Option<&Provenance> {
        (!self.deidentified).then_some(&self.provenance)
    }

    /// As [`legible`], for this scan.
    pub(super) fn check(&self) -> Result<(), DicomError> {
        legible(&self.provenance)
    }

    /// Study Instance UID.
    pub(super) fn study(&self) -> &str {
        self.provenance.study_uid.as_deref().unwrap_or_default()
    }

    /// The Frame of Reference of the results: the scan's where its position is known.
    pub(super) fn frame_of_reference(&self) -> String {
        let known = self.provenance.frame_of_reference_uid.as_ref();
        match known.filter(|_| self.placed) {
            Some(uid) => uid.clone(),
            None => {
                let series = self.provenance.series_uid.as_deref();
                let parts = [self.study(), series.unwrap_or_default()].map(str::as_bytes);
                derived(&[b"frame of reference", parts[0], parts[1]])
            }
        }
    }

    /// The images that the volume was read from; `None` unless they were DICOM.
    pub(super) fn images(&self) -> Option<SourceImages<'_>> {
        let p = &self.provenance;
        let instances = if p.instance_uids.is_empty() {
            vec![p.sop_instance_uid.as_deref()?]
        } else {
            p.instance_uids.iter().map(String::as_str).collect()
        };
        Some(SourceImages {
            series: p.series_uid.as_deref()?,
            class: p.sop_class_uid.as_deref()?,
            instances,
        })
    }

    /// The Source Image Sequence of an image whose pixels do not lie where those of the sources do.
    pub(super) fn put_sources(&self, set: &mut DataSet) {
        if let Some(images) = self.images() {
            let mut sources = images.processed();
            for source in &mut sources {
                source.text(tags::SPATIAL_LOCATIONS_PRESERVED, "NO");
            }
            set.items(tags::SOURCE_IMAGE_SEQUENCE, sources);
        }
    }

    /// The reference to the image or frame that slice `k` was read from.
    pub(super) fn slice_reference(&self, k: usize) -> Option<DataSet> {
        let p = &self.provenance;
        let class = p.sop_class_uid.as_deref()?;
        let instance = p.instance_uids.get(k).or(p.sop_instance_uid.as_ref());
        let mut item = reference(class, instance?);
        if let Some(frame) = p.slice_frames.get(k) {
            item.text(tags::REFERENCED_FRAME_NUMBER, frame.to_string());
        }
        Some(item)
    }

    /// Whether [`SourceScan::slice_reference`] names the one image or frame of slice `k`, and not an instance with
    /// others.
    pub(super) fn names_slice(&self, k: usize) -> bool {
        let p = &self.provenance;
        let is_alone = self.shape[2] == 1 && p.sop_instance_uid.is_some();
        is_alone || k < p.instance_uids.len() || k < p.slice_frames.len()
    }

    /// When the results were made.
    pub(super) fn made(&self) -> &Moment {
        &self.made
    }

    /// Date and time of the content.
    pub(super) fn put_made(&self, set: &mut DataSet) {
        set.text(tags::CONTENT_DATE, self.made.date.as_str());
        set.text(tags::CONTENT_TIME, self.made.time.as_str());
    }

    /// Patient, General Study, and the marks of de-identification.
    pub(super) fn put_identity(&self, set: &mut DataSet) {
        let p = &self.provenance;
        set.text(tags::SPECIFIC_CHARACTER_SET, "ISO_IR 192");
        set.stated(tags::PATIENT_NAME, p.patient_name.as_deref());
        set.stated(tags::PATIENT_ID, p.patient_id.as_deref());
        set.stated(tags::PATIENT_BIRTH_DATE, p.patient_birth_date.as_deref());
        let sex = p.patient_sex.as_deref();
        let sex = sex.filter(|sex| ["M", "F", "O"].contains(sex));
        set.stated(tags::PATIENT_SEX, sex);
        set.text(tags::STUDY_INSTANCE_UID, self.study());
        set.stated(tags::STUDY_DATE, p.study_date.as_deref());
        set.stated(tags::STUDY_TIME, p.study_time.as_deref());
        set.stated(tags::STUDY_ID, p.study_id.as_deref());
        set.stated(tags::ACCESSION_NUMBER, p.accession_number.as_deref());
        set.stated(
            tags::REFERRING_PHYSICIAN_NAME,
            p.referring_physician.as_deref(),
        );
        if self.deidentified {
            set.text(tags::PATIENT_IDENTITY_REMOVED, "YES");
            set.text(tags::LONGITUDINAL_TEMPORAL_INFORMATION_MODIFIED, "REMOVED");
            let profile = ventriform_dicom::write::code::dcm(
                "113100",
                "Basic Application Confidentiality Profile",
            );
            set.code(tags::DEIDENTIFICATION_METHOD_CODE_SEQUENCE, profile);
        }
    }

    /// The Frame of Reference module.
    pub(super) fn put_frame_of_reference(&self, set: &mut DataSet) {
        set.text(tags::FRAME_OF_REFERENCE_UID, self.frame_of_reference());
        let indicator = self.provenance.position_reference_indicator.as_deref();
        set.stated(tags::POSITION_REFERENCE_INDICATOR, indicator);
    }

    /// Calls `add` with everything about the scan that gets into the objects.
    pub(super) fn add_to(&self, add: &mut dyn FnMut(&[u8])) {
        let p = &self.provenance;
        let texts = [
            &p.patient_name,
            &p.patient_id,
            &p.patient_birth_date,
            &p.patient_sex,
            &p.study_uid,
            &p.study_date,
            &p.study_time,
            &p.study_id,
            &p.accession_number,
            &p.referring_physician,
            &p.series_uid,
            &p.frame_of_reference_uid,
            &p.position_reference_indicator,
            &p.sop_class_uid,
            &p.sop_instance_uid,
        ];
        for text in texts {
            add(text.as_deref().unwrap_or_default().as_bytes());
        }
        p.instance_uids.iter().for_each(|uid| add(uid.as_bytes()));
        let frames: Vec<u8> = p
            .slice_frames
            .iter()
            .flat_map(|n| n.to_le_bytes())
            .collect();
        add(&frames);
        let matrix = self.frame.matrix();
        let numbers: Vec<u8> = matrix.iter().flat_map(|x| x.to_le_bytes()).collect();
        add(&numbers);
        let shape: Vec<u8> = self
            .shape
            .iter()
            .flat_map(|n| (*n as u64).to_le_bytes())
            .collect();
        add(&shape);
        add(self.made.date.as_bytes());
        add(self.made.time.as_bytes());
        add(&[u8::from(self.placed), u8::from(self.deidentified)]);
    }
}
