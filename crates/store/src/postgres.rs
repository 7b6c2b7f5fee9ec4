//! The database on a server: PostgreSQL.
//!
//! **One writer.** A transaction that reads before it writes takes an advisory lock first, so it runs as
//! if alone, as on SQLite. It reads under READ COMMITTED: each statement sees what was committed before
//! it began, so the statements after the lock see all that its last holder wrote. Waiting for the lock
//! is limited (`write_wait`); whoever holds it and does nothing is cut off by the server.
//!
//! **How a failed write ends.** As in [`super::writer`]: a transaction that does not end by a successful
//! commit closes its connection, so nothing can fall into it later. The commit asks the server whether
//! the transaction is still whole, as `COMMIT` alone reports success for one that failed.
//!
//! **A pooler in between** (PgBouncer) must give each connection a session of its own (`pool_mode = session`):
//! locks, limits, `LISTEN` and prepared statements belong to a session. Such poolers refuse startup parameters that
//! they do not know, so the limits of a session are set by a statement after connecting, and read back by another.
//! At the start, two connections show whether sessions are shared ([`check_sessions`]).
//!
//! **The tables change.** During a rolling upgrade a process of the next version adds columns and tables while this
//! one runs. A statement that the server has prepared before is refused then, once on each connection, before it
//! has done anything ([`faults::plan_is_stale`]): outside a transaction it is prepared anew, inside of one the
//! transaction ends as if the database had been busy.
//!
//! **The server is away.** At the start, the program waits for it for a limited time. Later, operations
//! fail with [`StoreFault::Away`] until it is back; a connection that was lost is noticed before it is used,
//! and a read whose connection breaks is done again.

use super::faults;
use super::health::Health;
use super::query::jitter;
use super::schema;
use super::shared::Shared;
use sqlx::migrate::MigrateError;
use sqlx::pool::PoolConnection;
use sqlx::postgres::{PgConnectOptions, PgConnection, PgPool, PgPoolOptions};
use sqlx::{AssertSqlSafe, ConnectOptions, Connection, Postgres, Row};
use std::ops::{Deref, DerefMut};
use std::sync::Arc;
use std::time::{Duration, Instant};
use ventriform_service::base::records::{StoreError, StoreFault, StoreResult};
use ventriform_service::config::{PostgresSettings, PostgresUrl};
use ventriform_service::limits::places::Place;

/// Pause between two attempts to reach the server at the start.
const RECONNECT_PAUSE: Duration = Duration::from_secs(1);
/// Longest time of one attempt to reach the server.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
/// Longest time of one statement.
const STATEMENT_TIMEOUT: Duration = Duration::from_secs(30);
/// The parameter of a session that names the process.
const RUN_SETTING: &str = "ventriform.run";
/// The faults of a pooler that hands out sessions for transactions.
const SHARED_SESSION: &str =
    "a pooler between this program and PostgreSQL lets several connections share one session";
/// Advice.
const USE_SESSIONS: &str = "Set `pool_mode = session` for this database in PgBouncer, or give the address of \
    PostgreSQL itself";
/// Advice about a user or a password that is not accepted.
const WRONG_PASSWORD: &str = "Correct user and password in the URL (or PGPASSWORD), or let the user in by pg_hba.conf \
     (by auth_file, if a pooler says so)";
/// Transactions of this process that write or wait at the server for the lock: while one commits, the next one is
/// there.
const WRITE_CONNECTIONS: usize = 2;
/// Oldest version of the server that is tested.
const OLDEST_SERVER_VERSION: i32 = 150_000;

/// The key of the lock for writing, in any schema of its own.
pub(super) const BEGIN_WRITING: &str = "BEGIN; SELECT pg_advisory_xact_lock(hashtextextended('ventriform writes ' || \
    current_schema(), 0))";

/// How the driver reaches the database at `url`.
///
/// # Errors
/// If a parameter of the URL has a value that the driver does not know.
fn options_of(url: &PostgresUrl) -> Result<PgConnectOptions, sqlx::Error> {
    url.with_password().parse()
}

