//! Values of settings with units or keywords: `30s`, `512MiB`, `auto`, `off`.
//!
//! Each value is printed exactly as it may be written, so `--print-config` reads back unchanged.
//! (`humantime` and `bytesize` print 90 s as `1m 30s` and round sizes to one decimal.)

use super::postgres::PostgresUrl;
use ipnet::IpNet;
use std::fmt;
use std::marker::PhantomData;
use std::net::{IpAddr, SocketAddr};
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

/// A length of time: a whole number with `ms`, `s`, `m`, `h` or `d`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd)]
pub struct Span(pub Duration);

const SPAN_UNITS: [(&str, u64); 5] = [
    ("ms", 1),
    ("s", 1000),
    ("m", 60_000),
    ("h", 3_600_000),
    ("d", 86_400_000),
];

impl FromStr for Span {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let ms = scaled(text, &SPAN_UNITS)
            .ok_or("give a whole number with a unit: 500ms, 30s, 10m, 1h or 7d")?;
        Ok(Self(Duration::from_millis(ms)))
    }
}

impl fmt::Display for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = u64::try_from(self.0.as_millis()).unwrap_or(u64::MAX);
        write_scaled(f, ms, &SPAN_UNITS)
    }
}

/// A number of bytes: a whole number with `B`, `KiB`, `MiB` or `GiB`, or `0`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd)]
pub struct Size(pub u64);

const SIZE_UNITS: [(&str, u64); 4] = [
    ("B", 1),
    ("KiB", 1 << 10),
    ("MiB", 1 << 20),
    ("GiB", 1 << 30),
];

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "0" {
            return Ok(Self(0));
        }
        scaled(text, &SIZE_UNITS)
            .map(Self)
            .ok_or("give a whole number with a unit: 4096B, 256KiB, 64MiB or 2GiB".into())
    }
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_scaled(f, self.0, &SIZE_UNITS)
    }
}

impl Size {
    /// The size as a length in memory.
    pub fn as_usize(self) -> usize {
        usize::try_from(self.0).unwrap_or(usize::MAX)
    }
}

/// Where files are kept: `folder`, or `s3://BUCKET/PREFIX`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum BlobPlace {
    /// In the data folder.
    Folder,
    /// In a bucket.
    S3 {
        /// The bucket's name.
        bucket: String,
        /// The beginning of the keys of all files, without a slash at its ends; may be empty.
        prefix: String,
    },
}

impl BlobPlace {
    /// Bucket and prefix, if it is one.
    pub fn bucket(&self) -> Option<(&str, &str)> {
        match self {
            Self::Folder => None,
            Self::S3 { bucket, prefix } => Some((bucket, prefix)),
        }
    }
}

/// Whether a name is one that buckets and the parts of keys may have without being escaped.
fn is_plain_part(part: &str) -> bool {
    let allowed = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    !part.is_empty() && part != "." && part != ".." && part.chars().all(allowed)
}

impl FromStr for BlobPlace {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "folder" {
            return Ok(Self::Folder);
        }
        let path = text
            .strip_prefix("s3://")
            .map(|path| path.trim_end_matches('/'));
        let path = path.filter(|path| path.split('/').all(is_plain_part));
        let path = path.ok_or(
            "give `folder` or s3://BUCKET/PREFIX, with letters, digits, points, `-` and `_`",
        )?;
        let (bucket, prefix) = path.split_once('/').unwrap_or((path, ""));
        Ok(Self::S3 {
            bucket: bucket.to_owned(),
            prefix: prefix.to_owned(),
        })
    }
}

impl fmt::Display for BlobPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Folder => f.write_str("folder"),
            Self::S3 { bucket, prefix } if prefix.is_empty() => write!(f, "s3://{bucket}"),
            Self::S3 { bucket, prefix } => write!(f, "s3://{bucket}/{prefix}"),
        }
    }
}

/// Names and values of the variables that the AWS tools read. Secret: `Debug` shows the names only.
#[derive(Clone, Default, PartialEq, Eq)]
pub struct AwsVariables(pub Vec<(String, String)>);

impl AwsVariables {
    /// The variables that are read.
    const VARIABLE_NAMES: [&str; 14] = [
        "AWS_ENDPOINT_URL",
        "AWS_ENDPOINT_URL_S3",
        "AWS_ENDPOINT_URL_STS",
        "AWS_REGION",
        "AWS_DEFAULT_REGION",
        "AWS_ACCESS_KEY_ID",
        "AWS_SECRET_ACCESS_KEY",
        "AWS_SESSION_TOKEN",
        "AWS_ROLE_ARN",
        "AWS_ROLE_SESSION_NAME",
        "AWS_WEB_IDENTITY_TOKEN_FILE",
        "AWS_CONTAINER_CREDENTIALS_RELATIVE_URI",
        "AWS_CONTAINER_CREDENTIALS_FULL_URI",
        "AWS_CONTAINER_AUTHORIZATION_TOKEN_FILE",
    ];

