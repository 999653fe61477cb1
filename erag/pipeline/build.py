"""Observations of a memory file to map, vectors and forest, swapped in at the end."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from erag.core.errors import InputError
from erag.core.progress import Progress, quiet
from erag.core.types import Forest, IntArray, TopoMap
from erag.forest.build import build_forest
from erag.forest.given import given_forest
from erag.lm.captioning import quarantine as move_away
from erag.lm.config import build_backend
from erag.lm.images import BadImage
from erag.lm.journal import Journal
from erag.lm.ledger import Ledger
from erag.lm.weights import ModelStore
from erag.memory.file import MemoryFile
from erag.memory.generations import Generation
from erag.pipeline.captions import Looked, look
from erag.pipeline.config import PipelineConfig
from erag.pipeline.describe import Describer, spoken, with_readings
from erag.retrieve.corpus import map_texts, split_sentences
from erag.topomap.build import build_map

NOWHERE = (-1, -1)
BUILD_VERSION = 3  # raised when the same observations and configuration give another map, text or forest


@dataclass(frozen=True)
class BuildReport:
    """What a build did: lines to print, seconds by stage, the ledger of its model calls.

    `bad` are the images that cannot be used, by the folder of their source; `moved` where they are now, if they were
    moved away.
    """

    lines: tuple[str, ...]
    seconds: dict[str, float]
    ledger: Ledger
    current: bool = False
    bad: Mapping[Path, Sequence[BadImage]] = field(default_factory=dict)
    moved: tuple[Path, ...] = ()


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
    memory: MemoryFile,
    config: PipelineConfig,
    store: ModelStore,
    *,
    given: bool = False,
    quarantine: Path | None = None,
    progress: Progress = quiet,
) -> BuildReport:
    """Build map and forest of a memory opened for writing; a memory that is up to date is left as it is.

    With `given` the clusters stated by the source become the forest. Images that cannot be used are told; with
    `quarantine` they are moved to that folder. Raises InputError for an empty memory.
    """
    ledger, clock = Ledger(), _Clock()
    model = build_backend(config.backend, store, ledger)
    eyes = "caption" in config.backend.roles
    looked = look(memory, Journal(model, memory.calls, ledger), config.captions, eyes=eyes, progress=progress)
    moved = _moved(looked, quarantine)
    if looked.lines:
        clock.stage("caption")
    resolved = _resolved(config, given, looked.state)
    if memory.generations.meta() == (memory.observations.revision, resolved):
        lines = ("the forest is up to date", *looked.lines)
        return BuildReport(lines, clock.seconds, ledger, True, looked.bad, moved)
    work = _Work(memory, config, given, Journal(model, memory.calls, ledger, progress), clock, progress)
    lines = _make(work, looked, resolved)
    return BuildReport((*lines, *ledger.lines()), clock.seconds, ledger, False, looked.bad, moved)


def _moved(looked: Looked, folder: Path | None) -> tuple[Path, ...]:
    if folder is None:
        return ()
    return tuple(path for root, bad in looked.bad.items() for path in move_away(bad, root, folder))


@dataclass(frozen=True)
class _Work:
    """What a build is made from and with."""

    memory: MemoryFile
    config: PipelineConfig
    given: bool
    backend: Journal
    clock: _Clock
    progress: Progress


def _make(work: _Work, looked: Looked, resolved: str) -> tuple[str, ...]:
    """Compute map, vectors and forest and swap them in; the lines of the report."""
    memory, config, backend, clock = work.memory, work.config, work.backend, work.clock
    topomap, map_lines = _map(memory, config, looked)
    clock.stage("map")
    texts = map_texts(topomap)
    spoken, rows = split_sentences(texts)
    _embed(backend, texts, spoken)
    clock.stage("embed")
    node_places = _places(memory, backend, texts)
    describer = _describer(topomap, backend, config, work.progress)
    vectors = memory.calls.read_vectors(node_places)
    forest, forest_lines = _forest(work, topomap, vectors, describer)
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
    if describer is not None and not work.given:
        forest = with_readings(topomap, forest)
    new = Generation(
        memory.observations.revision, resolved, backend.identity("embed"),
        (*map_lines, *looked.lines, *forest_lines), arrays, forest.clusters, looked.seen,
    )  # fmt: skip
    memory.generations.swap_in(new, memory.observations.purge)
    clock.stage("store")
    return new.report


def _resolved(config: PipelineConfig, given: bool, seen: str) -> str:
    """Everything but the observations that determines map, vectors and forest, as JSON; a change means a new build.

    `seen` is a hash of what captioners saw.
    """
    build = {"version": BUILD_VERSION, "forest": "given" if given else "cluster", "seen": seen}
    return json.dumps(
        {"build": build, "config": config.model_dump(mode="json", exclude={"retrieve", "aware", "answer"})},
        sort_keys=True,
    )


def _map(memory: MemoryFile, config: PipelineConfig, looked: Looked) -> tuple[TopoMap, list[str]]:
    nodes, frame = memory.observations.nodes(), memory.observations.frame
    if not nodes or frame is None:
        raise InputError(
            "nothing was ingested", where=str(memory.path), repair=f"erag ingest SOURCE --out {memory.path}"
        )
    here = {n.id for n in nodes}
    edges = [e for e in memory.observations.edges() if e.a in here and e.b in here]
    topomap, report = build_map(frame, looked.nodes(nodes), edges, config.map)
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
    work: _Work, topomap: TopoMap, vectors: np.ndarray, describer: Describer | None
) -> tuple[Forest, list[str]]:
    memory, config = work.memory, work.config
    if not work.given:
        by_summary = config.forest.cluster_embedding == "summary"
        summaries = describer.vectors if describer is not None and by_summary else None
        forest, report = build_forest(topomap, vectors, config.forest, work.progress, summaries)
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
