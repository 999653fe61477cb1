"""A memory written for other tools: GML, GeoJSON, or our own folder."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from erag.core.errors import ConfigError, MemoryFileError
from erag.core.types import EdgeKind, Frame, Observation
from erag.data.geojson import write_geojson
from erag.data.reading import GivenCluster, GivenEdge, Reading
from erag.data.writer import write_folder, write_gml
from erag.memory.database import undamaged
from erag.memory.file import MemoryFile
from erag.memory.generations import Generation

FORMATS = ("gml", "geojson", "jsonl")


def export(path: Path, out: Path, format_: str) -> str:
    """Write the map and forest of the memory at `path` to `out`; returns a line that says what was written.

    Before the first build the edges and clusters are those the sources state.
    """
    if format_ not in FORMATS:
        raise ConfigError(f"{format_!r}", where="--format", allowed=", ".join(FORMATS))
    with undamaged(path), MemoryFile.reading(path) as memory:
        reading = as_reading(memory)
    write = {"gml": write_gml, "geojson": write_geojson, "jsonl": write_folder}[format_]
    if out.exists() and out.samefile(path):
        raise ConfigError("is the memory itself", where="--out", allowed="another name")
    write(out, reading)
    counts = f"{len(reading.observations)} nodes, {len(reading.edges)} edges, {len(reading.clusters)} clusters"
    local = " (positions are local metres, not longitude and latitude)" if _is_local(format_, reading.frame) else ""
    return f"{out}: {counts}{local}"


def as_reading(memory: MemoryFile) -> Reading:
    """Everything a memory holds as one reading: its nodes, and the edges and clusters of its last build."""
    stored, generation = memory.observations, memory.generations.load()
    if stored.frame is None:
        raise MemoryFileError("nothing was ingested", where=str(memory.path), repair="erag ingest SOURCE --out M.erag")
    sources = stored.sources()
    nodes = stored.nodes(with_removed=generation is not None)
    if generation is not None:
        nodes = [replace(generation.shown(n), objects=()) for n in nodes]  # the formats have captions alone
    edges = tuple(stored.edges()) if generation is None else _edges(generation, [n.id for n in nodes])
    clusters = tuple(stored.clusters()) if generation is None else _clusters(generation)
    kept = {n.id for n in nodes} - stored.removed()
    roots = {name: root for name, (root, _, _) in sources.items()}
    origins = stored.origins()
    root = Path(os.path.commonpath(list(roots.values())))
    return Reading(
        source=memory.path.stem,
        root=root,
        frame=stored.frame,
        observations=tuple(_under(root, roots[origins[n.id]], n) for n in nodes if n.id in kept),
        edges=tuple(e for e in edges if e.a in kept and e.b in kept),
        clusters=_without_absent(clusters, kept),
        sensors=stored.sensors(),
        notes=tuple(note for _, notes, _ in sources.values() for note in notes),
    )


def _under(root: Path, own: Path, node: Observation) -> Observation:
    """A node whose image path, stated relative to its source's folder, is relative to `root`."""
    return node if node.image is None else replace(node, image=(own.relative_to(root) / node.image).as_posix())


def _without_absent(clusters: Sequence[GivenCluster], nodes: set[str]) -> tuple[GivenCluster, ...]:
    """Clusters (lower levels first) without members that are gone, and without clusters of which nothing is left."""
    there, kept = set(nodes), []
    for cluster in sorted(clusters, key=lambda c: c.level):
        members = tuple(m for m in cluster.members if m in there)
        if members:
            there.add(cluster.id)
            kept.append(replace(cluster, members=members))
    return tuple(kept)


def _edges(generation: Generation, ids: list[str]) -> tuple[GivenEdge, ...]:
    index, kinds, metres = (generation.arrays[f"edge_{part}"] for part in ("index", "kind", "metres"))
    return tuple(
        GivenEdge(ids[a], ids[b], EdgeKind(int(kind)), float(length))
        for a, b, kind, length in zip(*index, kinds, metres, strict=True)
    )


def _clusters(generation: Generation) -> tuple[GivenCluster, ...]:
    return tuple(
        GivenCluster(c.id, c.level, c.members, c.name, c.summary, c.relationships) for c in generation.clusters
    )


def _is_local(format_: str, frame: Frame) -> bool:
    return format_ == "geojson" and frame is Frame.METRIC
