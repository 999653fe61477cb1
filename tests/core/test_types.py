"""The values that pass between stages refuse what they cannot mean."""

import math

import numpy as np
import pytest

from erag.core.types import Cluster, EdgeKind, Edges, Forest, Frame, Interval, Observation, Pose, TopoMap


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("field", ["x", "y", "z", "yaw"])
def test_poses_are_finite(bad: float, field: str) -> None:
    values = {"x": 0.0, "y": 0.0, field: bad}
    with pytest.raises(ValueError, match="finite"):
        Pose(**values)


def test_a_pose_knows_its_position() -> None:
    assert Pose(1.0, 2.0).xyz == (1.0, 2.0, 0.0)
    assert Pose(1.0, 2.0).yaw is None


@pytest.mark.parametrize(("start", "end"), [(1.0, 0.0), (math.nan, 1.0), (0.0, math.inf), (-math.inf, 0.0)])
def test_intervals_are_finite_and_ordered(start: float, end: float) -> None:
    with pytest.raises(ValueError, match="interval"):
        Interval(start, end)


@pytest.mark.parametrize(
    ("interval", "since", "until", "expected"),
    [
        (Interval(10, 20), None, None, True),
        (Interval(10, 20), 20, None, False),
        (Interval(10, 20), 19.5, None, True),
        (Interval(10, 20), None, 10, False),
        (Interval(10, 20), None, 10.5, True),
        (Interval(10, 20), 0, 5, False),
        (Interval(10, 20), 12, 13, True),
        (Interval(10, 10), 10, 11, True),
        (Interval(10, 10), 9, 10, False),
        (Interval(10, 10), 10.5, None, False),
    ],
)
def test_overlap_with_a_window(interval: Interval, since: float | None, until: float | None, expected: bool) -> None:
    assert interval.overlaps(since, until) is expected


def test_edges_know_which_can_be_driven() -> None:
    kind = np.array([EdgeKind.PATH, EdgeKind.OBSERVED_FROM, EdgeKind.BRIDGE, EdgeKind.RADIUS], np.int8)
    edges = Edges(np.arange(8).reshape(2, 4), kind, np.ones(4))
    assert edges.traversable.tolist() == [True, False, True, True]
    assert len(edges) == 4
    assert len(Edges.empty()) == 0
    assert Edges.empty().traversable.shape == (0,)


def test_a_map_finds_rows_and_positions() -> None:
    nodes = tuple(Observation(i, "place", Pose(x, 1.0)) for i, x in (("a", 0.0), ("b", 5.0)))
    topomap = TopoMap(Frame.METRIC, nodes, Edges.empty())
    assert dict(topomap.row) == {"a": 0, "b": 1}
    assert topomap.positions.tolist() == [[0.0, 1.0, 0.0], [5.0, 1.0, 0.0]]
    assert TopoMap(Frame.METRIC, (), Edges.empty()).positions.shape == (0, 3)


def cluster(name: str, level: int, *members: str) -> Cluster:
    return Cluster(name, level, members, (0.0, 0.0, 0.0), 0.0)


def forest(parent: list[int]) -> Forest:
    """Leaves a to d; f over a and c, g over f and b; d is alone."""
    clusters = (cluster("f", 1, "a", "c"), cluster("g", 2, "f", "b"))
    level = np.array([0, 0, 0, 0, 1, 2])
    return Forest(("a", "b", "c", "d"), clusters, np.array(parent), level, np.zeros((6, 2), np.float32))


def test_a_forest_knows_children_roots_and_paths() -> None:
    grown = forest([4, 5, 4, -1, 5, -1])
    assert [c.tolist() for c in grown.children] == [[], [], [], [], [0, 2], [1, 4]]
    assert grown.roots.tolist() == [3, 5]
    assert grown.path(2) == ("g", "f", "c")
    assert grown.path(1) == ("g", "b")
    assert grown.path(3) == ("d",)
    assert grown.path(5) == ("g",)
    assert grown.n_leaves == 4
    assert grown.ids == ("a", "b", "c", "d", "f", "g")


def test_an_empty_forest_has_nothing() -> None:
    none = np.empty(0, np.int64)
    bare = Forest((), (), none, none, np.empty((0, 3), np.float32))
    assert (bare.children, bare.roots.tolist(), bare.ids) == ((), [], ())


def test_a_forest_refuses_arrays_of_another_size() -> None:
    with pytest.raises(ValueError, match="6 rows"):
        forest([4, 5, 4, -1, 5])
