"""The arithmetic of cross-voting."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.core.errors import BadModelOutput, InputError
from erag.evaluate.judges.protocol import Panel, Votes
from erag.evaluate.truth import Asked, NodeTruth, Pair

NAN = float("nan")
votes_of = st.lists(st.one_of(st.just(NAN), st.floats(0, 1)), min_size=3, max_size=3)


class Fixed:
    """A judge with votes of its own for any pairs."""

    def __init__(self, name: str, *votes: float, models: tuple[str, ...] = ()) -> None:
        self.name, self.models, self._votes = name, frozenset(models), votes

    def probabilities(self, pairs: list[Pair]) -> np.ndarray:
        return np.array(self._votes)


def votes(*rows: list[float]) -> Votes:
    names = tuple("abcdefg"[: len(rows[0])])
    return Votes(names, tuple(frozenset({f"model {n}"}) for n in names), np.array(rows))


PAIRS = [Pair(Asked("q", "a bench"), NodeTruth(n)) for n in "xy"]


def test_the_mean_of_five_votes() -> None:
    five = votes([1.0, 0.5, 0.0, 0.8, 0.7], [0.0, 0.0, 0.0, 0.0, 1.0])
    assert five.mean() == pytest.approx([0.6, 0.2])
    assert five.mean(["c"]) == pytest.approx([0.75, 0.25])
    assert five.probability(["a", "b", "c", "d"]) == pytest.approx([0.7, 1.0])


def test_an_abstention_is_no_vote_and_no_vote_is_no_0() -> None:
    some = votes([1.0, NAN, 0.0], [NAN, NAN, 0.4])
    assert some.mean() == pytest.approx([0.5, 0.4])
    with pytest.raises(InputError, match=r"nobody voted on 1 of 2 pairs, the first is number 1"):
        some.probability(["c"])
    assert np.isnan(some.mean(["c"])[1])


def test_judges_that_share_a_model_with_the_run_are_left_out_once() -> None:
    three = votes([1.0, 0.0, 0.5])
    assert three.sharing({"model b", "model z"}) == ("b",)
    rows = three.sensitivity({"model b", "model z"})
    assert list(rows) == ["all", "without the run's models", "without a", "without b", "without c"]
    assert [float(r[0]) for r in rows.values()] == pytest.approx([0.5, 0.75, 0.25, 0.75, 0.5])
    assert list(three.sensitivity()) == ["all", "without a", "without b", "without c"]
    assert list(three.sensitivity({"model a", "model b", "model c"}))[1] == "without a"  # nobody would be left
    assert list(votes([0.3]).sensitivity()) == ["all"]


def test_who_is_not_there_cannot_be_left_out() -> None:
    with pytest.raises(InputError, match=r"no judge 'z'.*allowed: a, b"):
        votes([0.1, 0.2]).mean(["z"])
    with pytest.raises(InputError, match="no judge is left"):
        votes([0.1, 0.2]).mean(["a", "b"])
    with pytest.raises(InputError, match="one or more judges"):
        Panel(()).vote(PAIRS).mean()


@pytest.mark.parametrize("wrong", [1.1, -0.1, float("inf")])
def test_votes_outside_0_to_1_are_refused(wrong: float) -> None:
    with pytest.raises(ValueError, match=r"outside \[0, 1\]"):
        votes([0.5, wrong])
    with pytest.raises(ValueError, match="votes of shape"):
        Votes(("a", "a"), (frozenset(), frozenset()), np.zeros((1, 2)))


def test_a_panel_gathers_columns_and_refuses_a_judge_that_cannot_count() -> None:
    made = Panel((Fixed("a", 1.0, 0.0), Fixed("b", NAN, 0.5, models=("m",)))).vote(PAIRS)
    assert made.judges == ("a", "b")
    assert made.models == (frozenset(), frozenset({"m"}))
    assert made.mean() == pytest.approx([1.0, 0.25])
    with pytest.raises(BadModelOutput, match=r"b: \(1,\) votes; allowed: 2, one a pair"):
        Panel((Fixed("a", 1.0, 0.0), Fixed("b", 1.0))).vote(PAIRS)
    assert Panel((Fixed("a"),)).vote([]).mean().shape == (0,)


@given(st.lists(votes_of, min_size=1, max_size=6), st.permutations([0, 1, 2]))
def test_the_mean_lies_among_the_votes_and_does_not_know_the_order_of_judges(rows: list, order: list[int]) -> None:
    cast = votes(*rows)
    mean = cast.mean()
    for row, value in zip(rows, mean, strict=True):
        known = [v for v in row if not np.isnan(v)]
        assert np.isnan(value) if not known else min(known) - 1e-12 <= value <= max(known) + 1e-12
    other = votes(*[[row[i] for i in order] for row in rows])
    assert other.mean() == pytest.approx(mean, nan_ok=True)
