"""The map as a networkx graph."""

import networkx as nx

from erag.core.types import EdgeKind, Frame, Interval, Observation, Pose
from erag.data.reading import GivenEdge
from erag.topomap.build import build_map
from erag.topomap.config import MapConfig
from erag.topomap.graph import to_networkx


def test_nodes_and_edges_bear_what_is_known() -> None:
    seen = Observation(
        "a",
        "place",
        Pose(1.0, 2.0, 3.0, 0.5),
        Interval(0, 86_400),
        "img/a.jpg",
        "gate",
        "A gate.",
        {"ndvi": 0.4},
        "walk",
    )
    bare = Observation("cup", "object", Pose(1.0, 2.0))
    topomap, _ = build_map(Frame.METRIC, [seen, bare], [], MapConfig())
    graph = to_networkx(topomap)
    assert isinstance(graph, nx.Graph)
    assert graph.graph == {"frame": "metric"}
    assert dict(graph.nodes(data=True)) == {
        "a": {
            "kind": "place", "x": 1.0, "y": 2.0, "z": 3.0, "yaw": 0.5, "time": "1970-01-01", "image": "img/a.jpg",
            "name": "gate", "caption": "A gate.", "sensors": {"ndvi": 0.4}, "source": "walk",
        },
        "cup": {"kind": "object", "x": 1.0, "y": 2.0, "z": 0.0, "sensors": {}, "source": ""},
    }  # fmt: skip
    assert list(graph.edges(data=True)) == [("a", "cup", {"kind": "observed_from", "metres": 3.0})]


def test_the_order_of_nodes_and_the_kinds_of_edges_are_kept() -> None:
    nodes = [Observation(i, "place", Pose(x, 0.0)) for i, x in (("z", 0.0), ("y", 1.0), ("x", 9.0))]
    given = [GivenEdge("z", "y", EdgeKind.PATH), GivenEdge("y", "x", EdgeKind.RADIUS)]
    graph = to_networkx(build_map(Frame.METRIC, nodes, given, MapConfig())[0])
    assert list(graph) == ["z", "y", "x"]
    assert graph.edges["z", "y"] == {"kind": "path", "metres": 1.0}
    assert graph.edges["y", "x"] == {"kind": "radius", "metres": 8.0}
    assert nx.shortest_path_length(graph, "z", "x", weight="metres") == 9.0
