"""Scores of one query's answers, and tables over queries."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.evaluate.answers import Answered, Ground, QueryScore, answer_scores, ranking_scores, summarise, top

answers = st.lists(
    st.builds(Answered, st.sampled_from("abcdefg"), st.floats(0, 1), st.floats(0, 1000), st.booleans()), max_size=8
)


def test_three_answers_by_hand() -> None:
    """R = 100: NI .9, .5, 0; P·NI .72, .2, 0; printed .08, .2, 1.5; SPL with l = 5: .4, .04, .05/1.5."""
    given_ = [Answered("a", 0.8, 10, True), Answered("b", 0.4, 50, False), Answered("c", 1.0, 150, True)]
    found = answer_scores(given_, Ground(100, 5))
    expected = {
        "p_q_a@1": 0.8, "p_q_a@5": 2.2 / 5,
        "ni@1": 0.9, "ni@5": 1.4 / 5,
        "p_q_a_l@1": 0.72, "p_q_a_l@5": 0.92 / 5,
        "p_q_a_l_printed@1": 0.08, "p_q_a_l_printed@5": 1.78 / 5,
        "spl@1": 0.4, "spl@5": (0.4 + 0.04 + 5 / 150) / 5,
        "on_edges@1": 1.0, "on_edges@5": 2 / 3,
        "metres@1": 10,
    }  # fmt: skip
    assert found == pytest.approx(expected)


def test_no_answer_counts_0_everywhere() -> None:
    found = answer_scores([], Ground(100, 5))
    assert set(found.values()) == {0.0}
    assert {"p_q_a@1", "p_q_a@5", "ni@1", "p_q_a_l@5", "p_q_a_l_printed@1", "spl@5"} <= set(found)
    assert answer_scores([]) == {"p_q_a@1": 0.0, "p_q_a@5": 0.0}


def test_a_node_answered_twice_counts_once() -> None:
    twice = [Answered("a", 1.0, 0), Answered("a", 1.0, 0), Answered("b", 0.5, 0)]
    found = answer_scores(twice, Ground(10))
    assert found["p_q_a@5"] == pytest.approx(1.5 / 5)
    assert found["ni@5"] == pytest.approx(2 / 5)


def test_only_the_first_five_count() -> None:
    many = [Answered(str(i), 1.0, 0) for i in range(5)]
    assert answer_scores([*many, Answered("x", 0.0, 0)], Ground(10)) == answer_scores(many, Ground(10))


def test_what_cannot_be_scored_is_refused() -> None:
    with pytest.raises(ValueError, match="no path length"):
        answer_scores([Answered("a", 1.0)], Ground(10))
    with pytest.raises(ValueError, match="must lie in"):
        Answered("a", float("nan"))
    with pytest.raises(ValueError, match="k must be at least 1"):
        top([1.0], 0)


@given(answers, st.floats(1e-3, 1000))
def test_bounds(made: list[Answered], radius: float) -> None:
    found = answer_scores(made, Ground(radius, 1.0))
    for k in (1, 5):
        assert 0 <= found[f"p_q_a_l@{k}"] <= found[f"p_q_a@{k}"] <= 1
        assert found[f"p_q_a_l@{k}"] <= found[f"ni@{k}"] + 1e-12
        assert 0 <= found[f"spl@{k}"] <= found[f"p_q_a@{k}"]
    assert found["p_q_a@1"] <= 5 * found["p_q_a@5"] + 1e-12


@given(answers, st.floats(1e-3, 1000), st.randoms(use_true_random=False))
def test_the_order_within_the_first_five_does_not_change_top_5(made: list[Answered], radius: float, random) -> None:
    five = list({a.node: a for a in made}.values())[:5]
    mixed = random.sample(five, len(five))
    one, other = answer_scores(five, Ground(radius, 1.0)), answer_scores(mixed, Ground(radius, 1.0))
    assert {k: v for k, v in one.items() if k.endswith("@5")} == pytest.approx(
        {k: v for k, v in other.items() if k.endswith("@5")}
    )


@given(answers, st.integers(0, 7), st.floats(1e-3, 1000))
def test_a_better_answer_never_costs(made: list[Answered], place: int, radius: float) -> None:
    if place >= len(made):
        return
    better = list(made)
    better[place] = Answered(made[place].node, 1.0, made[place].metres, made[place].on_edges)
    before, after = answer_scores(made, Ground(radius, 1.0)), answer_scores(better, Ground(radius, 1.0))
    assert all(after[name] >= value - 1e-12 for name, value in before.items())


def test_scores_against_labels() -> None:
    found = ranking_scores(["x", "a", "b"], {"a", "b"})
    assert (found["precision@1"], found["precision@5"]) == (0, pytest.approx(2 / 5))
    assert (found["success@1"], found["success@5"], found["mrr"]) == (0, 1, 0.5)
    assert found["map"] == pytest.approx((1 / 2 + 2 / 3) / 2)


def test_tables_keep_systems_that_did_not_answer() -> None:
    scores = [
        QueryScore("1", "w1", "explicit", answer_scores([Answered("a", 1.0, 0, True)], Ground(10))),
        QueryScore("2", "w2", "explicit", answer_scores([], Ground(10))),
    ]
    table = summarise(scores)
    assert table["p_q_a@1"].mean == 0.5
    assert table["p_q_a_l@1"].mean == 0.5
    assert table["metres@1"].mean == 0  # only the query that was answered has a way
    assert summarise(scores, by_environment=True)["p_q_a@1"].mean == 0.5
    assert summarise([]) == {}
