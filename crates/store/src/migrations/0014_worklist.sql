-- Work items (DICOM Unified Procedure Steps). `attributes` is DICOM JSON without the Transaction
-- UID under which a performer has claimed the item.

CREATE TABLE workitems (
    sequence    INTEGER PRIMARY KEY AUTOINCREMENT,
    tenant      TEXT NOT NULL,
    uid         TEXT NOT NULL,
    state       TEXT NOT NULL CHECK (state IN ('SCHEDULED', 'IN PROGRESS', 'COMPLETED', 'CANCELED')),
    transaction_uid TEXT,
    attributes  TEXT NOT NULL,
    changed_at  INTEGER NOT NULL,
    revision    INTEGER NOT NULL DEFAULT 0,
    UNIQUE (tenant, uid)
) STRICT;

CREATE INDEX workitems_by_state ON workitems (tenant, state, sequence);
CREATE INDEX workitems_by_end ON workitems (changed_at)
    WHERE state IN ('COMPLETED', 'CANCELED');
