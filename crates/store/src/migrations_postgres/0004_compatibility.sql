-- The oldest version of these migrations whose program works on the tables as they are. A migration that only adds
-- leaves it as it is; one that takes away what an older program needs raises it.
CREATE TABLE oldest_program (
    id      BIGINT PRIMARY KEY CHECK (id = 1),
    version BIGINT NOT NULL
);
INSERT INTO oldest_program VALUES (1, 4);
