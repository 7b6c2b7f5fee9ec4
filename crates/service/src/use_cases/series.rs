//! The ways of a job to archives: the series that its volume comes from, and the objects of its result that are sent.
//!
//! In: names as a request or an entry of the settings gives them. Out: a [`SeriesSource`] and a [`SendOrder`] that the
//! tenant's archives can fulfil.

use crate::base::error::{invalid_field as invalid, shorten};
use crate::base::records::{Failure, Resource, SendOrder, SeriesSource, Tenant};
use crate::use_cases::service::Service;
use crate::work::dicom;
use ventriform::results::export::dicom::is_uid;

/// A series as it is given; nothing of it is checked.
#[derive(Debug, Clone, Copy, Default)]
pub struct GivenSeries<'a> {
    /// The name of an archive.
    pub archive: Option<&'a str>,
    /// The base URL of a DICOMweb service.
    pub dicomweb: Option<&'a str>,
    /// Study Instance UID.
    pub study: Option<&'a str>,
    /// Series Instance UID.
    pub series: Option<&'a str>,
}

impl Service {
    /// The series that a job of the tenant is to fetch.
    ///
    /// # Errors
    /// `invalid-field` that names the part which cannot be used.
    pub async fn series_source(
        &self,
        tenant: &Tenant,
        given: GivenSeries<'_>,
    ) -> Result<SeriesSource, Failure> {
        let (archive, dicomweb) = match (given.archive, given.dicomweb) {
            (Some(name), None) => (Some(self.with_dicomweb(tenant, name)?), None),
            (None, Some(url)) => match self.settings.archives.at(url, tenant) {
                Some(archive) => (Some(archive.name.clone()), None),
                None => (None, Some(self.allowed(url).await?)),
            },
            (None, None) => {
                let failure = invalid("archive", "The source names no archive.");
                return Err(failure.fix(self.known_archives(tenant)));
            }
            (Some(_), Some(_)) => {
                let both = "A source has an `archive` or a `dicomweb`, not both.";
                return Err(invalid("dicomweb", both).fix("Leave one of them out."));
            }
        };
        Ok(SeriesSource {
            archive,
            dicomweb,
            study: uid("study", given.study)?,
            series: uid("series", given.series)?,
        })
    }

    /// The name of an archive from which can be fetched.
    fn with_dicomweb(&self, tenant: &Tenant, name: &str) -> Result<String, Failure> {
        match self.settings.archives.named(name, tenant) {
            Some(archive) if archive.dicomweb.is_some() => Ok(name.to_owned()),
            Some(_) => Err(invalid(
                "archive",
                format!("Nothing can be fetched from the archive `{name}`: it has no DICOMweb."),
            )
            .fix("Let it send the series by C-STORE, or ask the operator to set its `dicomweb`.")),
            None => Err(self.no_archive("archive", tenant, name)),
        }
    }

    /// A URL for which no archive is configured, if the operator allows it.
    async fn allowed(&self, url: &str) -> Result<String, Failure> {
        match self.archives.guard.check(url).await {
            Ok(_) if url.contains('?') => Err(invalid(
                "dicomweb",
                "The base URL of a DICOMweb service has no query.",
            )
            .fix("Leave out what begins with `?`.")),
            Ok(_) => Ok(url.trim_end_matches('/').to_owned()),
            Err(refusal) => Err(invalid(
                "dicomweb",
                format!("Nothing can be fetched from there. {refusal}"),
            )
            .fix(
                "Name a configured archive, or ask the operator for an entry in `[[archives]]` or in \
                 `dicomweb_allow`.",
            )),
        }
    }

    /// The order to send the objects of these names, of a result of that kind, to the archive `to`, or else to the
    /// archive of the source. `None` if neither names nor an archive are given.
    ///
    /// # Errors
    /// `invalid-field` that names the field which cannot be used.
    pub fn send_order(
        &self,
        tenant: &Tenant,
        kind: &str,
        names: Option<Vec<String>>,
        to: Option<&str>,
        source: Option<&SeriesSource>,
    ) -> Result<Option<SendOrder>, Failure> {
        let Some(names) = names else {
            let alone = "`to` is given without `send`.";
            return match to {
                None => Ok(None),
                Some(_) => Err(invalid("send", alone).fix(sendable_fix(kind))),
            };
        };
        let known = sendable(kind);
        for (number, name) in names.iter().enumerate() {
            let wrong = if !known.contains(&name.as_str()) {
                format!("A {kind} has no DICOM object `{}`.", shorten(name))
            } else if names[..number].contains(name) {
                format!("`{name}` is named twice.")
            } else {
                continue;
            };
            return Err(invalid("send", wrong).fix(sendable_fix(kind)));
        }
        if names.is_empty() {
            return Err(invalid("send", "`send` is empty.").fix(sendable_fix(kind)));
        }
        let to = to.or(source.and_then(|source| source.archive.as_deref()));
        let to = to.ok_or_else(|| {
            invalid("to", "It is not said where to send.").fix(self.known_archives(tenant))
        })?;
        if self.settings.archives.named(to, tenant).is_none() {
            return Err(self.no_archive("to", tenant, to));
        }
        Ok(Some(SendOrder {
            names,
            to: to.to_owned(),
        }))
    }

    /// [`Service::send_order`] of an entry of the settings, in which no names are an empty list.
    ///
    /// # Errors
    /// As [`Service::send_order`].
    pub(crate) fn listed_send_order(
        &self,
        tenant: &Tenant,
        kind: &str,
        names: &[String],
        to: Option<&str>,
        source: Option<&SeriesSource>,
    ) -> Result<Option<SendOrder>, Failure> {
        let names = (!names.is_empty()).then(|| names.to_vec());
        self.send_order(tenant, kind, names, to, source)
    }

    fn no_archive(&self, field: &str, tenant: &Tenant, name: &str) -> Failure {
        let detail = format!("There is no archive `{}`.", shorten(name));
        invalid(field, detail).fix(self.known_archives(tenant))
    }

    fn known_archives(&self, tenant: &Tenant) -> String {
        let archives = self.settings.archives.of_tenant(tenant);
        let names: Vec<&str> = archives.map(|archive| archive.name.as_str()).collect();
        if names.is_empty() {
            "No archive is configured: ask the operator for an entry in `[[archives]]`.".into()
        } else {
            format!("Known archives: {}.", names.join(", "))
        }
    }
}

fn uid(field: &str, given: Option<&str>) -> Result<String, Failure> {
    let wrong = match given {
        Some(text) if is_uid(text) => return Ok(text.to_owned()),
        Some(_) => "is no DICOM UID",
        None => "is missing",
    };
    Err(invalid(field, format!("`{field}` {wrong}.")).fix(
        "Give the Study and Series Instance UID: numbers separated by dots, at most 64 characters.",
    ))
}

/// The names of the DICOM objects that a result of that kind has.
fn sendable(kind: &str) -> Vec<&'static str> {
    let kind = Resource::ALL.into_iter().find(|known| known.noun() == kind);
    let all = kind.map(dicom::objects).unwrap_or_default();
    all.iter().map(|object| object.file_name()).collect()
}

/// Advice that names the objects which can be sent.
pub fn sendable_fix(kind: &str) -> String {
    match sendable(kind).as_slice() {
        [] => "Leave `send` and `to` out.".to_owned(),
        names => format!("Give some of {}.", names.join(", ")),
    }
}
