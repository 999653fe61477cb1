"""What bounds agreement with a teacher: how steady it is itself, and what more of its decisions would bring."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from erag.core.errors import InputError
from erag.core.types import IntArray
from erag.evaluate.statistics import Interval, clustered_bootstrap
from erag.study.decisions import Decision

if TYPE_CHECKING:
    from erag.study.pairs import Table

ALIKE = (0.6, 0.7, 0.8, 0.9, 0.95, 1.0)  # cosines of two questions


@dataclass(frozen=True)
class Steadiness:
    """How often a teacher chooses the same among the same cards for `pairs` pairs of questions of about a cosine."""

    least: float
    most: float
    pairs: int
    same: Interval


@dataclass(frozen=True)
class Learnt:
    """Agreement on questions left out by students that were taught about `questions` others."""

    questions: int
    agreement: Interval


@dataclass(frozen=True)
class Lot:
    """What a student is taught for a point of a learning curve, `repeats` times as often as all there is, and asked."""

    questions: int
    name: str
    taught: list[int]
    asked: list[int]
    repeats: float


def steadiness(decisions: Sequence[Decision], data: Table, resamples: int) -> list[Steadiness]:
    """By how alike two questions are (`ALIKE`): where there is no such pair there is no row.

    Where the questions mean the same a steady teacher would choose the same, so that no student can be told to do
    much better than the last rows. Intervals are over questions.
    """
    by_cards: dict[tuple[str, ...], list[int]] = defaultdict(list)
    for row, decision in enumerate(decisions):
        by_cards[decision.cards].append(row)
    asked, vectors = data.asked.numpy(), data.queries[data.asked].numpy()
    alike, same, ends = [np.empty(0)], [np.empty(0, bool)], [np.empty((0, 2), np.int64)]
    for rows in by_cards.values():
        chosen = np.array([decisions[row].cards[decisions[row].chosen] for row in rows])
        one, two = np.triu_indices(len(rows), 1)
        alike.append((vectors[rows] @ vectors[rows].T)[one, two])
        same.append(chosen[one] == chosen[two])
        ends.append(asked[rows][np.stack([one, two], axis=1)])
    cosines, agreed, questions = np.concatenate(alike), np.concatenate(same), np.concatenate(ends)
    found = []
    for least, most in pairwise(ALIKE):
        within = (cosines >= least) & ((cosines < most) | (most == ALIKE[-1]))
        if within.any():
            share = _share(agreed[within], questions[within], len(data.queries), resamples)
            found.append(Steadiness(least, most, int(within.sum()), share))
    return found


def _share(
    agreed: npt.NDArray[np.bool_], ends: npt.NDArray[np.int64], questions: int, resamples: int, seed: int = 0
) -> Interval:
    """The share of pairs (p, 2) of questions that agree (p,), with its 95 % bootstrap interval over questions."""
    rng = np.random.default_rng(seed)
    drawn = []
    for _ in range(resamples):
        times = np.bincount(rng.integers(questions, size=questions), minlength=questions)
        weight = times[ends].prod(axis=1)
        if weight.any():
            drawn.append(float(np.average(agreed, weights=weight)))
    low, high = np.percentile(drawn or [float("nan")], [2.5, 97.5])
    return Interval(float(agreed.mean()), float(low), float(high))


def lots(
    counts: Sequence[int], decisions: Sequence[Decision], fold: IntArray, least: int, seed: int
) -> list[Lot]:  # fmt: skip
    """For each number of questions and each fold (n,) the decisions about so many questions of the other folds.

    Smaller numbers of a fold are among the larger ones. Raises InputError where fewer than `least` decisions are left.
    """
    asked = np.array([decision.query for decision in decisions])
    found = []
    for count in counts:
        for number in np.unique(fold).tolist():
            others = np.unique(asked[fold != number])
            some = np.random.default_rng([seed, number]).permutation(len(others))[:count]
            taught = np.flatnonzero((fold != number) & np.isin(asked, others[some]))
            if len(taught) < least or count > len(others):
                what = f"a curve with {count} questions, of which {len(others)} are there, with {len(taught)} decisions"
                raise InputError(what, where="curve", allowed=f"as many as there are, and a batch of {least} decisions")
            repeats = float((fold != number).sum() / len(taught))
            out = np.flatnonzero(fold == number).tolist()
            found.append(Lot(count, f"{count} questions {number}", taught.tolist(), out, repeats))
    return found


def learning_curve(
    some: Sequence[Lot], decisions: Sequence[Decision], resamples: int,
    judged: Callable[[Lot], npt.NDArray[np.float64]],
) -> list[Learnt]:  # fmt: skip
    """Agreement by number of questions; `judged` teaches a student and returns its logits of what it is asked."""
    right: dict[int, dict[int, float]] = defaultdict(dict)
    for lot in some:
        picks = zip(lot.asked, judged(lot).argmax(axis=1).tolist(), strict=True)
        right[lot.questions] |= {row: float(decisions[row].agrees(pick)) for row, pick in picks}
    return [
        Learnt(count, clustered_bootstrap(list(own.values()), [decisions[row].query for row in own], samples=resamples))
        for count, own in right.items()
    ]
