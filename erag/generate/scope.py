"""What a question is about: the whole map, the region around the robot, or the region where its hits lie."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from erag.core.geometry import distance
from erag.core.text import word_set, words
from erag.core.types import Hit, IntArray, Query
from erag.forest.quality import base_nodes
from erag.generate.region import Regions
from erag.retrieve.corpus import Corpus

_LOCAL = frozenset({"here", "nearby", "around"})
_WHOLE = word_set("""
    overall whole entire across everywhere environment area map building campus city images views place general all
""")
PARTS, LEAST_PART = 10, 2  # regions told of a scope, and the views a region has at least
LOCAL_VIEWS = 8  # the smallest region that "here" means, in views
GATHERED, PART = 0.8, 0.25  # this share of the hits inside this share of the map makes a region


@dataclass(frozen=True)
class Scope:
    """The base nodes `rows` (r,) that an explanation speaks of, and what to call them."""

    rows: IntArray
    name: str


class Scopes:
    """Finds the scope of a question in a forest."""

    def __init__(self, corpus: Corpus, regions: Regions | None = None) -> None:
        self._corpus, self._regions = corpus, regions
        self._below = base_nodes(corpus.forest)

    def of(self, query: Query, hits: tuple[Hit, ...], eligible: np.ndarray) -> Scope:
        """The scope of `query`: the nodes `eligible` (n,) of a region, or of the whole map."""
        spoken = set(words(query.text or ""))
        if (region := self._region(query, eligible)) is not None:
            return region
        cluster = None
        if query.at is not None and spoken & _LOCAL:
            cluster = self._around(query)
        elif not spoken & _WHOLE:
            cluster = self._gathered(hits)
        rows = np.arange(len(eligible)) if cluster is None else self._below[cluster]
        rows = rows[eligible[rows] & self._corpus.searchable[rows]]
        return Scope(rows, self._name(cluster))

    def _region(self, query: Query, eligible: np.ndarray) -> Scope | None:
        """The region that the words of a query name, where any of its views may answer."""
        found = self._regions.of(query.text or "", query.at) if self._regions is not None else None
        if found is None:
            return None
        rows = found.rows[eligible[found.rows] & self._corpus.searchable[found.rows]]
        return Scope(rows, found.name) if len(rows) else None

    def parts(self, scope: Scope, name: Callable[[IntArray], str]) -> tuple[tuple[str, IntArray], ...]:
        """The regions a scope consists of, by name: clusters of the level that has about `PARTS` of them in it.

        `name` says what place the base nodes of one are; those of the same name are one, and those of none left out.
        """
        inside = set(scope.rows.tolist())
        by_level: dict[int, list[IntArray]] = {}
        for cluster, below in zip(self._corpus.forest.clusters, self._below, strict=True):
            rows = np.array([r for r in below.tolist() if r in inside], np.int64)
            if len(rows) >= LEAST_PART:
                by_level.setdefault(cluster.level, []).append(rows)
        several = [found for found in by_level.values() if len(found) > 1]
        joined: dict[str, list[IntArray]] = {}
        for rows in min(several, key=lambda found: abs(len(found) - PARTS), default=[]):
            joined.setdefault(name(rows), []).append(rows)
        named = ((said, np.sort(np.concatenate(rows))) for said, rows in joined.items() if said)
        return tuple(sorted(named, key=lambda part: (-len(part[1]), part[0])))

    def _name(self, cluster: int | None) -> str:
        if cluster is None:
            return "the whole map"
        found = self._corpus.forest.clusters[cluster]
        return f"the region {found.id} ({found.name})" if found.name else f"the region {found.id}"

    def _around(self, query: Query) -> int | None:
        """The smallest cluster with enough views that holds the node nearest to the robot."""
        if query.at is None:
            return None
        topomap = self._corpus.topomap
        nearest = int(distance(topomap.frame, np.array(query.at.xyz), topomap.positions).argmin())
        above = self._above(nearest)
        return next((c for c in above if len(self._below[c]) >= LOCAL_VIEWS), above[-1] if above else None)

    def _gathered(self, hits: tuple[Hit, ...]) -> int | None:
        """The smallest cluster that holds most of the hits and only a part of the map."""
        rows = [self._corpus.topomap.row[hit.node] for hit in hits]
        if len(rows) < 3:
            return None
        counts: dict[int, int] = {}
        for row in rows:
            for cluster in self._above(row):
                counts[cluster] = counts.get(cluster, 0) + 1
        limit = PART * self._corpus.forest.n_leaves
        inside = [c for c, n in counts.items() if n >= GATHERED * len(rows) and len(self._below[c]) <= limit]
        return min(inside, key=lambda c: (len(self._below[c]), c), default=None)

    def _above(self, row: int) -> list[int]:
        """Numbers of the clusters above a leaf, from below."""
        forest, up = self._corpus.forest, []
        parent = int(forest.parent[row])
        while parent >= 0:
            up.append(parent - forest.n_leaves)
            parent = int(forest.parent[parent])
        return up
