-- Whose scan a volume is, for its tenant alone: what the file says, and what the tenant states
-- beside that, as JSON objects. Both are NULL of a file that says nothing, and after an erasure. A
-- volume without a row was stored by a version that did not read whose scan it is.

CREATE TABLE scans (
    tenant           TEXT NOT NULL,
    volume           TEXT NOT NULL,
    found            TEXT,
    stated           TEXT,
    erased_at        INTEGER,
    study_uid        TEXT GENERATED ALWAYS AS
        (coalesce(json_extract(found, '$.study_uid'), json_extract(stated, '$.study_uid'))) VIRTUAL,
    series_uid       TEXT GENERATED ALWAYS AS (json_extract(found, '$.series_uid')) VIRTUAL,
    accession_number TEXT GENERATED ALWAYS AS
        (coalesce(json_extract(found, '$.accession_number'),
                  json_extract(stated, '$.accession_number'))) VIRTUAL,
    PRIMARY KEY (tenant, volume),
    FOREIGN KEY (tenant, volume) REFERENCES holdings (tenant, id) ON DELETE CASCADE
) STRICT, WITHOUT ROWID;

CREATE INDEX scans_by_study ON scans (tenant, study_uid) WHERE study_uid IS NOT NULL;
CREATE INDEX scans_by_series ON scans (tenant, series_uid) WHERE series_uid IS NOT NULL;
CREATE INDEX scans_by_accession ON scans (tenant, accession_number)
    WHERE accession_number IS NOT NULL;

-- From these the UIDs of de-identified objects are derived: the same for the objects of one study.
CREATE TABLE deidentification_secrets (
    tenant TEXT PRIMARY KEY,
    secret BLOB NOT NULL
) STRICT, WITHOUT ROWID;
