-- Models, segmentations and templates differ by kind only; templates have no volume.

CREATE TABLE products (
    sequence   INTEGER PRIMARY KEY AUTOINCREMENT,
    id         TEXT NOT NULL UNIQUE,
    kind       TEXT NOT NULL CHECK (kind IN ('model', 'segmentation', 'template')),
    created_at INTEGER NOT NULL,
    volume     TEXT,
    parameters TEXT NOT NULL,
    summary    TEXT NOT NULL,
    software   TEXT NOT NULL,
    files      TEXT NOT NULL
) STRICT;

INSERT INTO products (sequence, id, kind, created_at, volume, parameters, summary, software, files)
SELECT sequence, id, 'model', created_at, volume, parameters, summary, software, files FROM models;

DROP TABLE models;

CREATE INDEX products_by_kind ON products (kind, sequence);

-- What a job needs besides its volume: field of its parameters to id.
ALTER TABLE jobs ADD COLUMN needs TEXT NOT NULL DEFAULT '{}';
