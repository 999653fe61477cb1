"""The `gml` reader: which dialect a file is taken for, and what each makes of it."""

import math
from pathlib import Path

import pytest

from erag.core.errors import InputError
from erag.core.types import EdgeKind, Frame, Interval
from erag.data.gmlreader import GmlReader
from erag.data.reading import GivenEdge, Reading
from erag.data.rows import EDGE_OUT, ROW_OUT


def read(folder: Path, *parts: str) -> Reading:
    path = folder / "map.gml"
    path.write_text("graph [\n" + "\n".join(parts) + "\n]\n", encoding="utf-8")
    return GmlReader().read(path)


def node(i: int, type_: str, more: str = "", xyz: tuple[object, ...] = (1.5, 2.5, 0.0)) -> str:
    x, y, z = xyz
    return f'node [ id {i} label "n{i}" type "{type_}" position [ x {x} y {y} z {z} ] {more} ]'


def edge(a: int, b: int, more: str = "") -> str:
    return f"edge [ source {a} target {b} {more} ]"


def test_street_view_is_wgs84_with_months_and_without_yaw(tmp_path: Path) -> None:
    made = read(
        tmp_path,
        node(0, "street_view", 'base_heading 0 timestamp "2023-12" name "A" caption "&#34;B&#34;" pano_id "p"'),
        node(1, "street_view", 'base_heading 0 timestamp ""', (-79.9, 40.4, 0)),
    )
    a, b = made.observations
    assert made.frame is Frame.WGS84
    assert (a.id, a.name, a.caption, a.pose.xyz, a.pose.yaw) == ("n0", "A", '"B"', (1.5, 2.5, 0.0), None)
    assert a.time == Interval(1701388800.0, 1704067200.0)
    assert b.time is None
    assert made.notes == (
        "yaw is unknown: base_heading is 0 at all 2 nodes that state it",
        "attributes of nodes not kept: pano_id",
    )
    assert [(i.where, i.action) for i in made.issues] == [("map.gml:3", "kept without time")]
    assert made.source == f"{tmp_path.name}/map.gml"


def test_headings_that_differ_are_compass_bearings(tmp_path: Path) -> None:
    headings = ["0", "90", "180", "270", "450", "NaN"]
    made = read(tmp_path, *(node(i, "street_view", f"base_heading {h}") for i, h in enumerate(headings)))
    yaws = [o.pose.yaw for o in made.observations]
    assert yaws[:5] == pytest.approx([math.pi / 2, 0, -math.pi / 2, math.pi, 0])
    assert yaws[5] is None
    assert made.issues[0].action == "yaw unknown"


def test_street_view_forest_trusts_edges_and_reports_lists_that_differ(tmp_path: Path) -> None:
    made = read(
        tmp_path,
        *(node(i, "base") for i in range(4)),
        node(10, "cluster", 'level 1 members "n0" members "n1" name "C" summary "s" relationships "r"'),
        node(11, "cluster", 'level 1 members "n2" summary "s"'),
        node(12, "cluster", 'level 2 members "n10" members "n11" members "n3"'),
        *(edge(*ends) for ends in ((0, 10), (1, 10), (2, 11), (3, 11), (10, 12), (11, 12))),
    )
    a, b, c = made.clusters
    assert (a.id, a.level, a.members, a.name, a.summary, a.relationships) == ("n10", 1, ("n0", "n1"), "C", "s", ("r",))
    assert b.members == ("n2", "n3")
    assert c.members == ("n10", "n11")
    assert [(i.where, i.action) for i in made.issues] == [
        ("map.gml:7", "the edges are used"),
        ("map.gml:8", "the edges are used"),
        ("map.gml:8", "kept without summary"),
    ]


def test_member_lists_are_used_where_no_edge_is(tmp_path: Path) -> None:
    made = read(tmp_path, node(0, "base"), node(9, "cluster", 'level 1 summary "s" members "n0"'))
    assert made.clusters[0].members == ("n0",)
    assert [i.action for i in made.issues] == ["the list is used"]


