"""Observations and stated edges become a topological map (paper, section on memory)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from erag.core.errors import InputError
from erag.core.geometry import Points
from erag.core.types import EdgeKind, Edges, Frame, IntArray, Observation, TopoMap
from erag.data.reading import GivenEdge
from erag.topomap.bridges import bridges, components
from erag.topomap.config import MapConfig
from erag.topomap.edges import Candidates, Sequenced, merge, sequence_edges, stated_edges, traversable_nodes
from erag.topomap.neighbours import Neighbours, auto_radius, nearest_foreign
from erag.topomap.report import MapReport, describe


def build_map(
    frame: Frame, observations: Sequence[Observation], given: Sequence[GivenEdge], config: MapConfig
) -> tuple[TopoMap, MapReport]:
    """The map of n observations, in their order, with one edge a pair of nodes, and what there is to say about it.

    Equal input gives an equal map. Raises InputError when two observations have one id, ConfigError when the radius
    would join more than 10 million pairs.
    """
    nodes = tuple(observations)
    _check_ids(nodes)
    positions = TopoMap(frame, nodes, Edges.empty()).positions
    stated, issues = stated_edges(frame, nodes, positions, given)
    walked = _sequence(frame, nodes, positions, stated, config)
    ways = [stated, Candidates.of(walked.index, EdgeKind.PATH, walked.metres)]
    near, radius = _radius_edges(frame, nodes, positions, ways, config)
    met = _meeting_edges(frame, nodes, positions, merge([*ways, near]), config.meet)
    parts = [*ways, near, met]
    joined = merge(parts)
    bridging = config.bridge is True or (config.bridge == "auto" and not any(_traversable(w).any() for w in ways))
    if bridging:
        parts.append(_bridge_edges(frame, nodes, positions, joined, config.max_bridge))
    if config.observed_from:
        parts.append(_observed_from(frame, nodes, positions, joined))
    topomap = TopoMap(frame, nodes, merge(parts))
    report = describe(topomap)
    return topomap, replace(
        report,
        radius_m=radius,
        by_sequence=walked.index.shape[1],
        steps_too_long=walked.too_long,
        meetings=met.index.shape[1],
        bridges_left_out=max(0, report.components - 1) if bridging else 0,
        issues=issues,
    )


def _check_ids(nodes: Sequence[Observation]) -> None:
    seen: dict[str, Observation] = {}
    for node in nodes:
        if (other := seen.setdefault(node.id, node)) is not node:
            raise InputError(
                f"two nodes have the id {node.id!r} (sources {other.source!r} and {node.source!r})",
                allowed="ids that are unique in a map",
            )


def _traversable(part: Candidates) -> npt.NDArray[np.bool_]:
    return np.not_equal(part.kind, EdgeKind.OBSERVED_FROM)


def _sources_with_ways(nodes: Sequence[Observation], ways: Sequence[Candidates]) -> set[str]:
    """The sources of which a traversable edge touches a node."""
    rows = np.unique(np.concatenate([w.index[:, _traversable(w)].ravel() for w in ways]))
    return {nodes[i].source for i in rows}


def _sequence(
    frame: Frame, nodes: Sequence[Observation], positions: Points, stated: Candidates, config: MapConfig
) -> Sequenced:
    sources = {n.source for n in nodes} if config.path != "given" else set()
    if config.path == "auto":
        sources -= _sources_with_ways(nodes, [stated])
    return sequence_edges(frame, nodes, positions, sources, config.max_path_step, timed=config.path == "auto")


def _radius_edges(
    frame: Frame, nodes: Sequence[Observation], positions: Points, ways: Sequence[Candidates], config: MapConfig
) -> tuple[Candidates, float | None]:
    """The radius edges and the radius in metres, None where none applies."""
    rows = _passable_by_rule(nodes)
    asking = np.ones(len(rows), np.bool_)
    radius = config.edge_radius
    if radius == "auto":
        having = _sources_with_ways(nodes, ways)
        asking = np.array([nodes[i].source not in having for i in rows], np.bool_)
        radius = auto_radius(frame, positions[rows[asking]]) if asking.any() else None
    if radius is None:
        return Candidates.of(np.empty((2, 0), np.int64), EdgeKind.RADIUS, np.empty(0)), None
    index, metres = Neighbours(frame, positions[rows]).pairs_within(radius)
    asked = asking[index].any(axis=0)
    return Candidates.of(rows[index[:, asked]], EdgeKind.RADIUS, metres[asked]), radius


def _passable_by_rule(nodes: Sequence[Observation]) -> IntArray:
    """Rows of the nodes the radius rule joins: the places, or all objects where there is no place."""
    return np.flatnonzero(traversable_nodes(nodes, Edges.empty()))


def _meeting_edges(
    frame: Frame, nodes: Sequence[Observation], positions: Points, joined: Edges, meet: float | None
) -> Candidates:
    """An edge from each place to the nearest one of another component, where that is at most `meet` metres away."""
    rows = _passable_by_rule(nodes)
    label = _labels(nodes, joined, rows)
    found = nearest_foreign(frame, positions[rows], label, 0.0 if meet is None else meet)
    start = np.flatnonzero((found.row >= 0) & (meet is not None))
    pairs = np.sort(np.stack([start, found.row[start]]), axis=0)
    index, first = np.unique(pairs, axis=1, return_index=True)
    return Candidates.of(rows[index], EdgeKind.RADIUS, found.metres[start][first])


def _bridge_edges(
    frame: Frame, nodes: Sequence[Observation], positions: Points, joined: Edges, max_bridge: float | None
) -> Candidates:
    rows = np.flatnonzero(traversable_nodes(nodes, joined))
    index, metres = bridges(frame, positions[rows], _labels(nodes, joined, rows), max_bridge)
    return Candidates.of(rows[index], EdgeKind.BRIDGE, metres)


def _labels(nodes: Sequence[Observation], joined: Edges, rows: IntArray) -> IntArray:
    """The component of each of the rows under the traversable edges, counted from 0 among these rows."""
    _, label = components(len(nodes), joined.index[:, joined.traversable])
    _, compact = np.unique(label[rows], return_inverse=True)
    return compact.astype(np.int64)


def _observed_from(frame: Frame, nodes: Sequence[Observation], positions: Points, joined: Edges) -> Candidates:
    """An edge from each object without edges to the nearest place."""
    is_place = np.array([n.kind == "place" for n in nodes], np.bool_)
    places = np.flatnonzero(is_place)
    loose = np.flatnonzero(~is_place & ~np.isin(np.arange(len(nodes)), joined.index)) if len(places) else places
    found = Neighbours(frame, positions[places]).nearest(positions[loose])
    return Candidates.of(np.stack([loose, places[found.row]]), EdgeKind.OBSERVED_FROM, found.metres)
