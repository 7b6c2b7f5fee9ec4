-- Readings are products, keys may sign them, and what a reader wrote goes from the job when the reading goes.
--
-- SQLite cannot change a CHECK: its text in the schema is replaced, as https://sqlite.org/lang_altertable.html has it for
-- changes under which every row stays valid. A table that comes and goes tells other connections to read the schema again.

PRAGMA writable_schema = ON;
UPDATE sqlite_schema SET sql = replace(sql, '''serial'', ''normals''', '''serial'', ''reading'', ''normals''')
WHERE type = 'table' AND name IN ('products', 'holdings');
UPDATE sqlite_schema SET sql = replace(sql, '''submit'', ''admin''', '''submit'', ''sign'', ''admin''')
WHERE type = 'table' AND name = 'api_keys';
PRAGMA writable_schema = RESET;
CREATE TABLE schema_changed (id INTEGER PRIMARY KEY) STRICT;
DROP TABLE schema_changed;

CREATE INDEX jobs_of_readings ON jobs (result) WHERE kind = 'reading';

CREATE TRIGGER reading_forgotten AFTER DELETE ON holdings WHEN OLD.kind = 'reading' BEGIN
    UPDATE jobs SET parameters = json_remove(parameters, '$.reader', '$.limits', '$.impression')
    WHERE kind = 'reading' AND result = OLD.id AND tenant = OLD.tenant;
END;