def test_edges_that_lead_nowhere_are_told(tmp_path: Path) -> None:
    made = read(
        tmp_path,
        node(0, "base"),
        node(1, "base"),
        node(9, "cluster", 'level 1 summary "s"'),
        *(edge(*ends) for ends in ((0, 9), (9, 0), (0, 1), (0, 77), (1, 9))),
        "edge [ source 0 ]",
        "edge [ source 0 source 1 target 9 ]",
    )
    assert made.clusters[0].members == ("n0", "n1")
    out = [i for i in made.issues if i.action == EDGE_OUT]
    assert {i.where for i in out} == {"map.gml:6", "map.gml:7", "map.gml:8", "map.gml:10", "map.gml:11"}


def test_airsim_drones_objects_and_edges(tmp_path: Path) -> None:
    made = read(
        tmp_path,
        node(0, "drone", "yaw 0.25", (0.0, 0.0, -1.0)),
        node(1, "drone", "yaw 0.5", (1.0, 0.0, -1.0)),
        node(2, "object", "box2D [ min [ x 1 ] ]"),
        node(3, "object", 'name "n3" summary "Object: n3"'),
        node(4, "object", 'name "sofa" summary "A red sofa."'),
        node(5, "cluster", 'level 1 name "lounge" summary "s"'),
        edge(0, 1, 'type "drone_path" distance 1.25'),
        edge(2, 3, 'type "spatial" relationship "south" distance 3.0'),
        edge(2, 5, 'relationship "part_of"'),
        edge(3, 5, 'relationship "part_of"'),
        edge(3, 4, 'type "teleport"'),
    )
    assert made.frame is Frame.METRIC
    assert [(o.kind, o.name, o.caption, o.pose.yaw) for o in made.observations] == [
        ("place", None, None, 0.25),
        ("place", None, None, 0.5),
        ("object", "n2", None, None),
        ("object", "n3", None, None),
        ("object", "sofa", "A red sofa.", None),
    ]
    assert made.observations[0].pose.z == -1.0
    assert made.edges == (GivenEdge("n0", "n1", EdgeKind.PATH, 1.25),)
    assert made.clusters[0].members == ("n2", "n3")
    assert "z points down" in made.notes[0]
    assert made.notes[1] == "1 spatial relations between objects are not edges of the map"
    assert made.notes[2] == "attributes of nodes not kept: box2D"
    assert [(i.where, i.action) for i in made.issues] == [("map.gml:12", EDGE_OUT)]


def test_a_directly_logged_scene_points_up(tmp_path: Path) -> None:
    made = read(tmp_path, 'creation_method "direct_scene_logger"', node(0, "object"))
    assert "z points up" in made.notes[0]
    assert "which way z points it does not say" in read(tmp_path, node(0, "object")).notes[0]


def test_any_graph_that_states_its_frame(tmp_path: Path) -> None:
    made = read(
        tmp_path,
        'frame "metric" sensor [ name "t" min 0 max 50 ]',
        'node [ id 0 x 1 y 2 z 3 caption "c" name "n" timestamp 2023 sensor [ name "t" value 20 ] colour "red" ]',
        'node [ id 1 label "b" x 1 y 2 type "object" time [ start 5 end 6.5 ] ]',
        "node [ id 2 position [ x 1 y 2 ] time [ start 7 end 6 ] sensor [ value 3 ] ]",
        edge(0, 1, "distance 4"),
        edge(0, 2, 'kind "radius"'),
        edge(1, 2, 'kind "wormhole"'),
    )
    a, b, c = made.observations
    assert (a.id, b.id, c.id) == ("0", "b", "2")
    assert (a.pose.xyz, c.pose.xyz) == ((1, 2, 3), (1, 2, 0))
    assert (a.time, b.time, c.time) == (Interval(1672531200.0, 1704067200.0), Interval(5.0, 6.5), None)
    assert (a.sensors, b.kind, made.sensors) == ({"t": 20.0}, "object", {"t": (0.0, 50.0)})
    assert [e.kind for e in made.edges] == [EdgeKind.PATH, EdgeKind.RADIUS]
    assert made.edges[0].metres == 4
    assert made.notes == ("1 edges that state no kind are read as path edges", "attributes of nodes not kept: colour")
    assert [i.where for i in made.issues] == ["map.gml:5", "map.gml:5", "map.gml:8"]


