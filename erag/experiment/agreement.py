"""How far the panel agrees with labels, before it is used: on the head of rankings and on nodes drawn beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict

from erag.core.errors import InputError
from erag.core.text import content_hash
from erag.data.contract import QueryLine
from erag.evaluate.judges.agreement import PANEL, Agreement, agreement, panel_agreement
from erag.evaluate.judges.protocol import Votes
from erag.evaluate.judges.stack import Stack, cross_stacked
from erag.evaluate.scene import Scene
from erag.evaluate.truth import Pair
from erag.experiment.config import AgreementConfig, PanelConfig
from erag.experiment.judging import Voted
from erag.experiment.panel import Bench
from erag.experiment.questions import Posed, QuestionRecord
from erag.pipeline.query import Asker

STACK, ANSWERED = "stack", "answered"
FAR = 1 << 30  # the place of a node that is not in the head of the ranking


@dataclass(frozen=True, eq=False)
class Tried:
    """Labelled pairs of one data set with the votes on them: labels, queries, kinds, nodes and places (n,)."""

    votes: Votes
    labels: npt.NDArray[np.bool_]
    queries: tuple[str, ...]
    kinds: tuple[str, ...]
    nodes: tuple[str, ...]
    places: npt.NDArray[np.int64]

    def of(self, kept: npt.NDArray[np.bool_]) -> Tried:
        """The pairs that are kept."""
        rows = np.flatnonzero(kept)
        votes = replace(self.votes, values=self.votes.values[kept])
        queries, kinds, nodes = (tuple(values[i] for i in rows) for values in (self.queries, self.kinds, self.nodes))
        return Tried(votes, self.labels[kept], queries, kinds, nodes, self.places[kept])

    def records(self, data: str) -> list[TriedPair]:
        """The pairs as lines of a file, so that every figure of agreement can be computed again."""
        names, places = self.votes.judges, self.places.tolist()
        return [
            TriedPair(
                data=data, query=self.queries[i], kind=self.kinds[i], node=self.nodes[i],
                place=places[i] if places[i] < FAR else None, relevant=bool(self.labels[i]),
                votes={n: v for n, v in zip(names, row, strict=True) if v == v},
            )
            for i, row in enumerate(self.votes.values.tolist())
        ]  # fmt: skip


class TriedPair(BaseModel):
    """A pair the panel was tried on: its place in the ranking (None beside it), its label, the votes."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    data: str
    query: str
    kind: str
    node: str
    place: int | None
    relevant: bool
    votes: dict[str, float]


class AgreementRow(BaseModel):
    """One judge, the panel or the stack, on the pairs of a data set and a kind of question (`all` for both)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    data: str
    kind: str
    over: str
    judge: str
    pairs: int
    positives: int
    abstained: int
    auc: float | None
    query_auc: float | None
    query_low: float | None
    query_high: float | None
    brier: float
    ece: float
    models: tuple[str, ...] = ()


def triable(one: Posed) -> bool:
    """Whether a panel can be tried on a question: in words, labelled, and without a wish for readings.

    Labels count such a wish, and judges read no sensors.
    """
    return bool(one.question.relevant and one.question.text) and not one.stated


def tried(
    asker: Asker, scene: Scene, questions: Sequence[Posed], bench: Bench, config: AgreementConfig, seed: int
) -> Tried | None:
    """The pairs of some questions about one environment with the panel's votes; None where no question has labels."""
    asked = [q for q in questions if triable(q)]
    if not asked:
        return None
    lines = (QueryLine(1, q.question.id, {"id": q.question.id, "query": q.question.text}) for q in asked)
    rankings = [[h.node for h in r.hits] for r in asker.ask_lines(lines, config.top)]
    pairs, labels, places, of = list[Pair](), list[bool](), list[int](), list[Posed]()
    for one, ranking in zip(asked, rankings, strict=True):
        found = [*ranking, *_others(asker, one, ranking, config.others, seed)]
        pairs += [Pair(one.question.asked, scene.environment.truths.of(node)) for node in found]
        labels += [node in (one.question.relevant or ()) for node in found]
        places += [*range(1, len(ranking) + 1), *[FAR] * (len(found) - len(ranking))]
        of += [one] * len(found)
    environment = replace(scene.environment, questions=tuple(q.question for q in asked))
    votes = bench.panel(environment).vote(pairs)
    queries = tuple(f"{q.environment} {q.question.id}" for q in of)
    kinds = tuple(q.question.kind for q in of)
    nodes = tuple(pair.truth.node for pair in pairs)
    return Tried(votes, np.array(labels, np.bool_), queries, kinds, nodes, np.array(places, np.int64))


def _others(asker: Asker, one: Posed, ranking: Sequence[str], most: int, seed: int) -> list[str]:
    """Nodes beside the ranking that could be found, drawn by the seed."""
    corpus, seen = asker.corpus, set(ranking)
    rest = [n for n, row in corpus.topomap.row.items() if corpus.searchable[row] and n not in seen]
    return sorted(rest, key=lambda n: content_hash(str(seed), "others", *one.key, n))[:most]


