-- Running totals of what is stored, on SQLite; those on PostgreSQL stand in ../migrations_postgres/0002_totals.sql.
--
-- A quota is compared with all that a tenant stores, before every job, upload and result, within the transaction that
-- writes. Adding it up took time that grew with what is stored: 0.1 s at 1000 studies and 2 s at 100,000. So triggers
-- keep the totals as rows, and the time is the same however much is stored. The same holds for the counts of items that
-- /metrics tells.
--
-- The totals follow from the other tables: the view `stored` has a row for each thing that counts, and whoever doubts
-- the totals compares them with its sums (`ventriform doctor`), or makes them anew from it, as this file does.

-- What counts against the quota of each tenant: volumes and products that it has, received objects that are not part of
-- a volume yet, work items, and the records of jobs.
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

-- The bytes in `stored` by tenant. A tenant whose row is missing stores nothing, and so does one with 0.
CREATE TABLE stored_bytes (
    tenant TEXT PRIMARY KEY,
    bytes  INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

-- The number of items by kind, each counted once however many tenants have it; 'volume' are the rows of `volumes`, the
-- others those of `products`.
CREATE TABLE stored_items (
    kind  TEXT PRIMARY KEY,
    items INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

INSERT INTO stored_bytes (tenant, bytes) SELECT tenant, sum(bytes) FROM stored GROUP BY tenant;
INSERT INTO stored_items (kind, items)
    SELECT 'volume', count(*) FROM volumes HAVING count(*) > 0
    UNION ALL SELECT kind, count(*) FROM products GROUP BY kind;

-- Volumes and products: their rows are of all tenants that have them. Without the sign, SQLite would look for the few
-- owners of a volume among all volumes.
CREATE TRIGGER volume_counted AFTER INSERT ON volumes BEGIN
    INSERT INTO stored_items VALUES ('volume', 1) ON CONFLICT (kind) DO UPDATE SET items = items + 1;
    INSERT INTO stored_bytes SELECT tenant, NEW.bytes FROM holdings WHERE id = NEW.id AND +kind = 'volume'
    ON CONFLICT (tenant) DO UPDATE SET bytes = bytes + excluded.bytes;
END;
CREATE TRIGGER volume_discounted AFTER DELETE ON volumes BEGIN
    UPDATE stored_items SET items = items - 1 WHERE kind = 'volume';
    UPDATE stored_bytes SET bytes = bytes - OLD.bytes
    WHERE tenant IN (SELECT tenant FROM holdings WHERE id = OLD.id AND +kind = 'volume');
END;
CREATE TRIGGER volume_recounted AFTER UPDATE OF bytes ON volumes WHEN NEW.bytes != OLD.bytes BEGIN
    UPDATE stored_bytes SET bytes = bytes + NEW.bytes - OLD.bytes
    WHERE tenant IN (SELECT tenant FROM holdings WHERE id = NEW.id AND +kind = 'volume');
END;
CREATE TRIGGER product_counted AFTER INSERT ON products BEGIN
    INSERT INTO stored_items VALUES (NEW.kind, 1) ON CONFLICT (kind) DO UPDATE SET items = items + 1;
    INSERT INTO stored_bytes SELECT tenant, NEW.bytes FROM holdings WHERE id = NEW.id AND kind != 'volume'
    ON CONFLICT (tenant) DO UPDATE SET bytes = bytes + excluded.bytes;
END;
CREATE TRIGGER product_discounted AFTER DELETE ON products BEGIN
    UPDATE stored_items SET items = items - 1 WHERE kind = OLD.kind;
    UPDATE stored_bytes SET bytes = bytes - OLD.bytes
    WHERE tenant IN (SELECT tenant FROM holdings WHERE id = OLD.id AND kind != 'volume');
END;
-- Also of a new one: `product_sized` tells its bytes after it is inserted.
CREATE TRIGGER product_recounted AFTER UPDATE OF bytes ON products WHEN NEW.bytes != OLD.bytes BEGIN
    UPDATE stored_bytes SET bytes = bytes + NEW.bytes - OLD.bytes
    WHERE tenant IN (SELECT tenant FROM holdings WHERE id = NEW.id AND kind != 'volume');
END;

-- What a tenant has of them.
CREATE TRIGGER holding_counted AFTER INSERT ON holdings BEGIN
    INSERT INTO stored_bytes
    SELECT NEW.tenant, bytes FROM volumes WHERE id = NEW.id AND NEW.kind = 'volume'
    UNION ALL SELECT NEW.tenant, bytes FROM products WHERE id = NEW.id AND NEW.kind != 'volume'
    ON CONFLICT (tenant) DO UPDATE SET bytes = bytes + excluded.bytes;
END;
CREATE TRIGGER holding_discounted AFTER DELETE ON holdings BEGIN
    UPDATE stored_bytes SET bytes = bytes - coalesce(CASE OLD.kind
        WHEN 'volume' THEN (SELECT bytes FROM volumes WHERE id = OLD.id)
        ELSE (SELECT bytes FROM products WHERE id = OLD.id) END, 0)
    WHERE tenant = OLD.tenant;
END;
CREATE TRIGGER holding_recounted AFTER UPDATE OF tenant, id, kind ON holdings BEGIN
    UPDATE stored_bytes SET bytes = bytes - coalesce(CASE OLD.kind
        WHEN 'volume' THEN (SELECT bytes FROM volumes WHERE id = OLD.id)
        ELSE (SELECT bytes FROM products WHERE id = OLD.id) END, 0)
    WHERE tenant = OLD.tenant;
    INSERT INTO stored_bytes
    SELECT NEW.tenant, bytes FROM volumes WHERE id = NEW.id AND NEW.kind = 'volume'
    UNION ALL SELECT NEW.tenant, bytes FROM products WHERE id = NEW.id AND NEW.kind != 'volume'
    ON CONFLICT (tenant) DO UPDATE SET bytes = bytes + excluded.bytes;
END;

-- What is no item.
CREATE TRIGGER received_counted AFTER INSERT ON intake_objects WHEN NEW.file IS NOT NULL BEGIN
    INSERT INTO stored_bytes VALUES (NEW.tenant, NEW.bytes)
    ON CONFLICT (tenant) DO UPDATE SET bytes = bytes + excluded.bytes;
END;
CREATE TRIGGER received_discounted AFTER DELETE ON intake_objects WHEN OLD.file IS NOT NULL BEGIN
    UPDATE stored_bytes SET bytes = bytes - OLD.bytes WHERE tenant = OLD.tenant;
END;
CREATE TRIGGER received_recounted AFTER UPDATE OF tenant, file, bytes ON intake_objects BEGIN
    UPDATE stored_bytes SET bytes = bytes - iif(OLD.file IS NULL, 0, OLD.bytes) WHERE tenant = OLD.tenant;
    INSERT INTO stored_bytes VALUES (NEW.tenant, iif(NEW.file IS NULL, 0, NEW.bytes))
    ON CONFLICT (tenant) DO UPDATE SET bytes = bytes + excluded.bytes;
END;

CREATE TRIGGER workitem_counted AFTER INSERT ON workitems BEGIN
    INSERT INTO stored_bytes VALUES (NEW.tenant, NEW.bytes)
    ON CONFLICT (tenant) DO UPDATE SET bytes = bytes + excluded.bytes;
END;
CREATE TRIGGER workitem_discounted AFTER DELETE ON workitems BEGIN
    UPDATE stored_bytes SET bytes = bytes - OLD.bytes WHERE tenant = OLD.tenant;
END;
CREATE TRIGGER workitem_recounted AFTER UPDATE OF tenant, attributes ON workitems BEGIN
    UPDATE stored_bytes SET bytes = bytes - OLD.bytes WHERE tenant = OLD.tenant;
    INSERT INTO stored_bytes VALUES (NEW.tenant, NEW.bytes)
    ON CONFLICT (tenant) DO UPDATE SET bytes = bytes + excluded.bytes;
END;

CREATE TRIGGER job_counted AFTER INSERT ON jobs BEGIN
    INSERT INTO stored_bytes VALUES (NEW.tenant, NEW.bytes)
    ON CONFLICT (tenant) DO UPDATE SET bytes = bytes + excluded.bytes;
END;
CREATE TRIGGER job_discounted AFTER DELETE ON jobs BEGIN
    UPDATE stored_bytes SET bytes = bytes - OLD.bytes WHERE tenant = OLD.tenant;
END;
-- The columns of which `bytes` is made. Claims, progress and ends change none of them.
CREATE TRIGGER job_recounted
AFTER UPDATE OF tenant, parameters, needs, labels, external_id, webhook, source, send ON jobs BEGIN
    UPDATE stored_bytes SET bytes = bytes - OLD.bytes WHERE tenant = OLD.tenant;
    INSERT INTO stored_bytes VALUES (NEW.tenant, NEW.bytes)
    ON CONFLICT (tenant) DO UPDATE SET bytes = bytes + excluded.bytes;
END;
