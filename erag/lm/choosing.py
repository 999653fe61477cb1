"""Choosing among cards with a language model: one by one by likelihood, or from a numbered list under a grammar."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from erag.core.errors import BadModelOutput
from erag.lm import prompts
from erag.lm.odds import Pair
from erag.lm.roles import Prompt, SelectTask, Vectors
from erag.lm.textmodel import Continuation, TextModel

Measure = Literal["likelihood", "yes_no"]


@dataclass(frozen=True, slots=True)
class Limits:
    """How many characters of a query, a card, and a card of a numbered list are read."""

    query: int
    card: int
    listed: int


def relevance(model: TextModel, measure: Measure, pairs: Sequence[Pair], limits: Limits) -> Vectors:
    """(p,) float32, higher is better: each pair judged on its own, whatever else is asked.

    `likelihood`: how much more likely the query is, a token, after the card than after none, in nats
    (log P(q|card) - log P(q))/|q|. `yes_no`: log P(Yes) - log P(No) for the question whether the card satisfies it.
    The model sees distinct pairs in one fixed order, so that the order of candidates cannot change a batch.
    """
    distinct = sorted(set(pairs))
    found = dict(zip(distinct, _MEASURES[measure](model, distinct, limits), strict=True))
    return np.array([found[pair] for pair in pairs], np.float32)


def _likelihood(model: TextModel, pairs: Sequence[Pair], limits: Limits) -> list[float]:
    queries = sorted({query for query, _ in pairs})
    said = {query: prompts.quoted(query, limits.query) for query in queries}
    asked = [Continuation(prompts.answered(card, limits.card), said[query]) for query, card in pairs]
    alone = [Continuation(prompts.answered("", limits.card), said[query]) for query in queries]
    means = [found.mean for found in model.likelihoods([*asked, *alone])]
    prior = dict(zip(queries, means[len(asked) :], strict=True))
    return [mean - prior[query] for mean, (query, _) in zip(means[: len(asked)], pairs, strict=True)]


def _yes_no(model: TextModel, pairs: Sequence[Pair], limits: Limits) -> list[float]:
    chats = [prompts.yes_no(query, card, limits.query, limits.card) for query, card in pairs]
    asked = [Continuation(chat, word) for chat in chats for word in (prompts.YES, prompts.NO)]
    found = [likelihood.logprob for likelihood in model.likelihoods(asked)]
    return [yes - no for yes, no in zip(found[::2], found[1::2], strict=True)]


_MEASURES = {"likelihood": _likelihood, "yes_no": _yes_no}


def by_relevance(
    model: TextModel, measure: Measure, tasks: Sequence[SelectTask], k: int, limits: Limits
) -> list[list[int]]:
    """For each task the min(k, n) cards of highest relevance, best first; equal ones by their text."""
    pairs = [(task.query, card) for task in tasks for card in task.cards]
    ends = np.cumsum([len(task.cards) for task in tasks])[:-1]
    parts = np.split(relevance(model, measure, pairs, limits) if pairs else np.empty(0, np.float32), ends)
    return [_best(task, scores, k) for task, scores in zip(tasks, parts, strict=True)]


def _best(task: SelectTask, scores: Vectors, k: int) -> list[int]:
    return sorted(range(len(task.cards)), key=lambda i: (-float(scores[i]), task.cards[i], i))[:k]


def by_number(model: TextModel, tasks: Sequence[SelectTask], k: int, limits: Limits, rotations: int) -> list[list[int]]:
    """For each task min(k, n) cards, chosen one after the other from a numbered list under a grammar of its numbers.

    The list is sorted by text and shown in `rotations` rotations, whose votes are counted: the given order cannot
    matter, and a model that prefers the first number spreads its preference over the cards.
    """
    chosen: list[list[int]] = [[] for _ in tasks]
    for _ in range(k):
        open_tasks = [i for i, task in enumerate(tasks) if len(chosen[i]) < len(task.cards)]
        if not open_tasks:
            break
        left = [_sorted_rest(tasks[i], chosen[i]) for i in open_tasks]
        votes = _votes(model, [tasks[i] for i in open_tasks], left, limits, rotations)
        for i, rest, counts in zip(open_tasks, left, votes, strict=True):
            chosen[i].append(rest[int(np.argmax(counts))])  # the first of the most wanted, in order of text
    return chosen


def _sorted_rest(task: SelectTask, taken: Sequence[int]) -> list[int]:
    return sorted(set(range(len(task.cards))) - set(taken), key=lambda i: (task.cards[i], i))


def _votes(
    model: TextModel, tasks: Sequence[SelectTask], left: Sequence[Sequence[int]], limits: Limits, rotations: int
) -> list[np.ndarray]:
    """For each task the votes (r,) for its remaining cards, in their order."""
    turned = [(t, shift) for t, rest in enumerate(left) for shift in _shifts(len(rest), rotations)]
    asked = []
    for t, shift in turned:
        order = [*left[t][shift:], *left[t][:shift]]
        chat = prompts.choose(tasks[t].query, [tasks[t].cards[i] for i in order], limits.query, limits.listed)
        asked.append(Prompt(chat, _number(len(order)), max_tokens=12))
    votes = [np.zeros(len(rest), np.int64) for rest in left]
    for (t, shift), answer in zip(turned, model.generate(asked), strict=True):
        votes[t][(_read(answer.text, len(left[t])) - 1 + shift) % len(left[t])] += 1
    return votes


def _shifts(cards: int, rotations: int) -> list[int]:
    used = min(cards, rotations)
    return [cards * i // used for i in range(used)]


def _number(cards: int) -> dict[str, object]:
    return {"enum": list(range(1, cards + 1))}


def _read(text: str, cards: int) -> int:
    """The number a model chose. Raises BadModelOutput for anything but a whole number from 1 to `cards`."""
    try:
        number = json.loads(text)
    except ValueError as error:
        raise BadModelOutput(f"chose {text[:40]!r}", allowed=f"a number from 1 to {cards}") from error
    if type(number) is not int or not 1 <= number <= cards:
        raise BadModelOutput(f"chose {text[:40]!r}", allowed=f"a number from 1 to {cards}")
    return number
