"""The COEX folder: captions in JSON, quaternions, microseconds, edges and the forest beside them."""

import copy
import json
import math
from pathlib import Path
from typing import Any

import pytest

from erag.core.errors import InputError
from erag.core.types import EdgeKind, Frame
from erag.data.coex import CoexReader
from erag.data.reading import Reading

HALF = math.sqrt(0.5)
# A camera (x right, y down, z ahead) that looks along +x, +y, -x of a world whose z points up; x, y, z, w.
ALONG_X, ALONG_Y, ALONG_MINUS_X = (-0.5, 0.5, -0.5, 0.5), (-HALF, 0, 0, HALF), (-0.5, -0.5, 0.5, 0.5)


def node(i: int, quaternion: object = ALONG_X, **fields: object) -> dict[str, Any]:
    caption = json.dumps({"Description": f"Hall {i}.", "Objects": "floor, lamp"})
    made = {"node_id": i, "timestamp": 1571636004579869 + i, "position": [i, 2.0, 3.0], "quaternion": quaternion}
    return made | {"image": f"frames/{i:05}.jpg", "caption": caption} | fields


def edge(a: object, b: object, kind: object = "sequence") -> dict[str, object]:
    return {"src": a, "dst": b, "type": kind}


def folder(path: Path, nodes: list[Any], edges: list[Any], forest: dict[str, Any] | None = None) -> Reading:
    (path / "frames").mkdir()
    for item in nodes:
        if isinstance(item, dict) and isinstance(item.get("node_id"), int):
            (path / "frames" / f"{item['node_id']:05}.jpg").write_bytes(b"x")
    (path / "topological_graph.json").write_text(json.dumps({"nodes": nodes, "edges": edges}, indent=1))
    if forest is not None:
        (path / "semantic_forest_x.json").write_text(json.dumps(forest, indent=1))
    assert CoexReader().sniff(path)
    return CoexReader().read(path)


def test_a_sound_folder(tmp_path: Path) -> None:
    made = folder(tmp_path, [node(0), node(1)], [edge(0, 1), edge(1, 0, "proximity")])
    first = made.observations[0]
    assert made.frame is Frame.METRIC
    assert (first.id, first.image, first.caption) == ("0", "frames/00000.jpg", "Hall 0. Objects: floor, lamp.")
    assert first.time is not None
    assert first.time.start == first.time.end == 1571636004.579869
    assert [(e.a, e.b, e.kind, e.metres) for e in made.edges] == [
        ("0", "1", EdgeKind.PATH, None),
        ("1", "0", EdgeKind.RADIUS, None),
    ]
    assert made.issues == ()


@pytest.mark.parametrize(
    ("quaternion", "yaw"),
    [
        (ALONG_X, 0.0),
        (ALONG_Y, math.pi / 2),
        (ALONG_MINUS_X, math.pi),
        (tuple(3 * v for v in ALONG_Y), math.pi / 2),
        (tuple(-v for v in ALONG_Y), math.pi / 2),
    ],
)
def test_yaw_is_that_of_the_optical_axis(quaternion: tuple[float, ...], yaw: float, tmp_path: Path) -> None:
    made = folder(tmp_path, [node(0, list(quaternion))], [])
    assert abs(made.observations[0].pose.yaw or 0.0) == pytest.approx(yaw)
    assert made.issues == ()


@pytest.mark.parametrize(
    "quaternion",
    [
        [0, 0, 0, 0],
        [0, 0, math.nan, 1],
        [0, 0, math.inf, 1],
        [1e300] * 4,
        [1, 0, 0],
        "north",
        [0, 0, None, 1],
        [0, 0, 0, 1],
    ],
)
def test_a_quaternion_that_gives_no_heading(quaternion: object, tmp_path: Path) -> None:
    made = folder(tmp_path, [node(0, quaternion)], [])
    assert made.observations[0].pose.yaw is None
    assert [(i.where, i.action) for i in made.issues] == [("topological_graph.json:3", "yaw unknown")]


@pytest.mark.parametrize(
    ("caption", "means"),
    [
        ('{"Description": "A hall", "Objects": ["a", "b"]}', "A hall. Objects: a, b."),
        ('{"Description": "A hall!"}', "A hall!"),
        ('{"Objects": "a"}', None),
        ("A plain hall.", None),
        ('{"Description": "A", "Description": "B", "Objects": ""}', None),
        ("[" * 200_000, None),
        ("[1, 2]", None),
        ('{"Description": {"a": 1}, "Objects": 5}', None),
        ("9" * 10_000, None),
    ],
)
def test_captions(caption: str, means: str | None, tmp_path: Path) -> None:
    """Captions are JSON of two keys; whatever else they are is kept as the text it is, and told."""
    made = folder(tmp_path, [node(0, caption=caption)], [])
    assert made.observations[0].caption == (means or caption[:4000])
    assert [i.action for i in made.issues][:1] == ([] if means else ["read as plain text"])


