//! An archive as the operator describes it.

use crate::base::records::Tenant;
use std::fmt;
use std::path::PathBuf;
use url::Url;

/// Longest name of an archive.
const NAME_LENGTH: usize = 64;

/// The application entity title by which this service calls archives unless told otherwise.
const CALLING_AE_TITLE: &str = "VENTRIFORM";

/// Whether `text` can name an archive: 1 to 64 letters, digits, dots, dashes and underscores.
fn is_name(text: &str) -> bool {
    let allowed = |b: u8| b.is_ascii_alphanumeric() || b"._-".contains(&b);
    (1..=NAME_LENGTH).contains(&text.len()) && text.bytes().all(allowed)
}

/// An archive (PACS). Its address was given by the operator, so it may be private.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Archive {
    /// The name by which jobs know it.
    pub name: String,
    /// Base URL of its DICOMweb service, without a slash at the end.
    pub dicomweb: Option<String>,
    /// The variables of the environment that hold its user name and password.
    pub password_variables: Option<(String, String)>,
    /// The variable of the environment that holds a bearer token.
    pub token_variable: Option<String>,
    /// PEM file with the authorities that its certificate may come from, beside those of the
    /// system.
    pub ca_file: Option<PathBuf>,
    /// Where it takes objects by C-STORE.
    pub dicom: Option<DicomPeer>,
    /// The tenants that may use it; all if empty.
    pub tenants: Vec<Tenant>,
    /// The credentials found in the variables.
    pub credentials: Credentials,
}

/// Credentials for an archive. `Debug` does not show it.
#[derive(Clone, Default, PartialEq, Eq)]
pub enum Credentials {
    /// Nothing.
    #[default]
    None,
    /// A name and a password (RFC 7617).
    Basic {
        /// The name.
        username: String,
        /// The password.
        password: String,
    },
    /// A token (RFC 6750).
    Bearer(String),
}

impl fmt::Debug for Credentials {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Credentials::None => "None",
            Credentials::Basic { .. } => "Basic(..)",
            Credentials::Bearer(_) => "Bearer(..)",
        })
    }
}

/// An application entity that takes objects by C-STORE.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DicomPeer {
    /// Host and port.
    pub address: String,
    /// Its application entity title.
    pub called: String,
    /// The application entity title of this service there.
    pub calling: String,
    /// How to speak TLS with it; `None` for plain DICOM.
    pub tls: Option<DicomTls>,
}

/// DICOM over TLS (PS3.15 annex B).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DicomTls {
    /// PEM file with the authorities that its certificate must come from.
    pub ca_file: PathBuf,
    /// PEM files with this service's certificate and private key, if it asks for them.
    pub own: Option<(PathBuf, PathBuf)>,
}

/// Why an entry of the settings describes no archive.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field}: {reason}")]
pub struct ArchiveFault {
    /// The key at fault.
    pub field: &'static str,
    /// The faults of it, and what to write.
    pub reason: String,
}

fn fault(field: &'static str, reason: impl Into<String>) -> ArchiveFault {
    let reason = reason.into();
    ArchiveFault { field, reason }
}

/// A value of an entry that may be missing.
type Given<'a> = Option<&'a str>;

impl Archive {
    /// The keys of an entry that hold a text.
    pub const SETTING_KEYS: [&'static str; 12] = [
        "name",
        "dicomweb",
        "username_env",
        "password_env",
        "token_env",
        "ca_file",
        "dicom",
        "ae_title",
        "calling_ae_title",
        "dicom_ca_file",
        "dicom_cert_file",
        "dicom_key_file",
    ];

