"""What is kept on a cluster beside its members: position, mean distance, mean vector, mean sensor readings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from erag.core.geometry import Points, centroid, mean_pairwise_distance
from erag.core.types import Cluster, IntArray, TopoMap
from erag.forest.affinity import unit_rows

Vectors = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Base:
    """The base nodes: the map and unit vectors (n, d) float32 of its nodes, zeros where there is no text."""

    topomap: TopoMap
    vectors: Vectors

    @cached_property
    def readings(self) -> Mapping[str, npt.NDArray[np.float64]]:
        """Channel -> (n,) readings, NaN where a node has none."""
        nodes = self.topomap.nodes
        out: dict[str, npt.NDArray[np.float64]] = {}
        for i, node in enumerate(nodes):
            for channel, value in node.sensors.items():
                out.setdefault(channel, np.full(len(nodes), np.nan))[i] = value
        return dict(sorted(out.items()))

    def sensors(self, leaves: IntArray) -> dict[str, float]:
        """Mean of each channel over the base nodes that have a reading."""
        values = ((channel, column[leaves]) for channel, column in self.readings.items())
        known = ((channel, v[~np.isnan(v)]) for channel, v in values)
        return {channel: float(v.mean()) for channel, v in known if v.size}

    def position(self, leaves: IntArray) -> tuple[float, float, float]:
        """Centroid of base nodes, in the map's frame."""
        return centroid(self.topomap.frame, self.topomap.positions[leaves])

    def mean_vector(self, leaves: IntArray) -> Vectors:
        """(d,) unit mean of the vectors of base nodes that have text; zeros where none has."""
        total = self.vectors[leaves].sum(axis=0, dtype=np.float64)
        return np.asarray(unit_rows(total[None, :])[0], np.float32)


def describe(base: Base, ident: str, level: int, members: Sequence[str], leaves: IntArray, places: Points) -> Cluster:
    """A cluster without texts: `leaves` its base nodes, `places` (k, 3) the positions of its members.

    `mean_distance` is the mean distance in metres over all pairs of members (paper: kept on each new node).
    """
    return Cluster(
        id=ident,
        level=level,
        members=tuple(members),
        position=base.position(leaves),
        mean_distance=mean_pairwise_distance(base.topomap.frame, places),
        sensors=base.sensors(leaves),
    )