def test_a_graph_without_a_frame_is_refused_with_what_to_state(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'does not say in which frame.*add `frame "wgs84"`'):
        read(tmp_path, "node [ id 0 x 1 y 2 ]")
    with pytest.raises(InputError, match=r"the frame is 'utm'"):
        read(tmp_path, 'frame "utm"', "node [ id 0 x 1 y 2 ]")


@pytest.mark.parametrize(
    ("attributes", "told"),
    [
        ('format "erag-observations" version 2', "version 2 of erag-observations"),
        ("sensor 5", "a sensor is no list"),
        ('sensor [ name "t" min 5 max 1 ]', "range of the sensor 't' is 5 to 1"),
        ('sensor [ name "t" min 0 max 1e400 ]', "range of the sensor"),
        ("sensor [ min 0 max 1 ]", "id is not text"),
    ],
)
def test_attributes_that_cannot_be(attributes: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=told):
        read(tmp_path, 'frame "metric"', attributes, "node [ id 0 x 1 y 2 ]")


def test_rows_are_counted_with_their_lines(tmp_path: Path) -> None:
    made = read(
        tmp_path,
        node(0, "base"),
        node(1, "base", xyz=("NaN", 0, 0)),
        node(2, "base", xyz=(0, 95, 0)),
        node(0, "base"),
        'node [ type "base" position [ x 1 y 1 ] ]',
        'node [ id 7 label "n7" label "n8" type "base" position [ x 1 y 1 ] ]',
        'node [ id 0 label "other" type "base" position [ x 1 y 1 ] ]',
        'node [ id 8 label "n9" type "base" ]',
        'node [ id 9 label [ a 1 ] type "base" ]',
        'node [ id 11 label "n11" type "base" position [ x 1 x 2 y 1 ] ]',
    )
    assert [o.id for o in made.observations] == ["n0", "other", "n11"]
    out = {i.where for i in made.issues if i.action.startswith(ROW_OUT)}
    assert out == {f"map.gml:{line}" for line in (3, 4, 5, 6, 7, 9, 10)}
    kept = [i for i in made.issues if i.action.startswith("row kept")]
    assert {i.where for i in kept} == {"map.gml:5", "map.gml:8"}


def test_nothing_in_a_file_is_evaluated(tmp_path: Path) -> None:
    code = "__import__('pathlib').Path('pwned').touch()"
    made = read(tmp_path, node(0, "base", f'caption "{code}" base_heading "{code}"'), f'creator "{code}"')
    assert made.observations[0].caption == code
    assert not (Path.cwd() / "pwned").exists()


def test_a_file_without_nodes(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no node in it"):
        read(tmp_path, "edge [ source 0 target 1 ]")
    with pytest.raises(InputError, match=r"no node in it; map.gml:2: lists nested deeper"):
        read(tmp_path, "a [ " * 50)


def test_encodings(tmp_path: Path) -> None:
    cafe = node(0, "place", 'caption "café"')
    text = f'graph [ frame "metric"\r\n{cafe}\r\n{node(1, "place")} ]'
    path = tmp_path / "map.gml"
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert GmlReader().read(path).observations[0].caption == "café"
    path.write_bytes(text.encode("latin-1"))
    made = GmlReader().read(path)
    assert made.observations[0].caption == "caf\ufffd"
    assert made.issues[0].where == "map.gml:2"
    assert "first at byte" in made.issues[0].what
    path.write_bytes(text.encode("utf-16"))
    with pytest.raises(InputError, match="not UTF-8 text: byte 0"):
        GmlReader().read(path)
