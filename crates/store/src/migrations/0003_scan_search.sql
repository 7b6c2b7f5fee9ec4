-- The list of scans, searched, filtered and ordered as a whole: a row for each volume that a tenant has, with what the
-- list compares. It repeats what other tables hold, so that a search reads one compact table; triggers keep it, and
-- `listed_scans_now` says what a row must be.
--
-- `lower` knows the letters A to Z alone, on both engines. JSON has NUL as `\u0000`, which PostgreSQL has in no text.

CREATE TABLE listed_scans (
    -- That of the holding: the order of arrival.
    sequence       INTEGER PRIMARY KEY,
    tenant         TEXT NOT NULL,
    volume         TEXT NOT NULL,
    created_at     INTEGER NOT NULL,
    bytes          INTEGER NOT NULL,
    -- YYYYMMDD; '' if the header states none.
    study_date     TEXT NOT NULL,
    -- Patient's Name, else Patient ID, and what the tenant calls the scan: in small letters, numbers padded with zeros,
    -- as they are ordered. Scans of nobody come last.
    patient        TEXT NOT NULL,
    name           TEXT NOT NULL,
    patient_id     TEXT NOT NULL,
    modality       TEXT NOT NULL,
    rest_or_stress TEXT NOT NULL,
    -- Number of results of each kind.
    models         INTEGER NOT NULL,
    segmentations  INTEGER NOT NULL,
    beats          INTEGER NOT NULL,
    comparisons    INTEGER NOT NULL,
    -- What is searched, in small letters, a line for each text: what every caller sees, and also what names people.
    words          TEXT NOT NULL,
    personal_words TEXT NOT NULL,
    UNIQUE (tenant, volume),
    FOREIGN KEY (tenant, volume) REFERENCES holdings (tenant, id) ON DELETE CASCADE ON UPDATE CASCADE
) STRICT;

CREATE INDEX listed_scans_by_arrival ON listed_scans (tenant, sequence);
CREATE INDEX listed_scans_by_study_date ON listed_scans (tenant, study_date, sequence);
CREATE INDEX listed_scans_by_patient ON listed_scans (tenant, patient, sequence);
CREATE INDEX listed_scans_by_name ON listed_scans (tenant, name, sequence);
CREATE INDEX listed_scans_by_size ON listed_scans (tenant, bytes, sequence);

-- What the volumes of tenants are found by, as the other tables have it.
CREATE VIEW scan_texts AS
SELECT h.sequence, h.tenant, h.id AS volume, h.created_at, coalesce(v.bytes, 0) AS bytes,
       coalesce(h.external_id, json_extract(h.labels, '$.name')) AS name,
       coalesce(h.external_id, '') AS external_id,
       coalesce((SELECT group_concat(key || ':' || value, char(10)) FROM json_each(h.labels)), '') AS labels,
       coalesce(json_extract(v.facts, '$.format'), '') AS format,
       coalesce(json_extract(c.found, '$.patient_name'), json_extract(c.stated, '$.patient_name'), '') AS patient_name,
       coalesce(json_extract(c.found, '$.patient_id'), json_extract(c.stated, '$.patient_id'), '') AS patient_id,
       coalesce(json_extract(c.found, '$.study_date'), json_extract(c.stated, '$.study_date'), '') AS study_date,
       coalesce(json_extract(c.found, '$.accession_number'), json_extract(c.stated, '$.accession_number'), '')
           AS accession_number,
       coalesce(json_extract(c.found, '$.study_description'), json_extract(c.stated, '$.study_description'), '')
           AS study_description,
       coalesce(json_extract(c.found, '$.series_description'), '') AS series_description,
       coalesce(json_extract(c.found, '$.modality'), '') AS modality,
       coalesce(json_extract(c.found, '$.radiopharmaceutical'), '') AS radiopharmaceutical,
       coalesce(json_extract(c.found, '$.radionuclide'), '') AS radionuclide,
       coalesce(json_extract(c.found, '$.rest_or_stress'), '') AS rest_or_stress
