"""The edge rules of a map, one by one and together."""

import dataclasses
from collections.abc import Sequence
from itertools import pairwise as steps
from typing import Literal

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from erag.core.errors import InputError
from erag.core.geometry import pairwise
from erag.core.types import EdgeKind, Frame, Interval, Observation, Pose, TopoMap
from erag.data.reading import GivenEdge
from erag.topomap.build import build_map
from erag.topomap.config import MapConfig
from erag.topomap.report import MapReport, describe

PATH, RADIUS, BRIDGE, OBSERVED = EdgeKind
PLAIN = MapConfig(path="given", edge_radius=None, meet=None, bridge=False, observed_from=False)
POINTS = st.lists(st.tuples(*[st.integers(-8, 8)] * 3), min_size=1, max_size=12)


def node(
    name: str,
    *xyz: float,
    kind: Literal["place", "object"] = "place",
    time: Interval | float | None = None,
    source: str = "s",
) -> Observation:
    when = Interval(time, time) if isinstance(time, int | float) else time
    return Observation(name, kind, Pose(*xyz), time=when, source=source)


def places(points: Sequence[Sequence[float]], **more: str) -> list[Observation]:
    return [node(f"n{i}", *p, **more) for i, p in enumerate(points)]  # type: ignore[arg-type]


def edges(topomap: TopoMap) -> dict[tuple[str, str], tuple[EdgeKind, float]]:
    """The edges by node ids, in their order."""
    e = topomap.edges
    pairs = ((topomap.nodes[a].id, topomap.nodes[b].id) for a, b in e.index.T)
    return {p: (EdgeKind(k), float(m)) for p, k, m in zip(pairs, e.kind, e.metres, strict=True)}


def built(nodes: Sequence[Observation], given: Sequence[GivenEdge] = (), **config: object) -> tuple[TopoMap, MapReport]:
    return build_map(Frame.METRIC, nodes, given, PLAIN.model_copy(update=config))


def test_an_empty_map_is_a_map() -> None:
    for config in (MapConfig(), MapConfig(edge_radius=3, bridge=True, path="sequence")):
        topomap, report = build_map(Frame.WGS84, [], [], config)
        assert (len(topomap), len(topomap.edges), report.components) == (0, 0, 0)
        assert report.lines()[0] == "0 nodes: 0 places, 0 objects"


def test_two_nodes_of_one_id_are_refused() -> None:
    with pytest.raises(InputError, match=r"two nodes have the id 'a'.*'x' and 'y'"):
        built([node("a", 0, 0, source="x"), node("a", 1, 1, source="y")])


def test_stated_edges_are_kept_or_measured() -> None:
    nodes = places([(0, 0), (3, 4), (6, 8)])
    topomap, report = built(nodes, [GivenEdge("n2", "n1", PATH), GivenEdge("n0", "n1", RADIUS, 7.5)])
    assert edges(topomap) == {("n0", "n1"): (RADIUS, 7.5), ("n1", "n2"): (PATH, 5.0)}
    assert (report.path, report.radius, report.bridge, report.observed_from, report.issues) == (1, 1, 0, 0, ())


def test_what_is_wrong_with_stated_edges_is_reported() -> None:
    nodes = places([(0, 0), (10, 0), (20, 0), (30, 0)])
    given = [
        GivenEdge("n0", "ghost", PATH),
        GivenEdge("n0", "n0", PATH, 1.0),
        GivenEdge("n0", "n1", PATH, 9.8),
        GivenEdge("n1", "n2", PATH, 9.95),
        GivenEdge("n2", "n3", PATH, float("nan")),
        GivenEdge("n0", "n3", PATH, -1.0),
    ]
    topomap, report = built(nodes, given)
    assert edges(topomap) == {
        ("n0", "n1"): (PATH, 9.8),
        ("n0", "n3"): (PATH, 30.0),
        ("n1", "n2"): (PATH, 9.95),
        ("n2", "n3"): (PATH, 10.0),
    }
    assert [(i.where, i.what, i.action) for i in report.issues] == [
        ("edge 'n0'–'ghost'", "no node 'ghost'", "edge left out"),
        ("edge 'n0'–'n0'", "joins a node to itself", "edge left out"),
        ("edge 'n0'–'n1'", "length 9.800 m is shorter than the straight line, 10.000 m", "kept as stated"),
        ("edge 'n2'–'n3'", "nan m is no length", "measured: 10.000 m"),
        ("edge 'n0'–'n3'", "-1.0 m is no length", "measured: 30.000 m"),
    ]
    assert "5 issues with stated edges, the first: edge 'n0'–'ghost': no node 'ghost' (edge left out)" in report.lines()


