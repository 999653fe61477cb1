"""Path lengths and what they do to an answer's worth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.core.geometry import pairwise
from erag.core.types import EdgeKind, Edges, Frame, Observation, Pose, TopoMap
from erag.evaluate.location import nearness, paths, radius, shortest_path, spl, weighted, weighted_as_printed
from erag.topomap.routes import Router

metres = st.floats(0, 1e6)
shares = st.floats(0, 1)


def world(points: list[tuple[float, float, float]], links: list[tuple[int, int]] = (), frame=Frame.METRIC) -> TopoMap:
    nodes = tuple(Observation(f"n{i}", "place", Pose(*p), caption="a") for i, p in enumerate(points))
    index = np.array(links, np.int64).reshape(-1, 2).T
    length = np.array([np.linalg.norm(np.subtract(points[a], points[b])) for a, b in links], np.float64)
    return TopoMap(frame, nodes, Edges(index, np.full(len(links), EdgeKind.PATH, np.int8), length))


# 3 - 4 m east, then 3 m north: the way from n0 to n2 is 7 m, the straight line 5 m; n3 has no edges
CORNER = world([(0, 0, 0), (4, 0, 0), (4, 3, 0), (0, 3, 0)], [(0, 1), (1, 2)])


def test_lengths_run_along_edges_where_both_ends_are_connected() -> None:
    found = paths(CORNER, Router(CORNER), Pose(0, 0, 0), ["n2", "n3", "n0"])
    assert found.metres == pytest.approx([7, 3, 0])
    assert found.on_edges.tolist() == [True, False, True]
    assert found.share_on_edges == pytest.approx(2 / 3)
    assert shortest_path(CORNER, Router(CORNER), Pose(0, 0, 0), {"n2", "n3"}) == 3


def test_a_map_without_edges_has_straight_lengths() -> None:
    bare = world([(0, 0, 0), (4, 3, 0)])
    found = paths(bare, Router(bare), Pose(0, 0, 0), ["n1"])
    assert (found.metres.tolist(), found.on_edges.tolist()) == ([5.0], [False])


def test_no_answer_has_no_length() -> None:
    found = paths(CORNER, Router(CORNER), Pose(0, 0, 0), [])
    assert (len(found.metres), found.share_on_edges) == (0, 1)
    with pytest.raises(ValueError, match="needs a goal"):
        shortest_path(CORNER, Router(CORNER), Pose(0, 0, 0), [])
    with pytest.raises(KeyError):
        paths(CORNER, Router(CORNER), Pose(0, 0, 0), ["nowhere"])


def test_the_radius_by_hand() -> None:
    assert radius(CORNER) == 2.5
    assert radius(world([(0, 0, 0), (0, 0, 8)])) == 4
    assert radius(world([(1, 1, 1)])) == radius(world([])) == radius(world([(1, 1, 1)] * 3)) == 0
    equator = world([(0, 0, 0), (1, 0, 0)], frame=Frame.WGS84)  # one degree of a great circle
    assert radius(equator) == pytest.approx(6_371_008.8 * np.pi / 180 / 2)


@pytest.mark.parametrize(("frame", "scale"), [(Frame.METRIC, 100.0), (Frame.WGS84, 0.01)])
@pytest.mark.parametrize("shape", ["disc", "circle", "line", "grid", "twice"])
def test_the_radius_is_that_of_all_pairs(shape: str, frame: Frame, scale: float) -> None:
    rng = np.random.default_rng(7)
    angle = rng.uniform(0, 2 * np.pi, 700)
    points = {
        "disc": rng.standard_normal((700, 3)),
        "circle": np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1),
        "line": np.stack([angle, 2 * angle, 0 * angle], axis=1),
        "grid": np.array([(x, y, 0) for x in range(26) for y in range(26)], np.float64),
        "twice": np.repeat(rng.standard_normal((300, 3)), 2, axis=0),
    }[shape] * scale
    topomap = world([tuple(p) for p in points.tolist()], frame=frame)
    assert radius(topomap) == pytest.approx(pairwise(frame, points, points).max() / 2, rel=1e-12)


def test_worth_by_hand() -> None:
    assert nearness(100, 400) == 0.75
    assert weighted(0.8, 100, 400) == pytest.approx(0.6)
    assert weighted_as_printed(0.8, 100, 400) == pytest.approx(0.2)
    assert (nearness(500, 400), weighted(0.8, 500, 400)) == (0, 0)
    assert weighted_as_printed(0.8, 500, 400) == pytest.approx(1.0)
    assert spl(1, 30, 40) == 0.75
    assert spl(0.5, 30, 30) == 0.5


def test_a_map_that_is_a_point() -> None:
    assert (nearness(0, 0), nearness(1, 0)) == (1, 0)
    assert weighted_as_printed(0.5, 0, 0) == 0
    with pytest.raises(ValueError, match="R is 0"):
        weighted_as_printed(0.5, 1, 0)
    assert spl(0.5, 0, 0) == 0.5


@pytest.mark.parametrize("wrong", [(-1, 5), (1, -5), (float("nan"), 5), (1, float("inf"))])
def test_lengths_that_are_none_are_refused(wrong: tuple[float, float]) -> None:
    for call in (lambda: nearness(*wrong), lambda: weighted(1, *wrong), lambda: spl(1, *wrong)):
        with pytest.raises(ValueError, match="finite and not negative"):
            call()
    with pytest.raises(ValueError, match="probability"):
        weighted(1.2, 1, 5)


@given(shares, metres, st.floats(1e-3, 1e6))
def test_the_used_formula_is_bounded_and_the_printed_one_is_its_counterpart(p: float, ell: float, r: float) -> None:
    assert 0 <= weighted(p, ell, r) <= p
    if ell <= r:
        assert weighted(p, ell, r) + weighted_as_printed(p, ell, r) == pytest.approx(p)


@given(shares, metres, metres, st.floats(1e-3, 1e6))
def test_a_longer_way_never_pays_in_the_used_formula_and_always_in_the_printed(
    p: float, a: float, b: float, r: float
) -> None:
    near, far = sorted((a, b))
    assert weighted(p, near, r) >= weighted(p, far, r)
    assert weighted_as_printed(p, near, r) <= weighted_as_printed(p, far, r)
    assert spl(p, 1.0, near + 1) >= spl(p, 1.0, far + 1)


@given(shares, metres, st.floats(1e-3, 1e6), st.floats(0.1, 1e3))
def test_units_do_not_matter(p: float, ell: float, r: float, factor: float) -> None:
    assert weighted(p, ell * factor, r * factor) == pytest.approx(weighted(p, ell, r), abs=1e-9)
    assert spl(p, r * factor, (ell + r) * factor) == pytest.approx(spl(p, r, ell + r), abs=1e-9)


@given(shares, metres, metres)
def test_spl_lies_between_0_and_success(p: float, shortest: float, taken: float) -> None:
    assert 0 <= spl(p, shortest, taken) <= p
