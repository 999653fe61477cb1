"""Distances, centroids and spatial similarity in both frames."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from erag.core.types import Frame

EARTH_RADIUS_M = 6_371_008.8  # mean radius R1 of the WGS84 ellipsoid (IUGG)
Points = npt.NDArray[np.float64]  # (..., 3)


def distance(frame: Frame, a: npt.ArrayLike, b: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Distance in metres between points (..., 3) and (..., 3), broadcast against each other.

    WGS84: great circle (haversine), joined with the difference in height; METRIC: Euclidean.
    """
    p, q = np.asarray(a, np.float64), np.asarray(b, np.float64)
    if frame is Frame.METRIC:
        return np.asarray(np.linalg.norm(p - q, axis=-1))
    return np.hypot(_haversine(p, q), p[..., 2] - q[..., 2])


def _haversine(p: Points, q: Points) -> npt.NDArray[np.float64]:
    lon1, lat1, lon2, lat2 = (np.radians(v) for v in (p[..., 0], p[..., 1], q[..., 0], q[..., 1]))
    h = np.sin((lat2 - lat1) / 2) ** 2 + np.cos(lat1) * np.cos(lat2) * np.sin((lon2 - lon1) / 2) ** 2
    return np.asarray(2 * EARTH_RADIUS_M * np.arcsin(np.sqrt(np.clip(h, 0.0, 1.0))))


def pairwise(frame: Frame, a: Points, b: Points) -> npt.NDArray[np.float64]:
    """Distances in metres (n, m) between points (n, 3) and (m, 3)."""
    return distance(frame, a[:, None, :], b[None, :, :])


def spatial_similarity(metres: npt.ArrayLike, theta: float) -> npt.NDArray[np.float64]:
    """`exp(-d / θ)` in (0, 1] for distances and θ in metres (paper, S^spatial)."""
    return np.exp(-np.asarray(metres, np.float64) / theta)


def cartesian(frame: Frame, positions: Points) -> Points:
    """Points (n, 3) in metres whose Euclidean distance is a lower bound of `distance`, for k-d trees.

    WGS84 becomes Earth-centred coordinates on the sphere, so the antimeridian and the poles are nothing special.
    Heights are left out: lifting points off the sphere would stretch their chords beyond the great circle. The bound
    holds up to rounding, about 1e-8 m.
    """
    if frame is Frame.METRIC:
        return positions
    lon, lat = np.radians(positions[:, 0]), np.radians(positions[:, 1])
    unit = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=1)
    return unit * EARTH_RADIUS_M


def centroid(frame: Frame, positions: Points) -> tuple[float, float, float]:
    """The centre (x, y, z) of points (n, 3), n >= 1; right across the antimeridian and at the poles.

    Points that cancel out on the sphere (antipodes) have no centre; then it is the point with the least sum of
    distances to the others.
    """
    if frame is Frame.METRIC:
        x, y, z = positions.mean(axis=0)
        return (float(x), float(y), float(z))
    mean = cartesian(frame, positions).mean(axis=0) / EARTH_RADIUS_M
    if np.linalg.norm(mean) < 1e-9:
        x, y, z = positions[_distance_sums(frame, positions).argmin()]
        return (float(x), float(y), float(z))
    lon = float(np.degrees(np.arctan2(mean[1], mean[0])))
    lat = float(np.degrees(np.arctan2(mean[2], np.hypot(mean[0], mean[1]))))
    return (lon, lat, float(positions[:, 2].mean()))


def mean_pairwise_distance(frame: Frame, positions: Points, block: int = 1024) -> float:
    """Mean distance in metres over all pairs of points (n, 3); 0 for one point. Works in blocks of rows."""
    n = len(positions)
    return float(_distance_sums(frame, positions, block).sum()) / (n * (n - 1)) if n > 1 else 0.0


def _distance_sums(frame: Frame, positions: Points, block: int = 1024) -> npt.NDArray[np.float64]:
    """(n,) sums of the distances in metres from each of the points (n, 3) to all of them, in blocks of rows."""
    starts = range(0, len(positions), block)
    return np.concatenate([pairwise(frame, positions[i : i + block], positions).sum(axis=1) for i in starts])
