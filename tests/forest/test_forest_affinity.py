"""The hybrid dissimilarity: the paper's formula, bit for bit the same in any block, and θ taken from the map."""

from __future__ import annotations

import numpy as np
import pytest
from forest_worlds import by_definition, world
from hypothesis import given, settings
from hypothesis import strategies as st

from erag.core.errors import InputError
from erag.core.types import Frame
from erag.forest.affinity import affinity, auto_theta, unit_rows
from erag.forest.linkage import condensed

EVERYTHING = slice(None)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    n=st.integers(1, 60),
    frame=st.sampled_from(list(Frame)),
    alpha=st.sampled_from([0.0, 0.6, 1.0]),
)
def test_a_block_is_the_formula(seed: int, n: int, frame: Frame, alpha: float) -> None:
    w = world(seed, n, frame, alpha=alpha)
    assert np.allclose(w.rows.block(EVERYTHING, EVERYTHING), by_definition(w), atol=1e-7)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(2, 300), a=st.integers(0, 299), b=st.integers(1, 50))
def test_a_pair_has_the_same_bits_in_any_block(seed: int, n: int, a: int, b: int) -> None:
    rows = world(seed, n).rows
    whole = rows.block(EVERYTHING, EVERYTHING)
    part = slice(min(a, n - 1), min(a + b, n))
    i, j = (m.ravel() for m in np.indices((n, n)))
    assert (rows.block(part, EVERYTHING) == whole[part]).all()
    assert (rows.of_pairs(i, j).reshape(n, n) == whole).all()
    assert (condensed(rows) == whole[np.triu_indices(n, 1)]).all()


def test_identical_rows_are_at_exactly_zero() -> None:
    w = world(1, 200)
    twice = affinity(w.frame, np.tile(w.positions, (2, 1)), np.tile(w.vectors, (2, 1)), w.alpha, w.theta)
    assert (np.diagonal(twice.block(slice(0, 200), slice(200, 400))) == 0).all()


def test_without_text_the_distance_alone_counts() -> None:
    positions = np.array([[0, 0, 0], [30, 0, 0], [60, 0, 0]], float)
    vectors = np.array([[1, 0], [0, 0], [0, 1]], np.float32)
    far = affinity(Frame.METRIC, positions, vectors, 0.6, 30.0).block(EVERYTHING, EVERYTHING)
    assert far[0, 1] == pytest.approx(1 - np.exp(-1))
    assert far[1, 2] == pytest.approx(1 - np.exp(-1))
    assert far[0, 2] == pytest.approx(1 - 0.4 * np.exp(-2))


def test_vectors_need_not_be_of_unit_length() -> None:
    w = world(3, 30)
    scaled = affinity(w.frame, w.positions, w.vectors * 7.5, w.alpha, w.theta)
    assert np.allclose(scaled.block(EVERYTHING, EVERYTHING), w.rows.block(EVERYTHING, EVERYTHING), atol=1e-7)


def test_what_is_not_finite_or_does_not_fit_is_refused() -> None:
    with pytest.raises(InputError, match="vector 1 is not finite"):
        unit_rows(np.array([[1, 0], [np.nan, 0]]))
    with pytest.raises(InputError, match="shape"):
        unit_rows(np.zeros(3))
    with pytest.raises(InputError, match="2 vectors for 3 rows"):
        affinity(Frame.METRIC, np.zeros((3, 3)), np.zeros((2, 4)), 0.6, 1.0)
    with pytest.raises(InputError, match="position"):
        affinity(Frame.METRIC, np.full((1, 3), np.inf), np.zeros((1, 4)), 0.6, 1.0)


@pytest.mark.parametrize("frame", list(Frame))
def test_theta_is_the_diameter_of_the_ball_that_holds_a_cluster(frame: Frame) -> None:
    """On a long line with a step of 10 m the 16th nearest node is 80 m away."""
    steps = np.arange(500) * 10.0
    line = np.stack([steps, np.zeros(500), np.zeros(500)], axis=1)
    if frame is Frame.WGS84:
        line[:, 0] = np.degrees(steps / 6_371_008.8)
    assert auto_theta(frame, line, 16) == pytest.approx(160, rel=1e-6)


def test_theta_of_maps_without_extent() -> None:
    assert auto_theta(Frame.METRIC, np.zeros((0, 3)), 16) == 1.0
    assert auto_theta(Frame.METRIC, np.zeros((1, 3)), 16) == 1.0
    assert auto_theta(Frame.METRIC, np.zeros((50, 3)), 16) == 1.0
    two = np.array([[0, 0, 0], [0, 3, 4]], float)
    assert auto_theta(Frame.METRIC, two, 16) == 10.0


def test_theta_is_not_lost_where_most_nodes_coincide() -> None:
    positions = np.concatenate([np.zeros((300, 3)), np.arange(100)[:, None] * [10.0, 0, 0]])
    assert auto_theta(Frame.METRIC, positions, 16) > 50


def test_theta_of_a_sampled_map_is_near_that_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    positions = world(9, 4000).positions
    whole = auto_theta(Frame.METRIC, positions, 16)
    monkeypatch.setattr("erag.forest.affinity.THETA_SAMPLE", 500)
    assert auto_theta(Frame.METRIC, positions, 16) == pytest.approx(whole, rel=0.1)
