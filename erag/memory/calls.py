"""Call records and vectors of a memory file: the `CallStore` behind a journal."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from erag.core.types import IntArray
from erag.lm.callfile import Halves, Record, Source
from erag.lm.journal import Key
from erag.lm.roles import ROLES, RoleName, Vectors
from erag.memory.database import Database, undamaged

KEY_BYTES = 16
Place = tuple[int, int]  # block and row of a stored vector


class Calls:
    """Results and attempts of model calls; vectors lie in the blocks they were computed in, as float16."""

    def __init__(self, db: Database) -> None:
        self._db = db
        self._index: dict[Key, Place] = {}
        self._indexed = False

    def results(self, keys: Sequence[Key]) -> dict[Key, str]:
        found: dict[Key, str] = {}
        for key in dict.fromkeys(keys):
            if rows := self._db.rows("SELECT result FROM call_results WHERE key = ?", (key,)):
                found[key] = rows[0][0]
        return found

    def vectors(self, keys: Sequence[Key]) -> dict[Key, Vectors]:
        places = self.places(keys)
        known = [key for key in dict.fromkeys(keys) if key in places]
        rows = self.read_vectors(np.array([places[k] for k in known], np.int64).reshape(-1, 2))
        return dict(zip(known, rows, strict=True))

    def places(self, keys: Sequence[Key]) -> dict[Key, Place]:
        """Where the recorded vectors among `keys` lie."""
        if not self._indexed:
            for block, raw in self._db.rows("SELECT block, keys FROM vectors ORDER BY block"):
                self._note(block, [raw[i : i + KEY_BYTES] for i in range(0, len(raw), KEY_BYTES)])
            self._indexed = True
        return {key: self._index[key] for key in keys if key in self._index}

    def read_vectors(self, places: IntArray, dim: int = 0) -> Vectors:
        """(n, d) float32 unit rows for places (n, 2); a place (-1, -1) gives a row of zeros.

        `dim` is the width where no place names a vector.
        """
        blocks = {int(b) for b in np.unique(places[:, 0]) if b >= 0}
        loaded: dict[int, Vectors] = {}
        for block in sorted(blocks):
            ((width, data),) = self._db.rows("SELECT dim, data FROM vectors WHERE block = ?", (block,))
            loaded[block] = _unit(np.frombuffer(data, np.float16).reshape(-1, width).astype(np.float32))
        dim = max((v.shape[1] for v in loaded.values()), default=dim)
        out = np.zeros((len(places), dim), np.float32)
        for block, vectors in loaded.items():
            here = np.flatnonzero(places[:, 0] == block)
            out[here] = vectors[places[here, 1]]
        return out

    def begin(self, role: RoleName, fingerprint: str, keys: Sequence[Key]) -> int:
        with self._db.transaction() as connection:
            cursor = connection.execute(
                "INSERT INTO call_batches (role, fingerprint, started, status) VALUES (?, ?, ?, 'started')",
                (role, fingerprint, time.time()),
            )
            batch = int(cursor.lastrowid or 0)
            connection.executemany("INSERT INTO call_attempts VALUES (?, ?)", [(key, batch) for key in keys])
        return batch

    def finish(self, batch: int, records: Mapping[Key, tuple[str, str]]) -> None:
        with self._db.transaction() as connection:
            connection.executemany(
                """INSERT INTO call_results SELECT ?, role, fingerprint, ?, ? FROM call_batches WHERE batch = ?""",
                [(key, request, result, batch) for key, (request, result) in records.items()],
            )
            connection.execute(
                "UPDATE call_batches SET status = 'done', finished = ? WHERE batch = ?", (time.time(), batch)
            )

    def finish_vectors(self, batch: int, keys: Sequence[Key], vectors: Vectors) -> None:
        data = np.ascontiguousarray(vectors, np.float16).tobytes()
        with self._db.transaction() as connection:
            cursor = connection.execute(
                """INSERT INTO vectors (fingerprint, dim, keys, data)
                   SELECT fingerprint, ?, ?, ? FROM call_batches WHERE batch = ?""",
                (vectors.shape[1], b"".join(keys), data, batch),
            )
            block = int(cursor.lastrowid or 0)
            connection.execute(
                "UPDATE call_batches SET status = 'done', finished = ? WHERE batch = ?", (time.time(), batch)
            )
        self._note(block, keys)

    def fail(self, batch: int, error: str) -> None:
        with self._db.transaction() as connection:
            connection.execute(
                "UPDATE call_batches SET status = 'failed', finished = ?, error = ? WHERE batch = ?",
                (time.time(), error, batch),
            )

    def records(
        self, roles: Collection[RoleName] = ROLES, identities: Mapping[str, str] | None = None
    ) -> Iterator[Record]:
        """Every recorded call of some roles; `identities` are those known of embedders, by fingerprint."""
        known = identities or {}
        if "embed" in roles:
            for fingerprint, width, keys, data in self._db.rows("SELECT fingerprint, dim, keys, data FROM vectors"):
                source = Source("embed", fingerprint, known.get(fingerprint, ""))
                rows = np.frombuffer(data, np.float16).reshape(-1, width)
                yield from (Record(source, keys[i * KEY_BYTES :][:KEY_BYTES], vector=row) for i, row in enumerate(rows))
        columns = "key, role, fingerprint, request, result"
        for key, role, fingerprint, request, result in self._db.rows(f"SELECT {columns} FROM call_results"):  # noqa: S608
            if role in roles:
                yield Record(Source(role, fingerprint), key, request, result)

    def adopt(self, records: Sequence[Record]) -> int:
        """Take records over, all or none; how many were new. What is recorded already stays as it is."""
        with undamaged(self._db.path):
            texts = [r for r in records if r.vector is None]
            have = self.results([r.key for r in texts])
            new = {r.key: r for r in texts if r.key not in have}
            vectors = self._unknown([r for r in records if r.vector is not None])
            with self._db.transaction() as connection:
                connection.executemany(
                    "INSERT INTO call_results VALUES (?, ?, ?, ?, ?)",
                    [(r.key, r.source.role, r.source.fingerprint, r.request, r.result) for r in new.values()],
                )
                for (fingerprint, width), rows in vectors.items():
                    keys, data = b"".join(rows), np.stack(list(rows.values())).tobytes()
                    connection.execute(
                        "INSERT INTO vectors (fingerprint, dim, keys, data) VALUES (?, ?, ?, ?)",
                        (fingerprint, width, keys, data),
                    )
        self._index, self._indexed = {}, False
        return len(new) + sum(map(len, vectors.values()))

    def _unknown(self, records: Sequence[Record]) -> dict[tuple[str, int], dict[Key, Halves]]:
        """The vectors (d,) float16 that are not recorded yet, by fingerprint and width."""
        places = self.places([r.key for r in records])
        found: dict[tuple[str, int], dict[Key, Halves]] = {}
        for record in records:
            if record.vector is not None and record.key not in places:
                row = np.ascontiguousarray(record.vector, np.float16)
                found.setdefault((record.source.fingerprint, len(row)), {})[record.key] = row
        return found

    def _note(self, block: int, keys: Sequence[Key]) -> None:
        self._index.update({key: (block, row) for row, key in enumerate(keys)})


def _unit(vectors: Vectors) -> Vectors:
    norms = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(norms > 0, norms, 1), np.float32)