@pytest.mark.parametrize("swap", [False, True])
def test_doubles_become_one_edge(swap: bool) -> None:
    def edge(kind: EdgeKind, metres: float | None, a: str = "n0", b: str = "n1") -> GivenEdge:
        return GivenEdge(b, a, kind, metres) if swap else GivenEdge(a, b, kind, metres)

    def only(*given: GivenEdge) -> tuple[EdgeKind, float]:
        found = [edges(built(places([(0, 0), (10, 0)]), order)[0]) for order in (given, given[::-1])]
        assert found[0] == found[1]
        return found[0]["n0", "n1"]

    assert only(edge(OBSERVED, 10.0), edge(BRIDGE, 11.0), edge(RADIUS, 12.0), edge(PATH, 13.0)) == (PATH, 13.0)
    assert only(edge(OBSERVED, 10.0), edge(BRIDGE, 11.0), edge(RADIUS, 12.0)) == (RADIUS, 12.0)
    assert only(edge(OBSERVED, 10.0), edge(BRIDGE, 11.0)) == (BRIDGE, 11.0)
    assert only(edge(PATH, None), edge(PATH, 14.0)) == (PATH, 14.0)
    assert only(edge(PATH, 15.0), edge(PATH, 14.0)) == (PATH, 14.0)


def test_a_stated_path_outlives_the_radius_rule() -> None:
    topomap, _ = built(places([(0, 0), (10, 0)]), [GivenEdge("n0", "n1", PATH, 12.0)], edge_radius=50.0)
    assert edges(topomap) == {("n0", "n1"): (PATH, 12.0)}


def test_places_in_order_of_time_are_joined_by_sequence() -> None:
    nodes = [node(f"n{i}", x, 0, time=i) for i, x in enumerate([0, 10, 115, 120])]
    topomap, report = built(nodes, path="auto")
    assert edges(topomap) == {("n0", "n1"): (PATH, 10.0), ("n2", "n3"): (PATH, 5.0)}
    assert (report.by_sequence, report.steps_too_long, report.components) == (2, 1, 2)
    topomap, report = built(nodes, path="auto", max_path_step=105.0)
    assert (report.by_sequence, report.steps_too_long, report.components) == (3, 0, 1)


@pytest.mark.parametrize(
    "times",
    [
        [0, 1, 1],
        [0, 2, 1],
        [0, 1, None],
        [Interval(0, 5), Interval(5, 9), Interval(9, 10)],  # a month is no instant
    ],
)
def test_places_without_an_order_in_time_are_not_joined(times: list[Interval | int | None]) -> None:
    nodes = [node(f"n{i}", i, 0, time=t) for i, t in enumerate(times)]
    assert edges(built(nodes, path="auto")[0]) == {}
    assert list(edges(built(nodes, path="sequence")[0])) == [("n0", "n1"), ("n1", "n2")]


def test_sequences_stay_within_their_source_and_pass_over_objects() -> None:
    nodes = [
        node("a0", 0, 0, time=0, source="a"),
        node("b0", 0, 5, time=0, source="b"),
        node("cup", 1, 1, time=None, source="a", kind="object"),
        node("a1", 2, 0, time=1, source="a"),
        node("b1", 2, 5, time=1, source="b"),
    ]
    assert list(edges(built(nodes, path="auto")[0])) == [("a0", "a1"), ("b0", "b1")]


