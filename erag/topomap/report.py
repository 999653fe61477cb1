"""What a map consists of: nodes, edges by kind, components, bridges."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from erag.core.errors import printable
from erag.core.types import EdgeKind, TopoMap
from erag.data.reading import Issue
from erag.topomap.bridges import components
from erag.topomap.edges import traversable_nodes

LARGEST = 5


@dataclass(frozen=True, slots=True)
class MapReport:
    """Counts over a map; lengths in metres.

    `components`, the sizes of the `largest` of them and the `isolated` nodes are those of the traversable nodes and
    edges. What follows `unattached` is known only where the map was built: the radius used, the steps of a sequence
    too long to become an edge, the edges where recordings meet (among those of `radius`), the components that
    `max_bridge` kept apart, and the issues with stated edges.
    """

    nodes: int
    places: int
    objects: int
    path: int
    radius: int
    bridge: int
    observed_from: int
    components: int
    largest: tuple[int, ...]
    isolated: int
    bridge_total_m: float
    bridge_longest_m: float
    unattached: int
    radius_m: float | None = None
    by_sequence: int = 0
    steps_too_long: int = 0
    meetings: int = 0
    bridges_left_out: int = 0
    issues: tuple[Issue, ...] = ()

    def lines(self) -> list[str]:
        """The report as text, a fact a line."""
        return list(self._lines())

    def _lines(self) -> Iterator[str]:
        yield f"{_of(self.nodes, 'node')}: {_of(self.places, 'place')}, {_of(self.objects, 'object')}"
        sequence = f" ({self.by_sequence:,} by sequence)" if self.by_sequence else ""
        within = f" (within {self.radius_m:.1f} m)" if self.radius_m is not None else ""
        yield (
            f"edges: {self.path:,} path{sequence}, {self.radius:,} radius{within}, {self.bridge:,} bridge, "
            f"{self.observed_from:,} observed_from"
        )
        sizes = ", ".join(f"{size:,}" for size in self.largest)
        yield f"{_of(self.components, 'component')}, largest: {sizes or 'none'}; {_of(self.isolated, 'isolated node')}"
        if self.meetings:
            yield f"recordings meet at {_of(self.meetings, 'spot')}"
        if self.bridge:
            yield f"bridges: {self.bridge_total_m:,.1f} m in all, longest {self.bridge_longest_m:,.1f} m"
        if self.bridges_left_out:
            yield f"{_of(self.bridges_left_out, 'bridge')} left out as longer than max_bridge"
        if self.steps_too_long:
            yield f"{_of(self.steps_too_long, 'step')} of a sequence left out as longer than max_path_step"
        if self.unattached:
            yield f"{_of(self.unattached, 'object')} without an edge"
        if self.issues:
            first = self.issues[0]
            told = printable(f"{first.where}: {first.what} ({first.action})", 200)
            yield f"{_of(len(self.issues), 'issue')} with stated edges, the first: {told}"


def describe(topomap: TopoMap) -> MapReport:
    """Count what a finished map shows; the fields only its building knows keep their defaults."""
    nodes, edges = topomap.nodes, topomap.edges
    passable = traversable_nodes(nodes, edges)
    _, label = components(len(nodes), edges.index[:, edges.traversable])
    sizes = np.sort(np.unique(label[passable], return_counts=True)[1])[::-1]
    bridge_m = edges.metres[edges.kind == EdgeKind.BRIDGE]
    touched = np.isin(np.arange(len(nodes)), edges.index)
    is_object = np.array([n.kind == "object" for n in nodes], np.bool_)
    path, radius, bridge, observed = (int((edges.kind == k).sum()) for k in EdgeKind)
    return MapReport(
        nodes=len(nodes),
        places=int((~is_object).sum()),
        objects=int(is_object.sum()),
        path=path,
        radius=radius,
        bridge=bridge,
        observed_from=observed,
        components=len(sizes),
        largest=tuple(int(s) for s in sizes[:LARGEST]),
        isolated=int((sizes == 1).sum()),
        bridge_total_m=float(bridge_m.sum()),
        bridge_longest_m=float(bridge_m.max(initial=0.0)),
        unattached=int((is_object & ~touched & ~passable).sum()),
    )


def _of(count: int, noun: str) -> str:
    return f"{count:,} {noun}" if count == 1 else f"{count:,} {noun}s"
