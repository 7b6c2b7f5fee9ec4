-- Objects that other systems send by C-STORE or STOW-RS, until they are volumes, and what was received
-- before, so that the same object is not stored twice.

-- What will be one volume: a series of single slices, or one instance that is a volume of its own.
CREATE TABLE intake_groups (
    sequence          INTEGER PRIMARY KEY AUTOINCREMENT,
    id                TEXT NOT NULL UNIQUE,
    tenant            TEXT NOT NULL,
    study             TEXT NOT NULL,
    series            TEXT NOT NULL,
    -- The instance that is a volume of its own; empty for a series.
    instance          TEXT NOT NULL,
    modality          TEXT,
    image_type        TEXT NOT NULL,
    study_description TEXT,
    -- The last one who sent an object of it.
    protocol          TEXT NOT NULL CHECK (protocol IN ('c-store', 'stow-rs')),
    sender            TEXT NOT NULL,
    address           TEXT,
    -- gathering: objects arrive or wait to be read; filing: the volume is stored and its job is to be
    -- filed; stored; failed: it cannot be read.
    state             TEXT NOT NULL CHECK (state IN ('gathering', 'filing', 'stored', 'failed')),
    -- Grows with every object.
    revision          INTEGER NOT NULL,
    volume            TEXT,
    job               TEXT,
    failure           TEXT,
    created_at        INTEGER NOT NULL,
    changed_at        INTEGER NOT NULL,
    UNIQUE (tenant, study, series, instance)
) STRICT;

CREATE INDEX intake_groups_by_state ON intake_groups (state, changed_at);
CREATE INDEX intake_groups_by_tenant ON intake_groups (tenant, sequence);
CREATE INDEX intake_groups_by_volume ON intake_groups (tenant, volume) WHERE volume IS NOT NULL;

CREATE TABLE intake_objects (
    tenant       TEXT NOT NULL,
    sop_instance TEXT NOT NULL,
    group_id     TEXT NOT NULL REFERENCES intake_groups (id) ON DELETE CASCADE,
    -- SHA-256 of the data set, and of the whole file.
    data_sha256  TEXT NOT NULL,
    file_sha256  TEXT NOT NULL,
    -- Its name in the folder of received files; NULL once it is part of the group's volume.
    file         TEXT,
    bytes        INTEGER NOT NULL,
    received_at  INTEGER NOT NULL,
    PRIMARY KEY (tenant, sop_instance)
) STRICT, WITHOUT ROWID;

CREATE INDEX intake_objects_by_group ON intake_objects (group_id);
CREATE INDEX intake_objects_waiting ON intake_objects (tenant, bytes) WHERE file IS NOT NULL;

-- Who erases a volume erases what is known of its objects.
CREATE TRIGGER intake_forgotten AFTER DELETE ON holdings WHEN OLD.kind = 'volume' BEGIN
    DELETE FROM intake_objects WHERE file IS NULL AND group_id IN
        (SELECT id FROM intake_groups WHERE tenant = OLD.tenant AND volume = OLD.id);
    DELETE FROM intake_groups WHERE tenant = OLD.tenant AND volume = OLD.id
        AND NOT EXISTS (SELECT 1 FROM intake_objects WHERE group_id = intake_groups.id);
    UPDATE intake_groups SET volume = NULL WHERE tenant = OLD.tenant AND volume = OLD.id;
END;

-- So does who erases whose scan a volume is: the rows hold its UIDs.
CREATE TRIGGER intake_identity_erased AFTER UPDATE OF erased_at ON scans
WHEN NEW.erased_at IS NOT NULL BEGIN
    DELETE FROM intake_objects WHERE file IS NULL AND group_id IN
        (SELECT id FROM intake_groups WHERE tenant = NEW.tenant AND volume = NEW.volume);
    DELETE FROM intake_groups WHERE tenant = NEW.tenant AND volume = NEW.volume
        AND NOT EXISTS (SELECT 1 FROM intake_objects WHERE group_id = intake_groups.id);
END;
CREATE TRIGGER intake_identity_never_kept AFTER INSERT ON scans
WHEN NEW.erased_at IS NOT NULL BEGIN
    DELETE FROM intake_objects WHERE file IS NULL AND group_id IN
        (SELECT id FROM intake_groups WHERE tenant = NEW.tenant AND volume = NEW.volume);
    DELETE FROM intake_groups WHERE tenant = NEW.tenant AND volume = NEW.volume
        AND NOT EXISTS (SELECT 1 FROM intake_objects WHERE group_id = intake_groups.id);
END;
