-- What the store must not forget with one of its other tables, by name:
--   store      identity of this database, which the note beside it repeats
--   access     'open': callers without credentials were never refused; 'closed'; 'opened TIME': by the operator, on purpose
--   kept_head  'SEQUENCE:HASH' of an audit row that another place names and the trail lacked
CREATE TABLE store_marks (
    name  TEXT PRIMARY KEY,
    value TEXT NOT NULL
) STRICT, WITHOUT ROWID;
