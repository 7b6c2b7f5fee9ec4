-- Jobs start by priority, then by turn; see SQLite's migration 20.
ALTER TABLE jobs ADD COLUMN priority BIGINT NOT NULL DEFAULT 1;

DROP INDEX jobs_ready;
DROP INDEX jobs_in_turn;
CREATE INDEX jobs_ready ON jobs (priority, turn, sequence) WHERE state = 'queued' AND volume != '';
CREATE INDEX jobs_in_turn ON jobs (tenant, priority, turn) WHERE state IN ('queued', 'running');
