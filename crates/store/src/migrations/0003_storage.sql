-- One row, written to find out whether the database can be written again after a write failed.

CREATE TABLE probe (
    id    INTEGER PRIMARY KEY CHECK (id = 1),
    count INTEGER NOT NULL
) STRICT;

INSERT INTO probe VALUES (1, 0);

-- A volume's files with size and SHA-256. Of volumes stored by older versions, a single file's
-- id begins the hash; the hashes of several files are added when their content is first verified.
UPDATE volumes SET files =
    (SELECT json_group_array(json_object(
        'name', name.value,
        'bytes', iif(json_array_length(volumes.files) = 1, volumes.bytes, 0),
        'sha256', iif(json_array_length(volumes.files) = 1, substr(volumes.id, 5), '')))
     FROM json_each(volumes.files) AS name);
