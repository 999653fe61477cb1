"""What bounds agreement with a teacher: how steady it is itself, and what more of its decisions would bring."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from erag.core.errors import InputError
from erag.core.types import IntArray
from erag.evaluate.statistics import Interval, clustered_bootstrap, drawn_interval
from erag.study.decisions import Decision

if TYPE_CHECKING:
    from erag.study.pairs import Table

ALIKE = (0.6, 0.7, 0.8, 0.9, 0.95, 1.0)  # cosines of two questions
NEAR = 0.9  # of two questions that ask about the same
_PLACE = re.compile(r"\b(where|which|find|show|is there)\b", re.IGNORECASE)


@dataclass(frozen=True)
class Steadiness:
    """How often a teacher chooses the same among the same cards for `pairs` pairs of questions of about a cosine."""

    least: float
    most: float
    pairs: int
    same: Interval


@dataclass(frozen=True)
class Kind:
    """Decisions about questions of a kind: agreement by student, and of the teacher with itself in so many `pairs` of
    such questions that are alike (None: there is no pair)."""

    name: str
    decisions: int
    agreement: Mapping[str, Interval]
    itself: Interval | None
    pairs: int


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


@dataclass(frozen=True)
class Pairs:
    """Pairs of different questions about the same cards.

    `rows` (p, 2) are the decisions, `questions` (p, 2) the questions among `count`, `cosines` (p,) how alike these
    are, `agreed` (p,) whether the teacher chose the same.
    """

    rows: IntArray
    questions: IntArray
    count: int
    cosines: npt.NDArray[np.float64]
    agreed: npt.NDArray[np.bool_]

    def same(self, some: npt.NDArray[np.bool_], resamples: int) -> Interval:
        """How often the teacher chose the same in the pairs `some` (p,), its 95 % bootstrap interval over questions."""
        agreed, ends = self.agreed[some], self.questions[some]

        def draw(rng: np.random.Generator) -> float:
            times = np.bincount(rng.integers(self.count, size=self.count), minlength=self.count)
            weight = times[ends].prod(axis=1)
            return float(np.average(agreed, weights=weight)) if weight.any() else float("nan")

        return drawn_interval(float(agreed.mean()), draw, resamples)


def pairs_among(decisions: Sequence[Decision], data: Table) -> Pairs:
    """All pairs of questions about the same cards."""
    by_cards: dict[tuple[str, ...], list[int]] = defaultdict(list)
    for row, decision in enumerate(decisions):
        by_cards[decision.cards].append(row)
    asked, vectors = data.asked.numpy(), data.queries[data.asked].numpy()
    ends, alike = [np.empty((0, 2), np.int64)], [np.empty(0)]
    for rows in by_cards.values():
        one, two = np.triu_indices(len(rows), 1)
        ends.append(np.array(rows)[np.stack([one, two], axis=1)])
        alike.append((vectors[rows] @ vectors[rows].T)[one, two])
    both = np.concatenate(ends)
    chosen = np.array([decision.cards[decision.chosen] for decision in decisions])
    return Pairs(both, asked[both], len(data.queries), np.concatenate(alike), chosen[both[:, 0]] == chosen[both[:, 1]])


def steadiness(pairs: Pairs, resamples: int) -> list[Steadiness]:
    """By how alike two questions are (`ALIKE`): where there is no such pair there is no row.

    Where the questions mean the same a steady teacher would choose the same, so that no student can be told to do
    much better than the last rows.
    """
    found = []
    for least, most in pairwise(ALIKE):
        within = (pairs.cosines >= least) & ((pairs.cosines < most) | (most == ALIKE[-1]))
        if within.any():
            found.append(Steadiness(least, most, int(within.sum()), pairs.same(within, resamples)))
    return found


def by_kind(
    decisions: Sequence[Decision], pairs: Pairs, students: Mapping[str, npt.NDArray[np.float64]], resamples: int
) -> list[Kind]:
    """Questions that ask for a place, and others: how students agree (logits (n, m)), and the teacher with itself."""
    place = np.array([bool(_PLACE.search(decision.query)) for decision in decisions])
    found = []
    for name, some in (("ask for a place", place), ("ask something else", ~place)):
        rows = np.flatnonzero(some).tolist()
        if not rows:
            continue
        near = (pairs.cosines >= NEAR) & some[pairs.rows].all(axis=1)
        queries = [decisions[row].query for row in rows]
        agreement = {
            who: clustered_bootstrap(
                [float(decisions[row].agrees(int(logits[row].argmax()))) for row in rows], queries, samples=resamples
            )
            for who, logits in students.items()
        }
        itself = pairs.same(near, resamples) if near.any() else None
        found.append(Kind(name, len(rows), agreement, itself, int(near.sum())))
    return found


def lots(counts: Sequence[int], decisions: Sequence[Decision], fold: IntArray, least: int, seed: int) -> list[Lot]:
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
