"""Distances against independent libraries; bounds and centres at the antimeridian and the poles."""

import math

import numpy as np
import pytest
from geographiclib.geodesic import Geodesic
from hypothesis import assume, example, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from erag.core.geometry import (
    EARTH_RADIUS_M,
    cartesian,
    centroid,
    distance,
    mean_pairwise_distance,
    pairwise,
    spatial_similarity,
)
from erag.core.types import Frame

SPHERE = Geodesic(EARTH_RADIUS_M, 0)
ON_GLOBE = st.tuples(st.floats(-180, 180), st.floats(-90, 90), st.floats(-500, 9000))
IN_METRES = st.tuples(*[st.floats(-1e5, 1e5)] * 3)


def globe(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    return float(distance(Frame.WGS84, a, b))


@given(ON_GLOBE, ON_GLOBE)
@example((179.9999, 0.0, 0.0), (-179.9999, 0.0, 0.0))
@example((0.0, 90.0, 0.0), (123.0, 90.0, 0.0))
@example((0.0, 0.0, 0.0), (180.0, 0.0, 0.0))
@example((-79.9437, 40.4387, 0.0), (-79.9437001, 40.4387001, 0.0))
def test_haversine_equals_geographiclib_on_the_sphere(a: tuple[float, ...], b: tuple[float, ...]) -> None:
    flat_a, flat_b = (a[0], a[1], 0.0), (b[0], b[1], 0.0)
    expected = SPHERE.Inverse(a[1], a[0], b[1], b[0])["s12"]
    # Near antipodes the arcsine has 8 digits; elsewhere far more.
    assert globe(flat_a, flat_b) == pytest.approx(expected, rel=1e-6, abs=1e-6)


@given(ON_GLOBE, ON_GLOBE)
def test_the_sphere_is_within_0_6_percent_of_the_ellipsoid(a: tuple[float, ...], b: tuple[float, ...]) -> None:
    expected = Geodesic.WGS84.Inverse(a[1], a[0], b[1], b[0])["s12"]
    assert globe((a[0], a[1], 0.0), (b[0], b[1], 0.0)) == pytest.approx(expected, rel=0.006, abs=1e-6)


@given(ON_GLOBE, ON_GLOBE)
def test_haversine_equals_scikit_learn(a: tuple[float, ...], b: tuple[float, ...]) -> None:
    metrics = pytest.importorskip("sklearn.metrics.pairwise")
    radians = np.radians([[a[1], a[0]], [b[1], b[0]]])
    expected = metrics.haversine_distances(radians)[0, 1] * EARTH_RADIUS_M
    assert globe((a[0], a[1], 0.0), (b[0], b[1], 0.0)) == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_heights_join_the_great_circle_at_a_right_angle() -> None:
    flat = globe((10.0, 50.0, 0.0), (10.01, 50.0, 0.0))
    assert globe((10.0, 50.0, 100.0), (10.01, 50.0, 400.0)) == pytest.approx(math.hypot(flat, 300.0))
    assert globe((10.0, 50.0, -20.0), (10.0, 50.0, 22.0)) == 42.0


def test_metric_distance_is_euclidean_and_broadcasts() -> None:
    points = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 12.0]])
    assert distance(Frame.METRIC, points[0], points).tolist() == [0.0, 13.0]
    assert pairwise(Frame.METRIC, points, points).tolist() == [[0.0, 13.0], [13.0, 0.0]]


@given(hnp.arrays(np.float64, (6, 2), elements=st.floats(0, 1)), st.sampled_from(list(Frame)))
def test_distance_is_symmetric_and_zero_to_itself(unit: np.ndarray, frame: Frame) -> None:
    points = np.column_stack([unit[:, 0] * 360 - 180, unit[:, 1] * 180 - 90, unit[:, 0] * 50])
    metres = pairwise(frame, points, points)
    assert np.allclose(metres, metres.T, rtol=1e-12, atol=0)
    assert (np.diag(metres) == 0).all()


