-- Readers' profiles are products like templates: they have no volume. Only the list of kinds changes. It is
-- changed in the schema itself, so that whatever else belongs to these tables stays as it is
-- (https://www.sqlite.org/lang_altertable.html, "Making Other Kinds Of Table Schema Changes").

PRAGMA writable_schema = ON;
UPDATE sqlite_schema SET sql = replace(sql, '''template'')', '''template'', ''reader'')')
WHERE type = 'table' AND name IN ('products', 'holdings');
PRAGMA writable_schema = RESET;

-- Any change of the schema tells other connections to read it again.
CREATE TABLE readers_begin (id INTEGER) STRICT;
DROP TABLE readers_begin;
