"""One question scored in a built environment."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from erag.core.types import EdgeKind, Edges, Frame, Observation, Pose, TopoMap
from erag.data.contract import QueryLine
from erag.evaluate.dataset import Environment, Question
from erag.evaluate.scene import Scene
from erag.retrieve.rank import StraightLines

# a - b 4 m east - c 3 m north of b, along edges; R = 2.5
NODES = tuple(Observation(n, "place", Pose(x, y), caption=n) for n, x, y in (("a", 0, 0), ("b", 4, 0), ("c", 4, 3)))
MAP = TopoMap(
    Frame.METRIC, NODES, Edges(np.array([[0, 1], [1, 2]]), np.full(2, EdgeKind.PATH, np.int8), np.array([4.0, 3]))
)
WORLD = Environment("w", Path("w"), (), radius_m=10)


def question(*relevant: str) -> Question:
    return Question(QueryLine(1, "q", {"id": "q", "query": "x"}), "explicit", frozenset(relevant))


def test_scores_by_hand() -> None:
    """c first: ℓ = 7 m along the edges, NI = .3; b second: ℓ = 4, NI = .6. The nearest that answers is b."""
    score = Scene.of(WORLD, MAP).score(question("b", "c"), ["c", "b"], [1.0, 0.5], Pose(0, 0))
    assert (score.id, score.environment, score.kind) == ("q", "w", "explicit")
    values = score.values
    assert (values["p_q_a@1"], values["ni@1"], values["metres@1"]) == (1, pytest.approx(0.3), 7)
    assert values["p_q_a_l@5"] == pytest.approx((0.3 + 0.3) / 5)
    assert values["spl@1"] == pytest.approx(4 / 7)
    assert (values["precision@5"], values["mrr"], values["on_edges@5"]) == (0.4, 1, 1)


def test_straight_lines_and_the_map_s_own_radius() -> None:
    scene = Scene.of(Environment("w", Path("w"), ()), MAP, StraightLines(MAP))
    assert scene.radius_m == 2.5
    values = scene.score(question("c"), ["c"], [1.0], Pose(0, 0)).values
    assert (values["metres@1"], values["ni@1"], values["on_edges@1"]) == (5, 0, 0)


def test_without_a_location_or_labels_there_is_less() -> None:
    bare = Question(QueryLine(1, "q", {"id": "q"}), "global")
    assert set(Scene.of(WORLD, MAP).score(bare, ["a"], [0.5]).values) == {"p_q_a@1", "p_q_a@5"}
    unanswerable = Scene.of(WORLD, MAP).score(question(), ["a"], [0.5], Pose(0, 0)).values
    assert "precision@1" not in unanswerable
    assert "spl@1" not in unanswerable
    assert "p_q_a_l@1" in unanswerable


def test_no_answer_is_0_and_an_empty_map_too() -> None:
    values = Scene.of(WORLD, MAP).score(question("b"), [], [], Pose(0, 0)).values
    assert values["spl@1"] == values["p_q_a_l@1"] == values["ndcg@5"] == 0
    empty = Scene.of(Environment("w", Path("w"), ()), TopoMap(Frame.METRIC, (), Edges.empty()))
    assert empty.radius_m == 0
    assert set(empty.score(question("b"), [], [], Pose(0, 0)).values.values()) == {0.0}


def test_every_answer_has_a_probability() -> None:
    with pytest.raises(ValueError, match="shorter"):
        Scene.of(WORLD, MAP).score(question("b"), ["a", "b"], [1.0])
    with pytest.raises(KeyError):
        Scene.of(WORLD, MAP).score(question("b"), ["z"], [1.0], Pose(0, 0))
