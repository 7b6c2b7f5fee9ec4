-- Jobs start by priority, then by turn (store/tables/jobs.rs): 0 is urgent, 1 routine, 2 bulk.
ALTER TABLE jobs ADD COLUMN priority INTEGER NOT NULL DEFAULT 1;

DROP INDEX jobs_ready;
DROP INDEX jobs_in_turn;
CREATE INDEX jobs_ready ON jobs (state, priority, turn, sequence, volume) WHERE state = 'queued' AND volume != '';
CREATE INDEX jobs_in_turn ON jobs (tenant, priority, turn) WHERE state IN ('queued', 'running');
