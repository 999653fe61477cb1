"""The Python API: a memory file as an object with ingest, build, query and views for other tools."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import networkx as nx

from erag.core.progress import Progress, quiet
from erag.core.types import Forest, QueryKind, SensorWish, TopoMap
from erag.data.contract import QueryLine, Result, parse_query
from erag.forest.graph import to_networkx as forest_graph
from erag.lm.weights import ModelStore, default_store
from erag.memory.file import MemoryFile
from erag.pipeline.build import BuildReport, build
from erag.pipeline.config import PipelineConfig, load_config
from erag.pipeline.ingest import IngestReport, ingest
from erag.pipeline.query import Asker
from erag.topomap.graph import to_networkx as map_graph


class Memory:
    """A memory file and the configuration it is built and asked with.

    >>> memory = erag.open("campus.erag")
    >>> memory.ingest(erag.sample())
    >>> memory.build()
    >>> memory.query("Where can I lock up my bicycle?").answer.text
    """

    def __init__(self, path: Path, config: PipelineConfig, store: ModelStore) -> None:
        self.path, self.config = path, config
        self._store = store
        self._asker: Asker | None = None

    def ingest(self, source: str | Path, reader: str = "auto", id_prefix: str = "") -> IngestReport:
        """Add the observations of a file or folder; the memory file is made when absent."""
        self._asker = None
        return ingest(Path(source), self.path, reader, id_prefix)

    def remove(self, ids: Sequence[str]) -> int:
        """Take nodes out by id; returns how many. Raises InputError for an unknown id, changing nothing."""
        self._asker = None
        with MemoryFile.writing(self.path, "erag remove") as memory:
            return memory.observations.remove(ids)

    def build(self, *, given: bool = False, progress: Progress = quiet) -> BuildReport:
        """Map, vectors and forest from the observations; `given` takes the clusters stated by the source."""
        self._asker = None
        with MemoryFile.writing(self.path, "erag build") as memory:
            return build(memory, self.config, self._store, given=given, progress=progress)

    def query(
        self,
        text: str | None = None,
        *,
        at: Sequence[float] | None = None,
        sensor: Mapping[str, SensorWish] | None = None,
        since: str | None = None,
        until: str | None = None,
        hours: Sequence[float] | None = None,
        now: str | None = None,
        top: int = 5,
        kind: QueryKind | None = None,
    ) -> Result:
        """Hits and answer for a text, a position `at` (x, y[, z]) in the map's frame, or both.

        `since`, `until` and `now` are time stamps, `hours` [from, to) hours of the day in UTC.
        """
        raw_hours = None if hours is None else list(hours)
        stated = {"at": None if at is None else list(at), "sensor": None if sensor is None else dict(sensor)}
        raw = {
            "id": "query",
            "query": text,
            "since": since,
            "until": until,
            "kind": kind,
            "now": now,
            "hours": raw_hours,
            **stated,
        }
        return self.asker.ask(parse_query(QueryLine(1, "query", raw), top, self.asker.ground, "the query"))

    @property
    def asker(self) -> Asker:
        """The loaded memory; loaded anew after a change through this object."""
        if self._asker is None:
            self._asker = Asker(self.path, self.config, self._store)
        return self._asker

    @property
    def map(self) -> TopoMap:
        """The topological map of the last build."""
        return self.asker.corpus.topomap

    @property
    def forest(self) -> Forest:
        """The semantic forest of the last build."""
        return self.asker.corpus.forest

    def map_to_networkx(self) -> nx.Graph:
        """The map as a networkx graph."""
        return map_graph(self.map)

    def forest_to_networkx(self) -> nx.DiGraph:
        """The forest as a networkx digraph, edges from parent to child."""
        return forest_graph(self.forest, self.map)


def open_memory(
    path: str | Path, preset: str = "tiny", config: str | Path | None = None, overrides: Sequence[str] = ()
) -> Memory:
    """A memory file, which need not exist yet, with the configuration of a preset or a file."""
    settings = load_config(preset, Path(config) if config is not None else None, overrides)
    return Memory(Path(path), settings, default_store())
