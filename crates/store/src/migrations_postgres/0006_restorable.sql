-- pg_restore fills tables with an empty search path. A function of a generated column that calls another one of this
-- schema is not found then, and the rows are lost: this one now calls none.
CREATE OR REPLACE FUNCTION json_field(document TEXT, field TEXT) RETURNS TEXT
LANGUAGE sql IMMUTABLE STRICT PARALLEL SAFE AS $$ SELECT replace(document, '\u0000', '\ufffd')::json ->> field $$;
