"""Trips to a waypoint over the map: routes, blocked edges found on the way, new routes; success, and SPL."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from erag.core.geometry import EARTH_RADIUS_M, Points, centroid
from erag.core.types import Edges, Frame, Pose, Route, TopoMap
from erag.evaluate.location import spl
from erag.evaluate.navigation.planner import Leg, LocalPlanner, Point
from erag.evaluate.statistics import Interval, bootstrap
from erag.topomap.routes import Router

Pair = frozenset[str]  # the two nodes of an edge
Status = Literal["arrived", "missed", "blocked", "lost", "no_route"]
SUCCESS_M = 3.0


@dataclass(frozen=True, slots=True)
class Trip:
    """One attempt to get somewhere.

    `arrived`: the robot stopped within the success radius of the goal. `missed`: it believes so and is wrong.
    `blocked`: no open way is left. `lost`: its planner gave up. `no_route`: the map has none from there, or no start.
    `metres` were driven, `shortest_m` is the shortest open way (None where there is none), `error_m` the distance from
    the goal at the end (None without a route), `replans` the routes that were made anew.
    """

    status: Status
    metres: float = 0.0
    shortest_m: float | None = None
    error_m: float | None = None
    replans: int = 0

    @property
    def spl(self) -> float:
        """Success weighted by path length: 0 unless it arrived."""
        if self.status != "arrived" or self.shortest_m is None:
            return 0.0
        return spl(1.0, self.shortest_m, self.metres)


@dataclass(frozen=True)
class NavigationScore:
    """Trips of a run: `success` and `spl` with 95 % intervals, how many ended how, replans a trip."""

    trips: int
    success: Interval
    spl: Interval
    statuses: Mapping[str, int]
    replans: float


class Course:
    """The ground a robot drives on: a map, what blocks it unknown to the map, and who drives.

    `blocked` are pairs of node ids; a trip succeeds within `success_m` metres of its goal.
    """

    def __init__(
        self, topomap: TopoMap, planner: LocalPlanner, blocked: Collection[Pair] = (), success_m: float = SUCCESS_M
    ) -> None:
        self._map, self._planner, self._blocked = topomap, planner, frozenset(blocked)
        self._success_m = success_m
        self._plane = _Plane(topomap)
        self._open = Router(without(topomap, self._blocked))
        self._planned = Router(topomap)

    def trip(self, start: Pose | None, goal: str, seed: int = 0) -> Trip:
        """Drive from `start` to the node `goal` (for an object, to the place it was observed from).

        The robot plans on the map; where its planner meets a blocked edge it turns back to the node before it, strikes
        the edge out and plans again. Raises InputError for a goal that is not on the map.
        """
        route = self._planned.route(start, goal)
        if start is None or route.status != "ok":
            return Trip("no_route")
        best = self._open.route(start, goal)
        position, metres, known = self._plane.metres(np.array([start.xyz]))[0], 0.0, set[Pair]()
        while route.status == "ok":
            drive = self._planner.follow(position, self._legs(route), seed + len(known))
            position, metres = drive.position, metres + drive.metres
            if drive.ending != "blocked":
                error = float(np.linalg.norm(position - self._at(route.nodes[-1])))
                there: Status = "arrived" if error <= self._success_m else "missed"
                return Trip(there if drive.ending == "arrived" else "lost", metres, best.length_m, error, len(known))
            before, after = route.nodes[drive.finished - 1], route.nodes[drive.finished]
            known.add(frozenset((before, after)))
            route = Router(without(self._map, known)).route(before, goal)
        error = float(np.linalg.norm(position - self._at(goal)))
        return Trip("blocked", metres, best.length_m, error, len(known))

    def _legs(self, route: Route) -> list[Leg]:
        """To the first node, which no edge leads to, and from node to node."""
        pairs = [frozenset(pair) for pair in zip(route.nodes, route.nodes[1:], strict=False)]
        blocked = [False, *(pair in self._blocked for pair in pairs)]
        return [Leg(self._at(node), shut) for node, shut in zip(route.nodes, blocked, strict=True)]

    def _at(self, node: str) -> Point:
        return np.asarray(self._plane.nodes[self._map.row[node]])


class _Plane:
    """A local frame in metres: the map's own, or for WGS84 east and north of the nodes' centre (flat, for a few km)."""

    def __init__(self, topomap: TopoMap) -> None:
        self._frame = topomap.frame
        self._origin = np.array(centroid(topomap.frame, topomap.positions) if len(topomap) else (0.0, 0.0, 0.0))
        self.nodes = self.metres(topomap.positions)  # (n, 3)

    def metres(self, positions: Points) -> Points:
        """(n, 3) positions of the map's frame in the local one."""
        if self._frame is Frame.METRIC:
            return np.asarray(positions, np.float64)
        away = positions - self._origin
        east = (away[:, 0] + 180) % 360 - 180
        degree = EARTH_RADIUS_M * np.pi / 180
        return np.stack([east * degree * np.cos(np.radians(self._origin[1])), away[:, 1] * degree, positions[:, 2]], 1)


def without(topomap: TopoMap, pairs: Collection[Pair]) -> TopoMap:
    """The map without its edges between the nodes of `pairs`."""
    edges, ids = topomap.edges, [node.id for node in topomap.nodes]
    keep = np.array([frozenset((ids[a], ids[b])) not in pairs for a, b in edges.index.T.tolist()], np.bool_)
    return replace(topomap, edges=Edges(edges.index[:, keep], edges.kind[keep], edges.metres[keep]))


def random_blockages(topomap: TopoMap, share: float, seed: int = 0) -> frozenset[Pair]:
    """A `share` in [0, 1] of the pairs of nodes that traversable edges join, drawn by `seed`. Raises ValueError."""
    if not 0 <= share <= 1:
        raise ValueError(f"the share of blocked edges must lie in [0, 1], got {share}")
    ids = [node.id for node in topomap.nodes]
    index = topomap.edges.index[:, topomap.edges.traversable]
    pairs = sorted({tuple(sorted((ids[a], ids[b]))) for a, b in index.T.tolist()})
    drawn = np.random.default_rng(seed).permutation(len(pairs))[: round(share * len(pairs))]
    return frozenset(frozenset(pairs[i]) for i in drawn)


def navigation_score(trips: Sequence[Trip], seed: int = 0) -> NavigationScore:
    """The score of trips. Raises ValueError for none."""
    return NavigationScore(
        len(trips),
        bootstrap([float(t.status == "arrived") for t in trips], seed=seed),
        bootstrap([t.spl for t in trips], seed=seed),
        dict(sorted(Counter(t.status for t in trips).items())),
        sum(t.replans for t in trips) / len(trips),
    )


def end_to_end(generation: Sequence[float], trips: Sequence[Trip]) -> tuple[float, float, float]:
    """Means over queries: generation success, navigation success, and both at once.

    `generation` is P(Q|A) of what was answered, or 0 and 1. A query that was not answered has the trip `no_route` and
    fails in both. Raises ValueError for unequal lengths or no query.
    """
    if len(generation) != len(trips) or not trips:
        raise ValueError(f"{len(generation)} answers and {len(trips)} trips: one each a query, and one query at least")
    arrived = np.array([t.status == "arrived" for t in trips], np.float64)
    right = np.asarray(generation, np.float64)
    return float(right.mean()), float(arrived.mean()), float((right * arrived).mean())
