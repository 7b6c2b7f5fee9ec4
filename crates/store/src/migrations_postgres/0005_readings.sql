-- Readings are products, keys may sign them, and what a reader wrote goes from the job when the reading goes.

ALTER TABLE products DROP CONSTRAINT products_kind_check;
ALTER TABLE products ADD CONSTRAINT products_kind_check CHECK (kind IN
    ('model', 'segmentation', 'template', 'reader', 'beat', 'comparison', 'serial', 'reading', 'normals'));
ALTER TABLE holdings DROP CONSTRAINT holdings_kind_check;
ALTER TABLE holdings ADD CONSTRAINT holdings_kind_check CHECK (kind IN
    ('volume', 'model', 'segmentation', 'template', 'reader', 'beat', 'comparison', 'serial', 'reading', 'normals'));
ALTER TABLE api_keys DROP CONSTRAINT api_keys_scope_check;
ALTER TABLE api_keys ADD CONSTRAINT api_keys_scope_check CHECK (scope IN ('read', 'submit', 'sign', 'admin'));

CREATE INDEX jobs_of_readings ON jobs (result) WHERE kind = 'reading';

CREATE FUNCTION forget_reading() RETURNS TRIGGER LANGUAGE plpgsql AS $$
BEGIN
    UPDATE jobs SET parameters = (parameters::jsonb - 'reader' - 'limits' - 'impression')::text
    WHERE kind = 'reading' AND result = OLD.id AND tenant = OLD.tenant;
    RETURN NULL;
END $$;
CREATE TRIGGER reading_forgotten AFTER DELETE ON holdings FOR EACH ROW
    WHEN (OLD.kind = 'reading') EXECUTE FUNCTION forget_reading();
