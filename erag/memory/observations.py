"""What was observed, as stored: sources, nodes, and the edges and clusters the sources state."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from erag.core.errors import InputError
from erag.core.types import EdgeKind, Frame, Interval, Observation, Pose, Range
from erag.data.reading import GivenCluster, GivenEdge, Issue, Reading
from erag.memory.database import Database

_COLUMNS = 'id, origin, source, kind, x, y, z, yaw, start, "end", image, name, caption, sensors'
_INSERT = f"INSERT INTO nodes ({_COLUMNS}) VALUES ({', '.join('?' * 14)})"  # noqa: S608 (constants)
_UPDATE = f"UPDATE nodes SET ({_COLUMNS}, removed) = ({', '.join('?' * 14)}, 0) WHERE id = ?"  # noqa: S608 (constants)


@dataclass(frozen=True, slots=True)
class IngestCounts:
    """What an ingest did to the memory's nodes."""

    added: int
    replaced: int
    unchanged: int


class Observations:
    """The observations of a memory file."""

    def __init__(self, db: Database) -> None:
        self._db = db

    @property
    def frame(self) -> Frame | None:
        """The frame of all positions, None while the memory is empty."""
        value = self._db.value("SELECT value FROM meta WHERE key = 'frame'")
        return Frame(value) if value else None

    @property
    def revision(self) -> int:
        """Counts the changes of the observations; a forest built at another revision is out of date."""
        return int(self._db.value("SELECT value FROM meta WHERE key = 'revision'") or 0)

    def put(self, reading: Reading) -> IngestCounts:
        """Add or replace what a source says, in one transaction.

        Raises InputError, changing nothing, when the frame is not the memory's or an id belongs to another source.
        """
        self._check_frame(reading)
        known = self._known([o.id for o in reading.observations])
        self._check_owner(reading, known)
        self._check_clusters(reading)
        rows = {o.id: _to_row(o, reading.source) for o in reading.observations}
        added = [row for id_, row in rows.items() if id_ not in known]
        replaced = [row for id_, row in rows.items() if id_ in known and known[id_][1] != row]
        with self._db.transaction() as connection:
            _put_source(connection, reading)
            connection.executemany(_INSERT, added)
            connection.executemany(_UPDATE, [(*row, row[0]) for row in replaced])
            stated = _put_edges(connection, reading) + _put_clusters(connection, reading)
            _set_meta(connection, "frame", reading.frame.value)
            if added or replaced or stated:
                _set_meta(connection, "revision", str(self.revision + 1))
        return IngestCounts(len(added), len(replaced), len(rows) - len(added) - len(replaced))

    def remove(self, ids: Sequence[str]) -> int:
        """Take nodes out: they are no hits from now on and leave the map at the next build. Returns how many.

        Raises InputError, changing nothing, when an id is unknown.
        """
        known = self._known(ids)
        if unknown := [i for i in ids if i not in known or not known[i][1]]:
            raise InputError(
                f"no node {unknown[0]!r}", where=str(self._db.path), allowed="an id shown by `erag export` or a query"
            )
        with self._db.transaction() as connection:
            connection.executemany("UPDATE nodes SET removed = 1 WHERE id = ?", [(i,) for i in ids])
            _set_meta(connection, "revision", str(self.revision + 1))
        return len(set(ids))

    def purge(self, connection: sqlite3.Connection) -> None:
        """Delete removed nodes and the edges to them, inside the caller's transaction."""
        for column in ("a", "b"):
            connection.execute(
                f"DELETE FROM given_edges WHERE {column} IN (SELECT id FROM nodes WHERE removed)"  # noqa: S608 (constants)
            )
        connection.execute("DELETE FROM nodes WHERE removed")

    def nodes(self, *, with_removed: bool = False) -> list[Observation]:
        """All nodes in order of arrival."""
        where = "" if with_removed else "WHERE NOT removed"
        return [_from_row(r) for r in self._db.rows(f"SELECT {_COLUMNS} FROM nodes {where} ORDER BY seq")]  # noqa: S608

    def origins(self) -> dict[str, str]:
        """Node id -> the ingested source it came from, whose folder its image path is relative to."""
        return dict(self._db.rows("SELECT id, origin FROM nodes"))

    def removed(self) -> frozenset[str]:
        """Ids of nodes that were removed since the last build."""
        return frozenset(r[0] for r in self._db.rows("SELECT id FROM nodes WHERE removed"))

    def edges(self) -> list[GivenEdge]:
        """The edges the sources state, between nodes that are still there."""
        rows = self._db.rows("SELECT a, b, kind, metres FROM given_edges ORDER BY a, b, kind")
        return [GivenEdge(a, b, EdgeKind(kind), metres) for a, b, kind, metres in rows]

    def clusters(self) -> list[GivenCluster]:
        """The clusters the sources state."""
        rows = self._db.rows(
            "SELECT id, level, members, name, summary, relationships FROM given_clusters ORDER BY level, id"
        )
        return [GivenCluster(i, lv, tuple(json.loads(m)), n, s, tuple(json.loads(r))) for i, lv, m, n, s, r in rows]

    def image_hashes(self) -> dict[tuple[str, str], str]:
        """(origin, image path) -> sha256 (hex) of the file when it was last read."""
        return {(o, i): digest for o, i, digest in self._db.rows("SELECT origin, image, sha256 FROM image_hashes")}

    def put_image_hashes(self, hashes: Mapping[tuple[str, str], str]) -> None:
        """Note the sha256 of images by origin and path, in one transaction."""
        with self._db.transaction() as connection:
            rows = [(*key, digest) for key, digest in sorted(hashes.items())]
            connection.executemany("INSERT OR REPLACE INTO image_hashes VALUES (?, ?, ?)", rows)

    def sensors(self) -> dict[str, Range]:
        """The declared range of each sensor channel; two sources that differ give the wider range."""
        ranges: dict[str, Range] = {}
        for (text,) in self._db.rows("SELECT sensors FROM sources ORDER BY name"):
            for channel, (low, high) in json.loads(text).items():
                seen = ranges.get(channel, (low, high))
                ranges[channel] = (min(seen[0], low), max(seen[1], high))
        return ranges

    def sources(self) -> dict[str, tuple[Path, tuple[str, ...], tuple[Issue, ...]]]:
        """For each source its image folder, notes and the issues of its last reading."""
        rows = self._db.rows("SELECT name, root, notes, issues FROM sources ORDER BY name")
        return {
            name: (Path(root), tuple(json.loads(notes)), tuple(Issue(*i) for i in json.loads(issues)))
            for name, root, notes, issues in rows
        }

    def _known(self, ids: Iterable[str]) -> dict[str, tuple[str, tuple[Any, ...]]]:
        """id -> (origin, stored row) of the ids that exist and are not removed."""
        wanted = set(ids)
        rows = self._db.rows(f"SELECT {_COLUMNS}, removed FROM nodes")  # noqa: S608 (constants)
        return {r[0]: (r[1], (*r[:-1],) if not r[-1] else ()) for r in rows if r[0] in wanted}

    def _check_frame(self, reading: Reading) -> None:
        if self.frame not in (None, reading.frame):
            raise InputError(
                f"frame {reading.frame.value}", where=reading.source, allowed=f"{self.frame}, the frame of this memory",
                repair="ingest it into a memory of its own",
            )  # fmt: skip

    def _check_owner(self, reading: Reading, known: Mapping[str, tuple[str, tuple[Any, ...]]]) -> None:
        foreign = [i for i, (source, _) in known.items() if source != reading.source]
        if foreign:
            raise InputError(
                f"{len(foreign)} ids are already in this memory from {known[foreign[0]][0]!r}, such as {foreign[0]!r}",
                where=reading.source, repair="erag ingest … --id-prefix NAME/",
            )  # fmt: skip

    def _check_clusters(self, reading: Reading) -> None:
        stored = self._db.rows("SELECT id, source FROM given_clusters")
        others = {id_: source for id_, source in stored if source != reading.source}
        taken = [c.id for c in reading.clusters if c.id in others]
        nodes = {id_ for (id_,) in self._db.rows("SELECT id FROM nodes")}
        clash = [c.id for c in reading.clusters if c.id in nodes] + [
            o.id for o in reading.observations if o.id in others
        ]
        if taken or clash:
            raise InputError(
                f"the cluster id {(taken + clash)[0]!r} is already in this memory", where=reading.source,
                repair="erag ingest … --id-prefix NAME/",
            )  # fmt: skip


