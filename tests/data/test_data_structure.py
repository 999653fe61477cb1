"""The rules for given edges and clusters."""

import math

import pytest

from erag.core.types import EdgeKind
from erag.data.reading import GivenCluster, GivenEdge
from erag.data.rows import CLUSTER_OUT, EDGE_OUT, IssueLog, RawCluster, RawEdge
from erag.data.structure import clusters, edges

NODES = {"a", "b", "c", "d"}


def cluster(i: object, level: object, *members: object, line: int = 1, summary: object = "s") -> RawCluster:
    return RawCluster(line, i, level, members, summary=summary)


def test_sound_edges_are_kept_in_order() -> None:
    log = IssueLog("e")
    rows = [RawEdge(1, "a", "b", "path", 2), RawEdge(2, "b", "a", "radius"), RawEdge(3, "c", "d", "bridge", 0.0)]
    assert edges(rows, NODES, log) == (
        GivenEdge("a", "b", EdgeKind.PATH, 2.0),
        GivenEdge("b", "a", EdgeKind.RADIUS),
        GivenEdge("c", "d", EdgeKind.BRIDGE, 0.0),
    )
    assert log.issues == []


@pytest.mark.parametrize(
    ("edge", "told"),
    [
        (RawEdge(5, "a", "a", "path"), "joins a node with itself"),
        (RawEdge(5, "a", "x", "path"), "ends at 'x'"),
        (RawEdge(5, None, "a", "path"), "is not an id"),
        (RawEdge(5, ["a"], "a", "path"), "is not an id"),
        (RawEdge(5, "a", "b", "spatial"), "kind 'spatial', none of path, radius, bridge, observed_from"),
        (RawEdge(5, "a", "b", ["path"]), "kind a list"),
        (RawEdge(5, "a", "b", None), "kind None"),
        (RawEdge(5, "d", "c", "path", 3.0), "of line 1 again with length 3.0 instead of 1.0"),
        (RawEdge(5, "c", "d", "path", 1), "of line 1 again"),
    ],
)
def test_edges_that_cannot_be_used_are_left_out(edge: RawEdge, told: str) -> None:
    log = IssueLog("e")
    assert len(edges([RawEdge(1, "c", "d", "path", 1.0), edge], NODES, log)) == 1
    (issue,) = log.issues
    assert issue.where == "e:5"
    assert told in issue.what
    assert issue.action.startswith(EDGE_OUT)


@pytest.mark.parametrize("metres", [-1.0, math.nan, math.inf, "far", True, 1e12])
def test_a_bad_length_is_left_to_the_map(metres: object) -> None:
    log = IssueLog("e")
    assert edges([RawEdge(1, "a", "b", "path", metres)], NODES, log) == (GivenEdge("a", "b", EdgeKind.PATH),)
    assert log.issues[0].action == "length left out, the map measures it"


def test_clusters_come_in_the_order_of_the_file() -> None:
    log = IssueLog("c")
    top = RawCluster(1, "top", 2, ("one", "c"), "Top", " all \n of it ", ("x near y", 5))
    made = clusters([top, cluster("one", 1, "a", "b")], NODES, log)
    assert made == (
        GivenCluster("top", 2, ("one", "c"), "Top", "all of it", ("x near y",)),
        GivenCluster("one", 1, ("a", "b"), "", "s"),
    )
    assert [i.what for i in log.issues] == ["the relationship is not text: 5"]


@pytest.mark.parametrize(
    ("bad", "told"),
    [
        (cluster("a", 1, "b"), "is also that of a node"),
        (cluster("k", 1, "b"), "is also that of the cluster of line 1"),
        (cluster("x", 0, "b"), "level of the cluster 'x' is 0"),
        (cluster("x", "1", "b"), "level of the cluster 'x' is '1'"),
        (cluster("x", True, "b"), "is True"),
        (cluster("x", 10**9, "b"), "not 1 to 100"),
        (cluster("", 1, "b"), "id is empty"),
        (cluster(5, 1, "b"), "id is not text"),
        (cluster("x", 1), "has no members"),
    ],
)
def test_clusters_that_cannot_be_used_are_left_out(bad: RawCluster, told: str) -> None:
    log = IssueLog("c")
    assert [c.id for c in clusters([cluster("k", 1, "c"), bad], NODES, log)] == ["k"]
    assert told in log.issues[-1].what
    assert log.issues[-1].action == CLUSTER_OUT


@pytest.mark.parametrize("member", ["nobody", 5, None, ["a"], {"a": 1}, "x", "y", "a"])
def test_members_that_cannot_be_are_left_out(member: object) -> None:
    """Unknown ones, itself, one of the same level, one that has a parent already."""
    log = IssueLog("c")
    rows = [cluster("w", 1, "a"), cluster("x", 1, "b", member), cluster("y", 1, "c")]
    assert [c.members for c in clusters(rows, NODES, log)] == [("a",), ("b",), ("c",)]
    assert [i.action for i in log.issues] == ["member left out"]


def test_what_leads_to_nothing_falls_with_its_parents() -> None:
    log = IssueLog("c")
    rows = [cluster("top", 3, "middle"), cluster("middle", 2, "low"), cluster("low", 1, "nobody")]
    assert clusters(rows, NODES, log) == ()
    assert sum(i.action == CLUSTER_OUT for i in log.issues) == 3


def test_a_missing_summary_is_told() -> None:
    log = IssueLog("c")
    (made,) = clusters([cluster("x", 1, "a", summary=None)], NODES, log)
    assert made.summary == ""
    assert [i.what for i in log.issues] == ["the cluster 'x' has no summary"]
