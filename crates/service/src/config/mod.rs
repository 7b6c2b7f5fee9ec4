//! The settings of the service, read once at start into a typed struct.
//!
//! A setting comes from the first of these that has it: a command-line flag, a `VENTRIFORM_*`
//! environment variable, the TOML file given by `--config`, the default. The table below lists
//! every setting with its description, type and default; flags, variables, file keys, `--help`
//! and `--print-config` are generated from it. Nothing else in the program reads the environment.
//! Archives (`[[archives]]`) are in the file only.
//!
//! The crate `config` is not used: it does not combine with flags of `clap`, does not say in an
//! error which setting came from where, and cannot print the origins.

pub mod stores;

mod archives;
mod postgres;
mod tables;
mod units;

pub use postgres::{PostgresSettings, PostgresUrl};
pub use tables::Tables;
pub use units::{
    Auto, AutoSize, AwsVariables, BasePath, BlobPlace, Count, DatabaseUrl, Keyword, Limit,
    LogFormat, MinFree, Networks, NoAddress, NoLimit, Off, OptionalAddress, OptionalPath,
    OrKeyword, OtlpEndpoint, OwnRetention, Retention, Role, Size, Span, Words,
};

use crate::network::archive::Archives;
use crate::network::hooks::AllowList;
use crate::network::intake::{AeTitle, Rule, Sender};
use crate::network::worklist::Procedure;
use std::collections::BTreeMap;
use std::fmt::Display;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// The prefix of every environment variable.
pub const VARIABLE_PREFIX: &str = "VENTRIFORM_";

/// The variable with the path of the file.
const CONFIG_VARIABLE: &str = "VENTRIFORM_CONFIG";

/// The standard variable of OpenTelemetry for `otlp_endpoint`.
const OTLP_VARIABLE: &str = "OTEL_EXPORTER_OTLP_ENDPOINT";

/// Why the settings cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ConfigError {
    /// The file of `--config` could not be read.
    #[error("{path}: {reason}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The message of the system or of the TOML parser.
        reason: String,
    },
    /// A key of the file is not a setting.
    #[error("{path}: unknown setting `{key}`{}", hint(nearest))]
    UnknownKey {
        /// The file.
        path: PathBuf,
        /// The key as written.
        key: String,
        /// The setting with the most similar name.
        nearest: Option<String>,
    },
    /// A field of a list in the file is not valid.
    #[error("{path}: {field}: {reason}")]
    BadField {
        /// The file.
        path: PathBuf,
        /// The field: `archives[0].dicomweb`.
        field: String,
        /// The fault.
        reason: String,
    },
    /// A variable that a field of a list in the file names is not set.
    #[error("{field}: {reason}")]
    NoCredentials {
        /// The field: `archives[0].password_env`.
        field: String,
        /// Which variable is missing.
        reason: String,
    },
    /// A value is not valid for its setting.
    #[error("{setting} = `{value}` ({origin}): {reason}", origin = origin.described(setting))]
    BadValue {
        /// The setting's name.
        setting: &'static str,
        /// The value as written.
        value: String,
        /// Where it came from.
        origin: Origin,
        /// The fault.
        reason: String,
    },
}

fn hint(nearest: &Option<String>) -> String {
    nearest
        .as_ref()
        .map(|name| format!(" (did you mean `{name}`?)"))
        .unwrap_or_default()
}

/// Where the value of a setting came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// A command-line flag.
    Flag,
    /// A `VENTRIFORM_*` environment variable.
    Variable,
    /// The file of `--config`.
    File,
    /// The default.
    Default,
}

impl Origin {
    /// In words, where the value of that setting came from.
    pub fn described(self, setting: &str) -> String {
        match self {
            Origin::Flag => format!("flag --{}", setting.replace('_', "-")),
            Origin::Variable => format!("variable {}", variable_name(setting)),
            Origin::File => "file of --config".into(),
            Origin::Default => "default".into(),
        }
    }
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

/// One row of the table of settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SettingRow {
    /// The heading that it stands under in `--help`.
    pub group: &'static str,
    /// Its name, as it is written in the file.
    pub name: &'static str,
    /// The lines of its description.
    pub description: &'static [&'static str],
    /// Its default, as it would be written in the file; empty if there is none.
    pub default: &'static str,
}

impl SettingRow {
    /// Its description as one line.
    pub fn summary(&self) -> String {
        let lines: Vec<&str> = self.description.iter().map(|line| line.trim()).collect();
        lines.join(" ")
    }

    /// The command-line flag.
    pub fn flag(&self) -> String {
        format!("--{}", self.name.replace('_', "-"))
    }

