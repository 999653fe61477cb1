"""What bounds agreement with a teacher: how steady it is itself, and what more of its decisions would bring."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

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
    same: float


@dataclass(frozen=True)
class Learnt:
    """Agreement on questions left out by students that were taught `questions` others."""

    questions: int
    agreement: Interval


def steadiness(decisions: Sequence[Decision], data: Table) -> list[Steadiness]:
    """By how alike two questions are (`ALIKE`): where there is no such pair there is no row.

    Where the questions mean the same a steady teacher would choose the same, so that no student can be told to do
    much better than the last rows.
    """
    by_cards: dict[tuple[str, ...], list[int]] = defaultdict(list)
    for row, decision in enumerate(decisions):
        by_cards[decision.cards].append(row)
    vectors = data.queries[data.asked].numpy()
    alike, same = [np.empty(0)], [np.empty(0, bool)]
    for rows in by_cards.values():
        chosen = np.array([decisions[row].cards[decisions[row].chosen] for row in rows])
        one, two = np.triu_indices(len(rows), 1)
        alike.append((vectors[rows] @ vectors[rows].T)[one, two])
        same.append(chosen[one] == chosen[two])
    cosines, agreed = np.concatenate(alike), np.concatenate(same)
    found = []
    for least, most in pairwise(ALIKE):
        within = (cosines >= least) & ((cosines < most) | (most == ALIKE[-1]))
        if within.any():
            found.append(Steadiness(least, most, int(within.sum()), float(agreed[within].mean())))
    return found


def learning_curve(
    counts: Sequence[int], decisions: Sequence[Decision], fold: Sequence[int], resamples: int, seed: int,
    judged: Callable[[str, list[int], list[int]], np.ndarray],
) -> list[Learnt]:  # fmt: skip
    """Agreement on each fold (n,) by students that were taught so many questions of the others, drawn by `seed`.

    `judged` trains a student by a name on the rows of the first list and returns its logits of those of the second.
    """
    folds, asked = np.array(fold), np.array([decision.query for decision in decisions])
    curve = []
    for count in counts:
        right: dict[int, float] = {}
        for number in np.unique(folds).tolist():
            others = np.unique(asked[folds != number])
            some = np.random.default_rng([seed, number]).permutation(len(others))[:count]
            taught = np.flatnonzero((folds != number) & np.isin(asked, others[some])).tolist()
            out = np.flatnonzero(folds == number).tolist()
            logits = judged(f"{count} questions {number}", taught, out)
            picks = zip(out, logits.argmax(axis=1).tolist(), strict=True)
            right |= {row: float(decisions[row].agrees(pick)) for row, pick in picks}
        order = sorted(right)
        own = clustered_bootstrap([right[row] for row in order], asked[order].tolist(), samples=resamples)
        curve.append(Learnt(count, own))
    return curve