@given(st.lists(ON_GLOBE, min_size=2, max_size=8))
@example([(180.0, 5.0, 0.0), (-180.0, 5.0, 0.0)])
@example([(0.0, -90.0, 3.0), (77.0, -90.0, 3.0)])
def test_cartesian_distance_is_a_lower_bound_on_the_globe(points: list[tuple[float, ...]]) -> None:
    positions = np.array(points)
    flat = cartesian(Frame.WGS84, positions)
    chords = np.linalg.norm(flat[:, None] - flat[None], axis=-1)
    metres = pairwise(Frame.WGS84, positions, positions)
    assert (chords <= metres + 1e-7).all()
    level = positions * [1, 1, 0]
    arcs = pairwise(Frame.WGS84, level, level)
    assert np.allclose(2 * EARTH_RADIUS_M * np.sin(arcs / 2 / EARTH_RADIUS_M), chords, rtol=1e-6, atol=1e-6)


def test_cartesian_leaves_metres_alone() -> None:
    positions = np.array([[1.0, 2.0, 3.0]])
    assert cartesian(Frame.METRIC, positions) is positions


@pytest.mark.parametrize(
    ("points", "expected"),
    [
        ([(179.9, 10.0, 4.0), (-179.9, 10.0, 6.0)], (180.0, 10.0, 5.0)),
        ([(170.0, 0.0, 0.0), (-150.0, 0.0, 0.0)], (-170.0, 0.0, 0.0)),
        ([(0.0, 89.0, 0.0), (180.0, 89.0, 0.0)], (None, 90.0, 0.0)),
        ([(0.0, -89.0, 0.0), (120.0, -89.0, 0.0), (-120.0, -89.0, 0.0)], (None, -90.0, 0.0)),
        ([(10.0, 20.0, 3.0)], (10.0, 20.0, 3.0)),
    ],
)
def test_centroid_at_the_antimeridian_and_the_poles(
    points: list[tuple[float, ...]], expected: tuple[float | None, float, float]
) -> None:
    lon, lat, height = centroid(Frame.WGS84, np.array(points))
    assert (lat, height) == (pytest.approx(expected[1], abs=1e-3), expected[2])
    assert expected[0] is None or math.cos(math.radians(lon - expected[0])) == pytest.approx(1.0, abs=1e-12)


@given(st.lists(st.tuples(st.floats(-0.01, 0.01), st.floats(-0.01, 0.01)), min_size=1, max_size=6), st.floats(-85, 85))
def test_centroid_turns_with_the_longitude(offsets: list[tuple[float, float]], lat: float) -> None:
    def centre(lon: float) -> tuple[float, float, float]:
        wrapped = [((lon + dx + 180) % 360 - 180, lat + dy, 0.0) for dx, dy in offsets]
        return centroid(Frame.WGS84, np.array(wrapped))

    here, across = centre(0.0), centre(180.0)
    assert across[1] == pytest.approx(here[1], abs=1e-9)
    assert (across[0] - here[0]) % 360 == pytest.approx(180.0, abs=1e-7)


def test_points_that_cancel_out_have_their_medoid_as_centre() -> None:
    ring = [(lon, 0.0, 7.0) for lon in (0.0, 90.0, 180.0, -90.0)]
    assert centroid(Frame.WGS84, np.array(ring)) in ring


@given(st.lists(IN_METRES, min_size=1, max_size=7))
def test_metric_centroid_is_the_mean(points: list[tuple[float, ...]]) -> None:
    assert centroid(Frame.METRIC, np.array(points)) == pytest.approx(tuple(np.mean(points, axis=0)), abs=1e-6)


@given(st.lists(ON_GLOBE, min_size=1, max_size=9), st.integers(1, 4), st.sampled_from(list(Frame)))
def test_mean_pairwise_distance_does_not_depend_on_the_block(
    points: list[tuple[float, ...]], block: int, frame: Frame
) -> None:
    positions, n = np.array(points), len(points)
    pairs = [float(distance(frame, positions[i], positions[j])) for i in range(n) for j in range(i)]
    expected = sum(pairs) / len(pairs) if pairs else 0.0
    assert mean_pairwise_distance(frame, positions, block) == pytest.approx(expected, rel=1e-9, abs=1e-6)


@given(st.floats(0, 1e4), st.floats(0, 1e4), st.floats(20, 1e3))
def test_spatial_similarity_falls_from_one(near: float, far: float, theta: float) -> None:
    assume(near < far - 1e-3)
    close, distant = spatial_similarity([near, far], theta)
    assert 0 < distant < close <= 1
    assert spatial_similarity(theta, theta) == pytest.approx(math.exp(-1))
