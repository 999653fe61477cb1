"""A built memory file as a corpus in memory, ready to be searched."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from erag.core.errors import MemoryFileError
from erag.core.types import Edges, Forest, Observation, Range, TopoMap
from erag.memory.database import undamaged
from erag.memory.file import MemoryFile
from erag.memory.generations import Generation
from erag.retrieve.corpus import Corpus, map_texts


@dataclass(frozen=True)
class Built:
    """The corpus of a memory, the identity of its embedder, declared sensor ranges, and what is out of date."""

    corpus: Corpus
    embedder: str
    sensors: dict[str, Range]
    stale: tuple[str, ...]


def load(path: Path) -> Built:
    """The corpus a memory file holds. Raises MemoryFileError when it was not built yet."""
    with undamaged(path), MemoryFile.reading(path) as memory:
        generation = memory.generations.load()
        if generation is None:
            raise MemoryFileError("has no forest yet", where=str(path), repair=f"erag build {path}")
        nodes = memory.observations.nodes(with_removed=True)
        removed = memory.observations.removed()
        corpus = _corpus(memory, generation, nodes, removed)
        changed = generation.revision != memory.observations.revision
        stale = _stale(path, len(nodes) - len(corpus.topomap), len(removed)) if changed else ()
        return Built(corpus, generation.embedder, memory.observations.sensors(), stale)


def _corpus(memory: MemoryFile, generation: Generation, nodes: list[Observation], removed: frozenset[str]) -> Corpus:
    """The nodes the forest was built from are the first to have arrived; later ones wait for the next build."""
    arrays, frame = generation.arrays, memory.observations.frame
    n = len(arrays["node_places"])
    if frame is None or n > len(nodes):
        raise MemoryFileError("its forest does not fit its nodes", where=str(memory.path), repair="restore a copy")
    kept = tuple(_silenced(o) if o.id in removed else generation.shown(o) for o in nodes[:n])
    edges = Edges(arrays["edge_index"], arrays["edge_kind"], arrays["edge_metres"])
    topomap = TopoMap(frame, kept, edges)
    dim = arrays["cluster_vectors"].shape[1]
    node_vectors, sentence_vectors, summary_vectors = (
        memory.calls.read_vectors(arrays[f"{part}_places"], dim) for part in ("node", "sentence", "summary")
    )
    embeddings = np.concatenate([node_vectors, arrays["cluster_vectors"]])
    forest = Forest(tuple(o.id for o in kept), generation.clusters, arrays["parent"], arrays["level"], embeddings)
    return Corpus(
        topomap, forest, map_texts(topomap), node_vectors, sentence_vectors, arrays["sentence_rows"], summary_vectors
    )  # fmt: skip


def _silenced(observation: Observation) -> Observation:
    """A removed node: still a joint of routes until the next build, but with nothing to be found by."""
    return replace(observation, name=None, caption=None, image=None, sensors={}, objects=())


def _stale(path: Path, added: int, removed: int) -> tuple[str, ...]:
    what = [f"{added} added" if added else "", f"{removed} removed" if removed else ""]
    said = " and ".join(filter(None, what)) or "observations changed"
    return (f"the forest is older than the observations ({said}); to search them all: erag build {path}",)
