-- Jobs start in turns: each tenant has one job in each turn (store/tables/jobs.rs).
ALTER TABLE jobs ADD COLUMN turn INTEGER NOT NULL DEFAULT 0;

UPDATE jobs SET turn = queue.place FROM
    (SELECT sequence, row_number() OVER (PARTITION BY tenant ORDER BY sequence) AS place
     FROM jobs WHERE state = 'queued') AS queue
WHERE jobs.sequence = queue.sequence;

DROP INDEX jobs_ready;
CREATE INDEX jobs_ready ON jobs (turn, sequence) WHERE state = 'queued' AND volume != '';
CREATE INDEX jobs_in_turn ON jobs (tenant, turn) WHERE state IN ('queued', 'running');
