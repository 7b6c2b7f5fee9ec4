//! The flags of DICOM output.

use anyhow::{Result, anyhow};
use clap::Args;
use time::format_description::well_known::Rfc3339;
use time::{OffsetDateTime, UtcOffset};
use ventriform::advice::Explain;
use ventriform::export::dicom::{
    Deidentification, Moment, SourceScan, StatedIdentity, identity, legible,
};
use ventriform::gated::GatedHeart;
use ventriform::progress::Monitor;
use ventriform::rest_stress::ComparedHeart;
use ventriform::segmentation::SegmentedVolume;
use ventriform::volume::Provenance;
use ventriform::volume::{self, ReadLimits, ReadOptions, VolumeFile};

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

/// DICOM output whose identity is known.
pub(super) struct DicomOrder {
    identity: Provenance,
    made: Moment,
    deidentify: Option<(Deidentification, StatedIdentity)>,
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
    ) -> Result<Option<DicomOrder>> {
        if !self.dicom {
            return Ok(None);
        }
        let stated = self.stated();
        let found = volume::provenance(files, &ReadOptions { frame }, limits, &Monitor::silent())
            .map_err(|error| anyhow!(error.with_advice()))?;
        // The new identity of a DICOM scan is not meant to be the one in its file.
        let known = if self.deidentify && found.is_some() {
            (stated.check()).and_then(|()| identity(found.as_ref(), &Default::default()))
        } else {
            identity(found.as_ref(), &stated)
        };
        let known = known.and_then(|known| {
            if self.deidentify {
                Ok(known)
            } else {
                legible(&known).map(|()| known)
            }
        });
        let identity = known.map_err(|error| anyhow!(error.with_advice()))?;
        let secret = || {
            let given = self.deidentify_secret.clone();
            let given = given.or_else(|| std::env::var("VENTRIFORM_DEIDENTIFY_SECRET").ok());
            match given {
                Some(text) => text.into_bytes(),
                None => uuid::Uuid::new_v4().as_bytes().to_vec(),
            }
        };
        Ok(Some(DicomOrder {
            identity,
            made: self.moment()?,
            deidentify: self.deidentify.then(|| {
                let how = Deidentification { secret: secret() };
                (how, stated)
            }),
        }))
    }

    /// As [`DicomArgs::order`], of the gates of one beat: one file with all, or one for each.
    ///
    /// # Errors
    /// As there.
    pub(super) fn order_of_gates(
        &self,
        files: &[VolumeFile],
        limits: &ReadLimits,
    ) -> Result<Option<DicomOrder>> {
        // Files of one gate each are not one volume; whose scan they are says the first.
        let one = || self.order(&files[..files.len().min(1)], Some(0), limits);
        match self.order(files, Some(0), limits) {
            Err(error) if files.len() > 1 => one().map_err(|_| error),
            order => order,
        }
    }

    /// As [`DicomArgs::order`], of two scans of one patient, gated or not. Both are freed of the identity by one secret.
    ///
    /// # Errors
    /// As there.
    pub(super) fn order_of_pair(
        &self,
        scans: [&[VolumeFile]; 2],
        limits: &ReadLimits,
    ) -> Result<Option<[DicomOrder; 2]>> {
        let of = |files: &[VolumeFile]| {
            let gates = || self.order_of_gates(files, limits);
            self.order(files, None, limits)
                .or_else(|error| gates().map_err(|_| error))
        };
        let [first, second] = scans.map(of);
        let (Some(first), Some(mut second)) = (first?, second?) else {
            return Ok(None);
        };
        if let (Some((how, _)), Some((own, _))) = (&first.deidentify, &mut second.deidentify) {
            own.clone_from(how);
        }
        Ok(Some([first, second]))
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
        let gates = || self.whose_of_gates(files, limits);
        self.whose(files, None, limits)
            .or_else(|error| gates().map_err(|_| error))
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
        match self.whose(files, Some(0), limits) {
            Err(error) if files.len() > 1 => {
                self.whose(&files[..1], Some(0), limits).map_err(|_| error)
            }
            whose => whose,
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
        if self.deidentify {
            return Ok(None);
        }
        let options = ReadOptions { frame };
        let found = volume::provenance(files, &options, limits, &Monitor::silent())
            .map_err(|error| anyhow!(error.with_advice()))?;
        let stated = self.stated();
        Ok(identity(found.as_ref(), &stated).ok().or(found))
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

    /// The time of the objects, in UTC.
    fn moment(&self) -> Result<Moment> {
        let time = match &self.made_at {
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
}

impl DicomOrder {
    /// The scan that the objects of `made` belong to.
    pub(super) fn of(self, made: &SegmentedVolume) -> SourceScan {
        let scan = made.scan(self.identity, self.made);
        Self::anonymous(scan, self.deidentify.as_ref())
    }

    /// End diastole and end systole as the scans that the objects of `made` belong to.
    pub(super) fn of_beat(self, made: &GatedHeart) -> [SourceScan; 2] {
        let scans = made.scans(&self.identity, &self.made);
        scans.map(|scan| Self::anonymous(scan, self.deidentify.as_ref()))
    }

    /// The scan that the objects of `heart` belong to.
    pub(super) fn of_compared(self, heart: &ComparedHeart) -> SourceScan {
        let scan = heart.scan(self.identity, self.made);
        Self::anonymous(scan, self.deidentify.as_ref())
    }

    /// The scan, without the patient's identity if that is asked for.
    fn anonymous(scan: SourceScan, how: Option<&(Deidentification, StatedIdentity)>) -> SourceScan {
        match how {
            Some((how, stated)) => scan.deidentified(how, stated),
            None => scan,
        }
    }
}
