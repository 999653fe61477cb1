"""The readers on the outside data: every figure that was counted by other means, and no row lost."""

import math
from collections import Counter
from dataclasses import replace
from pathlib import Path

import networkx as nx
import numpy as np
import pytest

from erag.core.types import EdgeKind, Frame, Interval
from erag.data.reading import Reading
from erag.data.registry import read
from erag.data.writer import write_folder, write_gml

pytestmark = pytest.mark.shared


def levels(reading: Reading) -> list[int]:
    counts = Counter(c.level for c in reading.clusters)
    return [len(reading.observations), *(counts[level] for level in sorted(counts))]


def test_cmu_map(shared: Path) -> None:
    made = read(shared / "data/cmu_500/topological_map.gml")
    assert (made.frame, len(made.observations), len(made.edges), len(made.clusters)) == (Frame.WGS84, 3313, 0, 0)
    first = made.observations[0]
    assert (first.id, first.name) == ("0", "Winter Forest Roadside Parking")
    assert '"Ridgewood Trail"' in (first.caption or "")
    assert first.pose.xyz == (-79.94377147812496, 40.43877564980744, 0.0)
    assert first.time == Interval(1701388800.0, 1704067200.0)
    assert all(o.pose.yaw is None and o.image is None and o.kind == "place" for o in made.observations)
    assert sum(o.time is None for o in made.observations) == 3
    assert sum(i.what == "the time is empty" for i in made.issues) == 3
    assert [i.what[:32] for i in made.issues if i.where == "topological_map.gml"] == [
        "none of its 3313 images is there"
    ]
    assert len(made.issues) == 4
    assert "base_heading is 0 at all 3313 nodes" in made.notes[0]


def test_cmu_captions_equal_those_networkx_reads(shared: Path) -> None:
    path = shared / "data/cmu_500/topological_map.gml"
    graph = nx.read_gml(path)
    for o in read(path).observations:
        given = graph.nodes[o.id]
        assert (o.name, o.caption) == (" ".join(given["name"].split()), " ".join(given["caption"].split()))
        assert o.pose.xyz == tuple(given["position"].values())


def test_cmu_forest(shared: Path) -> None:
    made = read(shared / "data/cmu_500/semantic_forest_gpt4.gml")
    assert levels(made) == [3313, 159, 45, 10, 2, 1]
    bare = [i.what for i in made.issues if i.action == "kept without summary"]
    assert bare == ["the cluster 'cluster_L2_21' has no summary", "the cluster 'cluster_L4_1' has no summary"]
    assert sum(len(c.members) for c in made.clusters) == 3529
    sizes = [len(c.members) for c in made.clusters if c.level == 1]
    assert max(sizes) == 101
    assert round(np.mean(sizes)) == 21
    assert made.clusters[0].relationships[0] == "Roads flanked by vibrant autumn trees"
    assert not any("members" in i.what for i in made.issues)


def test_building99_forest(shared: Path) -> None:
    made = read(shared / "data/building99/semantic_forest_gpt.gml")
    assert Counter(o.kind for o in made.observations) == {"object": 257, "place": 253}
    assert Counter(e.kind for e in made.edges) == {EdgeKind.PATH: 252}
    assert levels(made)[1:] == [17, 7, 3, 3, 1]
    assert "1702 spatial relations between objects are not edges of the map" in made.notes
    assert 252 + 1702 + sum(len(c.members) for c in made.clusters) == 2240
    assert made.issues == ()
    assert made.edges[0].metres == 1.04250830411911
    assert all(o.name is None for o in made.observations if o.kind == "place")
    places = [o.pose for o in made.observations if o.kind == "place"]
    steps = np.diff([p.xyz[:2] for p in places], axis=0)
    turned = np.arctan2(steps[:, 1], steps[:, 0]) - [p.yaw for p in places[:-1]]
    assert np.median(np.cos(turned)) > 0.99  # the drone looks where it flies


def test_building99_objects(shared: Path) -> None:
    made = read(shared / "data/building99/objects.gml")
    assert len(made.observations) == 1236
    assert all(o.kind == "object" and o.caption is None and o.name for o in made.observations)
    assert any(o.name == "LightmassImportanceVolume_2" for o in made.observations)
    assert made.issues == ()