    /// The help of its flag: description, environment variable and default.
    fn help(&self) -> String {
        let default = match self.default {
            "" => String::new(),
            value => format!(" [default: {value}]"),
        };
        format!(
            "{} [env: {}]{default}",
            self.summary(),
            variable_name(self.name)
        )
    }
}

fn row(setting: &str) -> &'static SettingRow {
    let mut rows = Settings::ROWS.iter();
    rows.find(|row| row.name == setting)
        .expect("every setting has a row")
}

/// Switches need no value on the command line: `--allow-anonymous`.
fn arity(kind: &str) -> clap::builder::ValueRange {
    match kind {
        "bool" => (0..=1).into(),
        _ => 1.into(),
    }
}

/// Generates the struct of settings, the flags and the resolver from one table. A heading in
/// brackets begins a group.
macro_rules! settings {
    ($([$group:literal] $($(#[doc = $doc:literal])+ $name:ident: $kind:ty = $default:literal;)+)+) => {
        /// Every setting of the service.
        #[derive(Debug, Clone, PartialEq)]
        pub struct Settings {
            $($($(#[doc = $doc])+ pub $name: $kind,)+)+
            /// The archives that jobs may name; in the file only.
            pub archives: Archives,
            /// The variables for an S3 store; in the environment only.
            pub aws: AwsVariables,
        }

        /// The settings as flags of `ventriform serve`, all optional.
        #[derive(Debug, Clone, Default, clap::Args)]
        pub struct Flags {
            /// TOML file with settings; its keys are the names of the flags with `_` instead of `-`
            /// [env: VENTRIFORM_CONFIG]
            #[arg(long, value_name = "FILE")]
            pub config: Option<PathBuf>,
            $($(
                $(#[doc = $doc])+
                #[arg(long, value_name = "VALUE", num_args = arity(stringify!($kind)),
                    default_missing_value = "true", value_parser = <$kind as Setting>::parser(),
                    help_heading = $group, help = row(stringify!($name)).help())]
                pub $name: Option<$kind>,
            )+)+
        }

        impl Settings {
            /// Every setting's name, in the order of the documentation.
            pub const NAMES: &'static [&'static str] = &[$($(stringify!($name)),+),+];

            /// Every setting's description and default, in the order of the documentation.
            pub const ROWS: &'static [SettingRow] = &[$($(SettingRow {
                group: $group,
                name: stringify!($name),
                description: &[$($doc),+],
                default: $default,
            }),+),+];

            fn resolve(flags: &Flags, layers: &Layers) -> Result<(Self, Vec<Origin>), ConfigError> {
                let mut origins = Vec::new();
                let settings = Self {
                    $($($name: {
                        let (value, origin) =
                            layers.pick(stringify!($name), flags.$name.clone(), $default)?;
                        origins.push(origin);
                        value
                    },)+)+
                    archives: layers.archives.clone(),
                    aws: AwsVariables::default(),
                };
                Ok((settings, origins))
            }

            fn values(&self) -> Vec<String> {
                vec![$($(self.$name.shown()),+),+]
            }
        }
    };
}

