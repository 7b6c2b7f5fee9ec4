-- The audit trail. `hash` is SHA-256 of the hash before it, the sequence and the event's text.

CREATE TABLE audit (
    sequence INTEGER PRIMARY KEY AUTOINCREMENT,
    event    TEXT NOT NULL,
    hash     TEXT NOT NULL,
    recorded INTEGER GENERATED ALWAYS AS (json_extract(event, '$.recorded')) VIRTUAL,
    tenant   TEXT GENERATED ALWAYS AS (json_extract(event, '$.tenant')) VIRTUAL,
    agent    TEXT GENERATED ALWAYS AS (json_extract(event, '$.agent')) VIRTUAL,
    object   TEXT GENERATED ALWAYS AS (json_extract(event, '$.object')) VIRTUAL
) STRICT;

CREATE INDEX audit_by_tenant ON audit (tenant, sequence);
CREATE INDEX audit_by_object ON audit (object, sequence);
CREATE INDEX audit_by_time ON audit (recorded);

-- The last row of each removal of old rows.
CREATE TABLE audit_anchors (
    sequence  INTEGER PRIMARY KEY,
    hash      TEXT NOT NULL,
    pruned_at INTEGER NOT NULL
) STRICT;

CREATE TRIGGER audit_is_never_changed BEFORE UPDATE ON audit
BEGIN SELECT RAISE(ABORT, 'the audit trail is append-only'); END;

CREATE TRIGGER audit_is_removed_up_to_an_anchor BEFORE DELETE ON audit
WHEN OLD.sequence > coalesce((SELECT max(sequence) FROM audit_anchors), 0)
BEGIN SELECT RAISE(ABORT, 'the audit trail is append-only'); END;

CREATE TRIGGER audit_anchors_name_rows BEFORE INSERT ON audit_anchors
WHEN NOT EXISTS (SELECT 1 FROM audit WHERE sequence = NEW.sequence AND hash = NEW.hash)
BEGIN SELECT RAISE(ABORT, 'an anchor names a row of the audit trail'); END;

CREATE TRIGGER audit_anchors_are_never_changed BEFORE UPDATE ON audit_anchors
BEGIN SELECT RAISE(ABORT, 'the audit trail is append-only'); END;

CREATE TRIGGER audit_anchors_are_never_removed BEFORE DELETE ON audit_anchors
BEGIN SELECT RAISE(ABORT, 'the audit trail is append-only'); END;
