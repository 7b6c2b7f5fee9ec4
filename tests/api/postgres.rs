//! A PostgreSQL server of Debian's package, started for the tests on a free port in a temporary folder.
//!
//! The server ends with the tests, however they end: a shell waits for the end of its standard input and
//! then stops the server. PostgreSQL refuses to run as root, so root starts it as the user `postgres`.

use sqlx::{Connection, Executor, PgConnection};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, OnceLock};
use std::time::Duration;
use ventriform_service::config::DatabaseUrl;
use ventriform_service::config::{PostgresSettings, PostgresUrl};

/// Where Debian puts the programs of each version.
const DEBIAN_FOLDER: &str = "/usr/lib/postgresql";

/// Runs the server $1/postgres on the folder $2 and port $3 until standard input ends; `crash` stops it as
/// a power cut would.
const WATCH_SCRIPT: &str = r#"
trap : TERM INT HUP
"$1/postgres" -D "$2" -p "$3" -k "$2" >>"$2/log" 2>&1 </dev/null &
server=$!
read -r word
case "$word" in crash) kill -QUIT $server ;; *) kill -INT $server ;; esac
wait $server
"#;

/// A server of its own.
pub struct Server {
    programs: PathBuf,
    folder: PathBuf,
    port: u16,
    watch: Mutex<Option<Child>>,
}

/// The server that the tests of this process share.
pub fn server() -> &'static Server {
    static SHARED_SERVER: OnceLock<Server> = OnceLock::new();
    SHARED_SERVER.get_or_init(Server::new)
}

/// The folder with initdb and postgres.
fn programs() -> PathBuf {
    let versions = std::fs::read_dir(DEBIAN_FOLDER)
        .into_iter()
        .flatten()
        .flatten();
    let mut found: Vec<PathBuf> = versions
        .map(|version| version.path().join("bin"))
        .filter(|folder| folder.join("initdb").exists())
        .collect();
    found.sort();
    found.pop().expect(
        "PostgreSQL is needed for these tests and was not found: install Debian's `postgresql` \
         (scripts/test.sh does so)",
    )
}

/// A command that runs a script as a user that PostgreSQL accepts.
fn shell() -> Command {
    let root = std::fs::metadata("/proc/self").is_ok_and(|own| {
        use std::os::unix::fs::MetadataExt;
        own.uid() == 0
    });
    let mut command = if root {
        Command::new("setpriv")
    } else {
        Command::new("sh")
    };
    if root {
        command.args([
            "--reuid=postgres",
            "--regid=postgres",
            "--init-groups",
            "sh",
        ]);
    }
    command
}

impl Server {
    /// Makes and starts a server.
    pub fn new() -> Self {
        let programs = programs();
        // Not below the target folder, which another user may be kept from.
        let script = r#"folder=$(mktemp -d /tmp/ventriform-postgres.XXXXXX) && "$1/initdb" -D "$folder" -U tests \
            -A trust -E UTF8 --locale=C -N >/dev/null && echo "$folder""#;
        let made = shell().args(["-c", script, "sh"]).arg(&programs).output();
        let made = made.unwrap();
        let folder = String::from_utf8(made.stdout).unwrap().trim().to_owned();
        assert!(
            made.status.success() && !folder.is_empty(),
            "initdb: {}",
            String::from_utf8_lossy(&made.stderr)
        );
        let settings = "fsync = off\nlisten_addresses = '127.0.0.1'\nmax_connections = 300\n";
        let file = Path::new(&folder).join("postgresql.conf");
        let text = std::fs::read_to_string(&file).unwrap() + settings;
        std::fs::write(file, text).unwrap();
        let server = Self {
            programs,
            folder: folder.into(),
            port: crate::helpers::quiet_port(),
            watch: Mutex::default(),
        };
        server.start();
        server
    }

    /// Starts it, unless it runs.
    pub fn start(&self) {
        let mut watch = self.watch.lock().unwrap();
        if watch.is_some() {
            return;
        }
        // The folder is deleted when the tests end; Drop does not run for the shared server.
        let script = format!("{WATCH_SCRIPT}[ \"$word\" ] || rm -rf \"$2\"");
        let child = shell()
            .args(["-c", &script, "sh"])
            .arg(&self.programs)
            .arg(&self.folder)
            .arg(self.port.to_string())
            .stdin(Stdio::piped())
            .spawn()
            .unwrap();
        *watch = Some(child);
        for _ in 0..2400 {
            let answers = Command::new(self.programs.join("pg_isready"))
                .args(["-q", "-h", "127.0.0.1", "-p", &self.port.to_string()])
                .status();
            if answers.unwrap().success() {
                return;
            }
            std::thread::sleep(Duration::from_millis(25));
        }
        let log = std::fs::read_to_string(self.folder.join("log")).unwrap_or_default();
        panic!("PostgreSQL did not start: {log}");
    }

    /// Stops it: `crash` as a power cut would, `stop` in order.
    pub fn end(&self, word: &str) {
        if let Some(mut child) = self.watch.lock().unwrap().take() {
            writeln!(child.stdin.take().unwrap(), "{word}").unwrap();
            child.wait().unwrap();
        }
    }

    /// The URL of a database.
    pub fn url(&self, name: &str) -> String {
        format!("postgres://tests@127.0.0.1:{}/{name}", self.port)
    }

    /// Makes an empty database, and returns its URL.
    pub async fn database(&self) -> String {
        let name = ventriform_service::base::records::random_id("t_");
        self.run("postgres", &format!("CREATE DATABASE {name}"))
            .await;
        self.url(&name)
    }

    /// One of the programs of PostgreSQL, such as `pg_dump`.
    pub fn program(&self, name: &str) -> Command {
        Command::new(self.programs.join(name))
    }

    /// Runs statements in a database.
    pub async fn run(&self, database: &str, statements: &str) {
        let mut connection = PgConnection::connect(&self.url(database)).await.unwrap();
        let statements = sqlx::raw_sql(sqlx::AssertSqlSafe(statements));
        connection.execute(statements).await.unwrap();
        connection.close().await.unwrap();
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // Without a word, the shell deletes the folder.
        if let Some(mut child) = self.watch.lock().unwrap().take() {
            drop(child.stdin.take());
            let _ = child.wait();
        }
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// The setting for the database of a data folder, which is made when the folder is used first.
pub async fn database_of(folder: &Path) -> DatabaseUrl {
    let name = format!("of_{}", folder.file_name().unwrap().to_str().unwrap());
    let name: String = name.to_lowercase().replace(['.', '-'], "_");
    let made = format!("CREATE DATABASE \"{name}\"");
    let url = server().url("postgres");
    let mut connection = PgConnection::connect(&url).await.unwrap();
    // It is there already if the folder was used before.
    let _ = connection
        .execute(sqlx::raw_sql(sqlx::AssertSqlSafe(made)))
        .await;
    server().url(&name).parse().unwrap()
}

/// The address of a database.
pub fn reached(url: &str) -> PostgresSettings {
    reached_at(url.parse().unwrap())
}

/// The same.
pub fn reached_at(url: PostgresUrl) -> PostgresSettings {
    PostgresSettings {
        url,
        connections: 8,
        patience: Duration::from_secs(10),
    }
}