    /// The archive that an entry of the settings describes; `given` returns the text of a key.
    ///
    /// # Errors
    /// The first key that cannot be used.
    pub fn read<'a>(
        given: impl Fn(&str) -> Given<'a>,
        tenants: Vec<Tenant>,
    ) -> Result<Self, ArchiveFault> {
        let name = given("name").ok_or_else(|| fault("name", "it is missing"))?;
        if !is_name(name) {
            let reason = "give 1 to 64 letters, digits, dots, dashes or underscores";
            return Err(fault("name", reason));
        }
        let dicomweb = given("dicomweb").map(base_url).transpose()?;
        let archive = Self {
            name: name.to_owned(),
            password_variables: password_variables(
                variable("username_env", given("username_env"))?,
                variable("password_env", given("password_env"))?,
            )?,
            token_variable: variable("token_env", given("token_env"))?,
            ca_file: given("ca_file").map(PathBuf::from),
            dicom: peer(&given)?,
            dicomweb,
            tenants,
            credentials: Credentials::None,
        };
        archive.check()?;
        Ok(archive)
    }

    /// Checks how the keys fit together.
    fn check(&self) -> Result<(), ArchiveFault> {
        let Some(url) = &self.dicomweb else {
            let of_dicomweb = [
                ("username_env", self.password_variables.is_some()),
                ("token_env", self.token_variable.is_some()),
                ("ca_file", self.ca_file.is_some()),
            ];
            if let Some((field, _)) = of_dicomweb.into_iter().find(|(_, given)| *given) {
                return Err(fault(field, "it needs `dicomweb`"));
            }
            return match self.dicom {
                Some(_) => Ok(()),
                None => Err(fault("dicomweb", "give `dicomweb`, `dicom` or both")),
            };
        };
        if self.password_variables.is_some() && self.token_variable.is_some() {
            let reason = "give it or `username_env` and `password_env`, not both";
            return Err(fault("token_env", reason));
        }
        if self.ca_file.is_some() && !url.starts_with("https:") {
            return Err(fault("ca_file", "it is for `dicomweb` with https"));
        }
        Ok(())
    }

    /// Takes the credentials from the environment.
    ///
    /// # Errors
    /// The key whose variable is not set.
    pub fn read_credentials(
        &mut self,
        variable: impl Fn(&str) -> Option<String>,
    ) -> Result<(), ArchiveFault> {
        let value = |field: &'static str, name: &str| match variable(name) {
            Some(value) if !value.is_empty() => Ok(value),
            _ => Err(fault(
                field,
                format!("the environment variable `{name}` is not set"),
            )),
        };
        self.credentials = match (&self.password_variables, &self.token_variable) {
            (Some((username, password)), _) => Credentials::Basic {
                username: value("username_env", username)?,
                password: value("password_env", password)?,
            },
            (None, Some(token)) => Credentials::Bearer(value("token_env", token)?),
            (None, None) => Credentials::None,
        };
        Ok(())
    }

    /// Whether that tenant may use it.
    pub fn serves(&self, tenant: &Tenant) -> bool {
        self.tenants.is_empty() || self.tenants.contains(tenant)
    }

    /// The entry of the settings from which this archive is read.
    pub fn entry(&self) -> Vec<(&'static str, String)> {
        let (username, password) = self.password_variables.clone().unzip();
        let peer = self.dicom.clone();
        let calling = peer.as_ref().map(|peer| peer.calling.clone());
        let tls = peer.as_ref().and_then(|peer| peer.tls.clone());
        let own = tls.as_ref().and_then(|tls| tls.own.clone());
        let (certificate, key) = own.unzip();
        let path = |path: PathBuf| path.display().to_string();
        let values = [
            Some(self.name.clone()),
            self.dicomweb.clone(),
            username,
            password,
            self.token_variable.clone(),
            self.ca_file.clone().map(path),
            peer.as_ref().map(|peer| peer.address.clone()),
            peer.map(|peer| peer.called),
            calling,
            tls.map(|tls| path(tls.ca_file)),
            certificate.map(path),
            key.map(path),
        ];
        let given = Self::SETTING_KEYS.into_iter().zip(values);
        given
            .filter_map(|(key, value)| Some((key, value?)))
            .collect()
    }
}

fn base_url(text: &str) -> Result<String, ArchiveFault> {
    let wrong = |reason: &str| fault("dicomweb", reason);
    let url = Url::parse(text).map_err(|_| {
        wrong("it is not a URL; give the base of the DICOMweb service, such as https://pacs.example/dicom-web")
    })?;
    if !matches!(url.scheme(), "http" | "https") {
        return Err(wrong("it must begin with https:// or http://"));
    }
    if !url.username().is_empty() || url.password().is_some() {
        return Err(wrong(
            "a password does not belong into it: give `username_env` and `password_env`",
        ));
    }
    if url.query().is_some() || url.fragment().is_some() {
        return Err(wrong("it must have no query and no fragment"));
    }
    Ok(normal(&url))
}

/// A base URL as all are written: without a slash at the end.
fn normal(url: &Url) -> String {
    url.as_str().trim_end_matches('/').to_owned()
}

fn variable(field: &'static str, given: Given<'_>) -> Result<Option<String>, ArchiveFault> {
    let Some(name) = given else { return Ok(None) };
    let letter = |b: u8| b.is_ascii_alphanumeric() || b == b'_';
    let digit = name.bytes().next().is_none_or(|b| b.is_ascii_digit());
    if !digit && name.bytes().all(letter) {
        Ok(Some(name.to_owned()))
    } else {
        Err(fault(
            field,
            "give the name of an environment variable, not its value",
        ))
    }
}

