"""Forest generations: what a build made, written beside the one in use and swapped in within one transaction."""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from erag.core.types import Cluster, Observation
from erag.memory.database import Database

Array = npt.NDArray[Any]
_DTYPES = frozenset({"int64", "int8", "float64", "float32", "bool"})


@dataclass(frozen=True, slots=True)
class Seen:
    """What a captioner saw in a node's image. `caption` None: the node's own is left aside, and there is no other."""

    caption: str | None
    objects: tuple[str, ...] = ()


@dataclass(frozen=True)
class Generation:
    """One built forest: the revision of the observations it was built from, its resolved configuration (JSON), the
    identity of the embedder, its report (lines), arrays by name, clusters, and by node id what a captioner saw."""

    revision: int
    config: str
    embedder: str
    report: tuple[str, ...]
    arrays: Mapping[str, Array]
    clusters: tuple[Cluster, ...]
    seen: Mapping[str, Seen] = field(default_factory=dict)

    def shown(self, node: Observation) -> Observation:
        """A node as this build took it: with the caption and the objects a captioner saw, where one looked."""
        return shown(node, self.seen)


def shown(node: Observation, seen: Mapping[str, Seen]) -> Observation:
    """A node with what was seen in its image."""
    if node.id not in seen:
        return node
    return replace(node, caption=seen[node.id].caption, objects=seen[node.id].objects)


class Generations:
    """The forest of a memory file."""

    def __init__(self, db: Database) -> None:
        self._db = db

    def swap_in(self, new: Generation, also: Callable[[sqlite3.Connection], None]) -> None:
        """Make `new` the generation in use and drop the old one; `also` runs in the same transaction."""
        with self._db.transaction() as connection:
            for table in ("generation_arrays", "clusters", "seen", "generations"):
                connection.execute(f"DELETE FROM {table}")  # noqa: S608 (constants)
            cursor = connection.execute(
                "INSERT INTO generations (revision, config, embedder, report, built) VALUES (?, ?, ?, ?, ?)",
                (new.revision, new.config, new.embedder, json.dumps(new.report), time.time()),
            )
            number = int(cursor.lastrowid or 0)
            connection.executemany(
                "INSERT INTO generation_arrays VALUES (?, ?, ?, ?, ?)",
                [
                    (number, name, a.dtype.name, json.dumps(a.shape), np.ascontiguousarray(a).tobytes())
                    for name, a in new.arrays.items()
                ],
            )
            connection.executemany(
                f"INSERT INTO clusters VALUES ({', '.join('?' * 13)})",  # noqa: S608 (constants)
                [(number, row, *_to_row(c)) for row, c in enumerate(new.clusters)],
            )
            connection.executemany(
                "INSERT INTO seen VALUES (?, ?, ?, ?)",
                [(number, node, s.caption, json.dumps(s.objects)) for node, s in new.seen.items()],
            )
            also(connection)

    def load(self) -> Generation | None:
        """The generation in use, None before the first build."""
        found = self._db.rows("SELECT id, revision, config, embedder, report FROM generations ORDER BY id DESC LIMIT 1")
        if not found:
            return None
        number, revision, config, embedder, report = found[0]
        arrays = self._db.rows("SELECT name, dtype, shape, data FROM generation_arrays WHERE generation = ?", (number,))
        clusters = self._db.rows(
            """SELECT id, level, members, x, y, z, mean_distance, name, summary, relationships, sensors
               FROM clusters WHERE generation = ? ORDER BY row""",
            (number,),
        )
        return Generation(
            revision, config, embedder, tuple(json.loads(report)),
            {name: _array(dtype, shape, data) for name, dtype, shape, data in arrays},
            tuple(_from_row(row) for row in clusters), self._seen(number),
        )  # fmt: skip

    def _seen(self, number: int) -> dict[str, Seen]:
        rows = self._db.rows("SELECT node, caption, objects FROM seen WHERE generation = ? ORDER BY node", (number,))
        return {node: Seen(caption, tuple(json.loads(objects))) for node, caption, objects in rows}

    def meta(self) -> tuple[int, str] | None:
        """Revision and resolved configuration of the generation in use, without its arrays."""
        found = self._db.rows("SELECT revision, config FROM generations ORDER BY id DESC LIMIT 1")
        return (int(found[0][0]), str(found[0][1])) if found else None


def _array(dtype: str, shape: str, data: bytes) -> Array:
    if dtype not in _DTYPES:
        raise ValueError(f"array of type {dtype!r} in a memory file")
    return np.frombuffer(data, np.dtype(dtype)).reshape(json.loads(shape))


def _to_row(c: Cluster) -> Sequence[Any]:
    texts = (c.name, c.summary, json.dumps(c.relationships), json.dumps(dict(sorted(c.sensors.items()))))
    return (c.id, c.level, json.dumps(c.members), *c.position, c.mean_distance, *texts)


def _from_row(row: Sequence[Any]) -> Cluster:
    id_, level, members, x, y, z, mean_distance, name, summary, relationships, sensors = row
    return Cluster(
        id_, level, tuple(json.loads(members)), (x, y, z), mean_distance, name, summary,
        tuple(json.loads(relationships)), json.loads(sensors),
    )  # fmt: skip
