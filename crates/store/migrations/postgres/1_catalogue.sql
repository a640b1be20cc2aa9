-- Ids are compared byte by byte.
CREATE TABLE records (
    number bigint GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    kind smallint NOT NULL,
    id text COLLATE "C" NOT NULL,
    created_ms bigint NOT NULL,
    phase smallint NOT NULL,
    meta bytea NOT NULL,
    outcome bytea,
    completion bytea,
    announcement bytea,
    damage text,
    attempts bigint NOT NULL DEFAULT 0,
    declared bigint,
    reached bigint NOT NULL DEFAULT 0,
    UNIQUE (kind, id)
);

-- Cages of frames that were stored together. What they count with is summed, not kept in the record: that would have appends wait for each other.
CREATE TABLE chunks (
    number bigint PRIMARY KEY,
    record bigint NOT NULL,
    counted bigint NOT NULL,
    bytes bytea NOT NULL
);
-- Cages do not compress, and so a part of them is read alone.
ALTER TABLE chunks ALTER COLUMN bytes SET STORAGE EXTERNAL;
CREATE INDEX chunks_of_record ON chunks (record) INCLUDE (counted);

-- Who appends takes a block of numbers at a time.
CREATE SEQUENCE chunk_numbers AS bigint INCREMENT BY 1024;

CREATE TABLE frames (
    record bigint NOT NULL,
    frame bigint NOT NULL,
    chunk bigint NOT NULL,
    place bigint NOT NULL,
    bytes bigint NOT NULL,
    cage_crc bigint NOT NULL,
    l2 real NOT NULL,
    linf real NOT NULL,
    squared double precision NOT NULL,
    spread double precision NOT NULL,
    handle_digest bytea NOT NULL,
    full_digest bytea,
    crc bigint NOT NULL,
    PRIMARY KEY (record, frame)
);

-- One row: the version of these tables, the folder with the files of its records, how often a process has taken it for itself, and when it was last tried
-- to write.
CREATE TABLE catalogue (
    version bigint NOT NULL,
    folder text,
    taken bigint NOT NULL DEFAULT 0,
    probed timestamptz NOT NULL DEFAULT now()
);
INSERT INTO catalogue (version) VALUES (1);
