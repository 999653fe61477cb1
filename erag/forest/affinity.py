"""The hybrid dissimilarity 1 - S of two rows, the same for the full matrix and for blocks of pairs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from erag.core.errors import InputError
from erag.core.geometry import Points, cartesian, distance, spatial_similarity
from erag.core.types import FloatArray, Frame, IntArray

Doubles = npt.NDArray[np.float64]
GRID = 2.0**25  # unit vectors are rounded to multiples of 1 / GRID
PAIRS_AT_ONCE = 4096  # pairs whose vectors are gathered at a time
COINCIDENT_THETA_M = 1.0  # for maps whose nodes all coincide
THETA_SAMPLE = 20_000  # nodes whose neighbours are looked at on larger maps


@dataclass(frozen=True)
class Affinity:
    """Rows to be clustered and how alike two of them are.

    `positions` (n, 3) in `frame`; `units` (n, d) float64 unit vectors on a grid of 2^-25, rows of zeros where there is
    no text; `half` (n,) half their squared length; `texted` (n,) bool; `theta` in metres.

    The grid makes every product and partial sum of a dot product exact in float64. So a pair has the same value in any
    block, with any number of threads and any BLAS, and identical rows have dissimilarity exactly 0.
    """

    frame: Frame
    positions: Points
    units: Doubles
    half: Doubles
    texted: npt.NDArray[np.bool_]
    alpha: float
    theta: float

    def __len__(self) -> int:
        return len(self.positions)

    def semantic(self, a: IntArray | slice, b: IntArray | slice) -> Doubles:
        """(|a|, |b|) float64: ½‖e_a − e_b‖², which is 1 − cosine for unit vectors."""
        out = np.asarray(self.units[a] @ self.units[b].T)
        np.subtract(self.half[b], out, out=out)
        out += self.half[a][:, None]
        return out

    def combine(self, metres: Doubles, semantic: Doubles, both: npt.NDArray[np.bool_]) -> Doubles:
        """1 − S = (1−α)(1 − exp(−d/θ)) + α(1 − cos); where one of the two has no text, the spatial part alone."""
        weight = np.where(both, self.alpha, 0.0)
        return (1.0 - weight) * (1.0 - spatial_similarity(metres, self.theta)) + weight * semantic

    def of_pairs(self, i: IntArray, j: IntArray, semantic: Doubles | None = None) -> Doubles:
        """(p,) dissimilarity of rows i (p,) and j (p,); their `semantic` part where it is known already."""
        if semantic is None:
            semantic = self._semantic_of_pairs(i, j)
        metres = distance(self.frame, self.positions[i], self.positions[j])
        return self.combine(metres, semantic, self.texted[i] & self.texted[j])

    def _semantic_of_pairs(self, i: IntArray, j: IntArray) -> Doubles:
        out = self.half[i] + self.half[j]
        for at in range(0, len(out), PAIRS_AT_ONCE):
            part = slice(at, at + PAIRS_AT_ONCE)
            out[part] -= np.einsum("pd,pd->p", self.units[i[part]], self.units[j[part]])
        return out

    def block(self, a: IntArray | slice, b: IntArray | slice) -> Doubles:
        """(|a|, |b|) dissimilarities of all pairs of two groups of rows."""
        metres = distance(self.frame, self.positions[a][:, None, :], self.positions[b][None, :, :])
        both = self.texted[a][:, None] & self.texted[b][None, :]
        return self.combine(metres, self.semantic(a, b), both)

    def take(self, rows: IntArray) -> Affinity:
        """The same for a selection of rows, in that order."""
        return replace(
            self,
            positions=self.positions[rows],
            units=self.units[rows],
            half=self.half[rows],
            texted=self.texted[rows],
        )


def affinity(frame: Frame, positions: Points, vectors: FloatArray, alpha: float, theta: float) -> Affinity:
    """Prepare rows for clustering: positions (n, 3), vectors (n, d), zeros = no text; θ in metres.

    Raises InputError when shapes differ or something is not finite.
    """
    units = unit_rows(vectors)
    if len(units) != len(positions):
        raise InputError(f"{len(units)} vectors for {len(positions)} rows", where="forest", allowed="one vector a row")
    if not np.isfinite(positions).all():
        raise InputError("a position is not finite", where="forest", allowed="finite numbers")
    grid = np.rint(units * GRID) / GRID
    half = np.einsum("ij,ij->i", grid, grid) / 2
    return Affinity(frame, np.asarray(positions, np.float64), grid, half, half > 0, alpha, theta)


def unit_rows(vectors: FloatArray) -> Doubles:
    """(n, d) float64 with rows of length 1; rows of zeros stay zeros. Raises InputError for what is not finite."""
    v = np.asarray(vectors, np.float64)
    if v.ndim != 2:
        raise InputError(f"vectors of shape {v.shape}", where="forest", allowed="(n, d)")
    if not np.isfinite(v).all():
        raise InputError(f"vector {int(np.argmin(np.isfinite(v).all(axis=1)))} is not finite", where="forest")
    norm = np.linalg.norm(v, axis=1, keepdims=True)
    return np.asarray(np.divide(v, norm, out=np.zeros_like(v), where=norm > 1e-12))


def auto_theta(frame: Frame, positions: Points, members: float) -> float:
    """θ in metres: the extent of a typical cluster of `members` nodes on this map.

    Twice the median distance of a node to its `members`-th nearest other node, that is the diameter of the ball that
    holds as many. Maps above 20,000 nodes are sampled at a fixed stride. Nodes that coincide with all their neighbours
    are left out; when all do, θ is 1 m.
    """
    from scipy.spatial import cKDTree

    n = len(positions)
    k = min(round(members), n - 1)
    if k < 1:
        return COINCIDENT_THETA_M
    asked = np.arange(0, n, max(1, n // THETA_SAMPLE))
    points = cartesian(frame, positions)
    _, near = cKDTree(points).query(points[asked], k=[k + 1])  # the node itself is one of them
    metres = distance(frame, positions[asked], positions[near[:, 0]])
    apart = metres[metres > 0]
    return 2.0 * float(np.median(apart)) if apart.size else COINCIDENT_THETA_M
