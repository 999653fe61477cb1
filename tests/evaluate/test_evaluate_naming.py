"""Objects and places named: counts worked out by hand, and intervals that hold their figures."""

import numpy as np
import pytest

from erag.evaluate.naming import counted, naming, scores, universe


def test_counts_and_scores() -> None:
    said = [frozenset({"bench", "tree", "dragon"}), frozenset()]
    truth = [frozenset({"bench"}), frozenset({"tree"})]
    counts = counted(said, truth, ["bench", "tree"])
    assert counts.tolist() == [[[1, 0, 0], [0, 1, 0]], [[0, 0, 0], [0, 0, 1]]]
    assert scores(counts.sum(axis=(0, 1))).tolist() == pytest.approx([0.5, 0.5, 0.5])


def test_figures_have_intervals_that_hold_them() -> None:
    rng = np.random.default_rng(0)
    truth = [frozenset(n for n in "abcd" if rng.random() < 0.4) for _ in range(80)]
    said = [frozenset(n for n in "abcd" if (n in t) != (rng.random() < 0.2)) for t in truth]
    measured = naming(counted(said, truth, "abcd"), [True] * 60 + [False] * 20, "abcd", samples=200)
    for figure in (measured.precision, measured.recall, measured.f1, measured.place):
        assert figure.low < figure.mean < figure.high
        assert figure.high - figure.low < 0.3
    assert measured.place.mean == 0.75
    assert naming(counted(said, truth, "abcd"), [True] * 80, "abcd", 200).f1 == measured.f1


def test_only_classes_asked_for_or_there_count() -> None:
    truth = [frozenset({"bench"})]
    assert universe(["tree"], truth) == ["bench", "tree"]
    found = naming(
        counted([frozenset({"bench", "dragon"})], truth, universe(["tree"], truth)), [True], ["bench", "tree"]
    )
    assert found.f1.mean == 1.0
    assert [c.name for c in found.classes] == ["bench"]