    /// Those that are set and not empty.
    pub fn read(variable: impl Fn(&str) -> Option<String>) -> Self {
        let value = |name: &str| variable(name).filter(|value| !value.is_empty());
        let names = Self::VARIABLE_NAMES.into_iter();
        Self(
            names
                .filter_map(|name| Some((name.to_owned(), value(name)?)))
                .collect(),
        )
    }
}

impl fmt::Debug for AwsVariables {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list()
            .entries(self.0.iter().map(|(name, _)| name))
            .finish()
    }
}

/// The word that stands for the absence of a value.
pub trait Keyword {
    /// The word.
    const KEYWORD_TEXT: &'static str;
    /// The permitted texts, for error messages.
    const PERMITTED_TEXTS: &'static str;
}

/// A value, or a keyword if there is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OrKeyword<T, K>(pub Option<T>, PhantomData<K>);

impl<T: FromStr, K: Keyword> FromStr for OrKeyword<T, K> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == K::KEYWORD_TEXT {
            return Ok(Self(None, PhantomData));
        }
        match text.parse() {
            Ok(value) => Ok(Self(Some(value), PhantomData)),
            Err(_) => Err(format!(
                "give `{}` or {}",
                K::KEYWORD_TEXT,
                K::PERMITTED_TEXTS
            )),
        }
    }
}

impl<T: fmt::Display, K: Keyword> fmt::Display for OrKeyword<T, K> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Some(value) => value.fmt(f),
            None => f.write_str(K::KEYWORD_TEXT),
        }
    }
}

/// The keyword `auto`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Auto;

impl Keyword for Auto {
    const KEYWORD_TEXT: &'static str = "auto";
    const PERMITTED_TEXTS: &'static str = "a whole number from 1";
}

/// The keyword `auto` in place of a size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AutoSize;

impl Keyword for AutoSize {
    const KEYWORD_TEXT: &'static str = "auto";
    const PERMITTED_TEXTS: &'static str = "a size such as 256MiB, or 0B for none";
}

/// The keyword `sqlite`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InFolder;

impl Keyword for InFolder {
    const KEYWORD_TEXT: &'static str = "sqlite";
    const PERMITTED_TEXTS: &'static str = "a URL such as postgres://user@host:5432/name; characters such as @ : / in a \
         user or password are written as %40 %3A %2F";
}

/// The URL of a database on a server, or `sqlite`: a file in the data folder.
pub type DatabaseUrl = OrKeyword<PostgresUrl, InFolder>;

/// A size from 0, or `auto`: what fits the disk.
pub type MinFree = OrKeyword<Size, AutoSize>;

/// The keyword `off`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Off;

impl Keyword for Off {
    const KEYWORD_TEXT: &'static str = "off";
    const PERMITTED_TEXTS: &'static str = "a time such as 12h or 30d";
}

/// A number from 1, or `auto`: what fits the machine.
pub type Count = OrKeyword<NonZeroUsize, Auto>;

/// How long results are kept; `off` keeps them until they are deleted.
pub type Retention = OrKeyword<Span, Off>;

/// The keyword `off` in place of an address.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoAddress;

impl Keyword for NoAddress {
    const KEYWORD_TEXT: &'static str = "off";
    const PERMITTED_TEXTS: &'static str = "an address with a port, such as 127.0.0.1:11112";
}

/// An address to listen on; `off` is none.
pub type OptionalAddress = OrKeyword<SocketAddr, NoAddress>;

/// The address of a collector; `off` is none.
pub type OtlpEndpoint = OrKeyword<String, Off>;

/// The keyword `retention`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct General;

impl Keyword for General {
    const KEYWORD_TEXT: &'static str = "retention";
    const PERMITTED_TEXTS: &'static str = "`off` or a time such as 12h or 30d";
}

/// How long things of one kind are kept, or `retention`: as long as things of the other kinds.
pub type OwnRetention = OrKeyword<Retention, General>;

impl OwnRetention {
    /// The time, or the general one.
    pub fn or(self, general: Option<Duration>) -> Option<Duration> {
        match self.0 {
            Some(own) => own.0.map(|span| span.0),
            None => general,
        }
    }
}

