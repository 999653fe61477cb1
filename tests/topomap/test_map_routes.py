"""Routes and graph distances, against networkx and by example."""

import math

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.core.errors import InputError
from erag.core.types import EdgeKind, Edges, Frame, Observation, Pose, Route, TopoMap
from erag.topomap.graph import to_networkx
from erag.topomap.routes import Router

PATH, RADIUS, BRIDGE, OBSERVED = EdgeKind
Raw = list[tuple[int, int, EdgeKind, float]]


def made(points: list[tuple[float, ...]], edges: Raw, objects: str = "", frame: Frame = Frame.METRIC) -> TopoMap:
    """Nodes a, b, c … at the points; those named in `objects` are objects."""
    names = [chr(97 + i) for i in range(len(points))]
    nodes = tuple(
        Observation(n, "object" if n in objects else "place", Pose(*p)) for n, p in zip(names, points, strict=True)
    )
    index = np.array([e[:2] for e in edges], np.int64).reshape(-1, 2).T
    kind, metres = np.array([e[2] for e in edges], np.int8), np.array([e[3] for e in edges], np.float64)
    return TopoMap(frame, nodes, Edges(index, kind, metres))


@pytest.fixture
def corridor() -> TopoMap:
    """a - b = c (a bridge) - d in a line, e apart from all, the object f seen from b and d, the object g not."""
    points = [(0.0, 0.0), (10.0, 0.0), (20.0, 0.0), (30.0, 0.0), (500.0, 0.0), (20.0, 6.0), (21.0, 6.0)]
    edges = [
        (0, 1, PATH, 10.0),
        (2, 1, BRIDGE, 11.0),
        (2, 3, RADIUS, 10.0),
        (1, 5, OBSERVED, 12.0),
        (5, 3, OBSERVED, 9.0),
    ]
    return made(points, edges, objects="fg")


def test_a_route_runs_from_the_nearest_node_to_the_goal(corridor: TopoMap) -> None:
    route = Router(corridor).route(Pose(-3.0, 4.0), "d")
    assert route == Route("ok", ("a", "b", "c", "d"), 5.0 + 10 + 11 + 10, bridges=1)
    assert Router(corridor).route("c", "d") == Route("ok", ("c", "d"), 10.0, bridges=0)
    assert Router(corridor).route("d", "a") == Route("ok", ("d", "c", "b", "a"), 31.0, bridges=1)


def test_a_route_to_where_one_stands_is_that_node(corridor: TopoMap) -> None:
    assert Router(corridor).route("a", "a") == Route("ok", ("a",), 0.0)
    assert Router(corridor).route(Pose(0.0, 2.0), "a") == Route("ok", ("a",), 2.0)
    assert Router(corridor).route(Pose(500.0, 1.0), "e") == Route("ok", ("e",), 1.0)


def test_results_say_why_there_is_no_route(corridor: TopoMap) -> None:
    router = Router(corridor)
    assert router.route(None, "d") == Route("no_start")
    assert router.route(Pose(0.0, 51.0), "d") == Route("off_map")
    assert router.route(Pose(0.0, 51.0), "d", max_snap_m=51.0).status == "ok"
    assert router.route(Pose(0.0, 0.0), "e") == Route("unreachable")
    assert router.route("e", "a") == Route("unreachable")
    assert router.route("a", "g") == Route("unreachable")
    assert router.route("g", "a") == Route("off_map")


def test_a_route_to_an_object_ends_where_it_was_observed_from(corridor: TopoMap) -> None:
    router = Router(corridor)
    assert router.route("a", "f") == Route("ok", ("a", "b"), 10.0)
    assert router.route("c", "f") == Route("ok", ("c", "d"), 10.0)
    assert router.route("e", "f") == Route("unreachable")


def test_a_route_from_an_object_starts_where_it_was_observed_from(corridor: TopoMap) -> None:
    assert Router(corridor).route("f", "c") == Route("ok", ("d", "c"), 9.0 + 10.0)


