"""Neighbour searches equal brute force in both frames, across the antimeridian and at the poles."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from erag.core.errors import ConfigError
from erag.core.geometry import distance, pairwise
from erag.core.types import Frame
from erag.topomap.neighbours import Neighbours, auto_radius, nearest_foreign

METRIC = st.tuples(st.integers(-6, 6), st.integers(-6, 6), st.integers(-2, 2))
NEAR = st.tuples(st.integers(-9, 9), st.integers(-9, 9), st.integers(-3, 3))
CENTRES = [(0.0, 0.0), (180.0, 12.0), (-180.0, -40.0), (33.0, 89.9996), (-70.0, -90.0)]
Place = tuple[Frame, np.ndarray]


def around(centre: tuple[float, float], offsets: list[tuple[int, int, int]]) -> np.ndarray:
    """WGS84 positions some tens of metres from a centre; past a pole they come down on the other side."""
    points = []
    for dx, dy, z in offsets:
        lon, lat = centre[0] + dx * 1e-4, centre[1] + dy * 1e-4
        if abs(lat) > 90:
            lon, lat = lon + 180, np.sign(lat) * 180 - lat
        points.append(((lon + 180) % 360 - 180, lat, z * 10.0))
    return np.array(points)


def maps(min_size: int = 1, max_size: int = 14) -> st.SearchStrategy[Place]:
    """Small maps in metres, around awkward places of the globe, and over the whole globe with great heights."""
    metric = st.lists(METRIC, min_size=min_size, max_size=max_size).map(lambda p: (Frame.METRIC, np.array(p, float)))
    local = st.tuples(st.sampled_from(CENTRES), st.lists(NEAR, min_size=min_size, max_size=max_size)).map(
        lambda c: (Frame.WGS84, around(*c))
    )
    wide = st.lists(
        st.tuples(st.integers(-180, 180), st.integers(-90, 90), st.integers(0, 3).map(lambda k: k * 2e6)),
        min_size=min_size,
        max_size=max_size,
    ).map(lambda p: (Frame.WGS84, np.array(p, float)))
    return st.one_of(metric, local, wide)


@given(maps(), st.floats(0, 1))
def test_pairs_within_a_radius_equal_brute_force(place: Place, share: float) -> None:
    frame, positions = place
    metres = pairwise(frame, positions, positions)
    radius = share * float(metres.max())
    index, found = Neighbours(frame, positions).pairs_within(radius)
    upper = np.triu(np.ones(metres.shape, bool), k=1)
    # Pairs at the radius itself may fall on either side of its last digit.
    sure = set(zip(*np.nonzero(upper & (metres < radius * (1 - 1e-12))), strict=True))
    possible = set(zip(*np.nonzero(upper & (metres <= radius * (1 + 1e-12))), strict=True))
    assert sure <= set(zip(*index.tolist(), strict=True)) <= possible
    assert index.T.tolist() == sorted(index.T.tolist())
    assert found == pytest.approx(metres[tuple(index)])


@given(maps(), maps(), st.floats(0.1, 1))
@example((Frame.WGS84, np.array([[0.0, 0, 0], [150, 0, 9e6]])), (Frame.WGS84, np.array([[75.0, 0, 9e6]])), 1.0)
def test_nearest_equals_brute_force(place: Place, other: Place, share: float) -> None:
    frame, positions = place
    queries = other[1] if other[0] is frame else positions + np.array([0.001, -0.0005, 0.5])
    metres = pairwise(frame, queries, positions)
    limit = share * float(metres.max())
    row, found = Neighbours(frame, positions).nearest(queries, limit)
    best = np.where(metres.min(axis=1) <= limit, metres.min(axis=1), np.inf)
    assert found == pytest.approx(best)
    hit = np.flatnonzero(row >= 0)
    assert (row >= 0).tolist() == np.isfinite(best).tolist()
    assert distance(frame, queries[hit], positions[row[hit]]) == pytest.approx(best[hit])


def test_the_nearest_by_chord_need_not_be_the_nearest() -> None:
    """Straight through the Earth the antipode is nearer than a point 13,000 km overhead; over ground it is not."""
    points = np.array([[180.0, 0.0, 0.0], [0.0, 0.0, 1.3e7]])
    row, metres = Neighbours(Frame.WGS84, points).nearest(np.zeros((1, 3)))
    assert (row.tolist(), metres.tolist()) == ([1], [1.3e7])


def test_nobody_is_nearest_on_an_empty_map() -> None:
    row, metres = Neighbours(Frame.METRIC, np.empty((0, 3))).nearest(np.zeros((2, 3)))
    assert (row.tolist(), metres.tolist()) == ([-1, -1], [np.inf, np.inf])
    index, metres = Neighbours(Frame.WGS84, np.empty((0, 3))).pairs_within(10.0)
    assert (index.shape, metres.shape) == ((2, 0), (0,))


@given(maps(min_size=2), st.randoms(use_true_random=False))
def test_nearest_foreign_equals_brute_force(place: Place, random: object) -> None:
    frame, positions = place
    label = np.array([random.randrange(5) for _ in positions])  # type: ignore[attr-defined]
    metres = np.where(label[:, None] == label[None], np.inf, pairwise(frame, positions, positions))
    row, found = nearest_foreign(frame, positions, label)
    assert found == pytest.approx(metres.min(axis=1))
    assert all(label[i] != label[j] for i, j in enumerate(row) if j >= 0)


def test_a_radius_that_joins_everything_is_refused() -> None:
    positions = np.column_stack([np.arange(5000.0), np.zeros(5000), np.zeros(5000)])
    with pytest.raises(ConfigError, match="12,497,500 pairs of 5,000 nodes"):
        Neighbours(Frame.METRIC, positions).pairs_within(1e6)


def test_the_automatic_radius_spans_equal_spacing_and_skips_no_node() -> None:
    line = np.column_stack([np.arange(20.0) * 10, np.zeros(20), np.zeros(20)])
    assert auto_radius(Frame.METRIC, line) == pytest.approx(15.0)
    twice = np.concatenate([line, line])  # two pictures at every spot
    assert auto_radius(Frame.METRIC, twice) == pytest.approx(15.0)
    assert auto_radius(Frame.METRIC, line[:1]) == 0.0
    assert auto_radius(Frame.METRIC, np.empty((0, 3))) == 0.0
