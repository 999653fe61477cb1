"""Complete linkage of a sparse graph: nearest-neighbour chains over neighbour lists, absent pairs being too far."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from erag.core.types import IntArray

Ints = npt.NDArray[np.int32]
Merge = tuple[int, int, int]  # a vertex of either cluster and the rank of their farthest pair
SMALL_COMPONENT = 1500  # vertices up to which a component is clustered through its own full matrix


@dataclass(frozen=True)
class Graph:
    """The pairs of m vertices that may merge: `a`, `b` (e,) int32 and their `rank` (e,) int32, all different."""

    m: int
    a: Ints
    b: Ints
    rank: Ints

    def __len__(self) -> int:
        return len(self.rank)


def merge(graph: Graph) -> list[Merge]:
    """All merges of exact complete linkage over `graph`, by ascending rank.

    Two clusters may merge only if every pair between them is in the graph; their distance is the largest rank of those
    pairs. Since complete linkage is reducible and ranks are all different, the order in which components and chains are
    worked through does not change the result. Small components go through scipy's full matrix.
    """
    merges: list[Merge] = []
    for part in _components(graph):
        small = len(part.vertices) <= SMALL_COMPONENT
        merges += _dense(part, len(graph)) if small else _Chains(part.graph(graph.m)).run()
    return sorted(merges, key=lambda m: m[2])


@dataclass(frozen=True)
class _Part:
    """One component: its vertices, ascending, and its edges."""

    vertices: IntArray
    a: Ints
    b: Ints
    rank: Ints

    def graph(self, m: int) -> Graph:
        return Graph(m, self.a, self.b, self.rank)


def _components(graph: Graph) -> Iterator[_Part]:
    """The connected components that have an edge."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    shape = (graph.m, graph.m)
    links = coo_matrix((np.ones(len(graph), np.int8), (graph.a, graph.b)), shape)
    count, label = connected_components(links, directed=False)
    if count == 1:
        yield _Part(np.arange(graph.m), graph.a, graph.b, graph.rank)
        return
    vertices, of_vertex = _grouped(label, count)
    edges, of_edge = _grouped(label[graph.a], count)
    for c in np.flatnonzero(np.diff(of_edge)):
        e = edges[of_edge[c] : of_edge[c + 1]]
        v = vertices[of_vertex[c] : of_vertex[c + 1]]
        yield _Part(v, graph.a[e], graph.b[e], graph.rank[e])


def _grouped(label: npt.NDArray[np.int32], count: int) -> tuple[IntArray, IntArray]:
    """Indices ordered by label, and where each label begins (count + 1)."""
    order = np.argsort(label, kind="stable")
    return order, np.searchsorted(label[order], np.arange(count + 1))


def _dense(part: _Part, absent: int) -> list[Merge]:
    """Complete linkage of one component through its full matrix of ranks; `absent` is above every rank."""
    from scipy.cluster.hierarchy import linkage
    from scipy.spatial.distance import squareform

    if len(part.vertices) == 2:
        return [(int(part.a[0]), int(part.b[0]), int(part.rank[0]))]
    i, j = (np.searchsorted(part.vertices, v) for v in (part.a, part.b))
    matrix = np.full((len(part.vertices),) * 2, float(absent))
    matrix[i, j] = matrix[j, i] = part.rank
    steps = linkage(squareform(matrix, checks=False), "complete")
    some = list(part.vertices)  # a vertex of each node of the tree
    merges: list[Merge] = []
    for left, right, rank, _ in steps[steps[:, 2] < absent]:
        merges.append((int(some[int(left)]), int(some[int(right)]), int(rank)))
        some.append(some[int(left)])
    return merges