def _to_row(o: Observation, origin: str) -> tuple[Any, ...]:
    start, end = (o.time.start, o.time.end) if o.time else (None, None)
    sensors = json.dumps(dict(sorted(o.sensors.items())))
    p = o.pose
    source = o.source or origin
    return (o.id, origin, source, o.kind, p.x, p.y, p.z, p.yaw, start, end, o.image, o.name, o.caption, sensors)


def _from_row(row: Sequence[Any]) -> Observation:
    id_, _, source, kind, x, y, z, yaw, start, end, image, name, caption, sensors = row
    time = None if start is None else Interval(start, end)
    return Observation(id_, kind, Pose(x, y, z, yaw), time, image, name, caption, json.loads(sensors), source)


def _put_source(connection: sqlite3.Connection, reading: Reading) -> None:
    issues = [(i.where, i.what, i.action) for i in reading.issues]
    row = (str(reading.root.resolve()), dict(sorted(reading.sensors.items())), list(reading.notes), issues)
    connection.execute(
        "INSERT OR REPLACE INTO sources VALUES (?, ?, ?, ?, ?)",
        (reading.source, row[0], *(json.dumps(part) for part in row[1:])),
    )


def _put_edges(connection: sqlite3.Connection, reading: Reading) -> int:
    before = connection.total_changes
    connection.executemany(
        """INSERT INTO given_edges VALUES (?, ?, ?, ?, ?)
           ON CONFLICT (a, b, kind) DO UPDATE SET metres = excluded.metres WHERE metres IS NOT excluded.metres""",
        [(*sorted((e.a, e.b)), int(e.kind), e.metres, reading.source) for e in reading.edges],
    )
    return connection.total_changes - before


def _put_clusters(connection: sqlite3.Connection, reading: Reading) -> int:
    before = connection.total_changes
    connection.executemany(
        """INSERT INTO given_clusters VALUES (?, ?, ?, ?, ?, ?, ?) ON CONFLICT (id) DO UPDATE SET
           (level, members, name, summary, relationships) =
           (excluded.level, excluded.members, excluded.name, excluded.summary, excluded.relationships)
           WHERE (level, members, name, summary, relationships) IS NOT
           (excluded.level, excluded.members, excluded.name, excluded.summary, excluded.relationships)""",
        [
            (c.id, c.level, json.dumps(c.members), c.name, c.summary, json.dumps(c.relationships), reading.source)
            for c in reading.clusters
        ],
    )
    return connection.total_changes - before


def _set_meta(connection: sqlite3.Connection, key: str, value: str) -> None:
    connection.execute("INSERT OR REPLACE INTO meta VALUES (?, ?)", (key, value))
