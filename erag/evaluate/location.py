"""How far away an answer is, and what that takes from its worth: NI, P(Q|A,L), the printed formula, SPL."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from erag.core.geometry import centroid, distance, pairwise
from erag.core.types import Pose, TopoMap
from erag.retrieve.rank import Distances

_BLOCK = 256  # nodes whose distances are taken at once


@dataclass(frozen=True, slots=True)
class Paths:
    """`metres` (a,) float64 from L to each answer, and whether they run `on_edges` (a,) of the map or straight."""

    metres: npt.NDArray[np.float64]
    on_edges: npt.NDArray[np.bool_]

    @property
    def share_on_edges(self) -> float:
        """The share of the lengths that were measured along edges; 1 where there are none."""
        return float(self.on_edges.mean()) if len(self.on_edges) else 1.0


def paths(topomap: TopoMap, distances: Distances, start: Pose, nodes: Sequence[str]) -> Paths:
    """ℓ in metres from `start` to each of `nodes` (a,), in their order.

    With `erag.topomap.routes.Router` as `distances`: along the map's edges where it has any and both ends are
    connected, else the straight line. Raises KeyError for a node that is not on the map.
    """
    rows = np.array([topomap.row[node] for node in nodes], np.int64)
    metres, on_edges = distances.path_or_straight(start, rows)
    return Paths(np.asarray(metres, np.float64), np.asarray(on_edges, np.bool_))


def shortest_path(topomap: TopoMap, distances: Distances, start: Pose, goals: Collection[str]) -> float:
    """Metres from `start` to the nearest of the nodes `goals`. Raises ValueError for no goal."""
    if not goals:
        raise ValueError("a shortest path needs a goal")
    return float(paths(topomap, distances, start, sorted(goals)).metres.min())


def radius(topomap: TopoMap) -> float:
    """R: half the largest distance in metres between two nodes; 0 for a map without extent or without nodes.

    Exact at any size: nodes are taken from the outermost inwards, and those that no node can be far enough from are
    left out by the triangle inequality.
    """
    points = topomap.positions
    if len(points) < 2:
        return 0.0
    out = distance(topomap.frame, np.array(centroid(topomap.frame, points)), points)
    order = np.argsort(-out, kind="stable")
    points, out, largest = points[order], out[order], 0.0
    for start in range(0, len(points), _BLOCK):
        reachable = int(np.searchsorted(-out, out[start] - largest, side="right"))  # out[i] + out[start] >= largest
        if reachable <= start:  # such pairs were looked at from their outer end
            break
        block = pairwise(topomap.frame, points[start : start + _BLOCK], points[:reachable])
        largest = max(largest, float(block.max()))
    return largest / 2


def nearness(metres: float, radius_m: float) -> float:
    """NI = max(0, 1 − ℓ/R) in [0, 1]. Where R is 0 it is 1 for an answer at L and 0 for any other.

    Raises ValueError for a length or radius that is negative or not finite.
    """
    _check(metres, radius_m)
    if radius_m == 0:
        return float(metres == 0)
    return max(0.0, 1.0 - metres / radius_m)


def weighted(probability: float, metres: float, radius_m: float) -> float:
    """P(Q|A,L) = P(Q|A) · NI, in [0, 1]: what the paper's ablation table is consistent with."""
    return _probability(probability) * nearness(metres, radius_m)


def weighted_as_printed(probability: float, metres: float, radius_m: float) -> float:
    """P(Q|A) · (ℓ/R), the formula as the paper prints it: it rewards long paths and has no upper bound.

    Raises ValueError as `nearness`, and for a path of some length where R is 0.
    """
    _check(metres, radius_m)
    if metres == 0:
        return 0.0
    if radius_m == 0:
        raise ValueError(f"the printed formula has no value for a path of {metres} m where R is 0")
    return _probability(probability) * metres / radius_m


def spl(success: float, shortest: float, taken: float) -> float:
    """Success weighted by path length (Anderson et al., 2018): S · l / max(p, l), in [0, S].

    `shortest` is the least length in metres to anything that answers, `taken` that of the way to what was answered. S
    is 0 or 1, or a probability. Where both lengths are 0 it is S.
    """
    _check(shortest, taken)
    longest = max(shortest, taken)
    return _probability(success) * (shortest / longest if longest > 0 else 1.0)


def _check(*lengths: float) -> None:
    if not all(math.isfinite(length) and length >= 0 for length in lengths):
        raise ValueError(f"lengths must be finite and not negative, got {lengths}")


def _probability(value: float) -> float:
    if not 0 <= value <= 1:
        raise ValueError(f"a probability must lie in [0, 1], got {value}")
    return value
