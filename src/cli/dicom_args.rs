//! The flags of DICOM output.

use anyhow::{Result, anyhow};
use clap::Args;
use time::format_description::well_known::Rfc3339;
use time::{OffsetDateTime, UtcOffset};
use ventriform::base::progress::Monitor;
use ventriform::image::volume::{Provenance, ReadLimits, VolumeError, VolumeFile};
use ventriform::results::export::dicom::{Deidentification, Moment, StatedIdentity};
use ventriform::runs::advice::Explain;
use ventriform::runs::objects::{self, ObjectChoice, ObjectError, ObjectOrder};

/// Whether to write DICOM objects, and for whom.
#[derive(Debug, Args)]
#[command(next_help_heading = "DICOM output")]
pub struct DicomArgs {
    /// Also write the results as DICOM objects of the scan's patient and study
    #[arg(long)]
    dicom: bool,
    /// Patient ID; needed for a volume that is not DICOM. With --deidentify, the new Patient ID
    #[arg(long, value_name = "ID", requires = "dicom")]
    patient_id: Option<String>,
    /// Patient's name, as FAMILY^GIVEN. With --deidentify, the new name
    #[arg(long, value_name = "NAME", requires = "dicom")]
    patient_name: Option<String>,
    /// Patient's birth date
    #[arg(long, value_name = "YYYYMMDD", requires = "dicom")]
    patient_birth_date: Option<String>,
    /// Patient's sex
    #[arg(long, value_name = "M|F|O", requires = "dicom")]
    patient_sex: Option<String>,
    /// Study Instance UID; needed for a volume that is not DICOM
    #[arg(long, value_name = "UID", requires = "dicom")]
    study_uid: Option<String>,
    /// Date of the study
    #[arg(long, value_name = "YYYYMMDD", requires = "dicom")]
    study_date: Option<String>,
    /// Study ID: the number of the study in the department
    #[arg(long, value_name = "ID", requires = "dicom")]
    study_id: Option<String>,
    /// Accession number
    #[arg(long, value_name = "NUMBER", requires = "dicom")]
    accession_number: Option<String>,
    /// Referring physician's name, as FAMILY^GIVEN
    #[arg(long, value_name = "NAME", requires = "dicom")]
    referring_physician: Option<String>,
    /// Frame of Reference UID of the scan
    #[arg(long, value_name = "UID", requires = "dicom")]
    frame_of_reference_uid: Option<String>,
    /// Remove the patient's identity from the DICOM objects (PS3.15, basic profile) and leave it out of
    /// report.html and page.dcm
    #[arg(long)]
    deidentify: bool,
    /// Secret from which --deidentify derives new UIDs: with the same secret, objects of one study
    /// stay together [default: VENTRIFORM_DEIDENTIFY_SECRET, or a random one]
    #[arg(long, value_name = "TEXT", requires = "deidentify")]
    deidentify_secret: Option<String>,
    /// Date and time of the DICOM objects; with the same time, the same input gives the same bytes
    /// [default: now]
    #[arg(long, value_name = "RFC3339", requires = "dicom")]
    made_at: Option<String>,
}

impl DicomArgs {
    /// The objects that are to be written of `files`; `None` without `--dicom`.
    ///
    /// # Errors
    /// If patient or study are unknown, or a flag has a value that DICOM does not allow.
    pub(super) fn order(
        &self,
        files: &[VolumeFile],
        frame: Option<usize>,
        limits: &ReadLimits,
    ) -> Result<Option<ObjectOrder>> {
        self.ordered(|choice| choice.order(files, frame, limits, &Monitor::silent()))
    }

    /// As [`DicomArgs::order`], of the gates of one beat: one file with all, or one for each.
    ///
    /// # Errors
    /// As there.
    pub(super) fn order_of_gates(
        &self,
        files: &[VolumeFile],
        limits: &ReadLimits,
    ) -> Result<Option<ObjectOrder>> {
        self.ordered(|choice| choice.order_of_gates(files, limits, &Monitor::silent()))
    }

    /// As [`DicomArgs::order`], of scans of one patient, gated or not.
    ///
    /// # Errors
    /// As there.
    pub(super) fn order_of_scans(
        &self,
        scans: &[Vec<VolumeFile>],
        limits: &ReadLimits,
    ) -> Result<Option<Vec<ObjectOrder>>> {
        self.ordered(|choice| choice.order_of_scans(scans, limits, &Monitor::silent()))
    }

