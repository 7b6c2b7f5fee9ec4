//! DICOM objects of results: whose they are, and when they were made.
//!
//! In: the files of a scan, and what the caller states of patient and study ([`ObjectChoice`]). Out: an
//! [`ObjectOrder`], which gives the scan that the objects of a result belong to, and the person whom a report names.
//!
//! 1. The identity is what the files state, completed by the caller. Both must not contradict each other.
//! 2. Without an identity, or with one that cannot be read, there is no order.
//! 3. De-identified objects keep the identity only to derive new UIDs from it.
//!
//! Guaranteed: the same files, statements, secret and time give the same objects.

use crate::base::progress::{Cancelled, Monitor};
use crate::image::volume::{self, Provenance, ReadLimits, ReadOptions, VolumeError, VolumeFile};
use crate::results::export::dicom::{
    Deidentification, DicomError, Moment, SourceScan, StatedIdentity, identity, legible,
};
use crate::runs::gated::GatedHeart;
use crate::runs::rest_stress::ComparedHeart;
use crate::runs::segmentation::SegmentedVolume;
use crate::runs::serial::SerialHearts;

/// What a caller states of DICOM objects.
#[derive(Clone)]
pub struct ObjectChoice {
    /// Patient and study, where the files do not state them; the new ones of de-identified objects.
    pub stated: StatedIdentity,
    /// How new UIDs are derived if the patient's identity is to be removed.
    pub deidentify: Option<Deidentification>,
    /// When the objects were made.
    pub made: Moment,
}

