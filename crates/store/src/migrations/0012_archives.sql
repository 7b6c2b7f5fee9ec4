-- Archives: where the volume of a job is fetched from, and what of its result is sent where.

-- {"archive" or "dicomweb", "study", "series"}. Until the series is stored, the volume of such a job
-- is '' and no worker takes it.
ALTER TABLE jobs ADD COLUMN source TEXT;
-- {"names": [...], "to"}
ALTER TABLE jobs ADD COLUMN send TEXT;

CREATE INDEX jobs_ready ON jobs (sequence) WHERE state = 'queued' AND volume != '';

-- The fetching of the series of a job, until the job is erased.
CREATE TABLE pulls (
    job             TEXT PRIMARY KEY,
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

CREATE INDEX pulls_due ON pulls (destination, next_attempt_at) WHERE state = 'pending';

CREATE TRIGGER job_to_pull AFTER INSERT ON jobs WHEN NEW.source IS NOT NULL BEGIN
    INSERT INTO pulls (job, destination, since, next_attempt_at)
    SELECT NEW.id,
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

-- The objects on their way to an archive. The trigger writes them within the very transaction in
-- which the job succeeds: no success is without them, and none is without its success.
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

CREATE INDEX sends_due ON sends (destination, next_attempt_at) WHERE state = 'pending';
CREATE INDEX sends_by_age ON sends (since) WHERE state = 'pending';
CREATE INDEX sends_by_state ON sends (state, since);
CREATE INDEX sends_by_job ON sends (job, sequence);
CREATE INDEX sends_by_result ON sends (result) WHERE state = 'pending';

CREATE TRIGGER job_to_send AFTER UPDATE OF state ON jobs
WHEN NEW.state = 'succeeded' AND OLD.state != 'succeeded' AND NEW.send IS NOT NULL BEGIN
    INSERT INTO sends (id, tenant, job, result, name, destination, since, next_attempt_at)
    SELECT 'snd_' || lower(hex(randomblob(16))), NEW.tenant, NEW.id, NEW.result, value,
           json_extract(NEW.send, '$.to'), NEW.finished_at, NEW.finished_at
    FROM json_each(NEW.send, '$.names') ORDER BY key;
END;

CREATE TRIGGER job_with_archive_forgotten AFTER DELETE ON jobs BEGIN
    DELETE FROM pulls WHERE job = OLD.id;
    DELETE FROM sends WHERE job = OLD.id AND state != 'pending';
END;

-- What a tenant has erased is not sent any more, and a series is fetched anew.
CREATE TRIGGER holding_not_sent AFTER DELETE ON holdings BEGIN
    UPDATE sends SET state = 'dead', ended_at = CAST(unixepoch('subsec') * 1000 AS INTEGER),
           last_outcome = 'erased', last_error = 'The result was erased before it was sent.'
    WHERE result = OLD.id AND tenant = OLD.tenant AND state = 'pending';
    DELETE FROM pulled_series WHERE volume = OLD.id AND tenant = OLD.tenant;
END;
