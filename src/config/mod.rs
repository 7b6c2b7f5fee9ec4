//! The service's settings: read once from four layers into one typed struct.
//!
//! A flag beats a `VENTRIFORM_*` variable, which beats the file of `--config` (TOML), which
//! beats the default. One table below names every setting with its type, default and
//! sentence; flags, variables, file keys, `--help` and `--print-config` all come from it.
//! Nothing else in the program asks the environment.

mod units;

pub use units::{Count, LogFormat, Retention, Size, Span};

use std::collections::BTreeMap;
use std::fmt::Display;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// The prefix of every variable.
pub const VARIABLE_PREFIX: &str = "VENTRIFORM_";

/// A setting that cannot be used, with the layer it came from.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ConfigError {
    /// The file of `--config` could not be read.
    #[error("{path}: {reason}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system or the TOML parser said.
        reason: String,
    },
    /// A key of the file is no setting.
    #[error("{path}: unknown setting `{key}`{}", hint(nearest))]
    UnknownKey {
        /// The file.
        path: PathBuf,
        /// The key as written.
        key: String,
        /// The setting most like it.
        nearest: Option<String>,
    },
    /// A value does not fit its setting.
    #[error("{setting} = `{value}` ({origin}): {reason}")]
    BadValue {
        /// The setting's name.
        setting: &'static str,
        /// The value as written.
        value: String,
        /// Where it came from.
        origin: Origin,
        /// What is wrong with it.
        reason: String,
    },
}

fn hint(nearest: &Option<String>) -> String {
    nearest
        .as_ref()
        .map(|name| format!(" (did you mean `{name}`?)"))
        .unwrap_or_default()
}

/// The layer that decided a setting.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// A command-line flag.
    Flag,
    /// A `VENTRIFORM_*` variable.
    Variable,
    /// The file of `--config`.
    File,
    /// Nobody said anything.
    Default,
}

impl Display for Origin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Origin::Flag => "flag",
            Origin::Variable => "variable",
            Origin::File => "file",
            Origin::Default => "default",
        })
    }
}