fn password_variables(
    username: Option<String>,
    password: Option<String>,
) -> Result<Option<(String, String)>, ArchiveFault> {
    match (username, password) {
        (Some(username), Some(password)) => Ok(Some((username, password))),
        (None, None) => Ok(None),
        (Some(_), None) => Err(fault("password_env", "it is missing beside `username_env`")),
        (None, Some(_)) => Err(fault("username_env", "it is missing beside `password_env`")),
    }
}

/// The keys that need `dicom`.
const OF_DICOM: [&str; 5] = [
    "ae_title",
    "calling_ae_title",
    "dicom_ca_file",
    "dicom_cert_file",
    "dicom_key_file",
];

fn peer<'a>(given: &impl Fn(&str) -> Given<'a>) -> Result<Option<DicomPeer>, ArchiveFault> {
    let Some(address) = given("dicom") else {
        let alone = OF_DICOM.into_iter().find(|key| given(key).is_some());
        return match alone {
            Some(key) => Err(fault(key, "it needs `dicom`")),
            None => Ok(None),
        };
    };
    let (host, port) = address.rsplit_once(':').unwrap_or_default();
    if host.is_empty() || !port.parse::<u16>().is_ok_and(|port| port > 0) {
        return Err(fault(
            "dicom",
            "give host and port, such as `pacs.example:104`",
        ));
    }
    let title = |field: &'static str, title: &str| {
        let plain = |b: u8| (b' '..=b'~').contains(&b) && b != b'\\';
        let usable =
            (1..=16).contains(&title.len()) && title.trim() == title && title.bytes().all(plain);
        if usable {
            Ok(title.to_owned())
        } else {
            Err(fault(
                field,
                "give an application entity title: 1 to 16 characters",
            ))
        }
    };
    let called = given("ae_title");
    let called = called.ok_or_else(|| fault("ae_title", "it is missing beside `dicom`"))?;
    let calling = given("calling_ae_title").unwrap_or(CALLING_AE_TITLE);
    Ok(Some(DicomPeer {
        address: address.to_owned(),
        called: title("ae_title", called)?,
        calling: title("calling_ae_title", calling)?,
        tls: tls([
            given("dicom_ca_file"),
            given("dicom_cert_file"),
            given("dicom_key_file"),
        ])?,
    }))
}

