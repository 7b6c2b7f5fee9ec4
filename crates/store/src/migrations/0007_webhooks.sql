-- Webhooks: who is told about jobs, and each telling until it has ended. The trigger `job_told`
-- writes a delivery within the very transaction that changes the state of a job, whichever
-- statement that is: no end of a job is without its deliveries, and no delivery without its end.

-- The webhook of this job alone: {"url", "destination", "events", "secret"}.
ALTER TABLE jobs ADD COLUMN webhook TEXT;
-- The W3C trace context of the request that filed it.
ALTER TABLE jobs ADD COLUMN trace_parent TEXT;

-- Told about every job of their tenant.
CREATE TABLE webhook_endpoints (
    sequence    INTEGER PRIMARY KEY AUTOINCREMENT,
    id          TEXT NOT NULL UNIQUE,
    tenant      TEXT NOT NULL,
    created_at  INTEGER NOT NULL,
    url         TEXT NOT NULL,
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

CREATE INDEX deliveries_due ON deliveries (destination, next_attempt_at) WHERE state = 'pending';
CREATE INDEX deliveries_by_age ON deliveries (since) WHERE state = 'pending';
CREATE INDEX deliveries_by_end ON deliveries (ended_at) WHERE state != 'pending';
CREATE INDEX deliveries_by_state ON deliveries (state, since);
CREATE INDEX deliveries_by_job ON deliveries (job, sequence);

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

-- What was told about an erased job is erased with it; what is still to be told is kept.
CREATE TRIGGER job_forgotten AFTER DELETE ON jobs BEGIN
    DELETE FROM deliveries WHERE job = OLD.id AND state != 'pending';
END;
