-- Running totals of what is stored, on PostgreSQL. What they are for is said in ../migrations/0002_totals.sql; here is
-- what is different.
--
-- Locks. A total is one row for all that a tenant writes, so two transactions that write for one tenant would wait for
-- each other. They wait already: whatever adds or takes away something that counts holds the lock for writing
-- (store/database.rs) before its first statement, so no two of them are under way, and rows of several tenants are
-- locked in any order without a deadlock. What runs beside that lock (claims, renewals of leases, progress) changes
-- no column that counts, so it fires none of these triggers and waits for no total. Statements of an operator that are
-- run beside a service do not hold the lock; should two of them meet, the server ends one, as ever.
--
-- Each change leaves an old version of the total's row until it is committed. A single transaction that writes N things
-- reads up to N of them each time: hundreds cost nothing, but who copies a whole database disables the triggers, and
-- copies the totals (store/migrate/rows.rs).

-- Processes of the version before may be writing: none does between the sums and the triggers. First the lock for
-- writing, then the tables, as whoever writes does.
SELECT pg_advisory_xact_lock(hashtextextended('ventriform writes ' || current_schema(), 0));
LOCK TABLE holdings, volumes, products, intake_objects, workitems, jobs IN SHARE ROW EXCLUSIVE MODE;

CREATE VIEW stored AS
    SELECT h.tenant AS tenant, h.kind AS kind, v.bytes AS bytes
    FROM holdings AS h JOIN volumes AS v ON v.id = h.id WHERE h.kind = 'volume'
    UNION ALL
    SELECT h.tenant, h.kind, p.bytes FROM holdings AS h JOIN products AS p ON p.id = h.id WHERE h.kind != 'volume'
    UNION ALL
    SELECT tenant, 'received', bytes FROM intake_objects WHERE file IS NOT NULL
    UNION ALL
    SELECT tenant, 'workitem', bytes FROM workitems
    UNION ALL
    SELECT tenant, 'job', bytes FROM jobs;

-- Rows change all the time; room on the page lets that happen without touching the index.
CREATE TABLE stored_bytes (
    tenant TEXT COLLATE "C" PRIMARY KEY,
    bytes  BIGINT NOT NULL
) WITH (fillfactor = 50);

CREATE TABLE stored_items (
    kind  TEXT COLLATE "C" PRIMARY KEY,
    items BIGINT NOT NULL
) WITH (fillfactor = 50);

INSERT INTO stored_bytes (tenant, bytes) SELECT tenant, sum(bytes) FROM stored GROUP BY tenant;
INSERT INTO stored_items (kind, items)
    SELECT 'volume', count(*) FROM volumes HAVING count(*) > 0
    UNION ALL SELECT kind, count(*) FROM products GROUP BY kind;

-- The tenant stores so many bytes more, or fewer.
CREATE FUNCTION add_stored_bytes(of_tenant TEXT, added BIGINT) RETURNS VOID LANGUAGE plpgsql AS $$
BEGIN
    INSERT INTO stored_bytes AS total VALUES (of_tenant, added)
    ON CONFLICT (tenant) DO UPDATE SET bytes = total.bytes + excluded.bytes;
END $$;

-- Volumes and products: their rows are of all tenants that have them.
CREATE FUNCTION count_content() RETURNS TRIGGER LANGUAGE plpgsql AS $$
DECLARE
    is_volume BOOLEAN := TG_TABLE_NAME = 'volumes';
    its_kind TEXT := 'volume';
    its_id TEXT;
    added BIGINT := 0;
    items_added BIGINT := 0;
BEGIN
    IF TG_OP != 'DELETE' THEN
        its_id := NEW.id;
        added := NEW.bytes;
        items_added := 1;
        IF NOT is_volume THEN
            its_kind := NEW.kind;
        END IF;
    END IF;
    IF TG_OP != 'INSERT' THEN
        its_id := OLD.id;
        added := added - OLD.bytes;
        items_added := items_added - 1;
        IF NOT is_volume THEN
            its_kind := OLD.kind;
        END IF;
    END IF;
    IF items_added != 0 THEN
        INSERT INTO stored_items AS total VALUES (its_kind, items_added)
        ON CONFLICT (kind) DO UPDATE SET items = total.items + excluded.items;
    END IF;
    IF added != 0 THEN
        PERFORM add_stored_bytes(tenant, added) FROM holdings WHERE id = its_id AND (kind = 'volume') = is_volume;
    END IF;
    RETURN NULL;
END $$;
CREATE TRIGGER volume_counted AFTER INSERT OR DELETE OR UPDATE OF bytes ON volumes FOR EACH ROW
    EXECUTE FUNCTION count_content();
-- `product_sized` tells the bytes from the files.
CREATE TRIGGER product_counted AFTER INSERT OR DELETE OR UPDATE OF files, bytes ON products FOR EACH ROW
    EXECUTE FUNCTION count_content();

-- What a tenant has of them.
CREATE FUNCTION count_holding() RETURNS TRIGGER LANGUAGE plpgsql AS $$
BEGIN
    IF TG_OP != 'INSERT' THEN
        PERFORM add_stored_bytes(OLD.tenant, -bytes) FROM volumes WHERE id = OLD.id AND OLD.kind = 'volume';
        PERFORM add_stored_bytes(OLD.tenant, -bytes) FROM products WHERE id = OLD.id AND OLD.kind != 'volume';
    END IF;
    IF TG_OP != 'DELETE' THEN
        PERFORM add_stored_bytes(NEW.tenant, bytes) FROM volumes WHERE id = NEW.id AND NEW.kind = 'volume';
        PERFORM add_stored_bytes(NEW.tenant, bytes) FROM products WHERE id = NEW.id AND NEW.kind != 'volume';
    END IF;
    RETURN NULL;
END $$;
CREATE TRIGGER holding_counted AFTER INSERT OR DELETE OR UPDATE OF tenant, id, kind ON holdings FOR EACH ROW
    EXECUTE FUNCTION count_holding();

-- What is no item.
CREATE FUNCTION count_received() RETURNS TRIGGER LANGUAGE plpgsql AS $$
BEGIN
    IF TG_OP != 'INSERT' AND OLD.file IS NOT NULL THEN
        PERFORM add_stored_bytes(OLD.tenant, -OLD.bytes);
    END IF;
    IF TG_OP != 'DELETE' AND NEW.file IS NOT NULL THEN
        PERFORM add_stored_bytes(NEW.tenant, NEW.bytes);
    END IF;
    RETURN NULL;
END $$;
CREATE TRIGGER received_counted AFTER INSERT OR DELETE OR UPDATE OF tenant, file, bytes ON intake_objects FOR EACH ROW
    EXECUTE FUNCTION count_received();

CREATE FUNCTION count_record() RETURNS TRIGGER LANGUAGE plpgsql AS $$
BEGIN
    IF TG_OP != 'INSERT' THEN
        PERFORM add_stored_bytes(OLD.tenant, -OLD.bytes);
    END IF;
    IF TG_OP != 'DELETE' THEN
        PERFORM add_stored_bytes(NEW.tenant, NEW.bytes);
    END IF;
    RETURN NULL;
END $$;
CREATE TRIGGER workitem_counted AFTER INSERT OR DELETE OR UPDATE OF tenant, attributes ON workitems FOR EACH ROW
    EXECUTE FUNCTION count_record();
CREATE TRIGGER job_counted
    AFTER INSERT OR DELETE OR UPDATE OF tenant, parameters, needs, labels, external_id, webhook, source, send ON jobs
    FOR EACH ROW EXECUTE FUNCTION count_record();