/// Why a database on a server cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PostgresError {
    /// It was not reached in the time set.
    #[error(
        "{reason}: {url} was not reached within {waited:?} (database_wait). Check host and port, and \
         that PostgreSQL runs and accepts connections from this machine"
    )]
    Unreachable {
        /// The database.
        url: PostgresUrl,
        /// The time for which it was tried.
        waited: Duration,
        /// The last message.
        reason: String,
    },
    /// It refuses this user, or lacks something.
    #[error("{reason} ({url}). {fix}")]
    Refused {
        /// The database.
        url: PostgresUrl,
        /// The message of the server.
        reason: String,
        /// Advice.
        fix: &'static str,
    },
    /// A newer program has changed its tables.
    #[error(
        "{0}: its tables were made by a newer version of ventriform than this one ({version}). Start \
         that version, or restore a dump of the database from before it",
        version = env!("CARGO_PKG_VERSION")
    )]
    Newer(PostgresUrl),
    /// The last change of the tables did not end, or the tables are not those of this program.
    #[error(
        "{url}: its tables cannot be brought to this version: {reason}. Use an empty database, or one \
         that only ventriform has written to"
    )]
    Tables {
        /// The database.
        url: PostgresUrl,
        /// The failure.
        reason: String,
    },
}

/// Waits for the server, brings its tables to the current version, and makes a pool of connections. `wait`
/// is the longest time that an operation waits for a connection or a lock; `run` names this process, so
/// that it is not told of its own changes.
pub(super) async fn open(
    settings: &PostgresSettings,
    wait: Duration,
    run: &str,
) -> Result<(PgWriter, Shared<PgPool>), PostgresError> {
    let url = &settings.url;
    let refused = |error: sqlx::Error| refusal(url, &error);
    let options = options_of(url).map_err(refused)?;
    let options = with_few_parameters(options);
    let names = session_names(run);
    let made = while_away(settings, async || {
        let mut connection = connect(url, &options).await?;
        check_sessions(url, &mut connection, &options, run).await?;
        set_session(&mut connection, &names)
            .await
            .map_err(refused)?;
        check_server(url, &mut connection).await?;
        bring_up(&mut connection)
            .await
            .map_err(|error| migration_failure(url, error))?;
        Ok(connection)
    });
    let _ = made.await?.close().await;
    let session: Arc<[_]> = names.into_iter().chain(session_limits(wait)).collect();
    let pool = PgPoolOptions::new()
        .max_connections(settings.connections)
        .acquire_timeout(wait)
        .after_connect(move |connection, _| {
            let session = session.clone();
            Box::pin(async move { set_session(connection, &session).await })
        })
        .connect_lazy_with(options);
    let health = Arc::new(Health::default());
    let writing = Shared::new(pool.clone(), health.clone(), WRITE_CONNECTIONS, wait);
    // The rest is for single statements beside the lock.
    let reading = settings.connections as usize / 4 * 3;
    let readers = Shared::new(pool, health, reading.max(1), wait);
    Ok((PgWriter { shared: writing }, readers))
}

/// Brings the tables to the current version. Newer ones are left as they are if they say that this version works on
/// them: then another process is already of the next version, and this one is started once more beside it.
async fn bring_up(connection: &mut PgConnection) -> Result<(), MigrateError> {
    let mut migrations = schema::postgres();
    let own = migrations.iter().map(|migration| migration.version).max();
    let noted = sqlx::query_scalar("SELECT to_regclass('oldest_program') IS NOT NULL");
    if noted.fetch_one(&mut *connection).await? {
        let oldest = sqlx::query_scalar("SELECT version FROM oldest_program");
        let oldest: i64 = oldest.fetch_one(&mut *connection).await?;
        migrations.set_ignore_missing(own.is_some_and(|own| oldest <= own));
    }
    migrations.run(connection).await
}