settings! {
    ["Service"]
    /// Address and port to listen on; port 0 takes any free one
    listen: SocketAddr = "127.0.0.1:8080";
    /// What this process does: `all`; or, of several on one PostgreSQL database and one S3 store, `api`
    /// answers requests and receives images, `worker` computes jobs and does the background work
    role: Role = "all";
    /// Folder for the database and the files; created if missing, used by one process at a time
    data_dir: PathBuf = "ventriform-data";
    /// Where the files are kept: `folder` is the data folder, `s3://BUCKET/PREFIX` an S3 store. Its
    /// address and credentials come from the environment: AWS_ENDPOINT_URL, AWS_REGION,
    /// AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and the others that the AWS tools read
    blobs: BlobPlace = "folder";
    /// Largest size of the copies of files in an S3 store, kept in the data folder. They can be
    /// deleted at any time
    blob_cache: Size = "2GiB";
    /// Where jobs and records are kept: `sqlite` is a file in data_dir; else the URL of a PostgreSQL
    /// database, postgres://user:password@host:5432/name
    database: DatabaseUrl = "sqlite";
    /// How long a start waits for a database on a server
    database_wait: Span = "60s";
    /// Largest number of connections to a database on a server, from 2
    database_connections: u32 = "16";
    /// Space of the disk to keep free; with less, uploads and jobs are refused with status 507 while
    /// accepted jobs go on. `auto` is 256 MiB, or 5 % of a smaller disk; `0B` turns this off
    min_free: MinFree = "auto";
    /// Longest time that a write waits for the database before it is answered with status 503
    write_wait: Span = "2s";
    /// Age at which quarantined items are deleted (files without a record, kept for `ventriform
    /// doctor`); `off` keeps them
    quarantine_keep: Retention = "30d";
    /// Bytes per second that are read to verify every stored file once a day; `0B` turns this off
    scrub_rate: Size = "1MiB";

    ["Jobs"]
    /// Jobs computed at the same time; `auto` is one per core
    workers: Count = "auto";
    /// Threads of one job; `auto` is one. More make a single job faster, but fewer jobs per hour
    threads: Count = "auto";
    /// Largest number of waiting jobs; more are rejected with status 429, unless their tenant has less than
    /// its equal share of them
    queue_limit: usize = "1000";
    /// Crashes of its own process after which a job fails. A job that was running
    /// when the service died is computed in a process of its own, so power cuts do not count
    attempt_limit: u32 = "3";
    /// Longest computation of one job
    job_time_limit: Span = "10m";
    /// How long another process on the same store would respect a claim that is not renewed
    lease: Span = "30s";

    ["Uploads and requests"]
    /// Largest upload
    body_limit: Size = "1GiB";
    /// Largest number of files in one upload (a DICOM series has one per slice)
    parts_limit: usize = "2048";
    /// Largest JSON body
    json_limit: Size = "256KiB";
    /// Largest number of voxels of one volume
    voxel_limit: u64 = "268435456";
    /// Largest volume after decompression
    decompressed_limit: Size = "2GiB";
    /// Largest number of files in one zip archive
    file_limit: u64 = "8192";
    /// Largest file of a mesh (an expert's, as STL, PLY ...), unpacked; reading one takes up to eight times as
    /// much memory
    mesh_limit: Size = "8MiB";
    /// Memory that uploads and previews being decoded take together; more of them wait
    decoding_memory: Size = "256MiB";
    /// Largest number of uploads and previews that wait to be decoded; more are answered with
    /// status 503
    decoding_queue: usize = "256";
    /// Longest computation for reading one upload or drawing one preview, beside that of
    /// decoding_rate; longer ones are ended
    decoding_time: Span = "10s";
    /// Bytes of an upload for which decoding_time grows by one second
    decoding_rate: Size = "1MiB";
    /// Memory for answers about volumes, models, segmentations, beats, comparisons, templates and ended jobs, which are
    /// kept until something is written; `0B` keeps none
    answer_memory: Size = "8MiB";
    /// Memory that bodies of requests and answers take together, shared between tenants, and between the
    /// clients of each: at most a third for one client, half for an anonymous one. Requests beyond
    /// that wait for two seconds, then they are answered with status 503
    request_memory: Size = "128MiB";
    /// Threads for work that blocks (files, decoding); more of it waits for one. `auto` is 64. Each takes up to
    /// 2 MiB of memory
    blocking_threads: Count = "auto";
    /// Longest time a request with `Prefer: wait` waits. It is shorter than usual proxies wait for an
    /// answer (HAProxy 50s, nginx 60s), which would answer in its place
    wait_limit: Span = "45s";
    /// Largest number of templates in the library
    template_limit: u32 = "50";
    /// Largest number of readers' profiles
    reader_limit: u32 = "200";
    /// Largest number of sets of normal limits
    normals_limit: u32 = "50";
    /// Largest number of labels of one volume or job
    label_limit: usize = "16";

    ["DICOM"]
    /// Address and port on which other systems send images by DICOM C-STORE; `off` listens on none
    dicom_listen: OptionalAddress = "off";
    /// PEM file with the certificate and its chain for DICOM over TLS; with it, dicom_listen speaks TLS only
    dicom_tls_cert: OptionalPath = "off";
    /// PEM file with the private key of dicom_tls_cert
    dicom_tls_key: OptionalPath = "off";
    /// PEM file with the authorities that certificates of calling systems must come from; without it,
    /// callers need no certificate
    dicom_tls_client_ca: OptionalPath = "off";
    /// AE title of this service, which callers must name
    ae_title: AeTitle = "VENTRIFORM";
    /// The systems that may send: tables `[[senders]]` with `ae_title`, `addresses` (none allows any) and
    /// `tenant`. Without any, every system may send on loopback, and with allow_anonymous elsewhere
    senders: Tables<Sender> = "[]";
    /// Largest number of associations
    association_limit: usize = "32";
    /// Largest number of associations of one client address
    client_association_limit: usize = "8";
    /// Largest P-DATA-TF PDU, from 4KiB to 16MiB
    pdu_limit: Size = "256KiB";
    /// Largest object that is received by C-STORE or STOW-RS
    object_limit: Size = "1GiB";
    /// Largest number of bytes of one association
    association_bytes: Size = "16GiB";
    /// Longest time of an association for one PDU, and between two
    association_idle: Span = "60s";
    /// Longest time of an association
    association_time_limit: Span = "1h";
    /// How long after the end of an association (or a STOW-RS request) a series of single slices is
    /// taken to be complete
    series_quiet: Span = "5s";
    /// How long after its last slice a series is taken to be complete while an association is open, or
    /// if one broke off
    series_patience: Span = "2m";
    /// Largest number of received objects that are not part of a volume yet; more are refused, unless their
    /// tenant has less than its equal share of them. Those that make up no volume count for their tenant alone
    intake_objects: u64 = "20000";
    /// Largest size of received objects that are not part of a volume yet, counted likewise
    intake_bytes: Size = "8GiB";
    /// Age at which received objects that make up no volume are erased; `off` keeps them
    intake_keep: Retention = "7d";
    /// The jobs that received volumes start: tables `[[rules]]` with `modality`, `image_type`,
    /// `calling_ae`, `study_description` (what is absent matches anything), `kind`, `parameters`,
    /// `send` and `to`; of kind `comparison` also `stress` and `rest`, parts of the Series Description that tell both
    /// scans of a study. The first rule that matches counts
    rules: Tables<Rule> = "[]";
    /// The work items (UPS) that the service performs itself: tables `[[procedures]]` with `code` and
    /// `scheme` of the Scheduled Workitem Code, `archive`, `kind`, `parameters`, `send`, `to` and `tenant`
    procedures: Tables<Procedure> = "[]";

    ["Retention"]
    /// Age at which volumes, results and finished jobs are erased, unless one of the three settings
    /// below says otherwise; `off` keeps them until somebody erases them
    retention: Retention = "off";
    /// Age at which volumes are erased, counted from their last upload or use; `off` keeps them,
    /// `retention` is the value of that setting
    volume_retention: OwnRetention = "retention";
    /// Age at which models, segmentations, beats and comparisons are erased, counted from their last computation;
    /// `off` keeps them, `retention` is the value of that setting. Templates are kept
    result_retention: OwnRetention = "retention";
    /// Age at which the records of finished jobs are erased (not their results); `off` keeps them,
    /// `retention` is the value of that setting
    job_retention: OwnRetention = "retention";

    ["Connections"]
    /// Largest number of open connections. At the limit, a new connection takes the place of the one
    /// whose client has kept the service waiting the longest; if there is none, it is answered only on
    /// /healthz and /readyz
    connection_limit: usize = "4096";
    /// Largest number of open connections of one client address, counted as for connection_limit
    client_connection_limit: usize = "3072";
    /// Trusted proxies: addresses and networks, separated by commas. X-Forwarded-For or
    /// Forwarded names the client; X-Forwarded-Proto, -Host, -Port and -Prefix or Forwarded the address
    /// that it used, for links and the page. The limit on one client's connections does not apply to them
    trusted_proxies: Networks = "";
    /// Path of the service behind a proxy, such as `/heart`. Requests may have it or not; links begin
    /// with it. X-Forwarded-Prefix of a trusted proxy has priority
    base_path: BasePath = "";
    /// Time limit for the headers of a request, and for the TLS handshake
    header_timeout: Span = "10s";
    /// How long a connection may be idle between two requests. It is longer than usual proxies keep
    /// theirs (nginx 60s, Traefik 90s, Google Cloud 600s), so that they do not use a connection that is closing
    keep_alive_timeout: Span = "620s";
    /// Longest pause of a client in reading an answer; it must also read 1 KiB per second on average
    write_timeout: Span = "30s";
    /// After an early refusal: longest time for the client to send the rest, read the answer and close.
    /// A proxy that cannot send on may answer with 502 instead
    linger_time: Span = "10s";
    /// Longest pause of such a client in sending
    linger_pause: Span = "2s";
    /// Bytes of such a client that are read and thrown away
    linger_bytes: Size = "512MiB";
    /// Largest number of streams of events (/v1/jobs/ID/events); more are answered with status 429
    event_stream_limit: usize = "1024";
    /// Largest number of streams of events of one client address
    client_event_stream_limit: usize = "256";
    /// Longest pause within an upload
    body_timeout: Span = "30s";
    /// Longest time for an upload, from the first to the last byte
    upload_time_limit: Span = "1h";

    ["TLS"]
    /// PEM file with the certificate chain of the service; with it, only TLS 1.2 and 1.3 are spoken.
    /// The files are read again when they change and on SIGHUP
    tls_cert: OptionalPath = "off";
    /// PEM file with the private key of tls_cert
    tls_key: OptionalPath = "off";
    /// PEM file with the authorities whose client certificates are required; `off` requires none
    tls_client_ca: OptionalPath = "off";

    ["Access"]
    /// Serve callers without credentials also on addresses that are not loopback
    allow_anonymous: bool = "false";
    /// Serve /metrics to callers without credentials
    open_metrics: bool = "false";
    /// Names of this service that the Host header may have, separated by commas; `*` allows any.
    /// Names of this machine are always answered on loopback, and any name elsewhere if this is
    /// empty and callers need credentials
    hosts: Words = "";
    /// Sites whose pages may use the service, such as `https://viewer.example`, separated by commas;
    /// `*` allows any
    cors_origins: Words = "";
    /// Requests per minute of each caller; a key can have a limit of its own; `off` is none
    quota_requests: Limit<u64> = "60000";
    /// Size of all that one tenant stores: volumes, results, templates, readers, received objects, work
    /// items and the records of jobs (2 KiB each and their texts); `off` is none
    quota_bytes: Limit<Size> = "off";
    /// Waiting jobs of one tenant; `off` is none but queue_limit
    quota_jobs: Limit<u64> = "off";
    /// Requests with wrong credentials per minute and client address that are answered with status
    /// 401; more are answered with 429
    auth_failure_limit: u64 = "60";
    /// OpenID Connect issuer whose tokens are accepted (the value of their claim `iss`); empty
    /// accepts none
    oidc_issuer: String = "";
    /// What the claim `aud` of a token must hold
    oidc_audience: String = "ventriform";
    /// Address of the issuer's JWKS; empty asks the issuer's discovery document
    oidc_jwks: String = "";
    /// Claim that names a caller's tenant, or a path to it, as for oidc_scope_claim; empty puts every caller
    /// into the tenant `default`
    oidc_tenant_claim: String = "tenant";
    /// Claim that holds a caller's scopes: the words read, submit or admin, also with `ventriform:`
    /// before them. Dots lead into objects: `realm_access.roles`
    oidc_scope_claim: String = "scope";
    /// How far the clocks of issuer and service may differ
    oidc_leeway: Span = "60s";
    /// How long an API key may live that a subject of the issuer makes, if it asks for more than its token has left;
    /// `0s` lets it end with the token
    oidc_key_life: Span = "0s";
    /// Age at which rows of the audit trail are removed; `off` keeps them
    audit_retention: Retention = "off";

    ["Webhooks"]
    /// Hosts, addresses and networks that webhooks may go to although they are not public, separated
    /// by commas; `http` is for these only
    webhook_allow: AllowList = "";
    /// Largest number of attempts of one delivery
    webhook_attempts: u32 = "12";
    /// Longest time for which a delivery is tried
    webhook_age: Span = "3d";
    /// Pause after the first failed attempt; each is four times the one before, at most 6h
    webhook_backoff: Span = "5s";
    /// Longest attempt
    webhook_timeout: Span = "10s";
    /// Largest number of deliveries sent at the same time
    webhook_concurrency: usize = "16";
    /// Largest number of deliveries sent at the same time to one host and port
    webhook_destination_concurrency: usize = "4";
    /// Largest number of pending deliveries of one tenant to one host and port; the oldest beyond that are given up
    webhook_backlog: u32 = "10000";
    /// How long delivered and given-up deliveries are kept
    webhook_history: Span = "7d";
    /// Largest number of registered webhooks of one tenant
    webhook_endpoint_limit: u32 = "20";

    ["Archives"]
    /// Hosts, addresses and networks that a job may name in `source.dicomweb` although no archive is
    /// configured for them, separated by commas; empty allows none
    dicomweb_allow: AllowList = "";
    /// Longest pause of an archive in an answer
    archive_timeout: Span = "30s";
    /// Longest time for one fetch of a series or one delivery
    archive_time_limit: Span = "10m";
    /// Largest number of attempts of one fetch or delivery
    archive_attempts: u32 = "20";
    /// Longest time for which a fetch or a delivery is tried
    archive_age: Span = "3d";
    /// Pause after the first failed attempt; each is four times the one before, at most 6h
    archive_backoff: Span = "5s";
    /// Largest number of fetches, and of deliveries, at the same time
    archive_concurrency: usize = "4";

    ["Traces"]
    /// Address of an OpenTelemetry collector (OTLP over HTTP), such as http://127.0.0.1:4318; the
    /// variable OTEL_EXPORTER_OTLP_ENDPOINT is read too. `off` sends no traces
    otlp_endpoint: OtlpEndpoint = "off";

    ["Shutdown and log"]
    /// After SIGTERM or Ctrl-C: time for running jobs to end before they return to the queue
    shutdown_grace: Span = "30s";
    /// Log lines as `text` or `json`
    log_format: LogFormat = "text";
    /// Log filter, in the syntax of RUST_LOG
    log: String = "info";
}

