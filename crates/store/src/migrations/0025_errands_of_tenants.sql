-- Errands are worked off in lanes, each of one tenant and one destination; `tables/errands.rs` jumps from lane to lane.
ALTER TABLE pulls ADD COLUMN tenant TEXT NOT NULL DEFAULT 'default';
UPDATE pulls SET tenant = jobs.tenant FROM jobs WHERE jobs.id = pulls.job;

DROP TRIGGER job_to_pull;
CREATE TRIGGER job_to_pull AFTER INSERT ON jobs WHEN NEW.source IS NOT NULL BEGIN
    INSERT INTO pulls (job, tenant, destination, since, next_attempt_at)
    SELECT NEW.id, NEW.tenant,
           coalesce(json_extract(NEW.source, '$.archive'), json_extract(NEW.source, '$.dicomweb')),
           NEW.created_at, NEW.created_at;
END;

DROP INDEX pulls_due;
CREATE INDEX pulls_due ON pulls (destination, tenant, next_attempt_at) WHERE state = 'pending';
DROP INDEX sends_due;
CREATE INDEX sends_due ON sends (destination, tenant, next_attempt_at) WHERE state = 'pending';
DROP INDEX deliveries_due;
CREATE INDEX deliveries_due ON deliveries (destination, tenant, next_attempt_at) WHERE state = 'pending';
