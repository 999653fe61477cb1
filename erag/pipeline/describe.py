"""What a build has written about its clusters: names, summaries and relationships, and how good they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from erag.aware.readings import readings
from erag.aware.visits import visits
from erag.core.progress import Progress
from erag.core.types import Cluster, Forest, IntArray, TopoMap
from erag.forest.quality import base_nodes, forest_quality
from erag.forest.summaries import Summaries, SummaryConfig, summarise_forest
from erag.lm.journal import Journal
from erag.lm.roles import Vectors


class Describer:
    """Describes clusters with the summariser of a backend; behind its journal nothing is asked twice."""

    def __init__(self, topomap: TopoMap, backend: Journal, config: SummaryConfig, progress: Progress) -> None:
        self._topomap, self._backend, self._config, self._progress = topomap, backend, config, progress
        self._levels: Summaries | None = None
        self._done: dict[str, Cluster] = {}

    def vectors(self, clusters: Sequence[Cluster]) -> Vectors:
        """(k, d) the embedded summaries of the new clusters of a level, described here (see `build_forest`)."""
        if self._levels is None:
            self._levels = Summaries(self._topomap, self._backend, self._config, self._backend.ledger)
        described = self._levels.level(clusters)
        self._done.update({cluster.id: cluster for cluster in described})
        return self._backend.embed([spoken(cluster) for cluster in described], "document")

    def described(self, forest: Forest) -> Forest:
        """`forest` with the texts of all its clusters."""
        if self._done:
            return replace(forest, clusters=tuple(self._done[cluster.id] for cluster in forest.clusters))
        return summarise_forest(
            self._topomap, forest, self._backend, self._config, self._backend.ledger, self._progress
        )

    def report(self, forest: Forest) -> list[str]:
        """A line a level: how many of its clusters are described, and how well."""
        found = forest_quality(self._topomap, forest, self._config.evidence.facts)
        return ["summaries", *(f"  level {level}: {quality.line()}" for level, quality in found.items())]


def with_readings(topomap: TopoMap, forest: Forest) -> Forest:
    """`forest` with a sentence for each sensor channel at the end of its summaries: mean, spread, trend over visits.

    Counted by code over all base nodes; the sentences are for readers, the vectors of summaries are made without them.
    """
    if not any(node.sensors for node in topomap.nodes):
        return forest
    seen = [visit.rows for visit in visits(topomap)]
    pairs = zip(forest.clusters, base_nodes(forest), strict=True)
    return replace(forest, clusters=tuple(_with_readings(topomap, cluster, rows, seen) for cluster, rows in pairs))


def _with_readings(topomap: TopoMap, cluster: Cluster, rows: IntArray, seen: Sequence[IntArray]) -> Cluster:
    found = (readings(topomap, rows, channel, seen) for channel in sorted(cluster.sensors))
    said = " ".join(f"Mean {reading.line()}." for reading in found if reading is not None)
    return replace(cluster, summary=" ".join(filter(None, (cluster.summary, said)))) if said else cluster


def spoken(cluster: Cluster) -> str:
    """What stands for a cluster in searches: its summary, else its name."""
    return cluster.summary or cluster.name