impl Default for Settings {
    fn default() -> Self {
        Self::load(&Flags::default(), |_| None)
            .expect("the defaults are valid")
            .0
    }
}

/// The origin of each setting, in the order of [`Settings::NAMES`].
#[derive(Debug, Clone, PartialEq)]
pub struct Origins(Vec<Origin>);

impl Origins {
    /// Where the value of the setting with that name came from.
    pub fn origin(&self, setting: &str) -> Origin {
        let place = Settings::NAMES.iter().position(|name| *name == setting);
        let origin = place.and_then(|place| self.0.get(place));
        origin.copied().unwrap_or(Origin::Default)
    }
}

impl Settings {
    /// Resolves the settings: from `flags`, then `variable` (called with the full name, usually
    /// `std::env::var(..).ok()`), then the file, then the defaults.
    ///
    /// # Errors
    /// If a value is not valid, a key of the file is unknown, or the file cannot be read.
    pub fn load(
        flags: &Flags,
        variable: impl Fn(&str) -> Option<String>,
    ) -> Result<(Self, Origins), ConfigError> {
        let path = flags
            .config
            .clone()
            .or_else(|| variable(CONFIG_VARIABLE).map(PathBuf::from));
        let file = match path {
            Some(path) => read_file(&path)?,
            None => FileContent::default(),
        };
        let layers = Layers {
            variables: Settings::NAMES
                .iter()
                .filter_map(|name| {
                    let own = variable(&variable_name(name));
                    let value = own.or_else(|| match *name {
                        "otlp_endpoint" => variable(OTLP_VARIABLE).filter(|v| !v.is_empty()),
                        _ => None,
                    });
                    Some((*name, value?))
                })
                .collect(),
            file: file.values,
            archives: file.archives,
        };
        let (settings, origins) = Self::resolve(flags, &layers)?;
        Ok((settings, Origins(origins)))
    }