def test_bad_rows_and_edges_are_told_with_lines(tmp_path: Path) -> None:
    nodes = [
        node(0),
        node(1, position=[1, 2]),
        node(0),
        "x",
        node(True),
        node(4, timestamp="now", image="/x.jpg"),
        node(5),
    ]
    edges = [edge(0, 4), edge(0, 1), edge(0, 4, ["a"]), edge(0, 0), edge(4, 5, "teleport"), edge(None, 5), 7]
    made = folder(tmp_path, nodes, edges)
    text = (tmp_path / "topological_graph.json").read_text().splitlines()
    assert [o.id for o in made.observations] == ["0", "4", "5"]
    assert len(made.edges) == 1
    assert sum(i.action.startswith("row left out") for i in made.issues) == 4
    assert sum(i.action.startswith("edge left out") for i in made.issues) == 6
    assert [text[int(i.where.split(":")[1]) - 1].strip() for i in made.issues][:4] == ["{", "{", '"x",', "{"]


def test_repeated_keys_leave_a_row_out(tmp_path: Path) -> None:
    text = json.dumps({"nodes": [node(0), node(1)], "edges": []}).replace(
        '"node_id": 1,', '"node_id": 1, "node_id": 2,'
    )
    (tmp_path / "topological_graph.json").write_text(text)
    made = CoexReader().read(tmp_path)
    assert [o.id for o in made.observations] == ["0"]
    assert any("'node_id' twice" in i.what for i in made.issues)


FOREST: dict[str, Any] = {
    "root": "L2_0",
    "nodes": {
        "L0_0": {"type": "leaf", "level": 0, "image": "frames/00000.jpg"},
        "L0_1": {"type": "leaf", "level": 0},
        "L1_0": {"type": "area", "level": 1, "children": ["L0_0", "L0_1"], "summary": "Halls."},
        "L2_0": {"type": "area", "level": 2, "children": ["L1_0"], "summary": "All."},
    },
}


def test_the_forest_names_leaves_by_node_ids(tmp_path: Path) -> None:
    made = folder(tmp_path, [node(0), node(1)], [], FOREST)
    assert [(c.id, c.level, c.members, c.summary) for c in made.clusters] == [
        ("L1_0", 1, ("0", "1"), "Halls."),
        ("L2_0", 2, ("L1_0",), "All."),
    ]
    assert made.issues == ()


def test_leaves_that_are_no_nodes_are_told(tmp_path: Path) -> None:
    forest = copy.deepcopy(FOREST)
    forest["nodes"]["L0_0"]["image"] = "frames/00009.jpg"
    forest["nodes"]["L0_7"] = {"type": "leaf"}
    forest["nodes"]["L1_1"] = {"type": "area", "level": 1, "children": "all"}
    forest["nodes"]["L1_2"] = [1]
    forest["nodes"]["L1_0"]["children"] += [["L0_0"], None]
    (tmp_path / "semantic_forest_y.json").write_text("{}")
    made = folder(tmp_path, [node(0), node(1)], [], forest)
    assert made.clusters[0].members == ("1",)
    actions = [i.action for i in made.issues]
    assert (
        actions
        == ["not read"] + ["leaf left out of the forest"] * 2 + ["cluster left out"] * 2 + ["member left out"] * 3
    )


def test_nodes_and_edges_in_files_of_their_own(tmp_path: Path) -> None:
    (tmp_path / "nodes_with_captions.json").write_text(json.dumps([node(0), node(1)]))
    made = CoexReader().read(tmp_path / "nodes_with_captions.json")
    assert [i.where for i in made.issues if "missing" in i.what] == ["edges.json"]
    (tmp_path / "edges.json").write_text(json.dumps({"edges": [edge(0, 1)], "meta": {}}))
    assert len(CoexReader().read(tmp_path).edges) == 1
    (tmp_path / "topological_graph.json").write_text('{"nodes": ')  # damaged: the other two are read
    made = CoexReader().read(tmp_path)
    assert len(made.observations) == 2
    assert made.issues[0].where == "topological_graph.json:1"


@pytest.mark.parametrize("cut", [10, 300, 700, 1200])
def test_a_file_cut_off_keeps_what_stands_before(cut: int, tmp_path: Path) -> None:
    text = json.dumps({"nodes": [node(i) for i in range(6)], "edges": []}, indent=1)
    (tmp_path / "topological_graph.json").write_text(text[:-cut])
    made = CoexReader().read(tmp_path)
    assert [o.id for o in made.observations] == [str(i) for i in range(len(made.observations))]
    assert "damaged JSON" in made.issues[0].what
    assert "left out" in made.issues[0].action


@pytest.mark.parametrize(
    "text", ["[" * 300_000, '{"nodes": ' + "[" * 300_000, '{"a":' * 100_000, "7", '{"nodes": {"a": 1}}', "{,}"]
)
def test_json_that_is_none(text: str, tmp_path: Path) -> None:
    (tmp_path / "topological_graph.json").write_text(text)
    with pytest.raises(InputError):
        CoexReader().read(tmp_path)