def test_the_two_files_of_building99_point_z_opposite_ways(shared: Path) -> None:
    """What the notes on the frames rest on."""
    up = {o.id: o.pose for o in read(shared / "data/building99/objects.gml").observations}
    down = [o for o in read(shared / "data/building99/semantic_forest_gpt.gml").observations if o.kind == "object"]
    a, b = (np.array([p.xyz for p in poses]) for poses in ([up[o.id] for o in down], [o.pose for o in down]))
    correlation = [np.corrcoef(a[:, i], b[:, i])[0, 1] for i in range(3)]
    assert correlation[0] > 0.99
    assert correlation[1] > 0.99
    assert correlation[2] < -0.9


def test_coex(shared: Path) -> None:
    made = read(shared / "data/coex_1f")
    assert len(made.observations) == 50
    assert Counter(e.kind for e in made.edges) == {EdgeKind.RADIUS: 140, EdgeKind.PATH: 49}
    assert levels(made) == [50, 3, 1, 1]
    assert made.issues == ()
    assert all(o.image and (made.root / o.image).is_file() for o in made.observations)
    caption = made.observations[0].caption or ""
    assert caption.startswith("The scene depicts a modern lobby area")
    assert caption.endswith("Objects: escalator, marble floor, wooden wall, elevators, digital sign.")
    times = [o.time.start for o in made.observations if o.time]
    assert times == sorted(times)
    assert times[0] == 1571636004.579869
    assert len(times) == 50


def test_coex_cameras_look_along_the_walk(shared: Path) -> None:
    poses = [o.pose for o in read(shared / "data/coex_1f").observations]
    steps = np.diff([p.xyz[:2] for p in poses], axis=0)
    turned = np.arctan2(steps[:, 1], steps[:, 0]) - [p.yaw for p in poses[:-1]]
    assert np.median(np.cos(turned)) > 0.95
    assert all(-math.pi <= (p.yaw or 0.0) <= math.pi for p in poses)


def test_coex_from_its_separate_files(shared: Path, tmp_path: Path) -> None:
    source = shared / "data/coex_1f"
    for name in ("nodes_with_captions.json", "edges.json", "semantic_forest_gpt4o_mini.json"):
        (tmp_path / name).write_bytes((source / name).read_bytes())
    made, whole = read(tmp_path), read(source)
    assert made.edges == whole.edges
    assert made.clusters == whole.clusters
    assert [o.pose for o in made.observations] == [o.pose for o in whole.observations]
    assert [i.what[:22] for i in made.issues] == ["none of its 50 images "]


@pytest.mark.parametrize(
    "source",
    ["cmu_500/semantic_forest_gpt4.gml", "building99/objects.gml", "building99/semantic_forest_gpt.gml", "coex_1f"],
)
def test_all_of_it_survives_both_writers(source: str, shared: Path, tmp_path: Path) -> None:
    given = read(shared / "data" / source)
    write_folder(tmp_path / "folder", given)
    folder = read(tmp_path / "folder")
    assert replace(folder, root=given.root, issues=()) == replace(given, issues=())
    write_gml(tmp_path / "folder.gml", given)
    exported = read(tmp_path / "folder.gml")
    nodes = tuple(replace(o, image=None) for o in given.observations)
    assert replace(exported, root=given.root, issues=()) == replace(given, observations=nodes, issues=())
    graph = nx.read_gml(tmp_path / "folder.gml")
    assert len(graph) == len(given.observations) + len(given.clusters)


@pytest.mark.parametrize("line", [7000, 20000, 40000])
def test_a_quote_lost_in_the_street_view_costs_one_row(line: int, shared: Path, tmp_path: Path) -> None:
    lines = (shared / "data/cmu_500/topological_map.gml").read_text().split("\n")
    at = next(i for i in range(line, len(lines)) if lines[i].startswith("    caption"))
    lines[at] = lines[at][:-1]
    (tmp_path / "map.gml").write_text("\n".join(lines))
    made = read(tmp_path / "map.gml")
    assert len(made.observations) == 3312
    assert sum(i.action.startswith("row left out") for i in made.issues) == 1


def test_two_swapped_rows_of_the_street_view_are_found(shared: Path, tmp_path: Path) -> None:
    text = (shared / "data/cmu_500/topological_map.gml").read_text()
    a = "x -79.94377147812496\n      y 40.43877564980744"
    assert text.count(a) == 1
    (tmp_path / "map.gml").write_text(text.replace(a, "x 40.43877564980744\n      y -79.94377147812496"))
    made = read(tmp_path / "map.gml")
    assert len(made.observations) == 3312
    (issue,) = [i for i in made.issues if i.action == "row left out"]
    assert issue.where == "map.gml:2"
    assert "look swapped" in issue.what