    /// What the environment, or else the file that it names, says of one setting, and where; `None` if nothing. For commands
    /// that need no other setting, and are not to fail by one.
    ///
    /// # Errors
    /// If the file cannot be read, or has a key that is no setting.
    pub fn stated(
        setting: &str,
        variable: impl Fn(&str) -> Option<String>,
    ) -> Result<Option<(String, Origin)>, ConfigError> {
        if let Some(text) = variable(&variable_name(setting)) {
            return Ok(Some((text, Origin::Variable)));
        }
        let Some(path) = variable(CONFIG_VARIABLE) else {
            return Ok(None);
        };
        let text = read_file(Path::new(&path))?.values.remove(setting);
        Ok(text.map(|text| (text, Origin::File)))
    }

    /// Takes the credentials of the archives and of an S3 store from the environment. Not part of
    /// [`Settings::load`]: commands beside the service need none.
    ///
    /// # Errors
    /// The field whose variable is not set.
    pub fn read_credentials(
        &mut self,
        variable: impl Fn(&str) -> Option<String>,
    ) -> Result<(), ConfigError> {
        for (number, archive) in self.archives.0.iter_mut().enumerate() {
            archive
                .read_credentials(&variable)
                .map_err(|fault| ConfigError::NoCredentials {
                    field: format!("{}[{number}].{}", archives::ARCHIVES_KEY, fault.field),
                    reason: fault.reason,
                })?;
        }
        self.read_aws(variable);
        Ok(())
    }

