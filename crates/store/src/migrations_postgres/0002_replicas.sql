-- Several processes on one database.

-- The processes that live. Written anew all the time and worthless after a crash of the server, so without log.
CREATE UNLOGGED TABLE runs (
    id         TEXT COLLATE "C" PRIMARY KEY,
    workers    BIGINT NOT NULL,
    -- By the clock of this server, as all of these times.
    expires_at BIGINT NOT NULL
);

-- Items that are not to be erased while the process that names them lives, likewise without log.
CREATE UNLOGGED TABLE holds (
    token TEXT COLLATE "C" PRIMARY KEY,
    run   TEXT COLLATE "C" NOT NULL,
    item  TEXT COLLATE "C" NOT NULL
);
CREATE INDEX holds_by_item ON holds (item);

-- What one process does for all.
CREATE TABLE duties (
    name       TEXT COLLATE "C" PRIMARY KEY,
    run        TEXT COLLATE "C" NOT NULL,
    expires_at BIGINT NOT NULL
);

-- Where the files of the records are: a bucket, or the name of a data folder.
CREATE TABLE store_place (
    id    BIGINT PRIMARY KEY CHECK (id = 1),
    place TEXT NOT NULL
);

-- Places in the bucket whose files were erased, or replaced. A process that found an item stored there just
-- before must not write a row that names them.
CREATE TABLE given_up_places (
    place       TEXT COLLATE "C" PRIMARY KEY,
    given_up_at BIGINT NOT NULL
);
CREATE INDEX given_up_places_by_time ON given_up_places (given_up_at);

CREATE FUNCTION places_of(files TEXT) RETURNS SETOF TEXT LANGUAGE sql IMMUTABLE STRICT PARALLEL SAFE AS $$
    SELECT DISTINCT file ->> 'place' FROM json_array_elements(readable_json(files)) AS file
    WHERE file ->> 'place' IS NOT NULL
$$;

CREATE FUNCTION give_up_places() RETURNS TRIGGER LANGUAGE plpgsql AS $$
DECLARE
    kept TEXT := '[]';
BEGIN
    IF TG_OP = 'UPDATE' THEN
        kept := NEW.files;
    END IF;
    INSERT INTO given_up_places (place, given_up_at)
    SELECT place, database_now() FROM places_of(OLD.files) AS place
    WHERE place NOT IN (SELECT places_of(kept))
    ON CONFLICT DO NOTHING;
    RETURN NULL;
END $$;
CREATE TRIGGER volume_places_given_up AFTER DELETE OR UPDATE OF files ON volumes FOR EACH ROW
    EXECUTE FUNCTION give_up_places();
CREATE TRIGGER product_places_given_up AFTER DELETE OR UPDATE OF files ON products FOR EACH ROW
    EXECUTE FUNCTION give_up_places();

-- Reported as a serialisation failure, which it is: done again, it finds that the files are gone.
CREATE FUNCTION refuse_given_up_places() RETURNS TRIGGER LANGUAGE plpgsql AS $$
BEGIN
    IF EXISTS (SELECT 1 FROM given_up_places WHERE place IN (SELECT places_of(NEW.files))) THEN
        RAISE EXCEPTION 'the files of % were erased meanwhile', NEW.id USING ERRCODE = 'serialization_failure';
    END IF;
    RETURN NEW;
END $$;
CREATE TRIGGER volume_places_are_there BEFORE INSERT OR UPDATE OF files ON volumes FOR EACH ROW
    EXECUTE FUNCTION refuse_given_up_places();
CREATE TRIGGER product_places_are_there BEFORE INSERT OR UPDATE OF files ON products FOR EACH ROW
    EXECUTE FUNCTION refuse_given_up_places();

-- Tells the other processes, when the change is committed: the kind, who has changed it, and what.
CREATE FUNCTION tell_processes() RETURNS TRIGGER LANGUAGE plpgsql AS $$
DECLARE
    what TEXT := '';
BEGIN
    IF TG_ARGV[0] != 'workitem' THEN
        what := NEW.id;
    END IF;
    PERFORM pg_notify('ventriform_' || md5(TG_TABLE_SCHEMA),
                      TG_ARGV[0] || ' ' || coalesce(current_setting('ventriform.run', TRUE), '') || ' ' || what);
    RETURN NULL;
END $$;
CREATE TRIGGER job_filing_told AFTER INSERT ON jobs FOR EACH ROW EXECUTE FUNCTION tell_processes('job');
CREATE TRIGGER job_change_told AFTER UPDATE ON jobs FOR EACH ROW WHEN (NEW.revision != OLD.revision)
    EXECUTE FUNCTION tell_processes('job');
CREATE TRIGGER erasure_told AFTER INSERT OR UPDATE ON erased FOR EACH ROW
    EXECUTE FUNCTION tell_processes('erased');
CREATE TRIGGER workitem_told AFTER INSERT OR UPDATE ON workitems FOR EACH ROW
    WHEN (NEW.state = 'SCHEDULED') EXECUTE FUNCTION tell_processes('workitem');
