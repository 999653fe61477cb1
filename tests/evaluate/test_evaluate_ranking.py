"""Ranking metrics: against ir-measures, by hand, and what must hold of any ranking."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.evaluate.ranking import average_precision, ndcg_at, precision_at, recall_at, reciprocal_rank, success_at

NODES = [f"n{i}" for i in range(12)]
rankings = st.lists(st.sampled_from(NODES), unique=True, max_size=12)
with_repeats = st.lists(st.sampled_from(NODES), max_size=12)
labels = st.sets(st.sampled_from(NODES), min_size=1)
places = st.integers(1, 12)


def test_the_same_numbers_as_trec_eval() -> None:
    ir = pytest.importorskip("ir_measures", reason="no ir-measures: pip install -e .[dev]")
    rng = np.random.default_rng(0)
    names = {
        "P@1": lambda h, r: precision_at(h, r, 1),
        "P@5": lambda h, r: precision_at(h, r, 5),
        "R@5": lambda h, r: recall_at(h, r, 5),
        "Success@1": lambda h, r: success_at(h, r, 1),
        "Success@5": lambda h, r: success_at(h, r, 5),
        "RR": reciprocal_rank,
        "AP": average_precision,
        "nDCG@5": lambda h, r: ndcg_at(h, r, 5),
        "nDCG@10": lambda h, r: ndcg_at(h, r, 10),
    }
    runs, labelled = {}, {}
    for q in range(60):
        nodes = rng.permutation([f"d{i}" for i in range(15)])
        runs[f"q{q}"] = [str(n) for n in nodes[: rng.integers(1, 15)]]
        labelled[f"q{q}"] = {str(n) for n in rng.permutation(nodes)[: rng.integers(1, 9)]}
    run = {q: {d: 100.0 - i for i, d in enumerate(hits)} for q, hits in runs.items()}
    qrels = {q: dict.fromkeys(sorted(wanted), 1) for q, wanted in labelled.items()}
    measures = [ir.parse_measure(name) for name in names]
    theirs = {(str(m.measure), m.query_id): m.value for m in ir.iter_calc(measures, qrels, run)}
    assert len(theirs) == len(names) * 60
    for (name, q), value in theirs.items():
        assert names[name](runs[q], labelled[q]) == pytest.approx(value, abs=1e-9), (name, q)


def test_graded_ndcg_is_that_of_trec_eval() -> None:
    ir = pytest.importorskip("ir_measures", reason="no ir-measures: pip install -e .[dev]")
    rng = np.random.default_rng(1)
    runs = {f"q{q}": [str(d) for d in rng.permutation(10)] for q in range(40)}
    gains = {q: {str(d): int(rng.integers(0, 4)) for d in range(10)} | {"3": 2} for q in runs}
    run = {q: {d: 100.0 - i for i, d in enumerate(hits)} for q, hits in runs.items()}
    theirs = list(ir.iter_calc([ir.nDCG @ 5], gains, run))
    assert len(theirs) == 40
    for one in theirs:
        ours = ndcg_at(runs[one.query_id], {d: float(g) for d, g in gains[one.query_id].items()}, 5)
        assert ours == pytest.approx(one.value, abs=1e-9)


def test_ndcg_by_hand() -> None:
    second, third = 1 / math.log2(3), 1 / math.log2(4)
    assert ndcg_at(["x", "a", "b"], {"a", "b"}, 3) == pytest.approx((second + third) / (1 + second))
    assert ndcg_at(["x", "a", "b"], {"a", "b"}, 1) == 0.0
    assert ndcg_at(["b", "a"], {"a": 3.0, "b": 1.0}, 2) == pytest.approx((1 + 3 * second) / (3 + second))
    assert ndcg_at(["a", "a", "b"], {"a", "b"}, 3) == pytest.approx((1 + third) / (1 + second))  # a place wasted
    assert ndcg_at([], {"a"}, 5) == 0.0


def test_average_precision_and_recall_by_hand() -> None:
    assert average_precision(["a", "x", "b"], {"a", "b", "c"}) == pytest.approx((1 + 2 / 3) / 3)
    assert average_precision(["a", "a", "b"], {"a", "b"}) == pytest.approx((1 + 2 / 3) / 2)
    assert recall_at(["a", "x", "b"], {"a", "b", "c", "d"}, 3) == 0.5


@pytest.mark.parametrize("gains", [{}, {"a": 0.0}, {"a": -1.0, "b": 2.0}, {"a": float("nan")}, {"a": float("inf")}])
def test_gains_that_mean_nothing_are_refused(gains: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"gains must be finite|relevant nodes"):
        ndcg_at(["a"], gains, 1)
    with pytest.raises(ValueError, match="k must be at least 1"):
        ndcg_at(["a"], {"a": 1.0}, 0)


@given(with_repeats, labels, places)
def test_all_lie_between_0_and_1(hits: list[str], relevant: set[str], k: int) -> None:
    values = [f(hits, relevant, k) for f in (precision_at, recall_at, success_at, ndcg_at)]
    values += [reciprocal_rank(hits, relevant), average_precision(hits, relevant)]
    assert all(0 <= value <= 1 + 1e-12 for value in values)


@given(rankings, labels, places)
def test_a_ranking_of_relevant_nodes_alone_is_perfect(hits: list[str], relevant: set[str], k: int) -> None:
    best = sorted(relevant) + [h for h in hits if h not in relevant]
    assert ndcg_at(best, relevant, k) == pytest.approx(1)
    assert average_precision(best, relevant) == pytest.approx(1)
    assert reciprocal_rank(best, relevant) == 1


@given(rankings, labels, places, st.data())
def test_moving_a_relevant_hit_up_never_costs(hits: list[str], relevant: set[str], k: int, data: st.DataObject) -> None:
    wrong_before_right = [i for i in range(len(hits) - 1) if hits[i] not in relevant and hits[i + 1] in relevant]
    if not wrong_before_right:
        return
    i = data.draw(st.sampled_from(wrong_before_right))
    better = [*hits[:i], hits[i + 1], hits[i], *hits[i + 2 :]]
    for metric in (precision_at, recall_at, success_at, ndcg_at):
        assert metric(better, relevant, k) >= metric(hits, relevant, k)
    assert reciprocal_rank(better, relevant) >= reciprocal_rank(hits, relevant)
    assert average_precision(better, relevant) > average_precision(hits, relevant)


@given(rankings, labels, places, st.randoms(use_true_random=False))
def test_the_names_of_nodes_do_not_matter(hits: list[str], relevant: set[str], k: int, random: object) -> None:
    other = dict(zip(NODES, reversed(NODES), strict=True))
    for metric in (precision_at, recall_at, success_at, ndcg_at):
        assert metric([other[h] for h in hits], {other[r] for r in relevant}, k) == metric(hits, relevant, k)


@given(with_repeats, labels, places)
def test_success_is_a_precision_above_0(hits: list[str], relevant: set[str], k: int) -> None:
    assert (success_at(hits, relevant, k) == 1) == (precision_at(hits, relevant, k) > 0)
    assert (success_at(hits, relevant, k) == 1) == (ndcg_at(hits, relevant, k) > 0)
