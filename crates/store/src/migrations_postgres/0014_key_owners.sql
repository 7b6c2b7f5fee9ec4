-- The subject of the OpenID Connect issuer whose key it is; see SQLite's migration of the same name.
ALTER TABLE api_keys ADD COLUMN owner TEXT COLLATE "C";

UPDATE api_keys SET owner = (
    SELECT agent FROM audit
    WHERE object = api_keys.id AND json_field(event, 'activity') = 'key-created' AND agent != 'anonymous'
    ORDER BY sequence LIMIT 1)
WHERE maker = '';
