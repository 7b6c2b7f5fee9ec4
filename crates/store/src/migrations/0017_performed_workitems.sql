-- Work items that the service performs itself: the job that does the work, '' until it is filed.
ALTER TABLE workitems ADD COLUMN performer TEXT;

CREATE INDEX workitems_scheduled ON workitems (sequence) WHERE state = 'SCHEDULED';
CREATE INDEX workitems_performed ON workitems (sequence)
    WHERE state = 'IN PROGRESS' AND performer IS NOT NULL;

-- Who erases a volume, or whose scan it is, erases its UIDs in the jobs that fetched it, and in what is
-- known of the series.
CREATE TRIGGER job_source_forgotten AFTER DELETE ON holdings WHEN OLD.kind = 'volume' BEGIN
    UPDATE jobs SET source = json_set(source, '$.study', '', '$.series', '')
    WHERE tenant = OLD.tenant AND volume = OLD.id AND source IS NOT NULL;
END;
CREATE TRIGGER job_source_erased AFTER UPDATE OF erased_at ON scans
WHEN NEW.erased_at IS NOT NULL BEGIN
    UPDATE jobs SET source = json_set(source, '$.study', '', '$.series', '')
    WHERE tenant = NEW.tenant AND volume = NEW.volume AND source IS NOT NULL;
    DELETE FROM pulled_series WHERE tenant = NEW.tenant AND volume = NEW.volume;
END;
CREATE TRIGGER job_source_never_kept AFTER INSERT ON scans WHEN NEW.erased_at IS NOT NULL BEGIN
    UPDATE jobs SET source = json_set(source, '$.study', '', '$.series', '')
    WHERE tenant = NEW.tenant AND volume = NEW.volume AND source IS NOT NULL;
    DELETE FROM pulled_series WHERE tenant = NEW.tenant AND volume = NEW.volume;
END;

-- What was erased before.
UPDATE jobs SET source = json_set(source, '$.study', '', '$.series', '')
WHERE source IS NOT NULL AND volume != '' AND (
    EXISTS (SELECT 1 FROM scans s
            WHERE s.tenant = jobs.tenant AND s.volume = jobs.volume AND s.erased_at IS NOT NULL)
    OR NOT EXISTS (SELECT 1 FROM holdings h WHERE h.tenant = jobs.tenant AND h.id = jobs.volume));
DELETE FROM pulled_series WHERE EXISTS (SELECT 1 FROM scans s
    WHERE s.tenant = pulled_series.tenant AND s.volume = pulled_series.volume
    AND s.erased_at IS NOT NULL);