FROM holdings AS h
LEFT JOIN volumes AS v ON v.id = h.id
LEFT JOIN (SELECT tenant, volume, replace(found, '\u0000', '\ufffd') AS found,
                  replace(stated, '\u0000', '\ufffd') AS stated FROM scans) AS c
    ON c.tenant = h.tenant AND c.volume = h.id
-- Found by its id: there may be as many volumes as holdings.
WHERE +h.kind = 'volume';

-- The rows of `listed_scans` as they must be.
CREATE VIEW listed_scans_now AS
SELECT sequence, tenant, volume, created_at, bytes, study_date,
       CASE WHEN whose GLOB '*[0-9]*' THEN
           (WITH RECURSIVE read (rest, done, digits) AS (
                SELECT lower(whose), '', ''
                UNION ALL
                SELECT substr(rest, 2),
                       CASE WHEN substr(rest, 1, 1) BETWEEN '0' AND '9' THEN done ELSE done ||
                           CASE digits WHEN '' THEN '' ELSE substr('000000000000', length(digits) + 1) || digits END
                           || substr(rest, 1, 1) END,
                       CASE WHEN substr(rest, 1, 1) BETWEEN '0' AND '9' THEN digits || substr(rest, 1, 1) ELSE '' END
                FROM read WHERE rest != '')
            SELECT done ||
                CASE digits WHEN '' THEN '' ELSE substr('000000000000', length(digits) + 1) || digits END
            FROM read WHERE rest = '')
       ELSE lower(whose) END AS patient,
       CASE WHEN name IS NULL THEN 'scan ' || substr(volume, 5, 8)
            WHEN name GLOB '*[0-9]*' THEN
           (WITH RECURSIVE read (rest, done, digits) AS (
                SELECT lower(name), '', ''
                UNION ALL
                SELECT substr(rest, 2),
                       CASE WHEN substr(rest, 1, 1) BETWEEN '0' AND '9' THEN done ELSE done ||
                           CASE digits WHEN '' THEN '' ELSE substr('000000000000', length(digits) + 1) || digits END
                           || substr(rest, 1, 1) END,
                       CASE WHEN substr(rest, 1, 1) BETWEEN '0' AND '9' THEN digits || substr(rest, 1, 1) ELSE '' END
                FROM read WHERE rest != '')
            SELECT done ||
                CASE digits WHEN '' THEN '' ELSE substr('000000000000', length(digits) + 1) || digits END
            FROM read WHERE rest = '')
       ELSE lower(name) END AS name,
       patient_id, modality, rest_or_stress,
       (SELECT count(*) FROM sources AS s WHERE s.tenant = texts.tenant AND s.volume = texts.volume
            AND s.id >= 'mdl_' AND s.id < 'mdl`') AS models,
       (SELECT count(*) FROM sources AS s WHERE s.tenant = texts.tenant AND s.volume = texts.volume
            AND s.id >= 'seg_' AND s.id < 'seg`') AS segmentations,
       (SELECT count(*) FROM sources AS s WHERE s.tenant = texts.tenant AND s.volume = texts.volume
            AND s.id >= 'bea_' AND s.id < 'bea`') AS beats,
       (SELECT count(*) FROM sources AS s WHERE s.tenant = texts.tenant AND s.volume = texts.volume
            AND s.id >= 'cmp_' AND s.id < 'cmp`') AS comparisons,
       lower(format || char(10) || modality || char(10) || radiopharmaceutical || char(10)
             || radionuclide || char(10) || rest_or_stress) AS words,
       lower(format || char(10) || modality || char(10) || radiopharmaceutical || char(10)
             || radionuclide || char(10) || rest_or_stress || char(10) || external_id || char(10) || labels || char(10)
             || patient_name || char(10) || patient_id || char(10) || study_date || char(10)
             || CASE study_date WHEN '' THEN '' ELSE substr(study_date, 1, 4) || '-' || substr(study_date, 5, 2)
                 || '-' || substr(study_date, 7, 2) END
             || char(10) || accession_number || char(10) || study_description || char(10) || series_description)
           AS personal_words