/// A connection whose statements may take any time, to tables that [`open`] has made.
pub(super) async fn connect_unlimited(
    settings: &PostgresSettings,
) -> Result<PgConnection, sqlx::Error> {
    let options = with_few_parameters(options_of(&settings.url)?);
    let mut connection = options.connect().await?;
    set_session(&mut connection, &[("statement_timeout", "0".into())]).await?;
    Ok(connection)
}

/// Connects to a database that another program may have made, for reading: its tables stay as they are. Statements may
/// take any time.
pub(super) async fn open_as_it_is(
    settings: &PostgresSettings,
) -> Result<Shared<PgPool>, PostgresError> {
    let refused = |error: sqlx::Error| refusal(&settings.url, &error);
    let options = with_few_parameters(options_of(&settings.url).map_err(refused)?);
    let reached = while_away(settings, async || connect(&settings.url, &options).await);
    let _ = reached.await?.close().await;
    let pool = PgPoolOptions::new()
        .max_connections(1)
        .after_connect(|connection, _| {
            Box::pin(async move {
                let session = [
                    ("statement_timeout", "0".into()),
                    ("default_transaction_read_only", "on".into()),
                ];
                set_session(connection, &session).await
            })
        })
        .connect_lazy_with(options);
    Ok(Shared::new(pool, Arc::default(), 1, STATEMENT_TIMEOUT))
}

/// Whether a service has made its tables in the database.
pub(super) async fn has_tables(settings: &PostgresSettings) -> Result<bool, sqlx::Error> {
    let options = with_few_parameters(options_of(&settings.url)?);
    let mut connection = options.connect().await?;
    let made = sqlx::query_scalar("SELECT to_regclass('_sqlx_migrations') IS NOT NULL");
    let made = made.fetch_one(&mut connection).await?;
    connection.close().await?;
    Ok(made)
}

/// Without the startup parameters that poolers do not know. Numbers are transferred in binary form, so the digits of
/// their text do not matter.
fn with_few_parameters(options: PgConnectOptions) -> PgConnectOptions {
    options
        .application_name("ventriform")
        .extra_float_digits(None)
}

/// Settings of a session besides its limits. `run` names this process.
fn session_names(run: &str) -> Vec<(&'static str, String)> {
    vec![
        ("client_min_messages", "warning".into()),
        (RUN_SETTING, run.to_owned()),
    ]
}