    /// Takes the variables for an S3 store from the environment, if the files are in one.
    pub fn read_aws(&mut self, variable: impl Fn(&str) -> Option<String>) {
        if self.blobs.bucket().is_some() {
            self.aws = AwsVariables::read(variable);
        }
    }

    /// The database on a server, if the records are kept on one.
    pub fn postgres(&self) -> Option<PostgresSettings> {
        self.database.0.clone().map(|url| PostgresSettings {
            url,
            connections: self.database_connections.max(2),
            patience: self.database_wait.0,
        })
    }

    /// The settings as TOML that reads back, with the origin of each as a comment.
    pub fn print(&self, origins: &Origins) -> String {
        let lines = Self::NAMES
            .iter()
            .zip(self.values())
            .zip(&origins.0)
            .map(|((name, value), origin)| format!("{name} = {value:?} # {origin}\n"));
        lines.chain([archives::print(&self.archives)]).collect()
    }
}

/// The environment variable of a setting.
pub fn variable_name(setting: &str) -> String {
    format!("{VARIABLE_PREFIX}{}", setting.to_uppercase())
}

struct Layers {
    variables: BTreeMap<&'static str, String>,
    file: BTreeMap<String, String>,
    archives: Archives,
}

/// The content of the file of `--config`.
#[derive(Default)]
struct FileContent {
    /// The settings as text, so that values of every origin go through one parser.
    values: BTreeMap<String, String>,
    archives: Archives,
}

