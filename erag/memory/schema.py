"""The tables of a memory file and their version."""

APPLICATION_ID = 0x45524147  # "ERAG", in the SQLite header
VERSION = 2

TABLES = """
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;

CREATE TABLE sources (
    name TEXT PRIMARY KEY, root TEXT NOT NULL, sensors TEXT NOT NULL, notes TEXT NOT NULL, issues TEXT NOT NULL
) WITHOUT ROWID;

-- `seq` is the order of arrival and fixes the order of the map; `origin` is the source that was ingested, `source` what
-- the observation itself names; `removed` nodes are no hits and go at the next build.
CREATE TABLE nodes (
    seq INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE, origin TEXT NOT NULL REFERENCES sources (name),
    source TEXT NOT NULL, kind TEXT NOT NULL, x REAL NOT NULL, y REAL NOT NULL, z REAL NOT NULL, yaw REAL,
    start REAL, "end" REAL, image TEXT, name TEXT, caption TEXT, sensors TEXT NOT NULL,
    removed INTEGER NOT NULL DEFAULT 0
);

-- As the sources state them; `a` < `b`.
CREATE TABLE given_edges (
    a TEXT NOT NULL, b TEXT NOT NULL, kind INTEGER NOT NULL, metres REAL, source TEXT NOT NULL,
    PRIMARY KEY (a, b, kind)
) WITHOUT ROWID;

CREATE TABLE given_clusters (
    id TEXT PRIMARY KEY, level INTEGER NOT NULL, members TEXT NOT NULL, name TEXT NOT NULL, summary TEXT NOT NULL,
    relationships TEXT NOT NULL, source TEXT NOT NULL
) WITHOUT ROWID;

-- Vectors in the batches they were computed in: `keys` n x 16 bytes, `data` n x dim float16.
CREATE TABLE vectors (
    block INTEGER PRIMARY KEY, fingerprint TEXT NOT NULL, dim INTEGER NOT NULL, keys BLOB NOT NULL, data BLOB NOT NULL
);

CREATE TABLE call_results (
    key BLOB PRIMARY KEY, role TEXT NOT NULL, fingerprint TEXT NOT NULL, request TEXT NOT NULL, result TEXT NOT NULL
) WITHOUT ROWID;

CREATE TABLE call_batches (
    batch INTEGER PRIMARY KEY, role TEXT NOT NULL, fingerprint TEXT NOT NULL, started REAL NOT NULL, finished REAL,
    status TEXT NOT NULL CHECK (status IN ('started', 'done', 'failed')), error TEXT
);

-- One row for each time a call was tried; a call is finished when its batch is done.
CREATE TABLE call_attempts (
    key BLOB NOT NULL, batch INTEGER NOT NULL REFERENCES call_batches (batch), PRIMARY KEY (key, batch)
) WITHOUT ROWID;

-- The forest in use is the one generation; a new one is built beside it and swapped in.
CREATE TABLE generations (
    id INTEGER PRIMARY KEY AUTOINCREMENT, revision INTEGER NOT NULL, config TEXT NOT NULL, embedder TEXT NOT NULL,
    report TEXT NOT NULL, built REAL NOT NULL
);
CREATE TABLE generation_arrays (
    generation INTEGER NOT NULL REFERENCES generations (id), name TEXT NOT NULL, dtype TEXT NOT NULL,
    shape TEXT NOT NULL, data BLOB NOT NULL, PRIMARY KEY (generation, name)
) WITHOUT ROWID;
CREATE TABLE clusters (
    generation INTEGER NOT NULL REFERENCES generations (id), row INTEGER NOT NULL, id TEXT NOT NULL,
    level INTEGER NOT NULL, members TEXT NOT NULL, x REAL NOT NULL, y REAL NOT NULL, z REAL NOT NULL,
    mean_distance REAL NOT NULL, name TEXT NOT NULL, summary TEXT NOT NULL, relationships TEXT NOT NULL,
    sensors TEXT NOT NULL, PRIMARY KEY (generation, row)
) WITHOUT ROWID;
"""

SEEN = """
-- What a captioner saw: stands in place of the node's own caption, as long as this generation is in use. No `caption`:
-- the node's own is left aside.
CREATE TABLE seen (
    generation INTEGER NOT NULL REFERENCES generations (id), node TEXT NOT NULL, caption TEXT, objects TEXT NOT NULL,
    PRIMARY KEY (generation, node)
) WITHOUT ROWID;

-- The sha256 of each image when it was last read, so that its caption is found when the file is gone.
CREATE TABLE image_hashes (
    origin TEXT NOT NULL, image TEXT NOT NULL, sha256 TEXT NOT NULL, PRIMARY KEY (origin, image)
) WITHOUT ROWID;
"""

TABLES += SEEN
UPGRADES = {1: SEEN}  # version of an older file -> what brings it to the next one
