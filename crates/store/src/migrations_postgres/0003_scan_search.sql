-- The list of scans on PostgreSQL: what is for what is said in ../migrations/0003_scan_search.sql; here is what is
-- different.

CREATE TABLE listed_scans (
    sequence       BIGINT PRIMARY KEY,
    tenant         TEXT COLLATE "C" NOT NULL,
    volume         TEXT COLLATE "C" NOT NULL,
    created_at     BIGINT NOT NULL,
    bytes          BIGINT NOT NULL,
    study_date     TEXT COLLATE "C" NOT NULL,
    patient        TEXT COLLATE "C" NOT NULL,
    name           TEXT COLLATE "C" NOT NULL,
    patient_id     TEXT COLLATE "C" NOT NULL,
    modality       TEXT COLLATE "C" NOT NULL,
    rest_or_stress TEXT COLLATE "C" NOT NULL,
    models         BIGINT NOT NULL,
    segmentations  BIGINT NOT NULL,
    beats          BIGINT NOT NULL,
    comparisons    BIGINT NOT NULL,
    words          TEXT COLLATE "C" NOT NULL,
    personal_words TEXT COLLATE "C" NOT NULL,
    UNIQUE (tenant, volume),
    FOREIGN KEY (tenant, volume) REFERENCES holdings (tenant, id) ON DELETE CASCADE ON UPDATE CASCADE
);

CREATE INDEX listed_scans_by_arrival ON listed_scans (tenant, sequence);
CREATE INDEX listed_scans_by_study_date ON listed_scans (tenant, study_date, sequence);
CREATE INDEX listed_scans_by_patient ON listed_scans (tenant, patient, sequence);
CREATE INDEX listed_scans_by_name ON listed_scans (tenant, name, sequence);
CREATE INDEX listed_scans_by_size ON listed_scans (tenant, bytes, sequence);

-- A text in small letters with its numbers padded, as texts are ordered.
CREATE FUNCTION order_key(ordered TEXT) RETURNS TEXT
LANGUAGE sql IMMUTABLE STRICT PARALLEL SAFE AS $$
    SELECT coalesce(string_agg(
        CASE WHEN part[1] ~ '^[0-9]' THEN substr('000000000000', length(part[1]) + 1) || part[1] ELSE part[1] END,
        '' ORDER BY place), '')
    FROM regexp_matches(lower(ordered COLLATE "C"), '[0-9]+|[^0-9]+', 'g') WITH ORDINALITY AS found (part, place)
$$;

CREATE VIEW scan_texts AS
SELECT h.sequence, h.tenant, h.id AS volume, h.created_at, coalesce(v.bytes, 0) AS bytes,
       coalesce(h.external_id, json_field(h.labels, 'name')) AS name,
       coalesce(h.external_id, '') AS external_id,
       coalesce((SELECT string_agg(key || ':' || value, chr(10)) FROM json_each(h.labels)), '') AS labels,
       coalesce(json_field(v.facts, 'format'), '') AS format,
       coalesce(json_field(c.found, 'patient_name'), json_field(c.stated, 'patient_name'), '') AS patient_name,
       coalesce(json_field(c.found, 'patient_id'), json_field(c.stated, 'patient_id'), '') AS patient_id,
       coalesce(json_field(c.found, 'study_date'), json_field(c.stated, 'study_date'), '') AS study_date,
       coalesce(json_field(c.found, 'accession_number'), json_field(c.stated, 'accession_number'), '')
           AS accession_number,
       coalesce(json_field(c.found, 'study_description'), json_field(c.stated, 'study_description'), '')
           AS study_description,
       coalesce(json_field(c.found, 'series_description'), '') AS series_description,
       coalesce(json_field(c.found, 'modality'), '') AS modality,
       coalesce(json_field(c.found, 'radiopharmaceutical'), '') AS radiopharmaceutical,
       coalesce(json_field(c.found, 'radionuclide'), '') AS radionuclide,
       coalesce(json_field(c.found, 'rest_or_stress'), '') AS rest_or_stress
FROM holdings AS h
LEFT JOIN volumes AS v ON v.id = h.id
LEFT JOIN scans AS c ON c.tenant = h.tenant AND c.volume = h.id
WHERE h.kind = 'volume';

