"""Random maps for tests of the forest, and complete linkage as scipy does it on the whole matrix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage

from erag.core.geometry import pairwise
from erag.core.types import Edges, Frame, Observation, Pose, TopoMap
from erag.forest.affinity import Affinity, affinity


@dataclass(frozen=True)
class World:
    frame: Frame
    positions: np.ndarray
    vectors: np.ndarray
    alpha: float = 0.6
    theta: float = 40.0

    @property
    def rows(self) -> Affinity:
        return affinity(self.frame, self.positions, self.vectors, self.alpha, self.theta)

    @property
    def topomap(self) -> TopoMap:
        nodes = [Observation(f"n{i}", "place", Pose(*map(float, p))) for i, p in enumerate(self.positions)]
        return TopoMap(self.frame, tuple(nodes), Edges.empty())


def world(
    seed: int, n: int, frame: Frame = Frame.METRIC, *, alpha: float = 0.6, theta: float = 40.0, textless: float = 0.1
) -> World:
    """Places scattered over some hundred metres around the antimeridian (WGS84) or the origin, in six topics."""
    rng = np.random.default_rng(seed)
    metres = rng.normal(size=(n, 3)) * [60.0, 60.0, 3.0]
    topics = rng.normal(size=(6, 16))
    vectors = topics[rng.integers(0, 6, n)] + 0.7 * rng.normal(size=(n, 16))
    vectors[rng.random(n) < textless] = 0
    return World(frame, to_frame(metres, frame), vectors.astype(np.float32), alpha, theta)


def to_frame(metres: np.ndarray, frame: Frame) -> np.ndarray:
    if frame is Frame.METRIC:
        return metres
    lon, lat = 180.0 + metres[:, 0] * 1.8e-5, 60.0 + metres[:, 1] * 0.9e-5
    return np.stack([np.where(lon > 180, lon - 360, lon), lat, metres[:, 2]], axis=1)


def by_definition(w: World) -> np.ndarray:
    """(n, n) 1 - S straight from the paper's formula; the spatial part alone where one of the two has no text."""
    lengths = np.linalg.norm(w.vectors.astype(np.float64), axis=1)
    units = w.vectors / np.where(lengths > 0, lengths, 1.0)[:, None]
    weight = w.alpha * np.outer(lengths > 0, lengths > 0)
    similarity = (1 - weight) * np.exp(-pairwise(w.frame, w.positions, w.positions) / w.theta)
    return 1 - similarity - weight * (units @ units.T)


def condensed_by_definition(w: World) -> np.ndarray:
    return np.maximum(by_definition(w)[np.triu_indices(len(w.positions), 1)], 0.0)


def has_ties(condensed: np.ndarray) -> bool:
    return bool((np.diff(np.sort(condensed)) < 1e-7).any())


def scipy_tree(w: World) -> np.ndarray:
    return linkage(condensed_by_definition(w), "complete")


def scipy_labels(tree: np.ndarray, height: float) -> np.ndarray:
    return canonical(fcluster(tree, height, "distance"))


def canonical(label: np.ndarray) -> np.ndarray:
    """Labels renumbered by the first row of each group."""
    _, first, group = np.unique(label, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[group]


def cut_heights(tree: np.ndarray) -> np.ndarray:
    """Heights between merges, over the whole tree, among them some in its lowest and highest part."""
    heights = np.unique(tree[:, 2])
    between = (heights[1:] + heights[:-1]) / 2
    return between[np.unique(np.linspace(0, len(between) - 1, 12).astype(int))]
