-- What the store must not forget with one of its other tables; see SQLite's migration 100.
CREATE TABLE store_marks (
    name  TEXT COLLATE "C" PRIMARY KEY,
    value TEXT NOT NULL
);
