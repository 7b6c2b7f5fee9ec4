-- Objects of one gate each may be a series for each gate: what these have in common tells their group.
ALTER TABLE intake_groups ADD COLUMN gates TEXT;
CREATE UNIQUE INDEX intake_groups_of_gates ON intake_groups (tenant, study, gates);

-- The series of an object of one gate, whose group may have the name of another.
ALTER TABLE intake_objects ADD COLUMN series TEXT;
CREATE INDEX intake_objects_by_series ON intake_objects (tenant, series) WHERE series IS NOT NULL;