/// Why no objects can be made for a scan.
#[derive(Debug, thiserror::Error)]
pub enum ObjectError {
    /// The files cannot be read.
    #[error(transparent)]
    Volume(#[from] VolumeError),
    /// The identity is unknown, contradicts itself or cannot be written.
    #[error(transparent)]
    Identity(#[from] DicomError),
}

impl From<Cancelled> for ObjectError {
    fn from(cancelled: Cancelled) -> Self {
        Self::Volume(cancelled.into())
    }
}

/// DICOM objects whose identity is known.
#[derive(Clone)]
pub struct ObjectOrder {
    identity: Provenance,
    choice: ObjectChoice,
}

impl ObjectChoice {
    /// The order of objects for the volume in `files`; `frame` is its number, where they hold several.
    ///
    /// # Errors
    /// [`ObjectError`] if patient or study are unknown, or a statement has a value that DICOM does not allow.
    pub fn order(
        &self,
        files: &[VolumeFile],
        frame: Option<usize>,
        limits: &ReadLimits,
        monitor: &Monitor<'_>,
    ) -> Result<ObjectOrder, ObjectError> {
        let found = volume::provenance(files, &ReadOptions { frame }, limits, monitor)?;
        // The new identity of a DICOM scan is not meant to be the one in its file.
        let identity = if self.deidentify.is_some() && found.is_some() {
            self.stated.check()?;
            identity(found.as_ref(), &StatedIdentity::default())?
        } else {
            identity(found.as_ref(), &self.stated)?
        };
        if self.deidentify.is_none() {
            legible(&identity)?;
        }
        let choice = self.clone();
        Ok(ObjectOrder { identity, choice })
    }

    /// As [`ObjectChoice::order`], of the gates of one beat: one file with all, or one for each.
    ///
    /// # Errors
    /// As there.
    pub fn order_of_gates(
        &self,
        files: &[VolumeFile],
        limits: &ReadLimits,
        monitor: &Monitor<'_>,
    ) -> Result<ObjectOrder, ObjectError> {
        of_gates(files, |files| self.order(files, Some(0), limits, monitor))
    }

    /// As [`ObjectChoice::order`], of a scan that may be gated.
    ///
    /// # Errors
    /// As there.
    fn order_of_either(
        &self,
        files: &[VolumeFile],
        limits: &ReadLimits,
        monitor: &Monitor<'_>,
    ) -> Result<ObjectOrder, ObjectError> {
        let gates = || self.order_of_gates(files, limits, monitor);
        let one = self.order(files, None, limits, monitor);
        one.or_else(|error| gates().map_err(|_| error))
    }

    /// The same of each of several scans of one patient.
    ///
    /// # Errors
    /// As there.
    pub fn order_of_scans(
        &self,
        scans: &[Vec<VolumeFile>],
        limits: &ReadLimits,
        monitor: &Monitor<'_>,
    ) -> Result<Vec<ObjectOrder>, ObjectError> {
        let orders = scans.iter();
        orders
            .map(|files| self.order_of_either(files, limits, monitor))
            .collect()
    }

    /// The same of each of two scans of one patient.
    ///
    /// # Errors
    /// As there.
    pub fn order_of_pair(
        &self,
        scans: [&[VolumeFile]; 2],
        limits: &ReadLimits,
        monitor: &Monitor<'_>,
    ) -> Result<[ObjectOrder; 2], ObjectError> {
        let [first, second] = scans.map(|files| self.order_of_either(files, limits, monitor));
        Ok([first?, second?])
    }
}

/// Of files of one gate each, which are not one volume, the first says what `of` is asked for.
fn of_gates<T, E>(
    files: &[VolumeFile],
    of: impl Fn(&[VolumeFile]) -> Result<T, E>,
) -> Result<T, E> {
    match of(files) {
        Err(error) if files.len() > 1 => of(&files[..1]).map_err(|_| error),
        found => found,
    }
}

/// Whose scan a report names: what `files` say, completed by what is `stated`.
///
/// # Errors
/// [`VolumeError`] if a file cannot be read.
pub fn whose(
    files: &[VolumeFile],
    frame: Option<usize>,
    stated: &StatedIdentity,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<Option<Provenance>, VolumeError> {
    let found = volume::provenance(files, &ReadOptions { frame }, limits, monitor)?;
    Ok(identity(found.as_ref(), stated).ok().or(found))
}

/// As [`whose`], of the gates of one beat.
///
/// # Errors
/// As there.
pub fn whose_gates(
    files: &[VolumeFile],
    stated: &StatedIdentity,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<Option<Provenance>, VolumeError> {
    of_gates(files, |files| {
        whose(files, Some(0), stated, limits, monitor)
    })
}

/// As [`whose`], of a scan that may be gated.
///
/// # Errors
/// As there.
pub fn whose_either(
    files: &[VolumeFile],
    stated: &StatedIdentity,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<Option<Provenance>, VolumeError> {
    let gates = || whose_gates(files, stated, limits, monitor);
    let one = whose(files, None, stated, limits, monitor);
    one.or_else(|error| gates().map_err(|_| error))
}

impl ObjectOrder {
    /// The scan that the objects of `made` belong to.
    pub fn source_scan(self, made: &SegmentedVolume) -> SourceScan {
        let scan = made.scan(self.identity, self.choice.made.clone());
        anonymous(scan, &self.choice)
    }

    /// End diastole and end systole as the scans that the objects of `made` belong to.
    pub fn of_beat(self, made: &GatedHeart) -> [SourceScan; 2] {
        let scans = made.scans(&self.identity, &self.choice.made);
        scans.map(|scan| anonymous(scan, &self.choice))
    }

    /// The scan that the objects of `heart` belong to.
    pub fn of_compared(self, heart: &ComparedHeart) -> SourceScan {
        let scan = heart.scan(self.identity, self.choice.made.clone());
        anonymous(scan, &self.choice)
    }
}

/// The scans that the objects of `made` belong to, in the order of its report. `orders` stand in the order in which the scans
/// were given.
pub fn of_serial(orders: &[ObjectOrder], made: &SerialHearts) -> Vec<SourceScan> {
    let scans = made.scans.iter();
    scans
        .filter_map(|scan| {
            let order = orders.get(scan.given.checked_sub(1)?)?;
            Some(order.clone().of_compared(&scan.heart))
        })
        .collect()
}

/// The scan, without the patient's identity if that is asked for.
fn anonymous(scan: SourceScan, choice: &ObjectChoice) -> SourceScan {
    match &choice.deidentify {
        Some(how) => scan.deidentified(how, &choice.stated),
        None => scan,
    }
}
