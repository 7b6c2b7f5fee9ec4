-- Everything that a tenant stores counts against its quota (store/tables/access.rs): the size of a product's files and
-- of a work item are columns of their own, so that adding them up reads no document.
ALTER TABLE products ADD COLUMN bytes INTEGER NOT NULL DEFAULT 0;

UPDATE products SET bytes =
    (SELECT coalesce(sum(json_extract(file.value, '$.bytes')), 0) FROM json_each(products.files) AS file);

CREATE TRIGGER product_sized AFTER INSERT ON products BEGIN
    UPDATE products SET bytes =
        (SELECT coalesce(sum(json_extract(file.value, '$.bytes')), 0) FROM json_each(NEW.files) AS file)
    WHERE id = NEW.id;
END;
CREATE TRIGGER product_resized AFTER UPDATE OF files ON products BEGIN
    UPDATE products SET bytes =
        (SELECT coalesce(sum(json_extract(file.value, '$.bytes')), 0) FROM json_each(NEW.files) AS file)
    WHERE id = NEW.id;
END;

ALTER TABLE workitems ADD COLUMN bytes INTEGER GENERATED ALWAYS AS (length(CAST(attributes AS BLOB))) VIRTUAL;
-- Pages of items are bounded in bytes, which are read from the indexes alone.
CREATE INDEX workitems_by_size ON workitems (tenant, sequence, bytes);
DROP INDEX workitems_by_state;
CREATE INDEX workitems_by_state ON workitems (tenant, state, sequence, bytes);

-- What the tenant may store in all when the job's result is added; NULL is no bound.
ALTER TABLE jobs ADD COLUMN storage_limit INTEGER;