def test_a_pose_beside_an_object_starts_at_a_place(corridor: TopoMap) -> None:
    assert Router(corridor).route(Pose(20.0, 6.0), "d").nodes == ("c", "d")


def test_many_goals_by_one_search(corridor: TopoMap) -> None:
    router = Router(corridor)
    goals = ["d", "e", "f", "a", "d"]
    assert router.routes(Pose(1.0, 0.0), goals) == [router.route(Pose(1.0, 0.0), g) for g in goals]
    assert router.routes("a", []) == []
    assert [r.status for r in router.routes(None, goals)] == ["no_start"] * 5


def test_unknown_nodes_are_named_with_a_close_match() -> None:
    nodes = tuple(Observation(i, "place", Pose(0.0, 0.0)) for i in ("drone_1", "drone_2", "Fountain"))
    router = Router(TopoMap(Frame.METRIC, nodes, Edges.empty()))
    for ask in (lambda: router.route(None, "fountan"), lambda: router.route("fountan", "drone_1")):
        with pytest.raises(InputError, match=r"no node 'fountan' on this map of 3 nodes.*'Fountain'"):
            ask()
    with pytest.raises(InputError) as raised:
        router.route(None, "x\n" * 10**5)
    assert len(str(raised.value)) <= 600


def test_an_empty_map_has_no_routes() -> None:
    router = Router(made([], []))
    with pytest.raises(InputError, match="the map is empty"):
        router.route(Pose(0.0, 0.0), "a")
    assert router.distances([]).shape == (0, 0)
    assert router.routes(Pose(0.0, 0.0), []) == []


def test_a_map_without_edges_has_only_the_node_one_stands_at() -> None:
    router = Router(made([(0.0, 0.0), (1.0, 0.0)], []))
    assert router.route("a", "b") == Route("unreachable")
    assert router.route(Pose(0.9, 0.0), "b").nodes == ("b",)
    assert router.distances([0]).tolist() == [[0.0, math.inf]]


def test_edges_of_no_length_are_edges() -> None:
    """Two pictures taken at one spot: csgraph must not take their edge for none."""
    edges = [(0, 1, PATH, 0.0), (1, 2, PATH, 0.0), (2, 3, BRIDGE, 4.0)]
    router = Router(made([(0.0, 0.0)] * 3 + [(4.0, 0.0)], edges))
    assert router.distances([0, 3]).tolist() == [[0.0, 0.0, 0.0, 4.0], [4.0, 4.0, 4.0, 0.0]]
    route = router.route("a", "d")
    assert (route.status, route.nodes, route.length_m, route.bridges) == ("ok", ("a", "b", "c", "d"), 4.0, 1)


def test_doubled_edges_are_not_added_up() -> None:
    edges = [(0, 1, PATH, 3.0), (1, 0, PATH, 5.0), (0, 1, RADIUS, 2.0)]
    router = Router(made([(0.0, 0.0), (2.0, 0.0)], edges))
    assert router.distances([0])[0, 1] == 3.0
    assert router.route("a", "b").length_m == 3.0


def test_poses_off_the_globe_are_refused_and_longitudes_wrap() -> None:
    router = Router(made([(179.9999, 10.0), (-179.9999, 10.0)], [(0, 1, PATH, 22.0)], frame=Frame.WGS84))
    with pytest.raises(InputError, match="latitude 95"):
        router.route(Pose(0.0, 95.0), "a")
    across = router.route(Pose(-179.99995, 10.0), "a")
    assert across.nodes == ("b", "a")
    assert router.route(Pose(180.0001, 10.0), "b").nodes == ("b",)
    assert router.route(Pose(180.0001, 10.0), "b").length_m == pytest.approx(0.0, abs=1e-6)


