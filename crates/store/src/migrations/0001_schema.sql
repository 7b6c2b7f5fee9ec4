-- The tables on SQLite. Those on PostgreSQL stand in ../migrations_postgres/0001_schema.sql, in the same order and with
-- the same columns, which tests/api/contract.rs compares.
--
-- A landed file is never changed: a later version adds a file with the next number, and the same on PostgreSQL.
--
-- Times are milliseconds since 1970 (UTC). JSON is kept as text. `sequence` is the order of arrival, in which lists are
-- read. Every filter of a list has an index that begins with the tenant and ends with that order, so that no page reads
-- more rows than one of its filters lets through (store/tables/pages.rs).

-- ---------------------------------------------------------------------------------------------- items

-- The content of an upload, stored once however many tenants have it.
CREATE TABLE volumes (
    sequence   INTEGER PRIMARY KEY AUTOINCREMENT,
    -- Derived from the content.
    id         TEXT NOT NULL UNIQUE,
    created_at INTEGER NOT NULL,
    bytes      INTEGER NOT NULL,
    -- [{"name", "bytes", "sha256", "place"}]
    files      TEXT NOT NULL,
    -- What was read from the content when it was uploaded.
    facts      TEXT NOT NULL
) STRICT;

-- What jobs made, and templates and readers, which have no volume.
CREATE TABLE products (
    sequence   INTEGER PRIMARY KEY AUTOINCREMENT,
    id         TEXT NOT NULL UNIQUE,
    kind       TEXT NOT NULL CHECK (kind IN
               ('model', 'segmentation', 'template', 'reader', 'beat', 'comparison', 'normals')),
    created_at INTEGER NOT NULL,
    volume     TEXT,
    parameters TEXT NOT NULL,
    -- The main figures.
    summary    TEXT NOT NULL,
    -- The program that made it.
    software   TEXT NOT NULL,
    files      TEXT NOT NULL,
    -- Of all files. A column, so that adding up what a tenant stores reads no document.
    bytes      INTEGER NOT NULL DEFAULT 0
) STRICT;

CREATE INDEX products_by_kind ON products (kind, sequence);

CREATE TRIGGER product_sized AFTER INSERT ON products BEGIN
    UPDATE products SET bytes =
        (SELECT coalesce(sum(json_extract(file.value, '$.bytes')), 0) FROM json_each(NEW.files) AS file)
    WHERE id = NEW.id;
END;
CREATE TRIGGER product_resized AFTER UPDATE OF files ON products BEGIN
    UPDATE products SET bytes =
        (SELECT coalesce(sum(json_extract(file.value, '$.bytes')), 0) FROM json_each(NEW.files) AS file)
    WHERE id = NEW.id;
END;

