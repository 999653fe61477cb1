"""Two memory files compared by what they hold, without run numbers, block numbers, folders and clock times."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from erag.memory.calls import KEY_BYTES
from erag.memory.database import undamaged
from erag.memory.file import MemoryFile

_SHOWN = 3
_PLACES = ("node_places", "sentence_places", "summary_places")  # block numbers: compared through the vectors they name


@dataclass(frozen=True)
class PartDiff:
    """One part of two memories: ids only in A, only in B, and in both but different."""

    part: str
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]
    differ: tuple[str, ...]

    def __bool__(self) -> bool:
        return bool(self.only_a or self.only_b or self.differ)

    def line(self) -> str:
        """The part in one line, with the first few ids of each sort."""
        sorts = (("only in A", self.only_a), ("only in B", self.only_b), ("different", self.differ))
        return f"{self.part}: " + "; ".join(f"{len(ids)} {what} ({_some(ids)})" for what, ids in sorts if ids)


def diff(a: MemoryFile, b: MemoryFile) -> list[PartDiff]:
    """The parts in which two memories differ; empty when they hold the same."""
    with undamaged(a.path):
        left = canonical(a)
    with undamaged(b.path):
        right = canonical(b)
    return [d for part in left if (d := _compare(part, left[part], right[part]))]


def canonical(memory: MemoryFile) -> dict[str, Mapping[str, Any]]:
    """What a memory holds, part by part, as id -> comparable value."""
    stored = memory.observations
    return {
        "frame": {"frame": stored.frame},
        "nodes": {o.id: o for o in stored.nodes()},
        "order of nodes": {"order": tuple(o.id for o in stored.nodes())},
        "removed nodes": dict.fromkeys(stored.removed()),
        "given edges": {f"{e.a} - {e.b} {e.kind.name}": e for e in stored.edges()},
        "given clusters": {c.id: c for c in stored.clusters()},
        "sources": {name: (notes, issues) for name, (_, notes, issues) in stored.sources().items()},
        "sensor ranges": stored.sensors(),
        "call results": _results(memory),
        "vectors": _vectors(memory),
        **_generation(memory),
    }


def _results(memory: MemoryFile) -> dict[str, Any]:
    rows = memory.db.rows("SELECT key, role, request, result FROM call_results")
    return {f"{role} {bytes(key).hex()}": (request, result) for key, role, request, result in rows}


def _vectors(memory: MemoryFile) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for keys, dim, data in memory.db.rows("SELECT keys, dim, data FROM vectors"):
        for i in range(len(keys) // KEY_BYTES):
            key = keys[i * KEY_BYTES : (i + 1) * KEY_BYTES]
            out[key.hex()] = data[i * dim * 2 : (i + 1) * dim * 2]
    return out


def _generation(memory: MemoryFile) -> dict[str, Mapping[str, Any]]:
    generation = memory.generations.load()
    if generation is None:
        return {"forest": {}, "clusters": {}, "seen in images": {}}
    arrays = {
        name: (a.dtype.name, a.shape, hashlib.sha256(a.tobytes()).hexdigest())
        for name, a in generation.arrays.items()
        if name not in _PLACES
    }
    for name in _PLACES:
        vectors = memory.calls.read_vectors(generation.arrays[name])
        arrays[name] = (vectors.dtype.name, vectors.shape, hashlib.sha256(vectors.tobytes()).hexdigest())
    settled = {"config": generation.config, "embedder": generation.embedder, "report": json.dumps(generation.report)}
    clusters = {c.id: c for c in generation.clusters}
    return {"forest": {**arrays, **settled}, "clusters": clusters, "seen in images": generation.seen}


def _compare(part: str, a: Mapping[str, Any], b: Mapping[str, Any]) -> PartDiff:
    return PartDiff(
        part,
        tuple(k for k in a if k not in b),
        tuple(k for k in b if k not in a),
        tuple(k for k in a if k in b and a[k] != b[k]),
    )


def _some(ids: tuple[str, ...]) -> str:
    return ", ".join(ids[:_SHOWN]) + (", …" if len(ids) > _SHOWN else "")
