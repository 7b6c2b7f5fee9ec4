-- Errands are worked off in lanes, each of one tenant and one destination; see SQLite's migration 25.
-- No job is filed meanwhile, by a process of the version before, whose fetch would have no tenant.
LOCK TABLE jobs IN SHARE ROW EXCLUSIVE MODE;
ALTER TABLE pulls ADD COLUMN tenant TEXT COLLATE "C" NOT NULL DEFAULT 'default';
UPDATE pulls SET tenant = jobs.tenant FROM jobs WHERE jobs.id = pulls.job;

CREATE OR REPLACE FUNCTION pull_for_job() RETURNS TRIGGER LANGUAGE plpgsql AS $$
BEGIN
    INSERT INTO pulls (job, tenant, destination, since, next_attempt_at)
    VALUES (NEW.id, NEW.tenant,
            coalesce(json_field(NEW.source, 'archive'), json_field(NEW.source, 'dicomweb')),
            NEW.created_at, NEW.created_at);
    RETURN NULL;
END $$;

DROP INDEX pulls_due;
CREATE INDEX pulls_due ON pulls (destination, tenant, next_attempt_at) WHERE state = 'pending';
DROP INDEX sends_due;
CREATE INDEX sends_due ON sends (destination, tenant, next_attempt_at) WHERE state = 'pending';
DROP INDEX deliveries_due;
CREATE INDEX deliveries_due ON deliveries (destination, tenant, next_attempt_at) WHERE state = 'pending';
