-- Content is stored once; a holding says that a tenant has it. An item without a holding is erased.

CREATE TABLE holdings (
    sequence    INTEGER PRIMARY KEY AUTOINCREMENT,
    tenant      TEXT NOT NULL,
    id          TEXT NOT NULL,
    kind        TEXT NOT NULL CHECK (kind IN ('volume', 'model', 'segmentation', 'template')),
    created_at  INTEGER NOT NULL,
    -- The last upload or computation that gave the same content; retention counts from here.
    renewed_at  INTEGER NOT NULL,
    external_id TEXT,
    labels      TEXT NOT NULL DEFAULT '{}',
    -- A legal hold: why, since when and by whom. Set together or not at all.
    hold_reason TEXT,
    held_at     INTEGER,
    held_by     TEXT,
    UNIQUE (tenant, id)
) STRICT;

CREATE INDEX holdings_by_kind ON holdings (tenant, kind, sequence);
CREATE INDEX holdings_by_item ON holdings (id);
CREATE INDEX holdings_by_age ON holdings (kind, renewed_at);
CREATE INDEX holdings_by_external_id ON holdings (tenant, external_id, kind, sequence)
    WHERE external_id IS NOT NULL;

INSERT INTO holdings (tenant, id, kind, created_at, renewed_at)
SELECT 'default', id, kind, created_at, created_at FROM (
    SELECT id, 'volume' AS kind, created_at, sequence FROM volumes
    UNION ALL SELECT id, kind, created_at, sequence FROM products)
ORDER BY created_at, sequence;

-- The volumes that went into an item: what was computed from a volume, or measured against it.
CREATE TABLE sources (
    tenant TEXT NOT NULL,
    id     TEXT NOT NULL,
    volume TEXT NOT NULL,
    PRIMARY KEY (tenant, id, volume),
    FOREIGN KEY (tenant, id) REFERENCES holdings (tenant, id) ON DELETE CASCADE
) STRICT, WITHOUT ROWID;

CREATE INDEX sources_by_volume ON sources (tenant, volume);

INSERT INTO sources (tenant, id, volume)
SELECT 'default', id, volume FROM products WHERE volume IS NOT NULL
UNION SELECT 'default', id, json_extract(parameters, '$.expert') FROM products
WHERE json_extract(parameters, '$.expert') LIKE 'vol\_%' ESCAPE '\';

ALTER TABLE jobs ADD COLUMN tenant TEXT NOT NULL DEFAULT 'default';
ALTER TABLE jobs ADD COLUMN external_id TEXT;
ALTER TABLE jobs ADD COLUMN labels TEXT NOT NULL DEFAULT '{}';

CREATE INDEX jobs_by_tenant ON jobs (tenant, sequence);
CREATE INDEX jobs_by_tenant_and_state ON jobs (tenant, state, sequence);
CREATE INDEX jobs_by_tenant_and_volume ON jobs (tenant, volume, sequence);
CREATE INDEX jobs_by_external_id ON jobs (tenant, external_id, sequence)
    WHERE external_id IS NOT NULL;

-- An idempotency key is its tenant's: TENANT/KEY. No tenant's name contains a slash.
UPDATE jobs SET idempotency_key = 'default/' || idempotency_key
WHERE idempotency_key IS NOT NULL;

-- The column `labels` by name and value, for searching; the triggers below keep it.
CREATE TABLE label_index (
    tenant   TEXT NOT NULL,
    kind     TEXT NOT NULL,
    name     TEXT NOT NULL,
    value    TEXT NOT NULL,
    sequence INTEGER NOT NULL,
    PRIMARY KEY (tenant, kind, name, value, sequence)
) STRICT, WITHOUT ROWID;

CREATE TRIGGER holding_labels_added AFTER INSERT ON holdings WHEN NEW.labels != '{}' BEGIN
    INSERT INTO label_index (tenant, kind, name, value, sequence)
    SELECT NEW.tenant, NEW.kind, key, value, NEW.sequence FROM json_each(NEW.labels);
END;
CREATE TRIGGER holding_labels_changed AFTER UPDATE OF labels ON holdings BEGIN
    DELETE FROM label_index WHERE (tenant, kind, name, value, sequence) IN
        (SELECT OLD.tenant, OLD.kind, key, value, OLD.sequence FROM json_each(OLD.labels));
    INSERT INTO label_index (tenant, kind, name, value, sequence)
    SELECT NEW.tenant, NEW.kind, key, value, NEW.sequence FROM json_each(NEW.labels);
END;
CREATE TRIGGER holding_labels_removed AFTER DELETE ON holdings WHEN OLD.labels != '{}' BEGIN
    DELETE FROM label_index WHERE (tenant, kind, name, value, sequence) IN
        (SELECT OLD.tenant, OLD.kind, key, value, OLD.sequence FROM json_each(OLD.labels));
END;
CREATE TRIGGER job_labels_added AFTER INSERT ON jobs WHEN NEW.labels != '{}' BEGIN
    INSERT INTO label_index (tenant, kind, name, value, sequence)
    SELECT NEW.tenant, 'job', key, value, NEW.sequence FROM json_each(NEW.labels);
END;
CREATE TRIGGER job_labels_changed AFTER UPDATE OF labels ON jobs BEGIN
    DELETE FROM label_index WHERE (tenant, kind, name, value, sequence) IN
        (SELECT OLD.tenant, 'job', key, value, OLD.sequence FROM json_each(OLD.labels));
    INSERT INTO label_index (tenant, kind, name, value, sequence)
    SELECT NEW.tenant, 'job', key, value, NEW.sequence FROM json_each(NEW.labels);
END;
CREATE TRIGGER job_labels_removed AFTER DELETE ON jobs WHEN OLD.labels != '{}' BEGIN
    DELETE FROM label_index WHERE (tenant, kind, name, value, sequence) IN
        (SELECT OLD.tenant, 'job', key, value, OLD.sequence FROM json_each(OLD.labels));
END;

-- What once was here is a tenant's own knowledge: answered with 410 to it, with 404 to others.
CREATE TABLE erased (
    tenant    TEXT NOT NULL,
    id        TEXT NOT NULL,
    erased_at INTEGER NOT NULL,
    PRIMARY KEY (tenant, id)
) STRICT, WITHOUT ROWID;

INSERT INTO erased (tenant, id, erased_at) SELECT 'default', id, erased_at FROM tombstones;
DROP TABLE tombstones;

-- Receipts of erasures.
CREATE TABLE erasures (
    sequence  INTEGER PRIMARY KEY AUTOINCREMENT,
    id        TEXT NOT NULL UNIQUE,
    tenant    TEXT NOT NULL,
    item      TEXT NOT NULL,
    erased_at INTEGER NOT NULL,
    erased_by TEXT NOT NULL,
    receipt   TEXT NOT NULL
) STRICT;

CREATE INDEX erasures_by_item ON erasures (tenant, item, sequence);
CREATE INDEX erasures_by_tenant ON erasures (tenant, sequence);