CREATE VIEW listed_scans_now AS
SELECT sequence, tenant, volume, created_at, bytes, study_date,
       coalesce(order_key(coalesce(nullif(patient_name, ''), nullif(patient_id, ''))), chr(1114111)) AS patient,
       coalesce(order_key(name), 'scan ' || substr(volume, 5, 8)) AS name,
       patient_id, modality, rest_or_stress,
       (SELECT count(*) FROM sources AS s WHERE s.tenant = texts.tenant AND s.volume = texts.volume
            AND s.id >= 'mdl_' AND s.id < 'mdl`') AS models,
       (SELECT count(*) FROM sources AS s WHERE s.tenant = texts.tenant AND s.volume = texts.volume
            AND s.id >= 'seg_' AND s.id < 'seg`') AS segmentations,
       (SELECT count(*) FROM sources AS s WHERE s.tenant = texts.tenant AND s.volume = texts.volume
            AND s.id >= 'bea_' AND s.id < 'bea`') AS beats,
       (SELECT count(*) FROM sources AS s WHERE s.tenant = texts.tenant AND s.volume = texts.volume
            AND s.id >= 'cmp_' AND s.id < 'cmp`') AS comparisons,
       lower(concat_ws(chr(10), format, modality, radiopharmaceutical, radionuclide, rest_or_stress)
             COLLATE "C") AS words,
       lower(concat_ws(chr(10), format, modality, radiopharmaceutical, radionuclide, rest_or_stress,
                       external_id, labels, patient_name, patient_id, study_date,
                       CASE study_date WHEN '' THEN '' ELSE substr(study_date, 1, 4) || '-' || substr(study_date, 5, 2)
                 || '-' || substr(study_date, 7, 2) END,
                       accession_number, study_description, series_description)
             COLLATE "C") AS personal_words
FROM scan_texts AS texts;

-- Called with a row of holdings, or of scans.
CREATE FUNCTION list_scan() RETURNS TRIGGER LANGUAGE plpgsql AS $$
DECLARE
    scan TEXT := coalesce(to_json(NEW) ->> 'volume', to_json(NEW) ->> 'id');
BEGIN
    DELETE FROM listed_scans WHERE tenant = NEW.tenant AND volume = scan;
    INSERT INTO listed_scans SELECT * FROM listed_scans_now AS n WHERE n.tenant = NEW.tenant AND n.volume = scan;
    RETURN NULL;
END $$;
CREATE TRIGGER scan_listed AFTER INSERT ON holdings FOR EACH ROW
    WHEN (NEW.kind = 'volume') EXECUTE FUNCTION list_scan();
CREATE TRIGGER listed_scan_renamed AFTER UPDATE OF external_id, labels ON holdings FOR EACH ROW
    WHEN (NEW.kind = 'volume'
          AND (NEW.external_id IS DISTINCT FROM OLD.external_id OR NEW.labels IS DISTINCT FROM OLD.labels))
    EXECUTE FUNCTION list_scan();
CREATE TRIGGER listed_scan_identified AFTER INSERT OR UPDATE OF found, stated ON scans FOR EACH ROW
    EXECUTE FUNCTION list_scan();

CREATE FUNCTION count_results() RETURNS TRIGGER LANGUAGE plpgsql AS $$
DECLARE
    made sources;
BEGIN
    IF TG_OP = 'DELETE' THEN made := OLD; ELSE made := NEW; END IF;
    UPDATE listed_scans AS l
    SET models = n.models, segmentations = n.segmentations, beats = n.beats, comparisons = n.comparisons
    FROM listed_scans_now AS n
    WHERE n.tenant = made.tenant AND n.volume = made.volume AND l.tenant = n.tenant AND l.volume = n.volume;
    RETURN NULL;
END $$;
CREATE TRIGGER listed_scan_used AFTER INSERT OR DELETE ON sources FOR EACH ROW EXECUTE FUNCTION count_results();

CREATE FUNCTION list_scans_of_volume() RETURNS TRIGGER LANGUAGE plpgsql AS $$
BEGIN
    DELETE FROM listed_scans WHERE sequence IN (SELECT h.sequence FROM holdings AS h WHERE h.id = NEW.id);
    INSERT INTO listed_scans SELECT * FROM listed_scans_now AS n WHERE n.volume = NEW.id;
    RETURN NULL;
END $$;
CREATE TRIGGER listed_scan_stored AFTER INSERT ON volumes FOR EACH ROW EXECUTE FUNCTION list_scans_of_volume();
CREATE TRIGGER listed_scan_read_again AFTER UPDATE OF facts ON volumes FOR EACH ROW
    WHEN (NEW.facts IS DISTINCT FROM OLD.facts) EXECUTE FUNCTION list_scans_of_volume();

INSERT INTO listed_scans SELECT * FROM listed_scans_now;
