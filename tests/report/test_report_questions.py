"""Wording of answers: every kind, status of route, and condition."""

from dataclasses import replace

import numpy as np
import pytest

from erag.core.types import (
    Answer,
    Cluster,
    Edges,
    Forest,
    Frame,
    Hit,
    Observation,
    Pose,
    Query,
    Route,
    TopoMap,
    Waypoint,
)
from erag.data.contract import Result
from erag.generate.answer import NOTHING
from erag.report.asking import Asked
from erag.report.questions import Wording
from erag.report.tree import leaf_counts, steps

NODES = tuple(
    Observation(f"n{i}", "place", Pose(float(i), 0.0), name=f"Place {i}", caption="A bench.") for i in range(3)
)
TOPOMAP = TopoMap(Frame.METRIC, NODES, Edges.empty())
CLUSTER = Cluster(
    "L1-0", 1, ("n0", "n1"), (0.5, 0.0, 0.0), 1.0, "Benches", "Two benches.", ("Bench by bench",), {"ndvi": 0.2}
)
FOREST = Forest(
    ("n0", "n1", "n2"), (CLUSTER,), np.array([3, 3, -1, -1]), np.array([0, 0, 0, 1]), np.zeros((4, 2), np.float32)
)
HIT = Hit("n1", (1.0, 0.0, 0.0), 0.75, 0.8, None, 0.5, ("L1-0", "n1"))
GO = Answer("find", "Go to n1.", "it is a bench", Waypoint("n1", Frame.METRIC, (1.0, 0.0, 0.0), 0.5), None, ("n1",))


def worded(answer: Answer | None, query: Query | None = None, seconds: bool = True, **result: object) -> object:
    asked = Asked("a bench", query, Result("q", (HIT,), answer, 0.25, 7, {"embed": 1, "score": 0}, **result))
    return Wording(TOPOMAP, FOREST, seconds=seconds).view(asked)


def test_a_find() -> None:
    view = worded(GO, Query("a bench", Pose(0.0, 0.0), {"ndvi": "low"}))
    assert view.status == "find"
    assert view.goal == 1
    assert view.waypoint == "n1 at 1, 0, 0 (metric), yaw 0.50 rad"
    assert view.conditions == ("from 0, 0, 0", "ndvi low")
    assert view.cost == "0.250 s · 7 rows scored · calls: 1 embed"
    (hit,) = view.hits
    assert (hit.row, hit.title, hit.near) == (1, "Place 1", "Benches")
    assert hit.parts == (("semantic", 0.8), ("sensor", 0.5))
    assert view.evidence == ()


@pytest.mark.parametrize(
    ("route", "said"),
    [
        (None, ""),
        (Route("no_start"), ""),
        (Route("unreachable"), "no way there is on the map"),
        (Route("off_map"), "the start is off the map"),
        (Route("ok", ("n0", "n1"), 1234.4, 0), "1,234 m over 2 nodes"),
        (Route("ok", ("n0", "n1"), 9.0, 1), "9 m over 2 nodes, 1 of its edges bridged, not driven"),
    ],
)
def test_routes(route: Route | None, said: str) -> None:
    view = worded(replace(GO, route=route))
    assert view.route == said
    assert view.way == ((0, 1) if route is not None and route.status == "ok" else ())


def test_an_explanation_rests_on_its_evidence() -> None:
    view = worded(
        Answer("explain", "Two views.\n\x07[n0] a bench", "from 2 views", evidence=("n0", "n2")), seconds=False
    )
    assert (view.status, view.goal) == ("explain", None)
    assert view.evidence == ((0, "n0"), (2, "n2"))
    assert view.answer == "Two views.\n[n0] a bench"
    assert view.preview == "Two views."
    assert view.cost == "7 rows scored · calls: 1 embed"


def test_a_refusal_and_an_error_are_told_apart() -> None:
    assert worded(Answer("find", NOTHING, "nothing comes near")).status == "refused"
    failed = worded(None, error="line 1: not a JSON object")
    assert (failed.status, failed.answer, failed.cost) == ("error", "line 1: not a JSON object", "calls: 1 embed")


def test_a_result_of_another_map_is_refused() -> None:
    with pytest.raises(KeyError):
        worded(replace(GO, waypoint=Waypoint("elsewhere", Frame.METRIC, (0.0, 0.0, 0.0))))


def test_the_tree_opens_and_closes_every_cluster_and_holds_every_leaf() -> None:
    found = list(steps(FOREST, TOPOMAP))
    assert [s.kind for s in found] == ["open", "leaf", "leaf", "close", "leaf"]
    assert [s.id for s in found if s.kind == "leaf"] == ["n0", "n1", "n2"]
    opened = found[0]
    assert (opened.title, opened.views, opened.sensors, opened.is_root) == ("Benches", 2, (("ndvi", 0.2),), True)
    assert leaf_counts(FOREST) == [1, 1, 1, 2]


def test_a_forest_deeper_than_recursion_allows() -> None:
    depth = 3000
    clusters = tuple(Cluster(f"c{i}", i + 1, (f"c{i - 1}" if i else "n0",), (0.0, 0.0, 0.0), 0.0) for i in range(depth))
    parent = np.array([*range(1, depth + 1), -1])
    forest = Forest(("n0",), clusters, parent, np.arange(depth + 1), np.zeros((depth + 1, 2), np.float32))
    found = list(steps(forest, TOPOMAP))
    assert [s.kind for s in found] == ["open"] * depth + ["leaf"] + ["close"] * depth