fn tls([authorities, certificate, key]: [Given<'_>; 3]) -> Result<Option<DicomTls>, ArchiveFault> {
    let own = match (certificate, key) {
        (Some(certificate), Some(key)) => Some((certificate.into(), key.into())),
        (None, None) => None,
        (Some(_), None) => {
            let reason = "it is missing beside `dicom_cert_file`";
            return Err(fault("dicom_key_file", reason));
        }
        (None, Some(_)) => {
            let reason = "it is missing beside `dicom_key_file`";
            return Err(fault("dicom_cert_file", reason));
        }
    };
    match authorities {
        Some(file) => Ok(Some(DicomTls {
            ca_file: file.into(),
            own,
        })),
        None if own.is_some() => Err(fault(
            "dicom_ca_file",
            "it is missing: name the file with the authorities of the archive's certificate",
        )),
        None => Ok(None),
    }
}

/// The archives of a service.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Archives(pub Vec<Archive>);

impl Archives {
    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The archive of that name that the tenant may use.
    pub fn named(&self, name: &str, tenant: &Tenant) -> Option<&Archive> {
        let mut named = self.0.iter().filter(|archive| archive.name == name);
        named.find(|archive| archive.serves(tenant))
    }

    /// The archive with that DICOMweb service that the tenant may use.
    pub fn at(&self, url: &str, tenant: &Tenant) -> Option<&Archive> {
        let url = normal(&Url::parse(url).ok()?);
        let mut all = self.0.iter();
        all.find(|archive| archive.dicomweb.as_ref() == Some(&url) && archive.serves(tenant))
    }

    /// The archives that the tenant may use.
    pub fn of_tenant<'a>(&'a self, tenant: &'a Tenant) -> impl Iterator<Item = &'a Archive> {
        self.0.iter().filter(|archive| archive.serves(tenant))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(entry: &[(&str, &str)]) -> Result<Archive, ArchiveFault> {
        let value = |key: &str| entry.iter().find(|(k, _)| *k == key).map(|(_, v)| *v);
        Archive::read(value, Vec::new())
    }

    #[test]
    fn an_entry_is_read_and_written_again() {
        let web = [
            ("name", "pacs"),
            ("dicomweb", "https://10.0.0.5:8042/dicom-web/"),
            ("username_env", "PACS_USER"),
            ("password_env", "PACS_PASSWORD"),
            ("ca_file", "/etc/pacs.pem"),
            ("dicom", "10.0.0.5:2762"),
            ("ae_title", "ORTHANC"),
            ("dicom_ca_file", "/etc/hospital.pem"),
            ("dicom_cert_file", "/etc/own.pem"),
            ("dicom_key_file", "/etc/own.key"),
        ];
        let archive = read(&web).unwrap();
        assert_eq!(
            archive.dicomweb.as_deref(),
            Some("https://10.0.0.5:8042/dicom-web")
        );
        let entry = archive.entry();
        let entry: Vec<_> = entry.iter().map(|(k, v)| (*k, v.as_str())).collect();
        assert_eq!(read(&entry), Ok(archive.clone()));
        assert!(entry.contains(&("calling_ae_title", "VENTRIFORM")));
        let archives = Archives(vec![archive]);
        let tenant = Tenant::default();
        for url in [
            "https://10.0.0.5:8042/dicom-web",
            "HTTPS://10.0.0.5:8042/dicom-web/",
        ] {
            assert!(archives.at(url, &tenant).is_some(), "{url}");
        }
        assert!(archives.at("https://10.0.0.5/dicom-web", &tenant).is_none());
        assert!(archives.named("pacs", &tenant).is_some());
    }

    #[test]
    fn an_archive_serves_its_tenants() {
        let tenants = vec!["north".parse().unwrap()];
        let mut archive = read(&[("name", "a"), ("dicomweb", "http://a")]).unwrap();
        archive.tenants = tenants;
        let archives = Archives(vec![archive]);
        assert!(archives.named("a", &"north".parse().unwrap()).is_some());
        assert!(archives.named("a", &Tenant::default()).is_none());
        assert!(archives.at("http://a/", &Tenant::default()).is_none());
    }

    #[test]
    fn each_fault_names_its_key() {
        let web = ("dicomweb", "https://a");
        let name = ("name", "a");
        let cases: &[(&[(&str, &str)], &str)] = &[
            (&[web], "name"),
            (&[("name", ""), web], "name"),
            (&[("name", "a b"), web], "name"),
            (&[name], "dicomweb"),
            (&[name, ("dicomweb", "pacs")], "dicomweb"),
            (&[name, ("dicomweb", "ftp://a")], "dicomweb"),
            (&[name, ("dicomweb", "https://u:p@a")], "dicomweb"),
            (&[name, ("dicomweb", "https://a/?x=1")], "dicomweb"),
            (&[name, web, ("username_env", "U")], "password_env"),
            (&[name, web, ("password_env", "P")], "username_env"),
            (
                &[
                    name,
                    web,
                    ("username_env", "se cret"),
                    ("password_env", "P"),
                ],
                "username_env",
            ),
            (
                &[
                    name,
                    web,
                    ("username_env", "U"),
                    ("password_env", "P"),
                    ("token_env", "T"),
                ],
                "token_env",
            ),
            (
                &[name, ("dicomweb", "http://a"), ("ca_file", "/ca.pem")],
                "ca_file",
            ),
            (&[name, ("dicom", "pacs"), ("ae_title", "A")], "dicom"),
            (&[name, ("dicom", "pacs:0"), ("ae_title", "A")], "dicom"),
            (&[name, ("dicom", "pacs:104")], "ae_title"),
            (
                &[
                    name,
                    ("dicom", "pacs:104"),
                    ("ae_title", "LONGER THAN SIXTEEN"),
                ],
                "ae_title",
            ),
            (&[name, web, ("ae_title", "A")], "ae_title"),
            (&[name, web, ("dicom_ca_file", "/ca")], "dicom_ca_file"),
            (
                &[
                    name,
                    ("dicom", "p:1"),
                    ("ae_title", "A"),
                    ("dicom_cert_file", "/c"),
                ],
                "dicom_key_file",
            ),
            (
                &[
                    name,
                    ("dicom", "p:1"),
                    ("ae_title", "A"),
                    ("dicom_cert_file", "/c"),
                    ("dicom_key_file", "/k"),
                ],
                "dicom_ca_file",
            ),
            (
                &[
                    name,
                    ("dicom", "p:1"),
                    ("ae_title", "A"),
                    ("token_env", "T"),
                ],
                "token_env",
            ),
        ];
        for (entry, field) in cases {
            assert_eq!(read(entry).unwrap_err().field, *field, "{entry:?}");
        }
    }

    #[test]
    fn credentials_come_from_the_environment_and_are_not_shown() {
        let mut archive = read(&[
            ("name", "a"),
            ("dicomweb", "https://a"),
            ("username_env", "U"),
            ("password_env", "P"),
        ])
        .unwrap();
        let missing = archive.read_credentials(|name| (name == "U").then(|| "me".into()));
        assert_eq!(missing.unwrap_err().field, "password_env");
        archive.read_credentials(|_| Some("hidden".into())).unwrap();
        assert!(matches!(archive.credentials, Credentials::Basic { .. }));
        assert!(!format!("{archive:?}").contains("hidden"));
    }
}
