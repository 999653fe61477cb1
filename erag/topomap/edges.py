"""The edges a map may have: stated by a source, by sequence, by a rule; and how doubles of a pair become one edge."""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from erag.core.geometry import Points, distance
from erag.core.types import EdgeKind, Edges, Frame, IntArray, Observation
from erag.data.reading import GivenEdge, Issue

SHORTER = 0.01  # the sphere differs from the ellipsoid by at most 0.6 %


@dataclass(frozen=True, slots=True)
class Candidates:
    """Edges before doubles are merged: `index` (2, e), `kind` (e,), `metres` (e,), `stated` (e,): by the source."""

    index: IntArray
    kind: npt.NDArray[np.int8]
    metres: npt.NDArray[np.float64]
    stated: npt.NDArray[np.bool_]

    @classmethod
    def of(cls, index: IntArray, kind: EdgeKind, metres: npt.NDArray[np.float64]) -> Candidates:
        """Measured edges (2, e) of one kind."""
        e = index.shape[1]
        return cls(index, np.full(e, kind, np.int8), metres, np.zeros(e, np.bool_))


@dataclass(frozen=True, slots=True)
class Sequenced:
    """Edges by sequence (2, e), their metres (e,), and how many steps were too long to become an edge."""

    index: IntArray
    metres: npt.NDArray[np.float64]
    too_long: int


def merge(parts: Sequence[Candidates]) -> Edges:
    """One edge a pair of nodes, ordered by its rows a < b.

    Of several, the kind decides (PATH before RADIUS before BRIDGE before OBSERVED_FROM), then a stated length before a
    measured one, then the shorter.
    """
    if not parts:
        return Edges.empty()
    index = np.sort(np.concatenate([p.index for p in parts], axis=1), axis=0)
    kind, metres, stated = (np.concatenate([getattr(p, f) for p in parts]) for f in ("kind", "metres", "stated"))
    order = np.lexsort((metres, ~stated, kind, index[1], index[0]))
    index = index[:, order]
    first = np.ones(len(order), np.bool_)
    first[1:] = (index[:, 1:] != index[:, :-1]).any(axis=0)
    return Edges(index[:, first], kind[order][first], metres[order][first])


def stated_edges(
    frame: Frame, nodes: Sequence[Observation], positions: Points, given: Sequence[GivenEdge]
) -> tuple[Candidates, tuple[Issue, ...]]:
    """The edges the sources state, their lengths as stated or measured, and what was wrong with some.

    Edges of a node to itself or to an unknown node are left out; a length that is no length (negative, not finite) is
    replaced by the measured one; one more than 1 % shorter than the straight line is kept as the source says. All
    three are reported.
    """
    row = {n.id: i for i, n in enumerate(nodes)}
    usable: list[GivenEdge] = []
    issues: list[Issue] = []
    for edge in given:
        if fault := _fault(edge, row):
            issues.append(Issue(_where(edge), fault, "edge left out"))
        else:
            usable.append(edge)
    index = np.array([(row[e.a], row[e.b]) for e in usable], np.int64).reshape(-1, 2).T
    straight = distance(frame, positions[index[0]], positions[index[1]])
    metres = np.array([math.nan if e.metres is None else e.metres for e in usable], np.float64)
    valid = np.isfinite(metres) & (metres >= 0)
    issues += _length_issues(usable, metres, straight, valid)
    kind = np.array([e.kind for e in usable], np.int8)
    return Candidates(index, kind, np.where(valid, metres, straight), valid), tuple(issues)


def _fault(edge: GivenEdge, row: dict[str, int]) -> str:
    if unknown := [end for end in (edge.a, edge.b) if end not in row]:
        return f"no node {unknown[0]!r}"
    return "joins a node to itself" if edge.a == edge.b else ""


def _length_issues(
    edges: Sequence[GivenEdge],
    metres: npt.NDArray[np.float64],
    straight: npt.NDArray[np.float64],
    valid: npt.NDArray[np.bool_],
) -> list[Issue]:
    stated = np.array([e.metres is not None for e in edges], np.bool_)
    short = valid & (metres < straight * (1 - SHORTER))
    found = []
    for i in np.flatnonzero(short | (stated & ~valid)).tolist():
        if valid[i]:
            what = f"length {metres[i]:.3f} m is shorter than the straight line, {straight[i]:.3f} m"
            found.append(Issue(_where(edges[i]), what, "kept as stated"))
        else:
            found.append(Issue(_where(edges[i]), f"{metres[i]} m is no length", f"measured: {straight[i]:.3f} m"))
    return found


def _where(edge: GivenEdge) -> str:
    return f"edge {edge.a!r}–{edge.b!r}"


def sequence_edges(
    frame: Frame,
    nodes: Sequence[Observation],
    positions: Points,
    sources: Set[str],
    max_step: float,
    timed: bool,
) -> Sequenced:
    """Edges between consecutive places of each of the `sources`, in the order of its records.

    `timed`: only where all places of the source bear strictly increasing instants.
    """
    places: dict[str, list[int]] = {}
    for i, node in enumerate(nodes):
        if node.kind == "place" and node.source in sources:
            places.setdefault(node.source, []).append(i)
    steps = [
        np.array([rows[:-1], rows[1:]], np.int64)
        for rows in places.values()
        if not timed or _increasing([nodes[i] for i in rows])
    ]
    index = np.concatenate([np.empty((2, 0), np.int64), *steps], axis=1)
    metres = distance(frame, positions[index[0]], positions[index[1]])
    near = metres <= max_step
    return Sequenced(index[:, near], metres[near], int((~near).sum()))


def _increasing(places: Sequence[Observation]) -> bool:
    times = [p.time for p in places]
    instants = [t.start for t in times if t is not None and t.start == t.end]
    return len(instants) == len(places) and all(a < b for a, b in pairwise(instants))


def traversable_nodes(nodes: Sequence[Observation], edges: Edges) -> npt.NDArray[np.bool_]:
    """(n,) bool: the nodes a route may pass: places, and whatever a traversable edge touches.

    A map without places is a map of objects alone; then all of them are, since nothing else is.
    """
    passable = np.array([n.kind == "place" for n in nodes], np.bool_)
    if not passable.any():
        return np.ones(len(nodes), np.bool_)
    passable[edges.index[:, edges.traversable].ravel()] = True
    return passable