impl Layers {
    fn pick<T>(
        &self,
        setting: &'static str,
        flag: Option<T>,
        default: &str,
    ) -> Result<(T, Origin), ConfigError>
    where
        T: Setting,
    {
        if let Some(value) = flag {
            return Ok((value, Origin::Flag));
        }
        let (text, origin) = match (self.variables.get(setting), self.file.get(setting)) {
            (Some(text), _) => (text.as_str(), Origin::Variable),
            (None, Some(text)) => (text.as_str(), Origin::File),
            (None, None) => (default, Origin::Default),
        };
        match T::read(text) {
            Ok(value) => Ok((value, origin)),
            Err(reason) => Err(ConfigError::BadValue {
                setting,
                // It may hold a password.
                value: match setting {
                    "database" => "...".to_owned(),
                    _ => text.to_owned(),
                },
                origin,
                reason,
            }),
        }
    }
}

fn read_file(path: &Path) -> Result<FileContent, ConfigError> {
    let unreadable = |reason: String| ConfigError::Unreadable {
        path: path.to_owned(),
        reason,
    };
    let text = std::fs::read_to_string(path).map_err(|error| {
        unreadable(format!(
            "the file of settings cannot be read ({error}): give the path of a TOML file by --config or \
             VENTRIFORM_CONFIG"
        ))
    })?;
    let table: toml::Table = text
        .parse()
        .map_err(|e: toml::de::Error| unreadable(e.to_string()))?;
    let mut content = FileContent::default();
    for (key, value) in table {
        if key == archives::ARCHIVES_KEY {
            content.archives = archives::read(path, value)?;
            continue;
        }
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
        content.values.insert(key, text);
    }
    Ok(content)
}

fn nearest(key: &str) -> Option<String> {
    let names = Settings::NAMES.iter().chain(&[archives::ARCHIVES_KEY]);
    names
        .map(|name| (strsim::jaro_winkler(key, name), *name))
        .filter(|(likeness, _)| *likeness > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name.to_owned())
}

/// The type of a setting: how its values are written, and read from a flag, a variable and the file.
trait Setting: Clone + Send + Sync + 'static {
    /// The value as it is written in the file.
    fn shown(&self) -> String;

    /// The value of a text.
    ///
    /// # Errors
    /// What to give instead.
    fn read(text: &str) -> Result<Self, String>;

    /// The same, of a flag.
    fn parser() -> clap::builder::ValueParser {
        clap::builder::ValueParser::new(Self::read)
    }
}

impl Setting for PathBuf {
    fn shown(&self) -> String {
        self.display().to_string()
    }

    fn read(text: &str) -> Result<Self, String> {
        match text {
            "" => Err("give a path such as ventriform-data".into()),
            path => Ok(path.into()),
        }
    }

    /// A path on the command line may be no text.
    fn parser() -> clap::builder::ValueParser {
        clap::builder::ValueParser::path_buf()
    }
}

/// Types whose own errors say what to give instead.
macro_rules! settings_of_our_own {
    ($($kind:ty),+) => {$(
        impl Setting for $kind {
            fn shown(&self) -> String {
                self.to_string()
            }

            fn read(text: &str) -> Result<Self, String> {
                text.parse().map_err(|error: <$kind as FromStr>::Err| error.to_string())
            }
        }
    )+};
}

settings_of_our_own!(
    Role,
    AeTitle,
    AllowList,
    BasePath,
    BlobPlace,
    DatabaseUrl,
    OtlpEndpoint,
    Count,
    MinFree,
    Span,
    Size,
    Retention,
    OwnRetention,
    LogFormat,
    Networks,
    OptionalAddress,
    OptionalPath,
    Tables<Rule>,
    Tables<Procedure>,
    Tables<Sender>,
    String,
    Words,
    Limit<u64>,
    Limit<Size>
);

/// Types of the standard library, whose errors name a fault of syntax only.
macro_rules! settings_of_the_library {
    ($($kind:ty: $permitted:literal),+) => {$(
        impl Setting for $kind {
            fn shown(&self) -> String {
                self.to_string()
            }

            fn read(text: &str) -> Result<Self, String> {
                text.parse().map_err(|_| $permitted.to_owned())
            }
        }
    )+};
}