impl Count {
    /// The number; `auto` is replaced by the given one, at least 1.
    pub fn or(self, auto: usize) -> usize {
        self.0.map_or(auto.max(1), NonZeroUsize::get)
    }
}

/// The format of log lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LogFormat {
    /// Text for people.
    Text,
    /// One JSON object per line.
    Json,
}

impl FromStr for LogFormat {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "text" => Ok(LogFormat::Text),
            "json" => Ok(LogFormat::Json),
            _ => Err("give `text` or `json`".into()),
        }
    }
}

impl fmt::Display for LogFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            LogFormat::Text => "text",
            LogFormat::Json => "json",
        })
    }
}

/// The role of a process in the service.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Everything.
    All,
    /// It answers requests and receives images.
    Api,
    /// It computes jobs, and does what is done in the background.
    Worker,
}

impl Role {
    /// Whether it answers requests.
    pub fn serves(self) -> bool {
        self != Self::Worker
    }

    /// Whether it computes jobs.
    pub fn works(self) -> bool {
        self != Self::Api
    }
}

impl FromStr for Role {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "all" => Ok(Role::All),
            "api" => Ok(Role::Api),
            "worker" => Ok(Role::Worker),
            _ => Err("give `all`, `api` or `worker`".into()),
        }
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Role::All => "all",
            Role::Api => "api",
            Role::Worker => "worker",
        })
    }
}

/// The path of a file, or `off`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct OptionalPath(pub Option<PathBuf>);

impl FromStr for OptionalPath {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "" => Err(format!("give `{}` or a path", Off::KEYWORD_TEXT)),
            Off::KEYWORD_TEXT => Ok(Self(None)),
            path => Ok(Self(Some(path.into()))),
        }
    }
}

impl fmt::Display for OptionalPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Some(path) => path.display().fmt(f),
            None => f.write_str(Off::KEYWORD_TEXT),
        }
    }
}

/// The keyword `off` of limits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoLimit;

impl Keyword for NoLimit {
    const KEYWORD_TEXT: &'static str = "off";
    const PERMITTED_TEXTS: &'static str = "a limit such as 1000, or 10GiB for sizes";
}

/// A limit, or `off`.
pub type Limit<T> = OrKeyword<T, NoLimit>;

/// Words, separated by commas or spaces; may be empty.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Words(Vec<String>);

impl Words {
    /// The words.
    pub fn iter(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(String::as_str)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl FromStr for Words {
    type Err = std::convert::Infallible;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let words = text.split([',', ' ']).filter(|word| !word.is_empty());
        Ok(Self(words.map(str::to_owned).collect()))
    }
}

impl fmt::Display for Words {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.join(", "))
    }
}

/// Networks: addresses and ranges in CIDR notation, separated by commas; may be empty.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Networks(Vec<IpNet>);

impl Networks {
    /// Whether one of them contains `address`.
    pub fn contain(&self, address: IpAddr) -> bool {
        self.0.iter().any(|network| network.contains(&address))
    }
}

impl FromStr for Networks {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let network = |part: &str| {
            let range = part.parse::<IpNet>().ok();
            range
                .or_else(|| part.parse::<IpAddr>().ok().map(IpNet::from))
                .ok_or_else(|| {
                    format!("`{part}` is no network; give a list such as `10.0.0.0/8, 192.0.2.1`")
                })
        };
        let parts = text
            .split(',')
            .map(str::trim)
            .filter(|part| !part.is_empty());
        parts.map(network).collect::<Result<_, _>>().map(Self)
    }
}

impl fmt::Display for Networks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<String> = self.0.iter().map(IpNet::to_string).collect();
        f.write_str(&names.join(", "))
    }
}

/// A path before those of the service: empty, or `/heart`, `/apps/heart`, without a slash at its end.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct BasePath(String);

/// Longest path before those of the service.
const LONGEST_BASE: usize = 200;

impl BasePath {
    /// The path; empty if there is none.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// The rest of a path below this one, with a slash at its start; `None` for other paths.
    pub fn rest_of<'a>(&self, path: &'a str) -> Option<&'a str> {
        if self.0.is_empty() {
            return None;
        }
        match path.strip_prefix(&self.0)? {
            "" => Some("/"),
            rest => rest.starts_with('/').then_some(rest),
        }
    }
}

impl FromStr for BasePath {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let path = text.strip_suffix('/').unwrap_or(text);
        let plain = |segment: &str| is_plain_part(segment) && segment.len() <= LONGEST_BASE;
        let usable = path.is_empty()
            || path.len() <= LONGEST_BASE
                && path
                    .strip_prefix('/')
                    .is_some_and(|rest| rest.split('/').all(plain));
        if usable {
            Ok(Self(path.to_owned()))
        } else {
            Err("give a path such as /heart, with letters, digits, points, `-` and `_`")
        }
    }
}