-- A holding says that a tenant has an item. An item without a holding is erased.
CREATE TABLE holdings (
    sequence    INTEGER PRIMARY KEY AUTOINCREMENT,
    tenant      TEXT NOT NULL,
    id          TEXT NOT NULL,
    kind        TEXT NOT NULL CHECK (kind IN
                ('volume', 'model', 'segmentation', 'template', 'reader', 'beat', 'comparison', 'normals')),
    created_at  INTEGER NOT NULL,
    -- The last upload, use or computation that gave the same content: the age that retention counts.
    renewed_at  INTEGER NOT NULL,
    external_id TEXT,
    labels      TEXT NOT NULL DEFAULT '{}',
    -- Whether `model=auto` fits this template too, beside the built-in hearts.
    library     INTEGER NOT NULL DEFAULT 0,
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

-- The volumes that went into an item: what was computed from a volume, or measured against it.
CREATE TABLE sources (
    tenant TEXT NOT NULL,
    id     TEXT NOT NULL,
    volume TEXT NOT NULL,
    PRIMARY KEY (tenant, id, volume),
    FOREIGN KEY (tenant, id) REFERENCES holdings (tenant, id) ON DELETE CASCADE
) STRICT, WITHOUT ROWID;

CREATE INDEX sources_by_volume ON sources (tenant, volume);

-- What a tenant once had: answered with 410 to it, with 404 to others.
CREATE TABLE erased (
    tenant    TEXT NOT NULL,
    id        TEXT NOT NULL,
    erased_at INTEGER NOT NULL,
    PRIMARY KEY (tenant, id)
) STRICT, WITHOUT ROWID;

CREATE INDEX erased_by_id ON erased (id);

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

-- Whose scan a volume is, for its tenant alone: what the file says, and what the tenant states beside that, as JSON
-- objects. Both are NULL of a file that says nothing, and after an erasure. A volume lacks its row only if a repair
-- could not save it.
CREATE TABLE scans (
    tenant           TEXT NOT NULL,
    volume           TEXT NOT NULL,
    found            TEXT,
    stated           TEXT,
    erased_at        INTEGER,
    study_uid        TEXT GENERATED ALWAYS AS
        (coalesce(json_extract(found, '$.study_uid'), json_extract(stated, '$.study_uid'))) VIRTUAL,
    series_uid       TEXT GENERATED ALWAYS AS (json_extract(found, '$.series_uid')) VIRTUAL,
    accession_number TEXT GENERATED ALWAYS AS
        (coalesce(json_extract(found, '$.accession_number'),
                  json_extract(stated, '$.accession_number'))) VIRTUAL,
    PRIMARY KEY (tenant, volume),
    FOREIGN KEY (tenant, volume) REFERENCES holdings (tenant, id) ON DELETE CASCADE
) STRICT, WITHOUT ROWID;

CREATE INDEX scans_by_study ON scans (tenant, study_uid) WHERE study_uid IS NOT NULL;
CREATE INDEX scans_by_series ON scans (tenant, series_uid) WHERE series_uid IS NOT NULL;
CREATE INDEX scans_by_accession ON scans (tenant, accession_number)
    WHERE accession_number IS NOT NULL;

-- From these the UIDs of de-identified objects are derived: the same for the objects of one study.
CREATE TABLE deidentification_secrets (
    tenant TEXT PRIMARY KEY,
    secret BLOB NOT NULL
) STRICT, WITHOUT ROWID;

-- ----------------------------------------------------------------------------------------------- jobs

CREATE TABLE jobs (
    sequence         INTEGER PRIMARY KEY AUTOINCREMENT,
    id               TEXT NOT NULL UNIQUE,
    tenant           TEXT NOT NULL,
    kind             TEXT NOT NULL,
    -- '' until it has come from its source: no worker takes the job before.
    volume           TEXT NOT NULL,
    parameters       TEXT NOT NULL,
    -- What it needs besides its volume: field of its parameters to id.
    needs            TEXT NOT NULL DEFAULT '{}',
    external_id      TEXT,
    labels           TEXT NOT NULL DEFAULT '{}',
    -- TENANT/KEY. No tenant's name contains a slash.
    idempotency_key  TEXT UNIQUE,
    -- A hash of the order that the key stands for.
    fingerprint      TEXT,
    -- Where the volume comes from: {"archive" or "dicomweb", "study", "series"}.
    source           TEXT,
    -- What of the result is sent where: {"names": [...], "to"}.
    send             TEXT,
    -- The webhook of this job alone: {"url", "destination", "events", "secret"}.
    webhook          TEXT,
    -- The W3C trace context of the request that filed it.
    trace_parent     TEXT,
    -- What the tenant may store in all when the result is added; NULL is no bound.
    storage_limit    INTEGER,

    -- Jobs start by priority (0 urgent, 1 routine, 2 bulk), then by turn: each tenant has one job in each turn
    -- (store/tables/jobs.rs).
    priority         INTEGER NOT NULL DEFAULT 1,
    turn             INTEGER NOT NULL DEFAULT 0,
    state            TEXT NOT NULL DEFAULT 'queued'
                     CHECK (state IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')),
    stage            TEXT,
    progress         REAL NOT NULL DEFAULT 0,
    -- Grows with every change.
    revision         INTEGER NOT NULL DEFAULT 1,
    cancel_requested INTEGER NOT NULL DEFAULT 0,
    -- A worker's temporary claim, and the process that holds it.
    lease_token      TEXT,
    lease_run        TEXT,
    lease_expires_at INTEGER,
    -- How often the job began, how often the service died meanwhile, and how often the job's own process did.
    attempts         INTEGER NOT NULL DEFAULT 0,
    interruptions    INTEGER NOT NULL DEFAULT 0,
    crashes          INTEGER NOT NULL DEFAULT 0,
    created_at       INTEGER NOT NULL,
    started_at       INTEGER,
    finished_at      INTEGER,
    failure          TEXT,
    result           TEXT,

    -- What the record counts against its tenant's quota until it is erased: the texts that it was filed with, and 2 KiB
    -- for the other columns, the indexes, and what is told and sent of it. So it does not grow while the job runs.
    bytes            INTEGER GENERATED ALWAYS AS
        (2048 + length(CAST(parameters AS BLOB)) + length(CAST(needs AS BLOB)) + length(CAST(labels AS BLOB))
         + length(CAST(coalesce(external_id, '') AS BLOB)) + length(CAST(coalesce(webhook, '') AS BLOB))
         + length(CAST(coalesce(source, '') AS BLOB)) + length(CAST(coalesce(send, '') AS BLOB))) VIRTUAL
) STRICT;

CREATE INDEX jobs_by_state ON jobs (state, sequence);
CREATE INDEX jobs_by_volume ON jobs (volume, state);
CREATE INDEX jobs_by_tenant ON jobs (tenant, sequence);
CREATE INDEX jobs_by_tenant_and_state ON jobs (tenant, state, sequence);
CREATE INDEX jobs_by_tenant_and_volume ON jobs (tenant, volume, sequence);
CREATE INDEX jobs_by_external_id ON jobs (tenant, external_id, sequence)
    WHERE external_id IS NOT NULL;
-- Retention looks for old jobs by it.
CREATE INDEX jobs_by_end ON jobs (finished_at) WHERE finished_at IS NOT NULL;
-- With the state as its first column the planner prefers this index to `jobs_by_state` for a place in the queue, and
-- with the volume as its last it reads no row of the table.
CREATE INDEX jobs_ready ON jobs (state, priority, turn, sequence, volume) WHERE state = 'queued' AND volume != '';
CREATE INDEX jobs_in_turn ON jobs (tenant, priority, turn) WHERE state IN ('queued', 'running');
CREATE INDEX jobs_by_kind ON jobs (tenant, kind, sequence);
CREATE INDEX jobs_by_priority ON jobs (tenant, priority, sequence);
CREATE INDEX jobs_by_filing ON jobs (tenant, created_at, sequence);
-- An erasure looks for the tenant's jobs that need an item by it.
CREATE INDEX jobs_with_needs ON jobs (tenant, state) WHERE needs != '{}';
CREATE INDEX jobs_by_size ON jobs (tenant, bytes);

-- The column `labels` of holdings and jobs by name and value, for searching; the triggers keep it.
CREATE TABLE label_index (
    tenant   TEXT NOT NULL,
    -- 'job', or the kind of a holding.
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

-- ------------------------------------------------------------------------------------------- webhooks

-- Addresses that are told of every job of their tenant.
CREATE TABLE webhook_endpoints (
    sequence    INTEGER PRIMARY KEY AUTOINCREMENT,
    id          TEXT NOT NULL UNIQUE,
    tenant      TEXT NOT NULL,
    created_at  INTEGER NOT NULL,
    url         TEXT NOT NULL,
    -- Host and port.
    destination TEXT NOT NULL,
    events      TEXT NOT NULL,
    secret      TEXT NOT NULL,
    -- Since when it answers 410: it is not told any more.
    gone_at     INTEGER
) STRICT;

CREATE INDEX webhook_endpoints_by_tenant ON webhook_endpoints (tenant, sequence);

-- What signs deliveries that have no secret of their own.
CREATE TABLE webhook_secrets (
    tenant       TEXT PRIMARY KEY,
    secret       TEXT NOT NULL,
    -- The secret before, which signs too until then.
    former       TEXT,
    former_until INTEGER
) STRICT, WITHOUT ROWID;

CREATE TABLE deliveries (
    sequence        INTEGER PRIMARY KEY AUTOINCREMENT,
    id              TEXT NOT NULL UNIQUE,
    tenant          TEXT NOT NULL,
    job             TEXT NOT NULL,
    -- NULL for the webhook of one job.
    endpoint        TEXT,
    url             TEXT NOT NULL,
    destination     TEXT NOT NULL,
    secret          TEXT,
    event           TEXT NOT NULL,
    kind            TEXT NOT NULL,
    result          TEXT,
    cause           TEXT,
    run             INTEGER NOT NULL,
    occurred_at     INTEGER NOT NULL,
    state           TEXT NOT NULL DEFAULT 'pending' CHECK (state IN ('pending', 'delivered', 'dead')),
    attempts        INTEGER NOT NULL DEFAULT 0,
    -- From when the limit on its age counts.
    since           INTEGER NOT NULL,
    next_attempt_at INTEGER NOT NULL,
    last_attempt_at INTEGER,
    last_status     INTEGER,
    last_outcome    TEXT,
    ended_at        INTEGER
) STRICT;

CREATE INDEX deliveries_by_age ON deliveries (since) WHERE state = 'pending';
CREATE INDEX deliveries_by_end ON deliveries (ended_at) WHERE state != 'pending';
CREATE INDEX deliveries_by_job ON deliveries (job, sequence);
CREATE INDEX deliveries_dead ON deliveries (sequence) WHERE state = 'dead';
-- What is due is looked for by destination and tenant, one after the other (store/tables/errands.rs). No index begins
-- with the state, since the planner would prefer it.
CREATE INDEX deliveries_due ON deliveries (destination, tenant, next_attempt_at) WHERE state = 'pending';

-- Writes deliveries within the very transaction that changes the state of a job, whichever statement that is: no end of
-- a job is without its deliveries, and no delivery without its end.
CREATE TRIGGER job_told AFTER UPDATE OF state ON jobs
WHEN NEW.state != OLD.state AND NEW.state != 'queued' BEGIN
    INSERT INTO deliveries (id, tenant, job, endpoint, url, destination, secret, event, kind,
                            result, cause, run, occurred_at, since, next_attempt_at)
    SELECT 'msg_' || lower(hex(randomblob(16))), NEW.tenant, NEW.id, endpoint, url, destination,
           secret, event, NEW.kind, NEW.result, json_extract(NEW.failure, '$.code'), NEW.attempts,
           at, at, at
    FROM (SELECT NULL AS endpoint, json_extract(NEW.webhook, '$.url') AS url,
                 json_extract(NEW.webhook, '$.destination') AS destination,
                 json_extract(NEW.webhook, '$.secret') AS secret,
                 json_extract(NEW.webhook, '$.events') AS events
          WHERE NEW.webhook IS NOT NULL
          UNION ALL
          SELECT id, url, destination, NULL, events FROM webhook_endpoints
          WHERE tenant = NEW.tenant AND gone_at IS NULL),
         (SELECT CASE NEW.state WHEN 'running' THEN 'started' ELSE NEW.state END AS event,
                 coalesce(NEW.finished_at, NEW.started_at, NEW.created_at) AS at)
    WHERE event IN (SELECT value FROM json_each(events));
END;

-- ------------------------------------------------------------------------------------------- archives

-- The fetching of the series of a job, until the job is erased.
CREATE TABLE pulls (
    job             TEXT PRIMARY KEY,
    tenant          TEXT NOT NULL,
    -- The archive's name, or the URL that the job gave.
    destination     TEXT NOT NULL,
    state           TEXT NOT NULL DEFAULT 'pending' CHECK (state IN ('pending', 'done', 'dead')),
    attempts        INTEGER NOT NULL DEFAULT 0,
    -- From when the limit on its age counts.
    since           INTEGER NOT NULL,
    next_attempt_at INTEGER NOT NULL,
    last_attempt_at INTEGER,
    last_error      TEXT
) STRICT, WITHOUT ROWID;

CREATE INDEX pulls_due ON pulls (destination, tenant, next_attempt_at) WHERE state = 'pending';

CREATE TRIGGER job_to_pull AFTER INSERT ON jobs WHEN NEW.source IS NOT NULL BEGIN
    INSERT INTO pulls (job, tenant, destination, since, next_attempt_at)
    SELECT NEW.id, NEW.tenant,
           coalesce(json_extract(NEW.source, '$.archive'), json_extract(NEW.source, '$.dicomweb')),
           NEW.created_at, NEW.created_at;
END;

CREATE TRIGGER job_not_pulled AFTER UPDATE OF state ON jobs
WHEN NEW.source IS NOT NULL AND NEW.state NOT IN ('queued', 'running') BEGIN
    UPDATE pulls SET state = 'dead' WHERE job = NEW.id AND state = 'pending';
END;

-- The volume that a tenant's series was stored as, and a hash of the UIDs of its instances then.
CREATE TABLE pulled_series (
    tenant    TEXT NOT NULL,
    base      TEXT NOT NULL,
    study     TEXT NOT NULL,
    series    TEXT NOT NULL,
    instances TEXT NOT NULL,
    volume    TEXT NOT NULL,
    PRIMARY KEY (tenant, base, study, series)
) STRICT, WITHOUT ROWID;

CREATE INDEX pulled_series_by_volume ON pulled_series (volume);

-- The objects on their way to an archive.
CREATE TABLE sends (
    sequence        INTEGER PRIMARY KEY AUTOINCREMENT,
    id              TEXT NOT NULL UNIQUE,
    tenant          TEXT NOT NULL,
    job             TEXT NOT NULL,
    result          TEXT NOT NULL,
    -- mask.dcm ...
    name            TEXT NOT NULL,
    destination     TEXT NOT NULL,
    state           TEXT NOT NULL DEFAULT 'pending' CHECK (state IN ('pending', 'delivered', 'dead')),
    attempts        INTEGER NOT NULL DEFAULT 0,
    since           INTEGER NOT NULL,
    next_attempt_at INTEGER NOT NULL,
    last_attempt_at INTEGER,
    -- stored, present, rejected ...
    last_outcome    TEXT,
    last_error      TEXT,
    ended_at        INTEGER
) STRICT;

-- As those of deliveries.
CREATE INDEX sends_by_age ON sends (since) WHERE state = 'pending';
CREATE INDEX sends_by_job ON sends (job, sequence);
CREATE INDEX sends_by_result ON sends (result) WHERE state = 'pending';
CREATE INDEX sends_dead ON sends (sequence) WHERE state = 'dead';
CREATE INDEX sends_due ON sends (destination, tenant, next_attempt_at) WHERE state = 'pending';

-- Writes them within the very transaction in which the job succeeds: no success is without them, and none is without
-- its success.
CREATE TRIGGER job_to_send AFTER UPDATE OF state ON jobs
WHEN NEW.state = 'succeeded' AND OLD.state != 'succeeded' AND NEW.send IS NOT NULL BEGIN
    INSERT INTO sends (id, tenant, job, result, name, destination, since, next_attempt_at)
    SELECT 'snd_' || lower(hex(randomblob(16))), NEW.tenant, NEW.id, NEW.result, value,
           json_extract(NEW.send, '$.to'), NEW.finished_at, NEW.finished_at
    FROM json_each(NEW.send, '$.names') ORDER BY key;
END;

-- --------------------------------------------------------------------------------------------- intake

-- Objects that other systems send by C-STORE or STOW-RS, until they are volumes, and what was received before, so that
-- the same object is not stored twice. A group is what will be one volume: a series of single slices, one instance that
-- is a volume of its own, or objects of one gate each.
CREATE TABLE intake_groups (
    sequence          INTEGER PRIMARY KEY AUTOINCREMENT,
    id                TEXT NOT NULL UNIQUE,
    tenant            TEXT NOT NULL,
    study             TEXT NOT NULL,
    series            TEXT NOT NULL,
    -- The instance that is a volume of its own; empty for a series.
    instance          TEXT NOT NULL,
    -- Objects of one gate each may be a series for each gate: what these have in common tells their group.
    gates             TEXT,
    modality          TEXT,
    image_type        TEXT NOT NULL,
    study_description TEXT,
    -- The last one who sent an object of it.
    protocol          TEXT NOT NULL CHECK (protocol IN ('c-store', 'stow-rs')),
    sender            TEXT NOT NULL,
    address           TEXT,
    -- gathering: objects arrive or wait to be read; filing: the volume is stored and its job is to be filed; stored;
    -- failed: it cannot be read.
    state             TEXT NOT NULL CHECK (state IN ('gathering', 'filing', 'stored', 'failed')),
    -- Grows with every object.
    revision          INTEGER NOT NULL,
    volume            TEXT,
    job               TEXT,
    failure           TEXT,
    created_at        INTEGER NOT NULL,
    changed_at        INTEGER NOT NULL,
    UNIQUE (tenant, study, series, instance)
) STRICT;

CREATE INDEX intake_groups_by_state ON intake_groups (state, changed_at);
CREATE INDEX intake_groups_by_tenant ON intake_groups (tenant, sequence);
CREATE INDEX intake_groups_by_volume ON intake_groups (tenant, volume) WHERE volume IS NOT NULL;
CREATE INDEX intake_groups_by_tenant_and_state ON intake_groups (tenant, state, sequence);
CREATE UNIQUE INDEX intake_groups_of_gates ON intake_groups (tenant, study, gates);

CREATE TABLE intake_objects (
    tenant       TEXT NOT NULL,
    sop_instance TEXT NOT NULL,
    group_id     TEXT NOT NULL REFERENCES intake_groups (id) ON DELETE CASCADE,
    -- The series of an object of one gate, whose group may have the name of another.
    series       TEXT,
    -- SHA-256 of the data set, and of the whole file.
    data_sha256  TEXT NOT NULL,
    file_sha256  TEXT NOT NULL,
    -- Its name in the folder of received files; NULL once it is part of the group's volume.
    file         TEXT,
    bytes        INTEGER NOT NULL,
    received_at  INTEGER NOT NULL,
    PRIMARY KEY (tenant, sop_instance)
) STRICT, WITHOUT ROWID;

CREATE INDEX intake_objects_by_group ON intake_objects (group_id);
CREATE INDEX intake_objects_waiting ON intake_objects (tenant, bytes) WHERE file IS NOT NULL;
CREATE INDEX intake_objects_by_file ON intake_objects (file) WHERE file IS NOT NULL;
CREATE INDEX intake_objects_by_series ON intake_objects (tenant, series) WHERE series IS NOT NULL;

-- ----------------------------------------------------------------------------------------- work items

-- Unified Procedure Steps of DICOM.
CREATE TABLE workitems (
    sequence        INTEGER PRIMARY KEY AUTOINCREMENT,
    tenant          TEXT NOT NULL,
    uid             TEXT NOT NULL,
    state           TEXT NOT NULL CHECK (state IN ('SCHEDULED', 'IN PROGRESS', 'COMPLETED', 'CANCELED')),
    -- Under which a performer has claimed it; not among the attributes.
    transaction_uid TEXT,
    -- The job that does the work of an item that the service performs itself, '' until it is filed.
    performer       TEXT,
    -- DICOM JSON.
    attributes      TEXT NOT NULL,
    changed_at      INTEGER NOT NULL,
    revision        INTEGER NOT NULL DEFAULT 0,
    -- Counts against the tenant's quota.
    bytes           INTEGER GENERATED ALWAYS AS (length(CAST(attributes AS BLOB))) VIRTUAL,
    UNIQUE (tenant, uid)
) STRICT;

CREATE INDEX workitems_by_end ON workitems (changed_at) WHERE state IN ('COMPLETED', 'CANCELED');
CREATE INDEX workitems_scheduled ON workitems (sequence) WHERE state = 'SCHEDULED';
CREATE INDEX workitems_performed ON workitems (sequence)
    WHERE state = 'IN PROGRESS' AND performer IS NOT NULL;
-- Pages of items are bounded in bytes, which are read from these two alone.
CREATE INDEX workitems_by_size ON workitems (tenant, sequence, bytes);
CREATE INDEX workitems_by_state ON workitems (tenant, state, sequence, bytes);

-- --------------------------------------------------------------------------------------------- access

-- API keys: the SHA-256 of each secret, never the secret. Rows are never deleted: a service that had a key once never
-- admits anonymous callers again.
CREATE TABLE api_keys (
    sequence   INTEGER PRIMARY KEY AUTOINCREMENT,
    id         TEXT NOT NULL UNIQUE,
    name       TEXT NOT NULL,
    tenant     TEXT NOT NULL,
    scope      TEXT NOT NULL CHECK (scope IN ('read', 'submit', 'admin')),
    -- The tenant's quota; NULL is the default.
    requests   INTEGER,
    bytes      INTEGER,
    jobs       INTEGER,
    created_at INTEGER NOT NULL,
    expires_at INTEGER,
    revoked_at INTEGER,
    digest     BLOB NOT NULL,
    -- The key that made this one over HTTP, '' if its maker had none; NULL if the operator made it.
    maker      TEXT,
    -- The subject of the OpenID Connect issuer whose key it is: who made it with a token, or with a key of that
    -- subject.
    owner      TEXT
) STRICT;

CREATE INDEX api_keys_by_tenant ON api_keys (tenant, sequence);

-- The audit trail. `hash` is SHA-256 of the hash before it, the sequence and the event's text.
CREATE TABLE audit (
    sequence INTEGER PRIMARY KEY AUTOINCREMENT,
    event    TEXT NOT NULL,
    hash     TEXT NOT NULL,
    recorded INTEGER GENERATED ALWAYS AS (json_extract(event, '$.recorded')) VIRTUAL,
    tenant   TEXT GENERATED ALWAYS AS (json_extract(event, '$.tenant')) VIRTUAL,
    agent    TEXT GENERATED ALWAYS AS (json_extract(event, '$.agent')) VIRTUAL,
    object   TEXT GENERATED ALWAYS AS (json_extract(event, '$.object')) VIRTUAL
) STRICT;

CREATE INDEX audit_by_tenant ON audit (tenant, sequence);
CREATE INDEX audit_by_time ON audit (recorded);
CREATE INDEX audit_by_object ON audit (tenant, object, sequence);
CREATE INDEX audit_by_agent ON audit (tenant, agent, sequence);
CREATE INDEX audit_by_tenant_and_time ON audit (tenant, recorded, sequence);

-- The last row of each removal of old rows.
CREATE TABLE audit_anchors (
    sequence  INTEGER PRIMARY KEY,
    hash      TEXT NOT NULL,
    pruned_at INTEGER NOT NULL
) STRICT;

CREATE TRIGGER audit_is_never_changed BEFORE UPDATE ON audit
BEGIN SELECT RAISE(ABORT, 'the audit trail is append-only'); END;

CREATE TRIGGER audit_is_removed_up_to_an_anchor BEFORE DELETE ON audit
WHEN OLD.sequence > coalesce((SELECT max(sequence) FROM audit_anchors), 0)
BEGIN SELECT RAISE(ABORT, 'the audit trail is append-only'); END;

CREATE TRIGGER audit_anchors_name_rows BEFORE INSERT ON audit_anchors
WHEN NOT EXISTS (SELECT 1 FROM audit WHERE sequence = NEW.sequence AND hash = NEW.hash)
BEGIN SELECT RAISE(ABORT, 'an anchor names a row of the audit trail'); END;

CREATE TRIGGER audit_anchors_are_never_changed BEFORE UPDATE ON audit_anchors
BEGIN SELECT RAISE(ABORT, 'the audit trail is append-only'); END;

CREATE TRIGGER audit_anchors_are_never_removed BEFORE DELETE ON audit_anchors
BEGIN SELECT RAISE(ABORT, 'the audit trail is append-only'); END;

-- ------------------------------------------------------------------------------------------ the store

-- One row, written to find out whether the database can be written again after a write failed.
CREATE TABLE probe (
    id    INTEGER PRIMARY KEY CHECK (id = 1),
    count INTEGER NOT NULL
) STRICT;

INSERT INTO probe VALUES (1, 0);

-- What the store must not forget with one of its other tables, by name:
--   store      identity of this database, which the note beside it repeats
--   access     'open': callers without credentials were never refused; 'closed'; 'opened TIME': by the operator, on
--              purpose
--   kept_head  'SEQUENCE:HASH' of an audit row that another place names and the trail lacked
CREATE TABLE store_marks (
    name  TEXT PRIMARY KEY,
    value TEXT NOT NULL
) STRICT, WITHOUT ROWID;

-- The last time at which a run of the service trusted its clock: a start at quite another time is in doubt, and nothing
-- is erased by age then.
CREATE TABLE trusted_time (
    id INTEGER PRIMARY KEY CHECK (id = 1),
    at INTEGER NOT NULL
) STRICT;

-- ------------------------------------------------------------------------------------------- erasures

-- What was told, fetched or sent of an erased job is erased with it; what is still to be told or sent is kept.
CREATE TRIGGER job_forgotten AFTER DELETE ON jobs BEGIN
    DELETE FROM deliveries WHERE job = OLD.id AND state != 'pending';
    DELETE FROM pulls WHERE job = OLD.id;
    DELETE FROM sends WHERE job = OLD.id AND state != 'pending';
END;

-- What a tenant has erased is not sent any more, and a series is fetched anew.
CREATE TRIGGER holding_forgotten AFTER DELETE ON holdings BEGIN
    UPDATE sends SET state = 'dead', ended_at = CAST(unixepoch('subsec') * 1000 AS INTEGER),
           last_outcome = 'erased', last_error = 'The result was erased before it was sent.'
    WHERE result = OLD.id AND tenant = OLD.tenant AND state = 'pending';
    DELETE FROM pulled_series WHERE volume = OLD.id AND tenant = OLD.tenant;
END;

-- With a volume goes what is known of its objects, and its UIDs in the jobs that fetched it.
CREATE TRIGGER volume_forgotten AFTER DELETE ON holdings WHEN OLD.kind = 'volume' BEGIN
    DELETE FROM intake_objects WHERE file IS NULL AND group_id IN
        (SELECT id FROM intake_groups WHERE tenant = OLD.tenant AND volume = OLD.id);
    DELETE FROM intake_groups WHERE tenant = OLD.tenant AND volume = OLD.id
        AND NOT EXISTS (SELECT 1 FROM intake_objects WHERE group_id = intake_groups.id);
    UPDATE intake_groups SET volume = NULL WHERE tenant = OLD.tenant AND volume = OLD.id;
    UPDATE jobs SET source = json_set(source, '$.study', '', '$.series', '')
    WHERE tenant = OLD.tenant AND volume = OLD.id AND source IS NOT NULL;
END;

-- So does it with whose scan a volume is: the rows hold its UIDs.
CREATE TRIGGER identity_erased AFTER UPDATE OF erased_at ON scans WHEN NEW.erased_at IS NOT NULL BEGIN
    DELETE FROM intake_objects WHERE file IS NULL AND group_id IN
        (SELECT id FROM intake_groups WHERE tenant = NEW.tenant AND volume = NEW.volume);
    DELETE FROM intake_groups WHERE tenant = NEW.tenant AND volume = NEW.volume
        AND NOT EXISTS (SELECT 1 FROM intake_objects WHERE group_id = intake_groups.id);
    UPDATE jobs SET source = json_set(source, '$.study', '', '$.series', '')
    WHERE tenant = NEW.tenant AND volume = NEW.volume AND source IS NOT NULL;
    DELETE FROM pulled_series WHERE tenant = NEW.tenant AND volume = NEW.volume;
END;
CREATE TRIGGER identity_never_kept AFTER INSERT ON scans WHEN NEW.erased_at IS NOT NULL BEGIN
    DELETE FROM intake_objects WHERE file IS NULL AND group_id IN
        (SELECT id FROM intake_groups WHERE tenant = NEW.tenant AND volume = NEW.volume);
    DELETE FROM intake_groups WHERE tenant = NEW.tenant AND volume = NEW.volume
        AND NOT EXISTS (SELECT 1 FROM intake_objects WHERE group_id = intake_groups.id);
    UPDATE jobs SET source = json_set(source, '$.study', '', '$.series', '')
    WHERE tenant = NEW.tenant AND volume = NEW.volume AND source IS NOT NULL;
    DELETE FROM pulled_series WHERE tenant = NEW.tenant AND volume = NEW.volume;
END;
