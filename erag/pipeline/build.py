"""Observations of a memory file to map, vectors and forest, swapped in at the end."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from erag.core.errors import InputError
from erag.core.progress import Progress, quiet
from erag.core.types import Forest, IntArray, TopoMap
from erag.forest.build import build_forest
from erag.forest.given import given_forest
from erag.lm.config import build_backend
from erag.lm.journal import Journal
from erag.lm.ledger import Ledger
from erag.lm.weights import ModelStore
from erag.memory.file import MemoryFile
from erag.memory.generations import Generation
from erag.pipeline.config import PipelineConfig
from erag.pipeline.describe import Describer, spoken, with_readings
from erag.retrieve.corpus import map_texts, split_sentences
from erag.topomap.build import build_map

NOWHERE = (-1, -1)
BUILD_VERSION = 3  # raised when the same observations and configuration give another map, text or forest


@dataclass(frozen=True)
class BuildReport:
    """What a build did: lines to print, seconds by stage, the ledger of its model calls."""

    lines: tuple[str, ...]
    seconds: dict[str, float]
    ledger: Ledger
    current: bool = False


class _Clock:
    """Seconds by stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def stage(self, name: str) -> None:
        now = time.perf_counter()
        self.seconds[name] = now - self._last
        self._last = now


def build(
    memory: MemoryFile, config: PipelineConfig, store: ModelStore, *, given: bool = False, progress: Progress = quiet
) -> BuildReport:
    """Build map and forest of a memory opened for writing; a memory that is up to date is left as it is.

    With `given` the clusters stated by the source become the forest. Raises InputError for an empty memory.
    """
    ledger, clock = Ledger(), _Clock()
    backend = Journal(build_backend(config.backend, store, ledger), memory.calls, ledger, progress)
    resolved = _resolved(config, given)
    if memory.generations.meta() == (memory.observations.revision, resolved):
        return BuildReport(("the forest is up to date",), clock.seconds, ledger, current=True)
    topomap, map_lines = _map(memory, config)
    clock.stage("map")
    texts = map_texts(topomap)
    spoken, rows = split_sentences(texts)
    _embed(backend, texts, spoken)
    clock.stage("embed")
    node_places = _places(memory, backend, texts)
    describer = _describer(topomap, backend, config, progress)
    vectors = memory.calls.read_vectors(node_places)
    forest, forest_lines = _forest(memory, topomap, vectors, config, given, describer, progress)
    clock.stage("cluster")
    if describer is not None:
        forest = describer.described(forest)
        clock.stage("summarise")
        forest_lines += describer.report(forest)
        clock.stage("check")
    arrays = {
        "node_places": node_places,
        "sentence_places": _places(memory, backend, spoken),
        "sentence_rows": rows,
        "summary_places": _summaries(memory, backend, forest),
        **_structure(topomap, forest),
    }
    if describer is not None and not given:
        forest = with_readings(topomap, forest)
    new = Generation(
        memory.observations.revision, resolved, backend.identity("embed"),
        (*map_lines, *forest_lines), arrays, forest.clusters,
    )  # fmt: skip
    memory.generations.swap_in(new, memory.observations.purge)
    clock.stage("store")
    return BuildReport((*map_lines, *forest_lines, *ledger.lines()), clock.seconds, ledger)


def _resolved(config: PipelineConfig, given: bool) -> str:
    """Everything but the observations that determines map, vectors and forest, as JSON; a change means a new build."""
    build = {"version": BUILD_VERSION, "forest": "given" if given else "cluster"}
    return json.dumps(
        {"build": build, "config": config.model_dump(mode="json", exclude={"retrieve", "aware", "answer"})},
        sort_keys=True,
    )


def _map(memory: MemoryFile, config: PipelineConfig) -> tuple[TopoMap, list[str]]:
    nodes, frame = memory.observations.nodes(), memory.observations.frame
    if not nodes or frame is None:
        raise InputError(
            "nothing was ingested", where=str(memory.path), repair=f"erag ingest SOURCE --out {memory.path}"
        )
    here = {n.id for n in nodes}
    edges = [e for e in memory.observations.edges() if e.a in here and e.b in here]
    topomap, report = build_map(frame, nodes, edges, config.map)
    return topomap, report.lines()


def _embed(backend: Journal, texts: Sequence[str], spoken: Sequence[str]) -> None:
    """Every distinct text of the map, whole and by sentence, in one batch plan."""
    distinct = sorted({t for t in (*texts, *spoken) if t})
    if distinct:
        backend.embed(distinct, "document")


def _places(memory: MemoryFile, backend: Journal, texts: Sequence[str]) -> IntArray:
    """Where the vector of each text lies, (n, 2) int64; -1 for an empty text."""
    keys = backend.keys("embed", texts, "document")
    places = memory.calls.places(keys)
    found = [places[key] if text else NOWHERE for key, text in zip(keys, texts, strict=True)]
    return np.array(found, np.int64).reshape(-1, 2)


def _describer(topomap: TopoMap, backend: Journal, config: PipelineConfig, progress: Progress) -> Describer | None:
    """None where no model plays the summariser: clusters are then judged by their nodes alone."""
    if "summarise" not in config.backend.roles:
        return None
    return Describer(topomap, backend, config.summaries, progress)


def _forest(
    memory: MemoryFile,
    topomap: TopoMap,
    vectors: np.ndarray,
    config: PipelineConfig,
    given: bool,
    describer: Describer | None,
    progress: Progress,
) -> tuple[Forest, list[str]]:
    if not given:
        by_summary = config.forest.cluster_embedding == "summary"
        summaries = describer.vectors if describer is not None and by_summary else None
        forest, report = build_forest(topomap, vectors, config.forest, progress, summaries)
        return forest, report.lines()
    clusters = memory.observations.clusters()
    if not clusters:
        raise InputError("its sources state no clusters", where=str(memory.path), repair=f"erag build {memory.path}")
    forest, issues = given_forest(topomap, clusters, vectors)
    return forest, [f"given forest: {len(forest.clusters)} clusters", *(f"{i.where}: {i.what}" for i in issues)]


def _summaries(memory: MemoryFile, backend: Journal, forest: Forest) -> IntArray:
    texts = [spoken(cluster) for cluster in forest.clusters]
    if any(texts):
        backend.embed(sorted({t for t in texts if t}), "document")
    return _places(memory, backend, texts)


def _structure(topomap: TopoMap, forest: Forest) -> dict[str, np.ndarray]:
    edges = topomap.edges
    return {
        "edge_index": edges.index, "edge_kind": edges.kind, "edge_metres": edges.metres,
        "parent": forest.parent, "level": forest.level,
        "cluster_vectors": forest.embeddings[forest.n_leaves :],
    }  # fmt: skip