class _Chains:
    """Nearest-neighbour chains. A cluster's list (ids, ranks) holds the clusters it may merge with.

    Lists are brought up to date only when their cluster comes up: ids of merged clusters are replaced by what they
    became, and a cluster only some of whose parts were in the list is dropped, since its other parts are too far.
    """

    def __init__(self, graph: Graph) -> None:
        self.m, top = graph.m, 2 * graph.m
        self.neighbours = _neighbour_lists(graph)
        self.lists: dict[int, tuple[Ints, Ints]] = {}
        self.became = np.arange(top, dtype=np.int32)
        self.size = np.ones(top, np.int32)
        self.some = np.arange(top, dtype=np.int64)  # a vertex of each cluster
        self.scratch = np.full(top, -1, np.int32)
        self.next = graph.m
        self.starts = np.unique(graph.a)

    def run(self) -> list[Merge]:
        merges: list[Merge] = []
        for start in self.starts:
            self._chain_from(int(start), merges)
        made = self.m
        while made < self.next:  # clusters made on the way may have neighbours left
            self._chain_from(made, merges)
            made += 1
        return merges

    def _chain_from(self, start: int, merges: list[Merge]) -> None:
        chain = [start] if self.became[start] == start else []
        while chain:
            self._step(chain, merges)

    def _step(self, chain: list[int], merges: list[Merge]) -> None:
        ids, ranks = self._current(chain[-1])
        if not ids.size:
            chain.pop()  # only the first of a chain can be without neighbours
            return
        best = int(ranks.argmin())
        nearest = int(ids[best])
        if len(chain) < 2 or nearest != chain[-2]:
            chain.append(nearest)
            return
        a, b = chain.pop(), chain.pop()
        merges.append((int(self.some[a]), int(self.some[b]), int(ranks[best])))
        self._join(a, b)

    def _current(self, cluster: int) -> tuple[Ints, Ints]:
        """The list of `cluster`, up to date."""
        if cluster not in self.lists:
            self.lists[cluster] = self.neighbours(cluster)
        ids, ranks = self.lists[cluster]
        gone = self.became[ids] != ids
        if gone.any():
            new_ids, new_ranks = self._renamed(ids[gone], ranks[gone])
            ids, ranks = np.concatenate([ids[~gone], new_ids]), np.concatenate([ranks[~gone], new_ranks])
            self.lists[cluster] = ids, ranks
        return ids, ranks

    def _renamed(self, ids: Ints, ranks: Ints) -> tuple[Ints, Ints]:
        """Merged clusters replaced by what they became, the largest rank of the parts; incomplete ones dropped."""
        now = self.became[ids]
        while True:
            after = self.became[now]
            if np.array_equal(after, now):
                break
            now = after
        self.became[ids] = now
        order = now.argsort(kind="stable")
        now, first = now[order], np.ones(len(now), bool)
        first[1:] = now[1:] != now[:-1]
        at = np.flatnonzero(first)
        whole = np.add.reduceat(self.size[ids[order]], at) == self.size[now[at]]
        return now[at][whole], np.maximum.reduceat(ranks[order], at)[whole]

    def _join(self, a: int, b: int) -> None:
        """Make a new cluster of a and b: the neighbours they share, at the larger rank."""
        (ids_a, ranks_a), (ids_b, ranks_b) = self._current(a), self._current(b)
        del self.lists[a], self.lists[b]
        new, self.next = self.next, self.next + 1
        self.became[[a, b]] = new
        self.size[new] = self.size[a] + self.size[b]
        self.some[new] = self.some[a]
        self.scratch[ids_a] = ranks_a
        of_a = self.scratch[ids_b]
        self.scratch[ids_a] = -1
        shared = of_a >= 0
        self.lists[new] = ids_b[shared], np.maximum(of_a[shared], ranks_b[shared])


def _neighbour_lists(graph: Graph) -> Callable[[int], tuple[Ints, Ints]]:
    """A function from a vertex to its neighbours (ids, ranks), over both directions of the edges."""
    from scipy.sparse import coo_matrix

    coo = coo_matrix((graph.rank, (graph.a, graph.b)), (graph.m, graph.m))
    down, up = coo.tocsr(), coo.tocsc()

    def of(v: int) -> tuple[Ints, Ints]:
        d, u = slice(down.indptr[v], down.indptr[v + 1]), slice(up.indptr[v], up.indptr[v + 1])
        ids = np.concatenate([down.indices[d], up.indices[u]])
        return ids.astype(np.int32, copy=False), np.concatenate([down.data[d], up.data[u]])

    return of