def joined(parts: Sequence[Tried]) -> Tried:
    """The pairs of several environments as one."""
    first = parts[0].votes
    votes = replace(first, values=np.concatenate([p.votes.values for p in parts]))
    return Tried(
        votes,
        np.concatenate([p.labels for p in parts]),
        tuple(q for p in parts for q in p.queries),
        tuple(k for p in parts for k in p.kinds),
        tuple(n for p in parts for n in p.nodes),
        np.concatenate([p.places for p in parts]),
    )


def agreement_rows(
    data: str, all_pairs: Tried, top: int, stack: Stack | None, fitting: Sequence[str]
) -> list[AgreementRow]:
    """The agreement of every judge, the panel, and the stack, by kind of question and for all together.

    The stack is the given one, else where `fitting` names judges one that is fitted on the other questions.
    """
    kinds = sorted(set(all_pairs.kinds))
    wanted = ["all", *(kinds if len(kinds) > 1 else [])]
    made = []
    stacked = _stacked(all_pairs, stack, fitting)
    for kind in wanted:
        kept = np.array([kind in ("all", k) for k in all_pairs.kinds])
        part = all_pairs.of(kept)
        found = panel_agreement(part.votes, part.labels, part.queries, part.places, top)
        found += _of_stack(part, None if stacked is None else stacked[kept], top)
        made += [_row(data, kind, one, all_pairs.votes) for one in found]
    return made


def answered_rows(
    votes: Sequence[Voted], questions: Sequence[QuestionRecord], panel: PanelConfig, similarity: str
) -> list[AgreementRow]:
    """The agreement on the pairs that systems answered, which is where a panel counts, by data set and kind."""
    kinds = {q.key: q.kind for q in questions if q.relevant and not q.stated}
    known = [v for v in votes if v.relevant is not None and v.key[:3] in kinds]
    names = tuple(name for name in panel.judges if any(name in v.votes for v in known))
    models = tuple(panel.models(name, similarity) for name in names)
    rows = []
    for data in dict.fromkeys(v.data for v in known):
        inside = [v for v in known if v.data == data]
        wanted = ["all", *sorted({kinds[v.key[:3]] for v in inside})]
        for kind in wanted if len(wanted) > 2 else wanted[:1]:
            part = [v for v in inside if kind in ("all", kinds[v.key[:3]])]
            rows += _answered(data, kind, part, names, models)
    return rows


def _answered(
    data: str, kind: str, part: Sequence[Voted], names: tuple[str, ...], models: tuple[frozenset[str], ...]
) -> list[AgreementRow]:
    values = np.array([[v.votes.get(name, np.nan) for name in names] for v in part], np.float64)
    votes = Votes(names, models, values.reshape(len(part), len(names)))
    labels, asked = np.array([bool(v.relevant) for v in part]), [" ".join(v.key[1:3]) for v in part]
    columns = {name: values[:, i] for i, name in enumerate(names)} | {PANEL: votes.mean()}
    if any(v.stack is not None for v in part):
        columns[STACK] = np.array([np.nan if v.stack is None else v.stack for v in part])
    found = [agreement(name, ANSWERED, column, labels, asked) for name, column in columns.items()]
    return [_row(data, kind, one, votes) for one in found if one is not None]


def stackable(votes: Votes, rules: Sequence[str]) -> list[str]:
    """The judges a stack is made of: all that voted but `rules`, which read labels."""
    silent = [bool(np.isnan(votes.values[:, i]).all()) for i in range(len(votes.judges))]
    return [name for name, nothing in zip(votes.judges, silent, strict=True) if not nothing and name not in rules]


def _stacked(all_pairs: Tried, stack: Stack | None, fitting: Sequence[str]) -> npt.NDArray[np.float64] | None:
    if stack is not None:
        return stack.probabilities(all_pairs.votes)
    if not fitting:
        return None
    try:
        return cross_stacked(all_pairs.votes, all_pairs.labels, fitting, all_pairs.queries)
    except InputError:  # too few questions to fit one on the others
        return None


def _of_stack(part: Tried, stacked: npt.NDArray[np.float64] | None, top: int) -> list[Agreement]:
    if stacked is None:
        return []
    asked, made = np.array(part.queries, dtype=np.str_), list[Agreement]()
    everything = np.ones(len(part.labels), np.bool_)
    for over, kept in (("all", everything), (f"top {top}", part.places <= top)):
        found = agreement(STACK, over, stacked[kept], part.labels[kept], asked[kept].tolist())
        made.extend([found] if found else [])
    return made


def _row(data: str, kind: str, one: Agreement, votes: Votes) -> AgreementRow:
    models = dict(zip(votes.judges, votes.models, strict=True))
    by_query = one.query_auc
    return AgreementRow(
        data=data, kind=kind, over=one.over, judge=one.judge, pairs=one.pairs, positives=one.positives,
        abstained=one.abstained, auc=one.auc, query_auc=None if by_query is None else by_query.mean,
        query_low=None if by_query is None else by_query.low, query_high=None if by_query is None else by_query.high,
        brier=one.brier, ece=one.ece, models=tuple(sorted(models.get(one.judge, ()))),
    )  # fmt: skip
