"""What the world says about the answers: votes and labels of question and node, similarity of texts to golden ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from pydantic import BaseModel, ConfigDict

from erag.evaluate.judges.pairs import answer_pairs
from erag.evaluate.judges.protocol import Votes
from erag.evaluate.judges.stack import Stack
from erag.evaluate.scene import Scene
from erag.evaluate.text import Golden, SemanticSimilarity
from erag.experiment.panel import Bench
from erag.experiment.predictions import Key, Prediction, QuestionKey, Score
from erag.experiment.questions import Posed

PairKey = tuple[str, str, str, str]  # data set, environment, id of the question, node


class Voted(BaseModel):
    """The votes on a question and a node, those of judges that abstain left out; `relevant` is the label.

    `stack` is what a fitted stack makes of the votes.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    data: str
    environment: str
    id: str
    node: str
    votes: dict[str, Score] = {}
    stack: Score | None = None
    relevant: bool | None = None

    @property
    def key(self) -> PairKey:
        return (self.data, self.environment, self.id, self.node)


class TextScored(BaseModel):
    """The scores of an answer in words, by the name of the metric."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    system: str
    data: str
    environment: str
    id: str
    mode: str
    values: dict[str, float]

    @property
    def key(self) -> Key:
        return (self.system, self.data, self.environment, self.id, self.mode)


def voted(
    predictions: Sequence[Prediction], questions: Sequence[Posed], scene: Scene, bench: Bench, stack: Stack | None
) -> list[Voted]:
    """The votes on every node that any system answered to a question about this environment, each pair once."""
    asked = {q.key: q for q in questions}
    answered: dict[QuestionKey, dict[str, None]] = {}
    for prediction in predictions:
        if prediction.question in asked and prediction.kind == "find":
            answered.setdefault(prediction.question, {}).update(dict.fromkeys(h.node for h in prediction.hits))
    kept = [asked[key] for key in answered]
    if not kept:
        return []
    environment = replace(scene.environment, questions=tuple(q.question for q in kept))
    each = [answer_pairs(environment, q.question, list(answered[q.key])) for q in kept]
    votes = bench.panel(environment).vote([pair for pairs in each for pair in pairs])
    stacked = None if stack is None else stack.probabilities(votes)
    keys = [(q, node) for q in kept for node in answered[q.key]]
    return [_voted(q, node, votes, i, stacked) for i, (q, node) in enumerate(keys)]


def _voted(one: Posed, node: str, votes: Votes, row: int, stacked: np.ndarray | None) -> Voted:
    cast = {n: float(v) for n, v in zip(votes.judges, votes.values[row], strict=True) if not np.isnan(v)}
    relevant = None if one.question.relevant is None else node in one.question.relevant
    said = None if stacked is None or np.isnan(stacked[row]) else float(stacked[row])
    return Voted(
        data=one.data, environment=one.environment, id=one.question.id, node=node, votes=cast, stack=said,
        relevant=relevant,
    )  # fmt: skip


def texts(
    predictions: Sequence[Prediction], questions: Mapping[QuestionKey, Posed], similarity: SemanticSimilarity
) -> list[TextScored]:
    """The scores of all answers to questions with a golden answer; a refusal is no answer and scores 0."""
    kept: list[tuple[Prediction, Posed, Golden]] = []
    for prediction in predictions:
        posed = questions.get(prediction.question)
        if posed is not None and posed.question.golden is not None:
            kept.append((prediction, posed, posed.question.golden))
    said = ["" if p.refused or p.error else p.text for p, _, _ in kept]
    asked, golden = [q.question.text or "?" for _, q, _ in kept], [g for _, _, g in kept]
    found = similarity.scores(asked, said, golden) if kept else []
    return [
        TextScored(
            system=p.system, data=p.data, environment=p.environment, id=p.id, mode=p.mode, values=score.values()
        )
        for (p, _, _), score in zip(kept, found, strict=True)
    ]  # fmt: skip