def test_distances_that_follow_edges_are_told_from_straight_ones(corridor: TopoMap) -> None:
    metres, along = Router(corridor).path_or_straight(Pose(0.0, 3.0), [0, 3, 4, 5, 6, 0])
    assert along.tolist() == [True, True, False, True, False, True]
    expected = [3.0, 34.0, math.hypot(500, 3), 3 + 10 + 12.0, math.hypot(21, 3), 3.0]
    assert metres.tolist() == pytest.approx(expected)
    nothing, flags = Router(corridor).path_or_straight(Pose(0.0, 3.0), [])
    assert (nothing.shape, flags.shape) == ((0,), (0,))


def test_a_start_off_the_map_measures_straight_lines(corridor: TopoMap) -> None:
    metres, along = Router(corridor).path_or_straight(Pose(0.0, 100.0), [0, 5])
    assert not along.any()
    assert metres.tolist() == pytest.approx([100.0, math.hypot(20, 94)])


def test_many_starts_at_once(corridor: TopoMap) -> None:
    router = Router(corridor)
    starts = [Pose(0.0, 3.0), Pose(0.0, 100.0), Pose(31.0, 0.0), Pose(0.0, 3.0)]
    metres, along = router.paths_or_straight(starts, range(7))
    one_by_one = [router.path_or_straight(s, range(7)) for s in starts]
    assert metres.tolist() == [m.tolist() for m, _ in one_by_one]
    assert along.tolist() == [a.tolist() for _, a in one_by_one]
    assert router.paths_or_straight([], range(7))[0].shape == (0, 7)


@st.composite
def graphs(draw: st.DrawFn) -> TopoMap:
    n = draw(st.integers(1, 9))
    points = draw(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=n, max_size=n))
    ends = st.integers(0, n - 1)
    lengths = st.sampled_from([0.0, 0.25, 1.0, 1.5, 2.0, 7.0])
    edges = draw(st.lists(st.tuples(ends, ends, st.sampled_from(list(EdgeKind)), lengths), max_size=20))
    once = {(min(a, b), max(a, b)): (kind, m) for a, b, kind, m in edges if a != b}
    flat = [(a, b, kind, m) for (a, b), (kind, m) in once.items()]
    objects = "".join(draw(st.sets(st.sampled_from("abcdefghi"[:n]))))
    return made([(float(x), float(y)) for x, y in points], flat, objects)


@given(graphs())
def test_dijkstra_equals_networkx(topomap: TopoMap) -> None:
    graph = to_networkx(topomap)
    graph.remove_edges_from([(a, b) for a, b, kind in graph.edges(data="kind") if kind == "observed_from"])
    expected = dict(nx.all_pairs_dijkstra_path_length(graph, weight="metres"))
    ids = [n.id for n in topomap.nodes]
    metres = Router(topomap).distances(range(len(ids)))
    assert metres.tolist() == [[pytest.approx(expected[a].get(b, math.inf)) for b in ids] for a in ids]


@given(graphs(), st.data())
def test_a_route_is_a_shortest_walk_over_edges(topomap: TopoMap, data: st.DataObject) -> None:
    router, graph = Router(topomap), to_networkx(topomap)
    goal = data.draw(st.sampled_from([n.id for n in topomap.nodes]))
    start = Pose(*data.draw(st.tuples(st.integers(0, 9), st.integers(0, 9))))
    route = router.route(start, goal)
    metres, along = router.path_or_straight(start, [topomap.row[goal]])
    assert (route.status == "ok") == bool(along[0])
    if route.status != "ok":
        assert route == Route(route.status)
        return
    steps = [graph.edges[pair] for pair in zip(route.nodes, route.nodes[1:], strict=False)]
    assert all(step["kind"] != "observed_from" for step in steps)
    assert route.bridges == sum(step["kind"] == "bridge" for step in steps)
    first = topomap.nodes[topomap.row[route.nodes[0]]].pose
    snap = math.dist(first.xyz, start.xyz)
    assert route.length_m == pytest.approx(snap + sum(step["metres"] for step in steps))
    if route.nodes[-1] == goal:
        assert metres[0] == pytest.approx(route.length_m)
    else:
        assert graph.edges[route.nodes[-1], goal]["kind"] == "observed_from"
