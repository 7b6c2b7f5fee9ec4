-- The last time, by the clock of this server, at which a process trusted it; see SQLite's migration of the same name.
CREATE TABLE trusted_time (
    id BIGINT PRIMARY KEY CHECK (id = 1),
    at BIGINT NOT NULL
);