def test_a_source_that_states_ways_is_taken_at_its_word() -> None:
    nodes = [node(f"{s}{i}", i, 5 * (s == "b"), time=i, source=s) for s in "ab" for i in range(3)]
    given = [GivenEdge("a0", "a2", PATH)]
    assert list(edges(built(nodes, given, path="auto")[0])) == [("a0", "a2"), ("b0", "b1"), ("b1", "b2")]
    both = edges(built(nodes, given, path="sequence")[0])
    assert list(both) == [("a0", "a1"), ("a0", "a2"), ("a1", "a2"), ("b0", "b1"), ("b1", "b2")]
    tied = [GivenEdge("a0", "a2", OBSERVED)]
    assert ("a0", "a1") in edges(built(nodes, tied, path="auto")[0])


@given(POINTS, st.floats(0.5, 20), st.sampled_from([Frame.METRIC, Frame.WGS84]))
def test_radius_edges_equal_brute_force(points: list[tuple[int, ...]], radius: float, frame: Frame) -> None:
    scaled = [(179.9999 + x * 2e-5 if x <= 5 else -180 + x * 1e-5, y * 2e-5, z) for x, y, z in points]
    nodes = places(scaled if frame is Frame.WGS84 else points)
    topomap, report = build_map(frame, nodes, [], PLAIN.model_copy(update={"edge_radius": radius}))
    metres = pairwise(frame, topomap.positions, topomap.positions)
    expected = [(a, b) for a in range(len(nodes)) for b in range(a + 1, len(nodes)) if metres[a, b] <= radius]
    assert topomap.edges.index.T.tolist() == [list(p) for p in expected]
    assert report.radius == len(expected)
    assert report.radius_m == radius


def test_the_automatic_radius_is_only_for_sources_without_ways() -> None:
    track = [node(f"t{i}", 10 * i, 0, source="track") for i in range(3)]
    given = [GivenEdge("t0", "t1", PATH), GivenEdge("t1", "t2", PATH)]
    _, report = built(track, given, edge_radius="auto")
    assert (report.radius, report.radius_m) == (0, None)
    survey = [node(f"v{i}", 10 * i, 4, source="survey") for i in range(3)]
    topomap, report = built(track + survey, given, edge_radius="auto")
    assert report.radius_m == pytest.approx(15.0)
    # Around the survey only: v-v and t-v, not t-t.
    assert all("v" in a + b for (a, b), (kind, _) in edges(topomap).items() if kind is RADIUS)
    assert {p for p, (kind, _) in edges(topomap).items() if kind is PATH} == {("t0", "t1"), ("t1", "t2")}
    assert (report.radius, report.components) == (2 + 3 + 4, 1)


def test_radius_edges_join_places_and_not_the_objects_beside_them() -> None:
    nodes = [node("a", 0, 0), node("b", 5, 0), node("cup", 2, 0, kind="object")]
    assert list(edges(built(nodes, edge_radius=10.0)[0])) == [("a", "b")]


def test_objects_alone_are_joined_so_that_routes_exist() -> None:
    nodes = [node(f"o{i}", x, 0, kind="object") for i, x in enumerate([0, 1, 2, 50])]
    topomap, report = build_map(Frame.METRIC, nodes, [], MapConfig(edge_radius=1.5))
    assert edges(topomap) == {("o0", "o1"): (RADIUS, 1.0), ("o1", "o2"): (RADIUS, 1.0), ("o2", "o3"): (BRIDGE, 48.0)}
    assert (report.components, report.observed_from, report.unattached) == (1, 0, 0)


