-- The run of the service that holds the lease, how often a run died while the job was running, and
-- how often the job's own process died.
ALTER TABLE jobs ADD COLUMN lease_run TEXT;
ALTER TABLE jobs ADD COLUMN interruptions INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN crashes INTEGER NOT NULL DEFAULT 0;


-- Retention looks for old jobs, deletions for unfinished jobs that need an item; neither reads the
-- whole table.
CREATE INDEX jobs_by_end ON jobs (finished_at) WHERE finished_at IS NOT NULL;
CREATE INDEX jobs_with_needs ON jobs (state) WHERE needs != '{}';
