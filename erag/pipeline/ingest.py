"""Observations into a memory file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from erag.core.errors import InputError
from erag.data.reading import Reading
from erag.data.registry import read
from erag.memory.file import MemoryFile
from erag.memory.observations import IngestCounts

MAX_PREFIX = 60  # characters


@dataclass(frozen=True)
class IngestReport:
    """What was read and what it changed."""

    reading: Reading
    counts: IngestCounts
    total: int


def ingest(source: Path, out: Path, reader: str = "auto", id_prefix: str = "", *, strict: bool = False) -> IngestReport:
    """Read `source` and add it to the memory file `out`, made when absent; one transaction.

    Raises InputError for a source that cannot be used, whose ids belong to another source of the memory, or, when
    `strict`, that has any issue.
    """
    _check_names(source, out)
    reading = prefixed(read(source, reader), id_prefix)
    if strict and reading.issues:
        first = reading.issues[0]
        raise InputError(
            f"{first.what} (the first of {len(reading.issues)} issues)", where=first.where, repair="leave out --strict"
        )
    with MemoryFile.writing(out, "erag ingest", create=True) as memory:
        counts = memory.observations.put(reading)
        return IngestReport(reading, counts, len(memory.observations.nodes()))


def _check_names(*paths: Path) -> None:
    for path in paths:
        if not str(path).isprintable() and max(str(path)) >= "\udc80":
            raise InputError("its name is not UTF-8", where=ascii(str(path)), repair="rename it")


def prefixed(reading: Reading, prefix: str) -> Reading:
    """`reading` with every id prefixed, so that two sources with equal ids fit into one memory."""
    if not prefix:
        return reading
    if len(prefix) > MAX_PREFIX or not prefix.isprintable():
        raise InputError(f"{prefix!r}", where="--id-prefix", allowed=f"up to {MAX_PREFIX} printable characters")
    return replace(
        reading,
        source=prefix + reading.source,
        observations=tuple(replace(o, id=prefix + o.id, source=prefix + o.source) for o in reading.observations),
        edges=tuple(replace(e, a=prefix + e.a, b=prefix + e.b) for e in reading.edges),
        clusters=tuple(
            replace(c, id=prefix + c.id, members=tuple(prefix + m for m in c.members)) for c in reading.clusters
        ),
    )
