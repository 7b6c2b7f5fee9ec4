-- Comparisons and normal limits are products like segmentations. Only the list of kinds changes; see migration 15.

PRAGMA writable_schema = ON;
UPDATE sqlite_schema SET sql = replace(sql, '''beat'')', '''beat'', ''comparison'', ''normals'')')
WHERE type = 'table' AND name IN ('products', 'holdings');
PRAGMA writable_schema = RESET;

-- Any change of the schema tells other connections to read it again.
CREATE TABLE comparisons_begin (id INTEGER) STRICT;
DROP TABLE comparisons_begin;
