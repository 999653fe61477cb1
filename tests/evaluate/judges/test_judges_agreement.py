"""Agreement with labels: AUC, calibration, the head of a ranking, scaling."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.core.errors import InputError
from erag.evaluate.judges.agreement import (
    PANEL,
    Bin,
    agreement,
    auc,
    calibration_error,
    panel_agreement,
    reliability,
)
from erag.evaluate.judges.calibration import Calibrated, Platt, cross_calibrated, fit_platt
from erag.evaluate.judges.protocol import Votes
from erag.evaluate.truth import Asked, NodeTruth, Pair

NAN = float("nan")
shares = st.integers(0, 1000).map(lambda i: i / 1000)
cast = st.lists(st.tuples(shares, st.booleans()), min_size=2, max_size=30)


def arrays(pairs: list[tuple[float, bool]]) -> tuple[np.ndarray, np.ndarray]:
    return np.array([v for v, _ in pairs]), np.array([label for _, label in pairs], np.bool_)


def test_auc_by_hand() -> None:
    assert auc(np.array([0.9, 0.8, 0.3, 0.1]), np.array([True, False, True, False])) == 3 / 4
    assert auc(np.array([0.5, 0.5]), np.array([True, False])) == 0.5
    assert auc(np.array([0.5, 0.5]), np.array([True, True])) is None


def test_auc_and_brier_are_those_of_scikit_learn() -> None:
    metrics = pytest.importorskip("sklearn.metrics", reason="no scikit-learn: pip install -e .[sentence]")
    rng = np.random.default_rng(0)
    for _ in range(10):
        votes, labels = np.round(rng.random(200), 1), rng.random(200) < 0.3  # many ties
        found = agreement("j", "all", votes, labels, ["q"] * 200)
        assert found is not None
        assert found.auc == pytest.approx(metrics.roc_auc_score(labels, votes))
        assert found.brier == pytest.approx(metrics.brier_score_loss(labels, votes))


@given(cast)
def test_auc_turns_around_with_votes_and_labels_and_ignores_the_scale(pairs: list[tuple[float, bool]]) -> None:
    votes, labels = arrays(pairs)
    value = auc(votes, labels)
    if value is None:
        return
    assert 0 <= value <= 1
    assert auc(-votes, labels) == pytest.approx(1 - value)
    assert auc(votes, ~labels) == pytest.approx(1 - value)
    assert auc(votes / 2, labels) == pytest.approx(value)


def test_bins_by_hand() -> None:
    votes, labels = np.array([0.05, 0.95, 1.0, 0.91]), np.array([False, True, True, False])
    low, high = reliability(votes, labels)
    assert low == Bin(0.0, 0.1, 1, pytest.approx(0.05), 0.0)
    assert high == Bin(0.9, 1.0, 3, pytest.approx(2.86 / 3), pytest.approx(2 / 3))
    assert calibration_error((low, high)) == pytest.approx((0.05 + 0.86) / 4)
    assert calibration_error(()) == 0


@given(cast)
def test_bins_hold_every_pair_and_the_error_is_bounded(pairs: list[tuple[float, bool]]) -> None:
    votes, labels = arrays(pairs)
    bins = reliability(votes, labels)
    assert sum(b.pairs for b in bins) == len(votes)
    assert 0 <= calibration_error(bins) <= 1


def test_abstentions_are_counted_and_not_scored() -> None:
    votes, labels = np.array([1.0, NAN, 0.0, NAN]), np.array([True, False, False, True])
    found = agreement("j", "all", votes, labels, ["q"] * 4)
    assert found is not None
    assert (found.pairs, found.positives, found.abstained, found.auc, found.brier) == (2, 1, 2, 1.0, 0.0)
    assert agreement("j", "all", np.full(2, NAN), labels[:2], ["q"] * 2) is None


def test_queries_are_averaged_one_by_one() -> None:
    """Query a is told apart, query b is turned around, c has one label only: mean ½, though all at once is not."""
    votes = np.array([0.9, 0.8, 0.1, 0.2, 0.5])
    labels = np.array([True, False, True, False, True])
    found = agreement("j", "all", votes, labels, ["a", "a", "b", "b", "c"])
    assert found is not None
    assert found.query_auc is not None
    assert found.query_auc.mean == 0.5
    assert found.auc == auc(votes, labels) == 0.5 + 0.0
    assert "by query 0.50" in found.line()
    alone = agreement("j", "all", votes[4:], labels[4:], ["c"])
    assert alone is not None
    assert (alone.auc, alone.query_auc) == (None, None)
    assert "AUC none, by query none" in alone.line()


def test_the_head_of_a_ranking_apart_from_all_pairs() -> None:
    votes = Votes(("good", "bad"), (frozenset(), frozenset()), np.array([[1, 0.0], [0.0, 1.0], [0.0, 0.0], [0.9, 0.5]]))
    labels, places = np.array([True, False, False, True]), np.array([1, 2, 3, 4])
    found = panel_agreement(votes, labels, ["q"] * 4, places, top=2)
    by = {(a.over, a.judge): a for a in found}
    assert list(by) == [(o, j) for o in ("all", "top 2") for j in ("good", "bad", PANEL)]
    assert by["all", "good"].auc == 1
    assert by["top 2", "bad"].auc == 0
    assert by["top 2", PANEL].auc == 0.5
    assert by["top 2", PANEL].pairs == 2


def test_scaling_makes_votes_as_sure_as_they_are_right() -> None:
    """Votes of .6 that are right one time in ten, votes of .8 that are right nine times in ten."""
    votes = np.repeat([0.6, 0.8], 1000)
    labels = np.concatenate([np.arange(1000) < 100, np.arange(1000) < 900])
    scaled = fit_platt(votes, labels)(votes)
    assert scaled[0] == pytest.approx(0.1, abs=0.01)
    assert scaled[-1] == pytest.approx(0.9, abs=0.01)


def test_scaling_never_turns_a_ranking_around() -> None:
    votes, labels = np.array([0.1, 0.2, 0.8, 0.9]), np.array([True, True, False, False])
    scale = fit_platt(votes, labels)
    assert scale.slope == 0
    assert scale(votes) == pytest.approx([0.5] * 4, abs=0.01)
    assert np.isnan(scale(np.array([NAN]))[0])


def test_votes_that_are_always_right_are_scaled_finitely() -> None:
    scale = fit_platt(np.array([0.0, 0.0, 1.0, 1.0]), np.array([False, False, True, True]))
    assert np.isfinite([scale.slope, scale.intercept]).all()
    assert scale(np.array([1.0]))[0] == pytest.approx(3 / 4, abs=0.01)  # Platt's (n + 1) / (n + 2)


def test_a_scaling_needs_both_labels_and_a_cross_scaling_two_queries() -> None:
    with pytest.raises(InputError, match="2 positive and 0 negative"):
        fit_platt(np.array([0.1, 0.2, NAN]), np.array([True, True, False]))
    with pytest.raises(InputError, match="two or more queries"):
        cross_calibrated(np.array([0.1]), np.array([True]), ["q"])


def test_a_query_is_scaled_by_the_others_alone() -> None:
    votes = np.tile([0.2, 0.7], 4)
    labels = np.array([False, True] * 3 + [True, False])  # the last query says the opposite
    queries = [q for q in "abcd" for _ in range(2)]
    scaled = cross_calibrated(votes, labels, queries, folds=4)
    assert scaled[6:] == pytest.approx(fit_platt(votes[:6], labels[:6])(votes[6:]))
    assert scaled[7] > 0.7  # what the others teach, whatever its own label


def test_a_scaled_judge_keeps_its_name_and_models() -> None:
    class Half:
        name, models = "half", frozenset({"m"})

        def probabilities(self, pairs: list[Pair]) -> np.ndarray:
            return np.full(len(pairs), 0.5)

    judge = Calibrated(Half(), Platt(1.0, 2.0))
    assert (judge.name, judge.models) == ("half", frozenset({"m"}))
    pair = Pair(Asked("q", "x"), NodeTruth("n"))
    assert judge.probabilities([pair]) == pytest.approx([1 / (1 + np.exp(-2))])