settings_of_the_library!(
    SocketAddr: "give an IP address with a port, such as 127.0.0.1:8080, 0.0.0.0:8080 or [::1]:8080",
    usize: "give a whole number, such as 16",
    u32: "give a whole number up to 4294967295, such as 16",
    u64: "give a whole number, such as 16",
    bool: "give `true` or `false`"
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
    fn a_flag_overrides_a_variable_overrides_the_file_overrides_the_default() {
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
    fn the_collector_is_also_read_from_the_standard_variable() {
        let standard = ("OTEL_EXPORTER_OTLP_ENDPOINT", "http://c:4318");
        let own = ("VENTRIFORM_OTLP_ENDPOINT", "off");
        let endpoint = |variables: &[_]| load(Flags::default(), variables, None).unwrap().0;
        let set = endpoint(&[standard]).otlp_endpoint;
        assert_eq!(set.0.as_deref(), Some("http://c:4318"));
        assert_eq!(endpoint(&[standard, own]).otlp_endpoint.0, None);
    }

    const PACS_SECTION: &str = "[[archives]]
name = \"pacs\"
dicomweb = \"https://10.0.0.5/dicom-web\"
username_env = \"PACS_USER\"
password_env = \"PACS_PASSWORD\"
tenants = [\"default\"]
";

    #[test]
    fn archives_are_read_and_their_credentials_are_not_in_the_file() {
        let (mut settings, _) = load(Flags::default(), &[], Some(PACS_SECTION)).unwrap();
        let [pacs] = &settings.archives.0[..] else {
            panic!("{:?}", settings.archives);
        };
        assert_eq!(pacs.name, "pacs");
        let error = settings.read_credentials(|_| None).unwrap_err().to_string();
        assert!(error.contains("archives[0].username_env"), "{error}");
        assert!(error.contains("PACS_USER"), "{error}");
        settings.read_credentials(|name| Some(name.into())).unwrap();
    }

    #[test]
    fn every_fault_of_an_archive_names_its_field() {
        for (text, field) in [
            ("archives = 1".to_owned(), "archives"),
            ("archives = [1]".to_owned(), "archives[0].name"),
            (
                format!("{PACS_SECTION}dicomwebb = \"a\""),
                "archives[0].dicomwebb",
            ),
            (format!("{PACS_SECTION}ca_file = 1"), "archives[0].ca_file"),
            (format!("{PACS_SECTION}{PACS_SECTION}"), "archives[1].name"),
            (
                PACS_SECTION.replace("https", "gopher"),
                "archives[0].dicomweb",
            ),
            (
                PACS_SECTION.replace("[\"default\"]", "[]"),
                "archives[0].tenants",
            ),
            (
                PACS_SECTION.replace("[\"default\"]", "[\"a/b\"]"),
                "archives[0].tenants",
            ),
            (
                PACS_SECTION.replace("[\"default\"]", "1"),
                "archives[0].tenants",
            ),
        ] {
            let error = load(Flags::default(), &[], Some(&text)).unwrap_err();
            assert!(error.to_string().contains(&format!("{field}:")), "{error}");
        }
        let error = load(Flags::default(), &[], Some("archivs = 1")).unwrap_err();
        assert!(error.to_string().contains("`archives`?"));
    }

    #[test]
    fn an_unknown_key_of_the_file_is_rejected_with_the_nearest_name() {
        let error = load(Flags::default(), &[], Some("queue_limits = 1")).unwrap_err();
        assert!(error.to_string().contains("`queue_limits`"));
        assert!(error.to_string().contains("`queue_limit`?"));
    }

    #[test]
    fn an_invalid_value_is_reported_with_its_origin() {
        let error = load(Flags::default(), &[("VENTRIFORM_LEASE", "soon")], None).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("lease") && text.contains("soon") && text.contains("variable"));
    }

    #[test]
    fn switches_need_no_value_on_the_command_line() {
        use clap::{Args, FromArgMatches};
        let given = |words: &[&str]| {
            let command = Flags::augment_args(clap::Command::new("serve"));
            let matches = command.get_matches_from([&["serve"], words].concat());
            Flags::from_arg_matches(&matches).unwrap().allow_anonymous
        };
        assert_eq!(given(&["--allow-anonymous", "--workers", "1"]), Some(true));
        assert_eq!(given(&["--allow-anonymous=false"]), Some(false));
        assert_eq!(given(&[]), None);
    }

    #[test]
    fn printed_settings_read_back_unchanged() {
        let flags = Flags {
            retention: Some("30d".parse().unwrap()),
            body_limit: Some("3MiB".parse().unwrap()),
            ..Flags::default()
        };
        let variables = [("VENTRIFORM_WORKERS", "4")];
        let (settings, origins) = load(flags, &variables, Some(PACS_SECTION)).unwrap();
        let printed = settings.print(&origins);
        assert!(printed.contains("workers = \"4\" # variable"));
        assert!(printed.contains("retention = \"30d\" # flag"));
        let (again, _) = load(Flags::default(), &[], Some(&printed)).unwrap();
        assert_eq!(again, settings);
    }
}