/// Sets parameters of a session, and makes sure that what was acknowledged is on disk, whatever the default of the
/// server.
///
/// # Errors
/// If the server refuses one, or the next statement finds another session.
async fn set_session(
    connection: &mut PgConnection,
    parameters: &[(&'static str, String)],
) -> Result<(), sqlx::Error> {
    let (names, values): (Vec<&str>, Vec<&str>) = parameters
        .iter()
        .map(|(name, value)| (*name, value.as_str()))
        .unzip();
    sqlx::query(
        "SELECT set_config(name, value, false) FROM unnest($1::text[], $2::text[]) AS one(name, value)
         UNION ALL SELECT set_config('synchronous_commit', 'on', false)
         WHERE current_setting('synchronous_commit') = 'off'",
    )
    .bind(&names)
    .bind(&values)
    .execute(&mut *connection)
    .await?;
    let Some((name, value)) = parameters.iter().find(|(name, _)| *name == RUN_SETTING) else {
        return Ok(());
    };
    let kept = sqlx::query_scalar("SELECT current_setting($1, true) IS NOT DISTINCT FROM $2");
    if kept.bind(name).bind(value).fetch_one(connection).await? {
        Ok(())
    } else {
        Err(sqlx::Error::Configuration(SHARED_SESSION.into()))
    }
}

/// Refuses a pooler that gives each transaction, and not each connection, a session: a parameter that one connection
/// has set shows in another one, or is lost while the other one is in a transaction.
///
/// # Errors
/// If sessions are shared, or a statement is refused.
async fn check_sessions(
    url: &PostgresUrl,
    first: &mut PgConnection,
    options: &PgConnectOptions,
    run: &str,
) -> Result<(), PostgresError> {
    let refused = |error| refusal(url, &error);
    let Ok(Ok(mut second)) = tokio::time::timeout(CONNECT_TIMEOUT, options.connect()).await else {
        // The server has no room for another connection now.
        return Ok(());
    };
    let mark = format!("probe {run}").replace('\'', "");
    // Simple statements: prepared ones would fail for a reason of their own.
    let show = format!("SELECT coalesce(current_setting('{RUN_SETTING}', true), '')");
    let shared = async {
        let set = format!("SELECT set_config('{RUN_SETTING}', '{mark}', false)");
        sqlx::raw_sql(AssertSqlSafe(set))
            .execute(&mut *first)
            .await?;
        sqlx::raw_sql("BEGIN").execute(&mut second).await?;
        let seen = sqlx::raw_sql(AssertSqlSafe(show.clone()));
        let seen: String = seen.fetch_one(&mut second).await?.get(0);
        let kept = sqlx::raw_sql(AssertSqlSafe(show)).fetch_one(&mut *first);
        let kept: String = kept.await?.get(0);
        sqlx::raw_sql("ROLLBACK").execute(&mut second).await?;
        Ok(seen == mark || kept != mark)
    };
    let shared = shared.await.map_err(refused)?;
    let _ = second.close().await;
    if !shared {
        Ok(())
    } else {
        Err(PostgresError::Refused {
            url: url.clone(),
            reason: SHARED_SESSION.into(),
            fix: USE_SESSIONS,
        })
    }
}

/// The limits of a session, so that a process that stands still or is cut off holds no lock
/// for long.
fn session_limits(wait: Duration) -> [(&'static str, String); 7] {
    let ms = |time: Duration| time.as_millis().to_string();
    [
        ("lock_timeout", ms(wait.max(Duration::from_millis(1)))),
        ("statement_timeout", ms(STATEMENT_TIMEOUT)),
        (
            "idle_in_transaction_session_timeout",
            ms(wait.max(Duration::from_secs(5))),
        ),
        ("tcp_keepalives_idle", "10".into()),
        ("tcp_keepalives_interval", "5".into()),
        ("tcp_keepalives_count", "3".into()),
        ("default_transaction_isolation", "read committed".into()),
    ]
}

/// One attempt to connect.
async fn connect(
    url: &PostgresUrl,
    options: &PgConnectOptions,
) -> Result<PgConnection, PostgresError> {
    match tokio::time::timeout(CONNECT_TIMEOUT, options.connect()).await {
        Ok(connected) => connected.map_err(|error| refusal(url, &error)),
        Err(_) => Err(PostgresError::Unreachable {
            url: url.clone(),
            waited: CONNECT_TIMEOUT,
            reason: "it does not answer".into(),
        }),
    }
}

/// Attempts again, from its beginning, what fails because the server is away, for as long as the settings allow.
async fn while_away<T>(
    settings: &PostgresSettings,
    mut attempt: impl AsyncFnMut() -> Result<T, PostgresError>,
) -> Result<T, PostgresError> {
    let started = Instant::now();
    let mut said = false;
    loop {
        let reason = match attempt().await {
            Err(PostgresError::Unreachable { reason, .. }) => reason,
            ended => return ended,
        };
        if started.elapsed() >= settings.patience {
            return Err(PostgresError::Unreachable {
                url: settings.url.clone(),
                waited: settings.patience,
                reason,
            });
        }
        if !said {
            tracing::warn!(database = %settings.url, reason, "waiting for the database");
            said = true;
        }
        let left = settings.patience.saturating_sub(started.elapsed());
        tokio::time::sleep(jitter(RECONNECT_PAUSE).min(left)).await;
    }
}

/// Checks that the server keeps what this program relies on.
async fn check_server(
    url: &PostgresUrl,
    connection: &mut PgConnection,
) -> Result<(), PostgresError> {
    let row = sqlx::query(
        "SELECT current_setting('server_version_num')::int, current_setting('server_encoding'),
                current_setting('fsync'), pg_is_in_recovery(), current_schema() IS NOT NULL",
    )
    .fetch_one(connection)
    .await
    .map_err(|error| refusal(url, &error))?;
    let refused = |reason: String, fix| {
        let url = url.clone();
        Err(PostgresError::Refused { url, reason, fix })
    };
    let version: i32 = row.get(0);
    let encoding: String = row.get(1);
    let fsync: String = row.get(2);
    let (standby, schema): (bool, bool) = (row.get(3), row.get(4));
    if version < OLDEST_SERVER_VERSION {
        let reason = format!("the server has version {}", version / 10_000);
        return refused(reason, "ventriform needs PostgreSQL 15 or newer");
    }
    if encoding != "UTF8" {
        let reason = format!("the database has the encoding {encoding}");
        return refused(
            reason,
            "Make it by CREATE DATABASE ... ENCODING 'UTF8' TEMPLATE template0",
        );
    }
    if standby {
        return refused(
            "the server is a standby, which cannot be written".into(),
            "Give the address of the primary",
        );
    }
    if !schema {
        return refused(
            "no schema of the search path exists".into(),
            "Make the schema, or correct `search_path` in the options of the URL",
        );
    }
    if fsync == "off" {
        tracing::warn!(
            "the server runs with fsync = off: a power cut can destroy what was acknowledged"
        );
    }
    Ok(())
}

/// The server's own words where it has said something, else what happened.
fn said_by_server(error: &sqlx::Error) -> String {
    match error {
        sqlx::Error::Database(said) => said.message().to_owned(),
        sqlx::Error::Configuration(reason) => reason.to_string(),
        error => error.to_string(),
    }
}

/// Whether a pooler refuses what will not change by waiting.
fn is_final(error: &sqlx::Error) -> bool {
    let said = said_by_server(error);
    let refused = |text: &&str| said.starts_with(*text);
    [
        "unsupported startup parameter",
        "no such database",
        "no such user",
    ]
    .iter()
    .chain(&AUTHENTICATION_CODES)
    .any(refused)
        || said.contains(STATEMENT_POOLING)
}

/// Part of what PgBouncer says where each statement gets a session of its own.
const STATEMENT_POOLING: &str = "pooling mode";
/// Beginnings of what PgBouncer says of a user or a password that it does not accept, under a code of its own.
const AUTHENTICATION_CODES: [&str; 4] = [
    "password authentication failed",
    "SASL authentication failed",
    "client password check failed",
    "login rejected",
];

/// Why a connection or a statement fails at the start: the server is away, or refuses it, and what to do.
fn refusal(url: &PostgresUrl, error: &sqlx::Error) -> PostgresError {
    let said = said_by_server(error);
    if faults::connection_was_lost(error) && !is_final(error) {
        return PostgresError::Unreachable {
            url: url.clone(),
            waited: Duration::ZERO,
            reason: said,
        };
    }
    let fix = match error {
        // Statement mode refuses every transaction.
        _ if said.contains(STATEMENT_POOLING) => USE_SESSIONS,
        _ if AUTHENTICATION_CODES
            .iter()
            .any(|text| said.starts_with(text)) =>
        {
            WRONG_PASSWORD
        }
        error if is_final(error) => {
            "A pooler says so: name database and user in its configuration, and leave parameters that it does not \
             know out of the URL or list them in `ignore_startup_parameters`"
        }
        sqlx::Error::Configuration(_) => USE_SESSIONS,
        error => match faults::sqlstate(error).as_deref() {
            Some("28P01" | "28000") => WRONG_PASSWORD,
            Some("3D000") => "Make the database first: CREATE DATABASE name OWNER user",
            Some("42501" | "3F000") => {
                "Give the user the right to make tables: GRANT CREATE ON SCHEMA public TO user"
            }
            // A prepared statement that another connection has made, or that is gone.
            Some("26000" | "42P05") => USE_SESSIONS,
            _ => "Correct the setting `database`",
        },
    };
    PostgresError::Refused {
        url: url.clone(),
        reason: said,
        fix,
    }
}

fn migration_failure(url: &PostgresUrl, error: MigrateError) -> PostgresError {
    match error {
        MigrateError::VersionMissing(_) | MigrateError::VersionTooNew(..) => {
            PostgresError::Newer(url.clone())
        }
        MigrateError::Execute(error) | MigrateError::ExecuteMigration(error, _)
            if faults::connection_was_lost(&error)
                || faults::sqlstate(&error).as_deref() == Some("42501") =>
        {
            refusal(url, &error)
        }
        error => PostgresError::Tables {
            url: url.clone(),
            reason: error.to_string(),
        },
    }
}

/// Connections that write.
pub(super) struct PgWriter {
    shared: Shared<PgPool>,
}

impl PgWriter {
    /// What statements tell.
    pub fn health(&self) -> &Health {
        &self.shared.health
    }

    /// A connection for single statements.
    pub async fn acquire(&self) -> StoreResult<PoolConnection<Postgres>> {
        let pool = &self.shared.pool;
        let connection = pool.acquire().await;
        connection.map_err(|error| faults::of_pool(pool, error))
    }

    /// Starts a transaction that holds the lock for writing.
    pub async fn begin(&self) -> StoreResult<PgTransaction> {
        let turn = self.shared.turn().await?;
        let mut transaction = PgTransaction {
            connection: self.acquire().await?,
            health: self.shared.health.clone(),
            ended: false,
            _turn: turn,
        };
        sqlx::raw_sql(BEGIN_WRITING)
            .execute(&mut *transaction)
            .await
            .map_err(|error| self.shared.health.noted(faults::of_postgres(error)))?;
        Ok(transaction)
    }

    /// Checks that the server answers and can be written.
    pub async fn check(&self) -> StoreResult<()> {
        let mut connection = self.acquire().await?;
        let row = sqlx::query(
            "SELECT pg_is_in_recovery() OR current_setting('transaction_read_only') = 'on'",
        )
        .fetch_one(&mut *connection)
        .await
        .map_err(faults::of_postgres)?;
        if row.get(0) {
            Err(StoreError::Database {
                cause: StoreFault::Away,
                message: "the server cannot be written".into(),
            })
        } else {
            Ok(())
        }
    }
}

/// A transaction. Dropping it without [`PgTransaction::commit`] closes its connection, which rolls it
/// back.
pub(super) struct PgTransaction {
    connection: PoolConnection<Postgres>,
    /// What its statements tell.
    health: Arc<Health>,
    ended: bool,
    _turn: Place,
}

impl PgTransaction {
    /// Makes the changes durable.
    ///
    /// # Errors
    /// If they may not be.
    pub async fn commit(mut self) -> StoreResult<()> {
        // The first statement fails if an earlier one did.
        sqlx::raw_sql("SELECT; COMMIT")
            .execute(&mut *self.connection)
            .await
            .map_err(|error| self.health.noted(faults::of_postgres(error)))?;
        self.ended = true;
        Ok(())
    }
}

impl PgTransaction {
    /// Where its statements run, and who notes what they tell.
    pub fn parts(&mut self) -> (&mut PgConnection, &Health) {
        (&mut self.connection, &self.health)
    }
}

impl Drop for PgTransaction {
    fn drop(&mut self) {
        if !self.ended {
            self.connection.close_on_drop();
        }
    }
}

impl Deref for PgTransaction {
    type Target = PgConnection;

    fn deref(&self) -> &PgConnection {
        &self.connection
    }
}

impl DerefMut for PgTransaction {
    fn deref_mut(&mut self) -> &mut PgConnection {
        &mut self.connection
    }
}