def test_recordings_of_one_place_meet_where_both_have_been() -> None:
    """Two drives along a street, half a metre apart for a while; a third past the other side of a wall."""
    first = [node(f"a{i}", 10.0 * i, 0, 0, source="a") for i in range(4)]
    second = [node(f"b{i}", 10.0 * i, 0.3 * i, 0, source="b") for i in range(4)]
    third = [node(f"c{i}", 10.0 * i, -0.7, 0, source="c") for i in range(4)]
    drives = (first, second, third)
    given = [GivenEdge(x.id, y.id, EdgeKind.PATH) for drive in drives for x, y in steps(drive)]
    nodes = [*first, *second, *third]
    topomap, report = built(nodes, given, meet=0.5)
    met = {pair: metres for pair, (kind, metres) in edges(topomap).items() if kind == RADIUS}
    assert met == {("a0", "b0"): 0.0, ("a1", "b1"): pytest.approx(0.3)}
    assert (report.meetings, report.components) == (2, 2)
    assert "recordings meet at 2 spots" in report.lines()
    assert built(nodes, given)[1].components == 3
    standing = [node(f"x{i}", 1, 2, 0, source="x") for i in range(300)]  # a robot that stood still: no clique
    assert built([*first, *standing], given[:3], meet=0.5)[1].radius <= 300


def test_a_path_that_crosses_itself_gets_no_shortcut() -> None:
    loop = places([(0, 0, 0), (10, 0, 0), (10, 10, 0), (0, 0.2, 0)])
    given = [GivenEdge(x.id, y.id, EdgeKind.PATH) for x, y in steps(loop)]
    assert built(loop, given, meet=0.5)[1].radius == 0


def test_automatic_bridges_are_only_for_maps_without_ways() -> None:
    far = [(0, 0), (1, 0), (100, 0)]
    assert built(places(far), bridge="auto")[1].bridge == 2
    assert built(places(far), [GivenEdge("n0", "n1", PATH)], bridge="auto")[1].bridge == 0
    assert built(places(far), [GivenEdge("n0", "n1", RADIUS)], bridge="auto")[1].bridge == 0
    assert built(places(far), [GivenEdge("n0", "n1", OBSERVED)], bridge="auto")[1].bridge == 2
    timed = [dataclasses.replace(n, time=Interval(i, i)) for i, n in enumerate(places(far))]
    assert built(timed, bridge="auto", path="auto", max_path_step=5.0)[1].bridge == 0
    assert built(places(far), [GivenEdge("n0", "n1", PATH)], bridge=True)[1].bridge == 1
    assert built(places(far), edge_radius=200.0, bridge=False)[1].bridge == 0


def test_bridges_that_are_too_long_are_counted_and_not_made() -> None:
    topomap, report = built(places([(0, 0), (1, 0), (11, 0), (111, 0)]), bridge=True, max_bridge=10.0)
    assert edges(topomap) == {("n0", "n1"): (BRIDGE, 1.0), ("n1", "n2"): (BRIDGE, 10.0)}
    assert (report.bridge, report.bridge_total_m, report.bridge_longest_m) == (2, 11.0, 10.0)
    assert (report.bridges_left_out, report.components, report.largest, report.isolated) == (1, 2, (3, 1), 1)
    assert "1 bridge left out as longer than max_bridge" in report.lines()


def test_objects_attach_to_the_nearest_place() -> None:
    nodes = [
        node("a", 0, 0),
        node("b", 10, 0),
        node("cup", 9, 0, kind="object"),
        node("pen", 1, 0, 2, kind="object"),
        node("door", 2, 0, kind="object"),
        node("seen", 2, 0, kind="object"),
    ]
    given = [GivenEdge("a", "b", PATH), GivenEdge("door", "b", PATH), GivenEdge("seen", "b", OBSERVED)]
    topomap, report = built(nodes, given, observed_from=True)
    assert edges(topomap) == {
        ("a", "b"): (PATH, 10.0),
        ("a", "pen"): (OBSERVED, pytest.approx(5**0.5)),
        ("b", "cup"): (OBSERVED, 1.0),
        ("b", "door"): (PATH, 8.0),
        ("b", "seen"): (OBSERVED, 8.0),
    }
    assert (report.observed_from, report.components, report.largest, report.unattached) == (3, 1, (3,), 0)
    _, report = built(nodes, given)
    assert (report.observed_from, report.unattached) == (1, 2)
    assert "2 objects without an edge" in report.lines()


