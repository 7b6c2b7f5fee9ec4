-- The last time at which a run of the service trusted its clock: a start at quite another time is in doubt, and nothing is
-- erased by age then.
CREATE TABLE trusted_time (
    id INTEGER PRIMARY KEY CHECK (id = 1),
    at INTEGER NOT NULL
);
