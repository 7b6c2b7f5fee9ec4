-- Times are milliseconds since 1970 (UTC); JSON is kept as text.

CREATE TABLE volumes (
    sequence   INTEGER PRIMARY KEY AUTOINCREMENT,
    id         TEXT NOT NULL UNIQUE,
    created_at INTEGER NOT NULL,
    bytes      INTEGER NOT NULL,
    files      TEXT NOT NULL,
    facts      TEXT NOT NULL
) STRICT;

CREATE TABLE models (
    sequence   INTEGER PRIMARY KEY AUTOINCREMENT,
    id         TEXT NOT NULL UNIQUE,
    created_at INTEGER NOT NULL,
    volume     TEXT NOT NULL,
    parameters TEXT NOT NULL,
    summary    TEXT NOT NULL,
    software   TEXT NOT NULL,
    files      TEXT NOT NULL
) STRICT;

CREATE TABLE jobs (
    sequence          INTEGER PRIMARY KEY AUTOINCREMENT,
    id                TEXT NOT NULL UNIQUE,
    kind              TEXT NOT NULL,
    volume            TEXT NOT NULL,
    parameters        TEXT NOT NULL,
    state             TEXT NOT NULL DEFAULT 'queued'
                      CHECK (state IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')),
    stage             TEXT,
    progress          REAL NOT NULL DEFAULT 0,
    attempts          INTEGER NOT NULL DEFAULT 0,
    revision          INTEGER NOT NULL DEFAULT 1,
    cancel_requested  INTEGER NOT NULL DEFAULT 0,
    lease_token       TEXT,
    lease_expires_at  INTEGER,
    created_at        INTEGER NOT NULL,
    started_at        INTEGER,
    finished_at       INTEGER,
    failure           TEXT,
    result            TEXT,
    idempotency_key   TEXT UNIQUE,
    fingerprint       TEXT
) STRICT;

CREATE INDEX jobs_by_state ON jobs (state, sequence);
CREATE INDEX jobs_by_volume ON jobs (volume, state);

-- What once was here: answered with 410 instead of 404.
CREATE TABLE tombstones (
    id        TEXT PRIMARY KEY,
    erased_at INTEGER NOT NULL
) STRICT;
