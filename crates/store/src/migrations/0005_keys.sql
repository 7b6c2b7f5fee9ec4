-- API keys: the SHA-256 of each secret, never the secret. Rows are never deleted: a service that had a
-- key once never admits anonymous callers again.

CREATE TABLE api_keys (
    sequence   INTEGER PRIMARY KEY AUTOINCREMENT,
    id         TEXT NOT NULL UNIQUE,
    name       TEXT NOT NULL,
    tenant     TEXT NOT NULL,
    scope      TEXT NOT NULL CHECK (scope IN ('read', 'submit', 'admin')),
    requests   INTEGER,
    bytes      INTEGER,
    jobs       INTEGER,
    created_at INTEGER NOT NULL,
    expires_at INTEGER,
    revoked_at INTEGER,
    digest     BLOB NOT NULL
) STRICT;
