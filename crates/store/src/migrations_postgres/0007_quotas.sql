-- Everything that a tenant stores counts against its quota; see SQLite's migration 21.
ALTER TABLE products ADD COLUMN bytes BIGINT NOT NULL DEFAULT 0;

UPDATE products SET bytes =
    (SELECT coalesce(sum((file ->> 'bytes')::BIGINT), 0) FROM json_array_elements(files::JSON) AS file);

CREATE FUNCTION product_sized() RETURNS TRIGGER LANGUAGE plpgsql AS $$
BEGIN
    NEW.bytes := (SELECT coalesce(sum((file ->> 'bytes')::BIGINT), 0)
                  FROM json_array_elements(NEW.files::JSON) AS file);
    RETURN NEW;
END
$$;
CREATE TRIGGER product_sized BEFORE INSERT OR UPDATE OF files ON products
    FOR EACH ROW EXECUTE FUNCTION product_sized();

ALTER TABLE workitems ADD COLUMN bytes BIGINT GENERATED ALWAYS AS (octet_length(attributes)) STORED;
-- Pages of items are bounded in bytes, which are read from the indexes alone.
CREATE INDEX workitems_by_size ON workitems (tenant, sequence, bytes);
DROP INDEX workitems_by_state;
CREATE INDEX workitems_by_state ON workitems (tenant, state, sequence, bytes);

ALTER TABLE jobs ADD COLUMN storage_limit BIGINT;
