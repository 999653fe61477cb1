"""What is inside a memory file, counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from erag.core.text import node_text
from erag.core.times import format_time
from erag.core.types import Interval, Observation, Range
from erag.data.reading import Issue
from erag.memory.database import undamaged
from erag.memory.file import MemoryFile


@dataclass(frozen=True)
class Inspection:
    """The contents of a memory: counts, ranges, the build's report, and the issues of its sources."""

    path: str
    bytes: int
    frame: str | None
    sources: Mapping[str, Sequence[str]]
    observations: Mapping[str, int]
    with_text: int
    with_image: int
    removed: int
    time: str | None
    sensors: Mapping[str, Range]
    given_edges: Mapping[str, int]
    given_clusters: int
    vectors: int
    calls: Mapping[str, int]
    unfinished_calls: int
    build: Sequence[str]
    state: str
    issues: Sequence[Issue]

    def record(self) -> dict[str, Any]:
        """The contents as plain values."""
        return asdict(self)

    def lines(self) -> list[str]:
        """The contents, a line a fact."""
        facts = {
            "file": f"{self.path}, {self.bytes / 1e6:.1f} MB, frame {self.frame or 'not set yet'}",
            "sources": "; ".join(self.sources) or "none",
            "observations": f"{_counts(self.observations)}; {self.with_text} with text, {self.with_image} with an image"
            + (f"; {self.removed} removed" if self.removed else ""),
            "time": self.time or "unknown",
            "sensors": ", ".join(f"{n} [{lo:g}, {hi:g}]" for n, (lo, hi) in self.sensors.items()) or "none",
            "stated": f"edges: {_counts(self.given_edges)}; clusters: {self.given_clusters}",
            "vectors": f"{self.vectors}; calls: {_counts(self.calls)}; {self.unfinished_calls} unfinished",
            "issues": str(len(self.issues)),
            "forest": self.state,
        }
        notes = [f"note: {note}" for notes in self.sources.values() for note in notes]
        return [*(f"{name:<13}{value}" for name, value in facts.items()), *notes, *self.build]


def inspect(memory: MemoryFile) -> Inspection:
    """Count what a memory holds."""
    with undamaged(memory.path):
        return _inspect(memory)


def _inspect(memory: MemoryFile) -> Inspection:
    stored, db = memory.observations, memory.db
    nodes, sources = stored.nodes(), stored.sources()
    generation = memory.generations.load()
    batches = db.rows(
        "SELECT b.role, b.status, count(*) FROM call_batches b JOIN call_attempts USING (batch) GROUP BY 1, 2"
    )
    return Inspection(
        path=str(memory.path),
        bytes=memory.path.stat().st_size,
        frame=stored.frame,
        sources={name: notes for name, (_, notes, _) in sources.items()},
        observations=dict(Counter(n.kind for n in nodes)),
        with_text=sum(bool(node_text(n.name, n.caption)) for n in map(generation.shown if generation else _own, nodes)),
        with_image=sum(n.image is not None for n in nodes),
        removed=len(stored.removed()),
        time=_span([n.time for n in nodes if n.time is not None]),
        sensors=_ranges(nodes, stored.sensors()),
        given_edges=dict(Counter(e.kind.name.lower() for e in stored.edges())),
        given_clusters=len(stored.clusters()),
        vectors=int(db.value("SELECT coalesce(sum(length(keys) / 16), 0) FROM vectors")),
        calls={role: n for role, status, n in batches if status == "done"},
        unfinished_calls=sum(n for _, status, n in batches if status != "done"),
        build=generation.report if generation else (),
        state=_state(generation.revision if generation else None, stored.revision),
        issues=[issue for _, _, issues in sources.values() for issue in issues],
    )


def _own(node: Observation) -> Observation:
    return node


def _state(built: int | None, now: int) -> str:
    if built is None:
        return "not built yet"
    return "up to date" if built == now else "older than the observations"


def _ranges(nodes: Sequence[Observation], declared: Mapping[str, Range]) -> dict[str, Range]:
    """Declared ranges, else the readings' own."""
    seen: dict[str, list[float]] = {}
    for node in nodes:
        for channel, value in node.sensors.items():
            seen.setdefault(channel, []).append(value)
    return {c: declared.get(c, (min(v), max(v))) for c, v in sorted(seen.items())}


def _span(times: Sequence[Interval]) -> str | None:
    if not times:
        return None
    first, last = min(t.start for t in times), max(t.end for t in times)
    return f"{format_time(Interval(first, last))} ({len(times)} observations)"


def _counts(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{n} {name}" for name, n in sorted(counts.items())) or "none"
