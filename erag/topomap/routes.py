"""Shortest ways over the map: routes to a node, and distances to many."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from erag.core.errors import InputError
from erag.core.geometry import distance
from erag.core.types import EdgeKind, Edges, Frame, IntArray, Pose, Route, TopoMap
from erag.topomap.edges import Candidates, merge, traversable_nodes
from erag.topomap.neighbours import Neighbours

MAX_SNAP_M = 50.0
Metres = npt.NDArray[np.float64]


class _Start(NamedTuple):
    """The row a route starts at, and the metres from where the robot stands to it."""

    row: int
    metres: float


class _Links(NamedTuple):
    """The `OBSERVED_FROM` edges (k,), sorted by object: the object, the place it was seen from, the metres between."""

    objects: IntArray
    places: IntArray
    metres: Metres


class Router:
    """Routes over the traversable edges of a map (Dijkstra); nothing is computed before the first question.

    Ask one router many things: the matrix, the tree of traversable nodes and the index are kept.
    """

    def __init__(self, topomap: TopoMap) -> None:
        self._map = topomap

    def route(self, start: Pose | str | None, goal: str, max_snap_m: float = MAX_SNAP_M) -> Route:
        """The shortest route to the node `goal`; see `routes`."""
        return self.routes(start, [goal], max_snap_m)[0]

    def routes(self, start: Pose | str | None, goals: Sequence[str], max_snap_m: float = MAX_SNAP_M) -> list[Route]:
        """The shortest routes from a pose or node id to each of the goals (node ids), by one search.

        A pose starts at the nearest traversable node; `off_map` where none is within `max_snap_m` metres, `no_start`
        without a start, `unreachable` where no traversable edges lead to the goal. A route to an object ends at the
        place it was observed from (of several, the one reached first). `length_m` is the straight way from the pose to
        the first node and the metres of the edges. Raises InputError for an unknown id and for a pose off the globe.
        """
        rows = [self._row(goal) for goal in goals]
        if start is None:
            return [Route("no_start") for _ in rows]
        if (at := self._start(start, max_snap_m)) is None:
            return [Route("off_map") for _ in rows]
        metres, before = dijkstra(self._matrix, indices=at.row, return_predecessors=True)
        return [self._way(at, self._stop(row, metres), metres, before) for row in rows]

    def distances(self, starts: Sequence[int] | IntArray) -> Metres:
        """(s, n) metres over traversable edges from the nodes in rows `starts` to all n nodes, inf where none lead."""
        distinct, back = np.unique(np.asarray(starts, np.int64), return_inverse=True)
        if not len(distinct):
            return np.empty((0, len(self._map)))
        return np.asarray(dijkstra(self._matrix, indices=distinct))[back]

    def path_or_straight(
        self, start: Pose, rows: Sequence[int] | IntArray, max_snap_m: float = MAX_SNAP_M
    ) -> tuple[Metres, npt.NDArray[np.bool_]]:
        """Metres (r,) from a pose to the nodes in `rows`, and whether they were measured along edges (r,)."""
        metres, is_graph = self.paths_or_straight([start], rows, max_snap_m)
        return metres[0], is_graph[0]

    def paths_or_straight(
        self, starts: Sequence[Pose], rows: Sequence[int] | IntArray, max_snap_m: float = MAX_SNAP_M
    ) -> tuple[Metres, npt.NDArray[np.bool_]]:
        """Metres (s, r) from poses to the nodes in `rows`, and whether they were measured along edges (s, r).

        Along edges: straight to the nearest traversable node, then the edges, and for an object the way on from the
        place it was observed from. Where that cannot be had, or the pose is off the map, the straight line.
        """
        wanted = np.asarray(rows, np.int64)
        points = np.array([s.xyz for s in starts], np.float64).reshape(-1, 3)
        metres = distance(self._map.frame, points[:, None], self._map.positions[wanted][None])
        is_graph = np.zeros(metres.shape, np.bool_)
        found = [self._start(s, max_snap_m) for s in starts]
        on_map = [i for i, at in enumerate(found) if at is not None]
        snaps = [at for at in found if at is not None]
        along = self._with_objects(self.distances([at.row for at in snaps]))[:, wanted]
        along = along + np.array([at.metres for at in snaps], np.float64)[:, None]
        is_graph[on_map] = np.isfinite(along)
        metres[on_map] = np.where(np.isfinite(along), along, metres[on_map])
        return metres, is_graph

    @cached_property
    def _matrix(self) -> csr_array:
        """(n, n) symmetric metres; edges of no length are stored zeros, which csgraph takes as edges."""
        edges, n = self._edges, len(self._map)
        index = np.concatenate([edges.index, edges.index[::-1]], axis=1)
        return csr_array((np.tile(edges.metres, 2), (index[0], index[1])), shape=(n, n))

    @cached_property
    def _edges(self) -> Edges:
        """The traversable edges, one a pair: the matrix would add doubles up."""
        edges = self._map.edges
        keep = edges.traversable
        unstated = np.zeros(int(keep.sum()), np.bool_)
        return merge([Candidates(edges.index[:, keep], edges.kind[keep], edges.metres[keep], unstated)])

    @cached_property
    def _keys(self) -> IntArray:
        """(e,) ascending keys of the pairs of rows, since `merge` orders by them."""
        low, high = self._edges.index
        return np.asarray(low * len(self._map) + high)

    @cached_property
    def _passable(self) -> npt.NDArray[np.bool_]:
        return traversable_nodes(self._map.nodes, self._map.edges)

    @cached_property
    def _passable_rows(self) -> IntArray:
        return np.flatnonzero(self._passable)

    @cached_property
    def _neighbours(self) -> Neighbours:
        return Neighbours(self._map.frame, self._map.positions[self._passable_rows])

    @cached_property
    def _links(self) -> _Links:
        """Ties between a traversable and another node; between two of a kind a tie says nothing."""
        edges = self._map.edges
        tied = np.flatnonzero(~edges.traversable)
        a, b = edges.index[:, tied]
        mixed = self._passable[a] != self._passable[b]
        objects, places = np.where(self._passable[a], b, a)[mixed], np.where(self._passable[a], a, b)[mixed]
        metres = edges.metres[tied][mixed]
        order = np.lexsort((places, metres, objects))
        return _Links(objects[order], places[order], metres[order])

    def _row(self, node: str) -> int:
        row = self._map.row.get(node)
        if row is None:
            close = difflib.get_close_matches(node[:100], self._map.row, n=1, cutoff=0.0)
            raise InputError(
                f"no node {node!r} on this map of {len(self._map):,} nodes",
                allowed=f"a node id, for example {close[0]!r}" if close else "the map is empty",
            )
        return row

    def _start(self, start: Pose | str, max_snap_m: float) -> _Start | None:
        if isinstance(start, Pose):
            return self._snap(start, max_snap_m)
        row = self._row(start)
        if self._passable[row]:
            return _Start(row, 0.0)
        ties = self._ties(row)
        return _Start(int(self._links.places[ties][0]), float(self._links.metres[ties][0])) if len(ties) else None

    def _snap(self, pose: Pose, max_snap_m: float) -> _Start | None:
        if self._map.frame is Frame.WGS84 and abs(pose.y) > 90:
            raise InputError(
                f"latitude {pose.y} of the pose {pose.xyz}", allowed="x = longitude, y = latitude, |y| <= 90"
            )
        found = self._neighbours.nearest(np.array([pose.xyz], np.float64), max_snap_m)
        return _Start(int(self._passable_rows[found.row[0]]), float(found.metres[0])) if found.row[0] >= 0 else None

    def _ties(self, row: int) -> IntArray:
        """Where the ties of an object stand in `_links`, the shortest first."""
        return np.arange(*np.searchsorted(self._links.objects, [row, row + 1]))

    def _stop(self, row: int, metres: Metres) -> int | None:
        """The row at which a route to `row` ends, given the `metres` (n,) from the start; None for a loose object."""
        if self._passable[row]:
            return row
        places = self._links.places[self._ties(row)]
        return int(places[metres[places].argmin()]) if len(places) else None

    def _way(self, at: _Start, stop: int | None, metres: Metres, before: npt.NDArray[np.int32]) -> Route:
        if stop is None or not np.isfinite(metres[stop]):
            return Route("unreachable")
        rows = [stop]
        while rows[-1] != at.row:
            rows.append(int(before[rows[-1]]))
        used = self._edge_numbers(np.array(rows[::-1], np.int64))
        length = at.metres + float(self._edges.metres[used].sum())
        bridges = int((self._edges.kind[used] == EdgeKind.BRIDGE).sum())
        return Route("ok", tuple(self._map.nodes[i].id for i in reversed(rows)), length, bridges)

    def _edge_numbers(self, rows: IntArray) -> IntArray:
        """The edges (p - 1,) between the consecutive `rows` (p,) of a way."""
        low, high = np.minimum(rows[:-1], rows[1:]), np.maximum(rows[:-1], rows[1:])
        return np.searchsorted(self._keys, low * len(self._map) + high).astype(np.int64)

    def _with_objects(self, metres: Metres) -> Metres:
        """`metres` (s, n) with the objects filled in: the least, over their ties, of way to the place and tie."""
        links = self._links
        if not len(links.objects):
            return metres
        objects, first = np.unique(links.objects, return_index=True)
        metres[:, objects] = np.minimum.reduceat(metres[:, links.places] + links.metres, first, axis=1)
        return metres