impl fmt::Display for BasePath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

fn scaled(text: &str, units: &[(&str, u64)]) -> Option<u64> {
    let digits = text.find(|c: char| !c.is_ascii_digit())?;
    let (number, unit) = text.split_at(digits);
    let (_, factor) = units.iter().find(|(name, _)| *name == unit.trim())?;
    number.parse::<u64>().ok()?.checked_mul(*factor)
}

/// Writes the value in the largest unit that divides it, so that it reads back exactly.
fn write_scaled(f: &mut fmt::Formatter<'_>, value: u64, units: &[(&str, u64)]) -> fmt::Result {
    let (name, factor) = units
        .iter()
        .rev()
        .find(|(_, factor)| value != 0 && value.is_multiple_of(*factor))
        .unwrap_or(&units[0]);
    write!(f, "{}{name}", value / factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_base_path_is_plain_and_the_rest_of_a_path_begins_with_a_slash() {
        for text in ["/heart", "/heart/", "/apps/heart_2.0/v-1"] {
            let path: BasePath = text.parse().unwrap();
            assert_eq!(path.as_str(), text.trim_end_matches('/'));
        }
        let bad = [
            "heart", "//heart", "/a//b", "/a/../b", "/a b", "/a?b", "/ä", "/a%2Fb",
        ];
        for text in bad {
            assert!(text.parse::<BasePath>().is_err(), "{text}");
        }
        let heart: BasePath = "/heart".parse().unwrap();
        assert_eq!(heart.rest_of("/heart/v1/jobs"), Some("/v1/jobs"));
        assert_eq!(heart.rest_of("/heart"), Some("/"));
        assert_eq!(heart.rest_of("/hearts"), None);
        assert_eq!(heart.rest_of("/v1/heart"), None);
        assert_eq!(BasePath::default().rest_of("/v1"), None);
        assert_eq!("/".parse(), Ok(BasePath::default()));
    }

    #[test]
    fn places_of_files_that_are_none_are_refused() {
        for text in [
            "",
            "hearts",
            "s3://",
            "s3:///p",
            "s3://a//b",
            "s3://a/../b",
            "s3://a/b c",
        ] {
            assert!(text.parse::<BlobPlace>().is_err(), "{text}");
        }
    }

    #[test]
    fn the_values_of_variables_are_not_shown() {
        let variables = AwsVariables::read(|name| Some(format!("secret of {name}")));
        let shown = format!("{variables:?}");
        assert!(shown.contains("AWS_SECRET_ACCESS_KEY") && !shown.contains("secret of"));
        assert!(AwsVariables::read(|_| Some(String::new())).0.is_empty());
    }

    #[test]
    fn values_read_back_as_printed() {
        for text in ["500ms", "30s", "90s", "10m", "7d", "0ms"] {
            assert_eq!(text.parse::<Span>().unwrap().to_string(), text);
        }
        for text in ["1000B", "256KiB", "3MiB", "2GiB"] {
            assert_eq!(text.parse::<Size>().unwrap().to_string(), text);
        }
        for text in ["folder", "s3://hearts", "s3://hearts/hospital-a/prod_1"] {
            assert_eq!(text.parse::<BlobPlace>().unwrap().to_string(), text);
        }
        for text in ["off", "/etc/tls/cert.pem"] {
            assert_eq!(text.parse::<OptionalPath>().unwrap().to_string(), text);
        }
        for text in ["", "heart.example, *"] {
            assert_eq!(text.parse::<Words>().unwrap().to_string(), text);
        }
        for text in ["off", "10GiB"] {
            assert_eq!(text.parse::<Limit<Size>>().unwrap().to_string(), text);
        }
        for text in ["", "10.0.0.0/8, 192.0.2.1/32, 2001:db8::/32"] {
            assert_eq!(text.parse::<Networks>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn invalid_values_are_rejected() {
        for text in [
            "",
            "10",
            "s",
            "-1s",
            "1.5h",
            "10 parsecs",
            "99999999999999999999s",
        ] {
            assert!(text.parse::<Span>().is_err(), "{text}");
        }
        assert!("18446744073709551615GiB".parse::<Size>().is_err());
        assert!("0".parse::<Count>().is_err());
        assert!("never".parse::<Retention>().is_err());
        assert!("10.0.0.0/33".parse::<Networks>().is_err());
    }
}
