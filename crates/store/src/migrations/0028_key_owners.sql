-- The subject of the OpenID Connect issuer whose key it is: who made it with a token, or with a key of that subject.
ALTER TABLE api_keys ADD COLUMN owner TEXT;

-- Keys that were made by a token before: the audit trail names the subject. `anonymous` is nobody's name.
UPDATE api_keys SET owner = (
    SELECT agent FROM audit
    WHERE object = api_keys.id AND json_extract(event, '$.activity') = 'key-created' AND agent != 'anonymous'
    ORDER BY sequence LIMIT 1)
WHERE maker = '';
