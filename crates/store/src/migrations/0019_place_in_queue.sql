-- With the state as its first column the planner prefers this index to `jobs_by_state` for a place in the
-- queue, and with the volume as its last it reads no row of the table.
DROP INDEX jobs_ready;
CREATE INDEX jobs_ready ON jobs (state, turn, sequence, volume) WHERE state = 'queued' AND volume != '';