    /// As [`DicomArgs::order`], of two scans of one patient, gated or not.
    ///
    /// # Errors
    /// As there.
    pub(super) fn order_of_pair(
        &self,
        scans: [&[VolumeFile]; 2],
        limits: &ReadLimits,
    ) -> Result<Option<[ObjectOrder; 2]>> {
        self.ordered(|choice| choice.order_of_pair(scans, limits, &Monitor::silent()))
    }

    fn ordered<T>(
        &self,
        order: impl FnOnce(&ObjectChoice) -> Result<T, ObjectError>,
    ) -> Result<Option<T>> {
        if !self.dicom {
            return Ok(None);
        }
        let choice = ObjectChoice {
            stated: self.stated(),
            deidentify: self.deidentify.then(|| Deidentification {
                secret: self.secret(),
            }),
            made: moment(self.made_at.as_deref())?,
        };
        let made = order(&choice).map_err(|error| anyhow!(error.with_advice()))?;
        Ok(Some(made))
    }

    fn secret(&self) -> Vec<u8> {
        let given = self.deidentify_secret.clone();
        let given = given.or_else(|| std::env::var("VENTRIFORM_DEIDENTIFY_SECRET").ok());
        match given {
            Some(text) => text.into_bytes(),
            None => uuid::Uuid::new_v4().as_bytes().to_vec(),
        }
    }

    /// Whose scan the report names: what `files` say, completed by the flags; nobody with
    /// `--deidentify`.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub(super) fn whose(
        &self,
        files: &[VolumeFile],
        frame: Option<usize>,
        limits: &ReadLimits,
    ) -> Result<Option<Provenance>> {
        self.named(|stated| objects::whose(files, frame, stated, limits, &Monitor::silent()))
    }

    /// As [`DicomArgs::whose`], of the gates of one beat.
    ///
    /// # Errors
    /// As there.
    pub(super) fn whose_of_gates(
        &self,
        files: &[VolumeFile],
        limits: &ReadLimits,
    ) -> Result<Option<Provenance>> {
        self.named(|stated| objects::whose_gates(files, stated, limits, &Monitor::silent()))
    }

    /// As [`DicomArgs::whose`], of a scan that may be gated.
    ///
    /// # Errors
    /// As there.
    pub(super) fn whose_of_either(
        &self,
        files: &[VolumeFile],
        limits: &ReadLimits,
    ) -> Result<Option<Provenance>> {
        self.named(|stated| objects::whose_either(files, stated, limits, &Monitor::silent()))
    }

    fn named(
        &self,
        whose: impl FnOnce(&StatedIdentity) -> Result<Option<Provenance>, VolumeError>,
    ) -> Result<Option<Provenance>> {
        if self.deidentify {
            return Ok(None);
        }
        whose(&self.stated()).map_err(|error| anyhow!(error.with_advice()))
    }

    fn stated(&self) -> StatedIdentity {
        StatedIdentity {
            patient_id: self.patient_id.clone(),
            patient_name: self.patient_name.clone(),
            patient_birth_date: self.patient_birth_date.clone(),
            patient_sex: self.patient_sex.clone(),
            study_uid: self.study_uid.clone(),
            study_date: self.study_date.clone(),
            study_id: self.study_id.clone(),
            accession_number: self.accession_number.clone(),
            referring_physician: self.referring_physician.clone(),
            frame_of_reference_uid: self.frame_of_reference_uid.clone(),
        }
    }
}

/// The time of objects that `--made-at` states, or now, in UTC.
pub(super) fn moment(made_at: Option<&str>) -> Result<Moment> {
    let time = match made_at {
        None => OffsetDateTime::now_utc(),
        Some(text) => OffsetDateTime::parse(text, &Rfc3339).map_err(|_| {
            anyhow!("--made-at {text:?} is no time; give one such as 2026-11-23T13:45:00Z")
        })?,
    };
    let time = time.to_offset(UtcOffset::UTC);
    let (hour, minute, second) = time.to_hms();
    Ok(Moment {
        date: format!(
            "{:04}{:02}{:02}",
            time.year(),
            u8::from(time.month()),
            time.day()
        ),
        time: format!("{hour:02}{minute:02}{second:02}"),
    })
}
