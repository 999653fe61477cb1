"""Forests stated by a source: what is consistent is kept, everything else is an issue."""

from __future__ import annotations

import numpy as np
import pytest

from erag.core.errors import InputError
from erag.core.types import Edges, Forest, Frame, Observation, Pose, TopoMap
from erag.data.reading import GivenCluster, Issue
from erag.forest.given import given_forest
from erag.forest.graph import to_networkx

NODES = tuple(Observation(f"n{i}", "place", Pose(10.0 * i, 0, 0), caption=f"place {i}") for i in range(6))
MAP = TopoMap(Frame.METRIC, NODES, Edges.empty())
VECTORS = np.eye(6, dtype=np.float32)


def build(*clusters: GivenCluster) -> tuple[Forest, tuple[Issue, ...]]:
    return given_forest(MAP, clusters, VECTORS)


def test_a_consistent_forest_is_kept_with_its_texts() -> None:
    top = GivenCluster("all", 7, ("left", "right"), "everything", "All of it.", ("left of right",))
    forest, issues = build(top, GivenCluster("left", 1, ("n0", "n1", "n2")), GivenCluster("right", 1, ("n3", "n4")))
    assert issues == ()
    assert [(c.id, c.level, c.members) for c in forest.clusters] == [
        ("left", 1, ("n0", "n1", "n2")),
        ("right", 1, ("n3", "n4")),
        ("all", 2, ("left", "right")),
    ]
    kept = forest.clusters[2]
    assert (kept.name, kept.summary, kept.relationships) == ("everything", "All of it.", ("left of right",))
    assert forest.clusters[0].position == (10.0, 0.0, 0.0)
    assert forest.clusters[0].mean_distance == pytest.approx(40 / 3)
    assert kept.mean_distance == 25.0
    assert kept.position == (20.0, 0.0, 0.0)
    assert np.allclose(forest.embeddings[6], [3**-0.5] * 3 + [0] * 3)
    assert [forest.ids[r] for r in forest.roots] == ["n5", "all"]
    assert forest.path(4) == ("all", "right", "n4")


def test_levels_are_counted_from_the_leaves() -> None:
    forest, _ = build(
        GivenCluster("a", 1, ("b", "n5")), GivenCluster("b", 1, ("c",)), GivenCluster("c", 9, ("n0", "n1"))
    )
    assert {c.id: c.level for c in forest.clusters} == {"c": 1, "b": 2, "a": 3}


def test_a_member_claimed_twice_stays_with_the_first() -> None:
    forest, issues = build(GivenCluster("a", 1, ("n0", "n1")), GivenCluster("b", 1, ("n1", "n2", "n2")))
    assert [c.members for c in forest.clusters] == [("n0", "n1"), ("n2",)]
    assert [i.where for i in issues] == ["cluster b", "cluster b"]
    assert "'n1' belongs to cluster a already" in issues[0].what
    assert issues[0].action == "first kept"


def test_unknown_members_and_empty_clusters_are_dropped_up_the_tree() -> None:
    forest, issues = build(
        GivenCluster("top", 3, ("middle",)),
        GivenCluster("middle", 2, ("empty",)),
        GivenCluster("empty", 1, ("nowhere",)),
        GivenCluster("good", 1, ("n0", "ghost")),
    )
    assert [c.id for c in forest.clusters] == ["good"]
    assert [(i.where, i.what) for i in issues] == [
        ("cluster empty", "member 'nowhere' is neither a node nor a cluster"),
        ("cluster good", "member 'ghost' is neither a node nor a cluster"),
        ("cluster empty", "has no members"),
        ("cluster middle", "has no members"),
        ("cluster top", "has no members"),
    ]


def test_cycles_are_cut_where_they_close() -> None:
    forest, issues = build(
        GivenCluster("a", 1, ("b", "n0")),
        GivenCluster("b", 1, ("c", "n1")),
        GivenCluster("c", 1, ("a", "n2")),
        GivenCluster("d", 1, ("d", "n3")),
    )
    assert {c.id: c.level for c in forest.clusters} == {"c": 1, "d": 1, "b": 2, "a": 3}
    assert [i.what for i in issues] == ["member 'a' contains this cluster", "member 'd' contains this cluster"]


def test_ids_used_twice_are_reported() -> None:
    forest, issues = build(GivenCluster("a", 1, ("n0",)), GivenCluster("a", 1, ("n1",)), GivenCluster("n2", 1, ("n3",)))
    assert [(c.id, c.members) for c in forest.clusters] == [("a", ("n0",))]
    assert [i.what for i in issues] == ["has the id of an earlier cluster", "has the id of a node"]


def test_no_clusters_leave_every_node_a_root() -> None:
    forest, issues = build()
    assert (len(forest.roots), forest.clusters, issues) == (6, (), ())
    assert forest.embeddings.shape == (6, 6)


def test_vectors_have_to_fit() -> None:
    with pytest.raises(InputError, match="5 vectors for 6 nodes"):
        given_forest(MAP, (), VECTORS[:5])


def test_a_forest_is_a_graph_from_parent_to_child() -> None:
    forest, _ = build(
        GivenCluster("all", 2, ("left", "n5"), "everything", "All."), GivenCluster("left", 1, ("n0", "n1"))
    )
    graph = to_networkx(forest, MAP)
    assert set(graph.edges) == {("all", "left"), ("all", "n5"), ("left", "n0"), ("left", "n1")}
    assert graph.graph == {"frame": "metric"}
    assert graph.nodes["n1"] == {
        "level": 0, "kind": "place", "x": 10.0, "y": 0.0, "z": 0.0, "text": "place 1", "sensors": {},
    }  # fmt: skip
    assert graph.nodes["all"]["text"] == "All."
    assert graph.nodes["all"]["leaves"] == 3
    assert graph.nodes["left"]["kind"] == "cluster"
