"""Exact complete linkage on 1 - S: one full matrix where it fits, passes over the closest pairs where it does not."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from erag.core.text import content_hash
from erag.core.types import IntArray
from erag.forest import guess
from erag.forest.affinity import Affinity, Doubles
from erag.forest.chain import Graph, merge
from erag.forest.dendrogram import Dendrogram, from_merges
from erag.forest.ranking import condensed_pairs, ranked
from erag.forest.search import Edges, Step, Table, pairs_within, table

DENSE_STRIPE = 256  # rows of the full matrix computed at a time


@dataclass(frozen=True)
class Limits:
    """Memory limits: rows of a full matrix, pairs held at a time, passes over the map."""

    dense: int = 4000
    edges: int = 20_000_000
    passes: int = 64


@dataclass(frozen=True)
class Goal:
    """Where a clustering may stop: merges above `height` and beyond `rows` remaining clusters are not needed."""

    height: float = float("inf")
    rows: int = 1


@dataclass(frozen=True)
class Linkage:
    """A clustering and how it was made.

    `merges` of the dendrogram reach the goal; `edges` pairs were examined in `passes` passes; `complete` is False when
    the passes ran out before the goal.
    """

    tree: Dendrogram
    merges: int
    path: Literal["dense", "sparse"]
    edges: int
    passes: int
    complete: bool = True


def complete_linkage(rows: Affinity, goal: Goal, limits: Limits, step: Step | None = None) -> Linkage:
    """Cluster `rows` (paper: CLINK on S) until `goal`; the same tree as scipy's linkage of the full matrix.

    Where pairs tie, complete linkage has several answers: ties are ordered by `ranked`. Raises ConfigError when the
    closest pairs alone exceed `limits.edges`.
    """
    if len(rows) <= limits.dense:
        tree = dense_tree(rows)
        return Linkage(tree, _reaching(tree, goal), "dense", len(rows) * (len(rows) - 1) // 2, 1)
    return _sparse(rows, goal, limits, step)


def dense_tree(rows: Affinity) -> Dendrogram:
    """The whole tree through scipy's nearest-neighbour chain over the condensed matrix."""
    from scipy.cluster.hierarchy import linkage

    n = len(rows)
    if n < 2:
        return from_merges(n, [], [])
    rank, heights = ranked(condensed(rows), condensed_pairs(n))
    steps = linkage(rank.astype(np.float64), "complete")
    return Dendrogram(n, steps[:, :2].astype(np.int64), heights[steps[:, 2].astype(np.int64)])


def condensed(rows: Affinity) -> Doubles:
    """(n (n - 1) / 2,) dissimilarities of all pairs i < j in scipy's order."""
    n = len(rows)
    out = np.empty(n * (n - 1) // 2)
    at = 0
    for begin in range(0, n, DENSE_STRIPE):
        block = rows.block(slice(begin, min(n, begin + DENSE_STRIPE)), slice(begin, n))
        for i, line in enumerate(block):
            out[at : at + len(line) - i - 1] = line[i + 1 :]
            at += len(line) - i - 1
    return out


def _reaching(tree: Dendrogram, goal: Goal) -> int:
    """How many of the first merges the goal asks for."""
    low = int(np.searchsorted(tree.height, goal.height, side="right"))
    return min(low, max(0, tree.n - goal.rows))


def _sparse(rows: Affinity, goal: Goal, limits: Limits, step: Step | None) -> Linkage:
    """Passes with a growing threshold. Each merges all that its pairs decide; the next looks at the clusters left.

    All merges of a pass lie within its threshold, all later ones above it, so that the passes together are one exact
    clustering; only the pairs of one pass are in memory. Identical rows are merged first and searched for once.
    """
    groups = identical(rows)
    first = np.array([group[0] for group in groups], np.int64)
    run = _Run(rows.take(first), goal, limits, np.arange(len(first)), len(first))
    while not run.finished and run.passes < limits.passes:
        run.further(step)
    same = [pair for group in groups for pair in balanced_merges(group)]
    pairs = same + [(int(first[u]), int(first[v])) for u, v in run.pairs]
    tree = from_merges(len(rows), pairs, [0.0] * len(same) + run.heights)
    return Linkage(tree, _reaching(tree, goal), "sparse", run.seen, run.passes, run.finished)


@dataclass
class _Run:
    """The passes so far: `label` the cluster of each row, `count` how many, `pairs` and `heights` the merges made."""

    rows: Affinity
    goal: Goal
    limits: Limits
    label: IntArray
    count: int
    pairs: list[tuple[int, int]] = field(default_factory=list)
    heights: list[float] = field(default_factory=list)
    reached: float = -1.0
    seen: int = 0
    passes: int = 0

    @property
    def finished(self) -> bool:
        return self.count <= self.goal.rows or self.reached >= self.goal.height

    def further(self, step: Step | None) -> None:
        """One pass."""
        found = self._closest(table(self.rows, self.label), step)
        self.reached, self.seen, self.passes = found.height, self.seen + found.seen, self.passes + 1
        a, b, d = found.arrays()
        rank, heights = ranked(d, lambda at: (a[at], b[at]))
        merges = merge(Graph(self.count, a, b, rank))
        some = np.empty(self.count, np.int64)  # a row of each cluster
        some[self.label] = np.arange(len(self.label))
        self.pairs += [(int(some[u]), int(some[v])) for u, v, _ in merges]
        self.heights += [float(heights[r]) for _, _, r in merges]
        after = from_merges(self.count, [(u, v) for u, v, _ in merges], [0.0] * len(merges))
        self.label, self.count = after.labels(len(merges))[self.label], self.count - len(merges)

    def _closest(self, clusters: Table, step: Step | None) -> Edges:
        """The pairs of clusters within a guessed height, at least one unless the goal's height has none."""
        height, wider = guess.height_for(clusters, self.goal.rows, self.limits.edges), 0.02
        while True:
            height = min(height, self.goal.height)
            found = pairs_within(clusters, height, self.limits.edges, step)
            if found.seen or height >= self.goal.height:
                return found
            height, wider = height + wider, 2 * wider


def identical(rows: Affinity) -> list[list[int]]:
    """Groups of rows alike in all that counts for S, ascending; most have one row."""
    places, words = rows.positions + 0.0, rows.units + 0.0  # no negative zeros
    groups: dict[bytes, list[int]] = {}
    for i, texted in enumerate(rows.texted):
        place = b"" if texted and rows.alpha == 1 else places[i].tobytes()
        word = b"" if rows.alpha == 0 else words[i].tobytes()
        groups.setdefault(content_hash(place, word), []).append(i)
    return list(groups.values())


def balanced_merges(group: list[int]) -> list[tuple[int, int]]:
    """Merges that join a group into one cluster round by round, so that it can be split into even parts."""
    merges: list[tuple[int, int]] = []
    while len(group) > 1:
        merges += list(zip(group[::2], group[1::2], strict=False))
        group = group[::2]
    return merges
