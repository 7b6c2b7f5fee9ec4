-- When a volume was last uploaded, or used by a job: its age counts from here.
ALTER TABLE volumes ADD COLUMN used_at INTEGER NOT NULL DEFAULT 0;
UPDATE volumes SET used_at = created_at;
CREATE INDEX volumes_by_use ON volumes (used_at);