FROM (SELECT *, coalesce(nullif(patient_name, ''), nullif(patient_id, ''), char(1114111)) AS whose
      FROM scan_texts) AS texts;

-- A row is made anew when anything changes of what it repeats.
CREATE TRIGGER scan_listed AFTER INSERT ON holdings WHEN NEW.kind = 'volume' BEGIN
    INSERT INTO listed_scans SELECT * FROM listed_scans_now WHERE tenant = NEW.tenant AND volume = NEW.id;
END;
CREATE TRIGGER listed_scan_renamed AFTER UPDATE OF external_id, labels ON holdings
WHEN NEW.kind = 'volume' AND (NEW.external_id IS NOT OLD.external_id OR NEW.labels IS NOT OLD.labels) BEGIN
    DELETE FROM listed_scans WHERE tenant = NEW.tenant AND volume = NEW.id;
    INSERT INTO listed_scans SELECT * FROM listed_scans_now WHERE tenant = NEW.tenant AND volume = NEW.id;
END;
CREATE TRIGGER listed_scan_identified AFTER INSERT ON scans BEGIN
    DELETE FROM listed_scans WHERE tenant = NEW.tenant AND volume = NEW.volume;
    INSERT INTO listed_scans SELECT * FROM listed_scans_now WHERE tenant = NEW.tenant AND volume = NEW.volume;
END;
CREATE TRIGGER listed_scan_identity_changed AFTER UPDATE OF found, stated ON scans BEGIN
    DELETE FROM listed_scans WHERE tenant = NEW.tenant AND volume = NEW.volume;
    INSERT INTO listed_scans SELECT * FROM listed_scans_now WHERE tenant = NEW.tenant AND volume = NEW.volume;
END;
CREATE TRIGGER listed_scan_used AFTER INSERT ON sources BEGIN
    UPDATE listed_scans SET (models, segmentations, beats, comparisons) =
        (SELECT models, segmentations, beats, comparisons FROM listed_scans_now AS now
         WHERE now.tenant = NEW.tenant AND now.volume = NEW.volume)
    WHERE tenant = NEW.tenant AND volume = NEW.volume
      AND EXISTS (SELECT 1 FROM holdings WHERE tenant = NEW.tenant AND id = NEW.volume);
END;
CREATE TRIGGER listed_scan_not_used AFTER DELETE ON sources BEGIN
    UPDATE listed_scans SET (models, segmentations, beats, comparisons) =
        (SELECT models, segmentations, beats, comparisons FROM listed_scans_now AS now
         WHERE now.tenant = OLD.tenant AND now.volume = OLD.volume)
    WHERE tenant = OLD.tenant AND volume = OLD.volume
      AND EXISTS (SELECT 1 FROM holdings WHERE tenant = OLD.tenant AND id = OLD.volume);
END;
-- A repair may write the content after the holding, or other facts of it.
CREATE TRIGGER listed_scan_stored AFTER INSERT ON volumes
WHEN EXISTS (SELECT 1 FROM holdings WHERE id = NEW.id) BEGIN
    DELETE FROM listed_scans WHERE sequence IN (SELECT sequence FROM holdings WHERE id = NEW.id);
    INSERT INTO listed_scans SELECT * FROM listed_scans_now WHERE volume = NEW.id;
END;
CREATE TRIGGER listed_scan_read_again AFTER UPDATE OF facts ON volumes WHEN NEW.facts IS NOT OLD.facts BEGIN
    DELETE FROM listed_scans WHERE sequence IN (SELECT sequence FROM holdings WHERE id = NEW.id);
    INSERT INTO listed_scans SELECT * FROM listed_scans_now WHERE volume = NEW.id;
END;

INSERT INTO listed_scans SELECT * FROM listed_scans_now;
