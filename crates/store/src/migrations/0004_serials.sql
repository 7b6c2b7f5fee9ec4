-- Serial comparisons are products.
--
-- SQLite cannot change a CHECK: its text in the schema is replaced, as https://sqlite.org/lang_altertable.html has it for
-- changes under which every row stays valid. A table that comes and goes tells other connections to read the schema again.

PRAGMA writable_schema = ON;
UPDATE sqlite_schema SET sql = replace(sql, '''comparison'', ''normals''', '''comparison'', ''serial'', ''normals''')
WHERE type = 'table' AND name IN ('products', 'holdings');
PRAGMA writable_schema = RESET;
CREATE TABLE schema_changed (id INTEGER PRIMARY KEY) STRICT;
DROP TABLE schema_changed;