def test_objects_attach_across_the_antimeridian_and_at_the_pole() -> None:
    nodes = [
        node("west", 179.9999, 0),
        node("east", -179.99, 0),
        node("cup", -179.9999, 0, kind="object"),
        node("pole", 20, 90),
        node("flag", -160, 89.9999, kind="object"),
    ]
    topomap, _ = build_map(Frame.WGS84, nodes, [], PLAIN.model_copy(update={"observed_from": True}))
    assert list(edges(topomap)) == [("west", "cup"), ("pole", "flag")]


@given(POINTS, st.data())
def test_components_equal_networkx_and_the_map_is_deterministic(
    points: list[tuple[int, ...]], data: st.DataObject
) -> None:
    nodes = [node(f"n{i}", *p, kind=data.draw(st.sampled_from(["place", "object"]))) for i, p in enumerate(points)]
    ends = st.sampled_from([n.id for n in nodes])
    stated = st.builds(GivenEdge, ends, ends, st.sampled_from(list(EdgeKind)), st.none() | st.floats(0, 30))
    given = data.draw(st.lists(stated, max_size=10))
    config = data.draw(
        st.builds(
            MapConfig,
            path=st.sampled_from(["given", "auto", "sequence"]),
            edge_radius=st.sampled_from([None, "auto", 4.0]),
            bridge=st.sampled_from(["auto", True, False]),
            max_bridge=st.sampled_from([None, 6.0]),
            observed_from=st.booleans(),
        )
    )
    topomap, report = build_map(Frame.METRIC, nodes, given, config)
    again, same = build_map(Frame.METRIC, nodes, tuple(reversed(given)), config)
    assert edges(topomap) == edges(again)
    assert dataclasses.replace(report, issues=()) == dataclasses.replace(same, issues=())
    graph = nx.Graph(k for k, (kind, _) in edges(topomap).items() if kind is not OBSERVED)
    no_place = not any(n.kind == "place" for n in nodes)
    graph.add_nodes_from(n.id for n in nodes if n.kind == "place" or no_place)
    sizes = sorted((len(c) for c in nx.connected_components(graph)), reverse=True)
    assert (report.components, list(report.largest), report.isolated) == (len(sizes), sizes[:5], sizes.count(1))
    assert (np.diff(topomap.edges.index, axis=0) > 0).all()
    assert describe(topomap).lines()[2] == report.lines()[2]


def test_the_report_reads_well() -> None:
    nodes = [*places([(0, 0), (10, 0), (20, 0), (200, 0)]), node("cup", 1, 0, kind="object")]
    _, report = build_map(Frame.METRIC, nodes, [], MapConfig(edge_radius=12.0))
    assert report.lines() == [
        "5 nodes: 4 places, 1 object",
        "edges: 0 path, 2 radius (within 12.0 m), 1 bridge, 1 observed_from",
        "1 component, largest: 4; 0 isolated nodes",
        "bridges: 180.0 m in all, longest 180.0 m",
    ]


@pytest.mark.parametrize(
    "bad",
    [
        {"path": "guess"},
        {"edge_radius": 0},
        {"edge_radius": -5},
        {"edge_radius": float("nan")},
        {"edge_radius": float("inf")},
        {"edge_radius": "wide"},
        {"max_bridge": 0},
        {"max_path_step": float("inf")},
        {"bridge": "sometimes"},
        {"radius": 5},
    ],
)
def test_wrong_configurations_are_refused(bad: dict[str, object]) -> None:
    with pytest.raises(ValidationError, match=next(iter(bad))):
        MapConfig(**bad)  # type: ignore[arg-type]


def test_a_configuration_survives_json_and_is_frozen() -> None:
    config = MapConfig(edge_radius=5, bridge=True, max_bridge=None)
    assert MapConfig.model_validate_json(config.model_dump_json()) == config
    with pytest.raises(ValidationError):
        config.bridge = False  # type: ignore[misc]
