"""Answers and votes to scores, a line of numbers for each answer: pure, from what lies in the run's folder alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from erag.core.errors import InputError
from erag.evaluate.answers import Answered, Ground, answer_scores, ranking_scores
from erag.experiment.driving import Driven
from erag.experiment.judging import PairKey, TextScored, Voted
from erag.experiment.predictions import Key, Place, Prediction, QuestionKey
from erag.experiment.questions import QuestionRecord

Probability = Callable[[Voted], float | None]
SAME_PLACE_M = 1e-6


@dataclass(frozen=True)
class Scored:
    """The scores of one answer by the name of the metric, with what tables choose by."""

    prediction: Prediction
    question: QuestionRecord
    values: Mapping[str, float]


def mean_vote(without: frozenset[str] = frozenset()) -> Probability:
    """P(Q|A) as the mean of the votes, without some of the judges; None where nobody is left."""

    def probability(pair: Voted) -> float | None:
        cast = [vote for name, vote in pair.votes.items() if name not in without]
        return sum(cast) / len(cast) if cast else None

    return probability


def stacked(pair: Voted) -> float | None:
    """P(Q|A) as the stack has it."""
    return pair.stack


def scored(
    predictions: Sequence[Prediction],
    questions: Sequence[QuestionRecord],
    votes: Sequence[Voted],
    texts: Sequence[TextScored],
    probability: Probability,
    trips: Sequence[Driven] = (),
) -> list[Scored]:
    """The scores of every prediction whose question is among `questions`, in their order.

    Raises InputError for an answer nobody voted on: that is no 0.
    """
    known = {q.key: q for q in questions}
    pairs = {v.key: v for v in votes}
    said, drove = {t.key: t.values for t in texts}, {t.key: t for t in trips}
    kept = [(p, known[p.question]) for p in predictions if p.question in known]
    values = (_values(p, q, pairs, said.get(p.key), probability) | _drove(drove.get(p.key)) for p, q in kept)
    return [Scored(p, q, _both(v)) for (p, q), v in zip(kept, values, strict=True)]


def _values(
    prediction: Prediction,
    question: QuestionRecord,
    pairs: Mapping[PairKey, Voted],
    said: Mapping[str, float] | None,
    probability: Probability,
) -> dict[str, float]:
    values = {"seconds": prediction.seconds, "visited": float(prediction.visited)}
    values |= {"error": float(prediction.error is not None), "refused": float(prediction.refused)}
    values |= {"tokens_in": float(prediction.tokens_in), "tokens_out": float(prediction.tokens_out)}
    values |= {"calls": float(sum(prediction.calls.values()))}
    if said is not None:
        return values | dict(said)
    if prediction.kind == "explain":
        return values
    answers = [(place, _pair(pairs, question.key, place.node)) for place in prediction.answers]
    if question.worded:
        voted = [_answered(place, pair, probability, question) for place, pair in answers]
        values |= answer_scores(voted, _ground(question))
    if question.relevant:
        values |= ranking_scores([place.node for place, _ in answers], _relevant(answers, question.relevant))
    return values | _held(prediction, question)


def _drove(trip: Driven | None) -> dict[str, float]:
    """Navigation success, whatever was answered."""
    return {} if trip is None else {"arrived": float(trip.status == "arrived"), "trip_spl": trip.spl}


def _both(values: Mapping[str, float]) -> Mapping[str, float]:
    """What is right and more: `arrived_right`, the robot got there; `precision_ni@1`, near: P(Q|A,L) by labels."""
    if "precision@1" not in values:
        return values
    joined = {"arrived": "arrived_right", "ni@1": "precision_ni@1"}
    return {
        **values,
        **{name: values[other] * values["precision@1"] for other, name in joined.items() if other in values},
    }


def _pair(pairs: Mapping[PairKey, Voted], question: QuestionKey, node: str) -> Voted:
    pair = pairs.get((*question, node))
    if pair is None:
        what = f"{node!r} was answered and not judged"
        raise InputError(what, where=" / ".join(question), repair="run without --tables-only")
    return pair


def _answered(place: Place, pair: Voted, probability: Probability, question: QuestionRecord) -> Answered:
    p = probability(pair)
    if p is None:
        raise InputError(f"nobody voted on {place.node!r}", where=" / ".join(question.key), allowed="a vote a pair")
    return Answered(place.node, min(1.0, p), place.metres, place.on_edges)


def _ground(question: QuestionRecord) -> Ground | None:
    if question.at is None or question.radius_m is None:
        return None
    return Ground(question.radius_m, question.shortest_m)


def _relevant(answers: Sequence[tuple[Place, Voted]], count: int) -> frozenset[str]:
    """As many ids as there are relevant nodes: those that were answered, and stand-ins for the others."""
    hit = {place.node for place, pair in answers if pair.relevant}
    return frozenset(hit | {f"\x00{i}" for i in range(count - len(hit))})


def _held(prediction: Prediction, question: QuestionRecord) -> dict[str, float]:
    """What the capabilities are read off: is the first answer the nearest node, what does the sensor read there?"""
    out = {"waypoint": float(prediction.waypoint is not None), "path": float(prediction.route == "ok")}
    first = prediction.answers[0] if prediction.answers else None
    if question.nearest_m is not None:
        near = first is not None and first.metres is not None and first.metres <= question.nearest_m + SAME_PLACE_M
        out["nearest@1"] = float(near)
    if first is not None and first.reading is not None:
        out["reading@1"] = first.reading
    return out


def by_key(scores: Sequence[Scored]) -> dict[Key, Scored]:
    """The scores by the key of their prediction."""
    return {s.prediction.key: s for s in scores}
