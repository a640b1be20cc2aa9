CREATE TABLE records (
    number INTEGER PRIMARY KEY,
    kind INTEGER NOT NULL,
    id TEXT NOT NULL,
    created_ms INTEGER NOT NULL,
    phase INTEGER NOT NULL,
    meta BLOB NOT NULL,
    outcome BLOB,
    completion BLOB,
    announcement BLOB,
    damage TEXT,
    attempts INTEGER NOT NULL DEFAULT 0,
    declared INTEGER,
    reached INTEGER NOT NULL DEFAULT 0,
    frame_bytes INTEGER NOT NULL DEFAULT 0,
    UNIQUE (kind, id)
) STRICT;

-- Cages of frames that were stored together.
CREATE TABLE chunks (
    number INTEGER PRIMARY KEY,
    record INTEGER NOT NULL,
    bytes BLOB NOT NULL
) STRICT;
CREATE INDEX chunks_of_record ON chunks (record);

-- What is not a number is kept as NULL.
CREATE TABLE frames (
    record INTEGER NOT NULL,
    frame INTEGER NOT NULL,
    chunk INTEGER NOT NULL,
    place INTEGER NOT NULL,
    bytes INTEGER NOT NULL,
    cage_crc INTEGER NOT NULL,
    l2 REAL,
    linf REAL,
    squared REAL,
    spread REAL,
    handle_digest BLOB NOT NULL,
    full_digest BLOB,
    crc INTEGER NOT NULL,
    PRIMARY KEY (record, frame)
) STRICT, WITHOUT ROWID;