/// Makes the struct of settings, the flags and the resolver from one table.
macro_rules! settings {
    ($($(#[doc = $doc:literal])+ $name:ident: $kind:ty = $default:literal;)+) => {
        /// Every setting of the service, resolved.
        #[derive(Debug, Clone, PartialEq)]
        pub struct Settings {
            $($(#[doc = $doc])+ pub $name: $kind,)+
        }

        /// The settings as flags of `ventriform serve`. All optional: see the module.
        #[derive(Debug, Clone, Default, clap::Args)]
        pub struct Flags {
            /// TOML file with settings, keys named like the flags with `_` [env: VENTRIFORM_CONFIG]
            #[arg(long, value_name = "FILE")]
            pub config: Option<PathBuf>,
            $(
                #[doc = concat!($($doc, " ",)+ "[default: ", $default, "]")]
                #[arg(long, value_name = "VALUE")]
                pub $name: Option<$kind>,
            )+
        }

        impl Settings {
            /// Every setting's name, in the order of the documentation.
            pub const NAMES: &'static [&'static str] = &[$(stringify!($name)),+];

            fn resolve(flags: &Flags, layers: &Layers) -> Result<(Self, Vec<Origin>), ConfigError> {
                let mut origins = Vec::new();
                let settings = Self {
                    $($name: {
                        let (value, origin) =
                            layers.pick(stringify!($name), flags.$name.clone(), $default)?;
                        origins.push(origin);
                        value
                    },)+
                };
                Ok((settings, origins))
            }

            fn values(&self) -> Vec<String> {
                vec![$(self.$name.shown()),+]
            }
        }
    };
}

settings! {
    /// Address and port to listen on; port 0 takes any free one
    listen: SocketAddr = "127.0.0.1:8080";
    /// Folder for the database and the files; made if absent, used by one process at a time
    data_dir: PathBuf = "ventriform-data";
    /// Jobs computed at the same time; `auto` is one per two cores
    workers: Count = "auto";
    /// Threads of one job; `auto` is two, or one on a single core
    threads: Count = "auto";
    /// Jobs that may wait; beyond it new ones are answered 429
    queue_limit: usize = "1000";
    /// Starts of one job before it is given up. A job that brings the process down looks like a
    /// power cut: too few, and a bad day loses good jobs
    attempt_limit: u32 = "10";
    /// Longest computation of one job
    job_time_limit: Span = "10m";
    /// How long a worker holds a job without a sign of life
    lease: Span = "30s";
    /// Largest upload
    body_limit: Size = "1GiB";
    /// Most files of one upload (a DICOM series has one per slice)
    parts_limit: usize = "2048";
    /// Largest JSON body
    json_limit: Size = "256KiB";
    /// Most voxels of one volume
    voxel_limit: u64 = "268435456";
    /// Largest volume once decompressed
    decompressed_limit: Size = "2GiB";
    /// Longest wait that `Prefer: wait` is granted
    wait_limit: Span = "60s";
    /// Most templates of the library
    template_limit: u32 = "50";
    /// Age at which finished jobs, volumes, models and segmentations are erased; `off` keeps them
    retention: Retention = "off";
    /// Connections served at the same time; more are closed at once
    connection_limit: usize = "4096";
    /// Time for a request's head to arrive, and for which an idle connection is kept
    header_timeout: Span = "10s";
    /// Longest pause between two pieces of an upload
    body_timeout: Span = "30s";
    /// Longest upload from first to last byte
    upload_time_limit: Span = "1h";
    /// On SIGTERM or Ctrl-C: time for running jobs to end before they go back to the queue
    shutdown_grace: Span = "30s";
    /// Log lines as `text` or `json`
    log_format: LogFormat = "text";
    /// What is logged, in the form of RUST_LOG
    log: String = "info";
}

impl Default for Settings {
    fn default() -> Self {
        Self::load(&Flags::default(), |_| None)
            .expect("the defaults are valid")
            .0
    }
}

/// Which layer decided each setting, in the order of [`Settings::NAMES`].
#[derive(Debug, Clone, PartialEq)]
pub struct Origins(Vec<Origin>);

impl Settings {
    /// Resolves the settings: `flags` first, then `variable` (asked by full name, usually
    /// `std::env::var(..).ok()`), then the file, then the defaults.
    ///
    /// # Errors
    /// The first value that does not fit, the first unknown key of the file, or a file that
    /// cannot be read.
    pub fn load(
        flags: &Flags,
        variable: impl Fn(&str) -> Option<String>,
    ) -> Result<(Self, Origins), ConfigError> {
        let path = flags
            .config
            .clone()
            .or_else(|| variable("VENTRIFORM_CONFIG").map(PathBuf::from));
        let layers = Layers {
            variables: Settings::NAMES
                .iter()
                .filter_map(|name| Some((*name, variable(&variable_name(name))?)))
                .collect(),
            file: match path {
                Some(path) => read_file(&path)?,
                None => BTreeMap::new(),
            },
        };
        let (settings, origins) = Self::resolve(flags, &layers)?;
        Ok((settings, Origins(origins)))
    }

    /// What `serve --print-config` prints: TOML that reads back, with each origin as comment.
    pub fn print(&self, origins: &Origins) -> String {
        Self::NAMES
            .iter()
            .zip(self.values())
            .zip(&origins.0)
            .map(|((name, value), origin)| format!("{name} = {value:?} # {origin}\n"))
            .collect()
    }
}

/// A setting's variable.
pub fn variable_name(setting: &str) -> String {
    format!("{VARIABLE_PREFIX}{}", setting.to_uppercase())
}

struct Layers {
    variables: BTreeMap<&'static str, String>,
    file: BTreeMap<String, String>,
}

impl Layers {
    fn pick<T>(
        &self,
        setting: &'static str,
        flag: Option<T>,
        default: &str,
    ) -> Result<(T, Origin), ConfigError>
    where
        T: FromStr<Err: Display>,
    {
        if let Some(value) = flag {
            return Ok((value, Origin::Flag));
        }
        let (text, origin) = match (self.variables.get(setting), self.file.get(setting)) {
            (Some(text), _) => (text.as_str(), Origin::Variable),
            (None, Some(text)) => (text.as_str(), Origin::File),
            (None, None) => (default, Origin::Default),
        };
        match text.parse() {
            Ok(value) => Ok((value, origin)),
            Err(error) => Err(ConfigError::BadValue {
                setting,
                value: text.to_owned(),
                origin,
                reason: error.to_string(),
            }),
        }
    }
}

/// The file's settings as text: numbers and strings are written alike, so one parser does.
fn read_file(path: &Path) -> Result<BTreeMap<String, String>, ConfigError> {
    let unreadable = |reason: String| ConfigError::Unreadable {
        path: path.to_owned(),
        reason,
    };
    let text = std::fs::read_to_string(path).map_err(|e| unreadable(e.to_string()))?;
    let table: toml::Table = text
        .parse()
        .map_err(|e: toml::de::Error| unreadable(e.to_string()))?;
    table
        .into_iter()
        .map(|(key, value)| {
            if !Settings::NAMES.contains(&key.as_str()) {
                return Err(ConfigError::UnknownKey {
                    path: path.to_owned(),
                    nearest: nearest(&key),
                    key,
                });
            }
            let text = match value {
                toml::Value::String(text) => text,
                other => other.to_string(),
            };
            Ok((key, text))
        })
        .collect()
}

fn nearest(key: &str) -> Option<String> {
    Settings::NAMES
        .iter()
        .map(|name| (strsim::jaro_winkler(key, name), *name))
        .filter(|(likeness, _)| *likeness > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name.to_owned())
}

/// A value as one would write it into the file. Paths have no `Display`; the rest has.
trait Shown {
    fn shown(&self) -> String;
}

impl Shown for PathBuf {
    fn shown(&self) -> String {
        self.display().to_string()
    }
}

macro_rules! shown_by_display {
    ($($kind:ty),+) => {$(
        impl Shown for $kind {
            fn shown(&self) -> String {
                self.to_string()
            }
        }
    )+};
}

shown_by_display!(
    SocketAddr, Count, Span, Size, Retention, LogFormat, String, usize, u32, u64
);

#[cfg(test)]
mod tests {
    use super::*;

    fn load(
        flags: Flags,
        variables: &[(&str, &str)],
        file: Option<&str>,
    ) -> Result<(Settings, Origins), ConfigError> {
        let folder = tempfile::tempdir().unwrap();
        let mut flags = flags;
        if let Some(text) = file {
            let path = folder.path().join("ventriform.toml");
            std::fs::write(&path, text).unwrap();
            flags.config = Some(path);
        }
        Settings::load(&flags, |name| {
            variables
                .iter()
                .find(|(n, _)| *n == name)
                .map(|(_, v)| (*v).to_owned())
        })
    }

    #[test]
    fn a_flag_beats_a_variable_beats_the_file_beats_the_default() {
        let file = Some("queue_limit = 1\nlease = \"5s\"\nparts_limit = 7\n");
        let flags = || Flags {
            queue_limit: Some(3),
            ..Flags::default()
        };
        let variables = [("VENTRIFORM_QUEUE_LIMIT", "2"), ("VENTRIFORM_LEASE", "6s")];
        let (settings, _) = load(flags(), &variables, file).unwrap();
        assert_eq!(settings.queue_limit, 3);
        assert_eq!(settings.lease, "6s".parse().unwrap());
        assert_eq!(settings.parts_limit, 7);
        assert_eq!(settings.listen.port(), 8080);
    }

    #[test]
    fn an_unknown_key_of_the_file_is_refused_by_name_with_the_nearest() {
        let error = load(Flags::default(), &[], Some("queue_limits = 1")).unwrap_err();
        assert!(error.to_string().contains("`queue_limits`"));
        assert!(error.to_string().contains("`queue_limit`?"));
    }

    #[test]
    fn a_bad_value_is_told_with_its_origin() {
        let error = load(Flags::default(), &[("VENTRIFORM_LEASE", "soon")], None).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("lease") && text.contains("soon") && text.contains("variable"));
    }

    #[test]
    fn what_is_printed_reads_back_the_same() {
        let flags = Flags {
            retention: Some("30d".parse().unwrap()),
            body_limit: Some("3MiB".parse().unwrap()),
            ..Flags::default()
        };
        let (settings, origins) = load(flags, &[("VENTRIFORM_WORKERS", "4")], None).unwrap();
        let printed = settings.print(&origins);
        assert!(printed.contains("workers = \"4\" # variable"));
        assert!(printed.contains("retention = \"30d\" # flag"));
        let (again, _) = load(Flags::default(), &[], Some(&printed)).unwrap();
        assert_eq!(again, settings);
    }
}
