"""Question-answer pairs with labels: what a panel is tried on before it judges, and what it judges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from erag.evaluate.dataset import Environment, Question
from erag.evaluate.truth import Pair


@dataclass(frozen=True, eq=False)
class LabelledPairs:
    """p pairs: their `labels` (p,) bool, the ids of their `queries` (p,), and their `places` (p,) in a ranking from 1.

    A node that the ranking of its query does not hold has the place after all nodes.
    """

    pairs: tuple[Pair, ...]
    labels: npt.NDArray[np.bool_]
    queries: tuple[str, ...]
    places: npt.NDArray[np.int64]


def labelled_pairs(
    environment: Environment, nodes: Sequence[str], rankings: Mapping[str, Sequence[str]]
) -> LabelledPairs:
    """Every labelled question in words of an environment with every one of `nodes`.

    `rankings` holds, by question id, node ids best first. A question without labels, or without words, is left out.
    """
    asked = [q for q in environment.questions if q.relevant is not None and q.text]
    truths = [environment.truths.of(node) for node in nodes]
    pairs, labels, places = list[Pair](), list[bool](), list[int]()
    for question in asked:
        place = {node: i for i, node in enumerate(rankings.get(question.id, ()), 1)}
        pairs.extend(Pair(question.asked, truth) for truth in truths)
        labels.extend(node in (question.relevant or ()) for node in nodes)
        places.extend(place.get(node, len(nodes) + 1) for node in nodes)
    return LabelledPairs(
        tuple(pairs),
        np.array(labels, np.bool_),
        tuple(q.id for q in asked for _ in nodes),
        np.array(places, np.int64),
    )


def answer_pairs(environment: Environment, question: Question, hits: Sequence[str]) -> tuple[Pair, ...]:
    """The pairs of one question and its answers, in their order."""
    return tuple(Pair(question.asked, environment.truths.of(node)) for node in hits)
