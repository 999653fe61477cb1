"""The projection against geodesic distances, and what could break it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.core.geometry import distance
from erag.core.types import Frame
from erag.report.plane import MARGIN, UNITS, Plane

COORDINATE = st.floats(-1e4, 1e4, allow_nan=False)


@pytest.mark.parametrize("centre", [(1.12, 52.41), (-79.94, 40.44), (179.999, -17.0), (-180.0, 5.0)])
def test_distances_on_the_plane_are_those_on_the_globe(centre: tuple[float, float]) -> None:
    steps = np.random.default_rng(3).uniform(-0.01, 0.01, (40, 2))
    lon = (centre[0] + steps[:, 0] + 180) % 360 - 180
    positions = np.stack([lon, centre[1] + steps[:, 1], np.zeros(40)], axis=1)
    plane = Plane.of(Frame.WGS84, positions)
    drawn = plane.points(positions)
    metres = np.linalg.norm(drawn[0] - drawn, axis=1) * plane.metres_per_unit
    assert metres == pytest.approx(distance(Frame.WGS84, positions[0], positions), rel=1e-3, abs=1.0)
    assert max(plane.width, plane.height) == UNITS + 2 * MARGIN


def test_north_and_y_are_up() -> None:
    for frame in Frame:
        plane = Plane.of(frame, np.array([[0.0, 0.0, 0.0], [0.001, 0.002, 0.0]]))
        south, north = plane.points(np.array([[0.0, 0.0, 0.0], [0.001, 0.002, 0.0]]))
        assert north[1] < south[1]
        assert north[0] > south[0]


@given(st.lists(st.tuples(COORDINATE, COORDINATE, COORDINATE), min_size=1, max_size=30))
def test_everything_lies_inside_the_margins(points: list[tuple[float, float, float]]) -> None:
    positions = np.array(points)
    plane = Plane.of(Frame.METRIC, positions)
    drawn = plane.points(positions)
    assert (drawn >= MARGIN).all()
    assert (drawn <= (plane.width - MARGIN, plane.height - MARGIN)).all()


def test_an_empty_map_a_single_node_and_a_start_beyond_all_bounds() -> None:
    empty = Plane.of(Frame.METRIC, np.empty((0, 3)))
    assert empty.points(np.empty((0, 3))).shape == (0, 2)
    single = Plane.of(Frame.WGS84, np.array([[10.0, 90.0, 0.0]]))
    assert single.points(np.array([[10.0, 90.0, 0.0]])).tolist() == [[MARGIN, MARGIN]]
    far = Plane.of(Frame.METRIC, np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0]])).points(np.array([[1e300, -1e300, 0.0]]))
    assert far.tolist() == [[100 * UNITS, 100 * UNITS]]
