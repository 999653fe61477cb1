"""How students that choose stand beside other ways, on questions and on sets of cards that none of them has seen."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from erag.evaluate.statistics import Interval, clustered_bootstrap
from erag.lm.config import BackendConfig, build_backend
from erag.lm.roles import Selector, SelectTask
from erag.lm.weights import ModelStore
from erag.study.calibration import areas
from erag.study.ceiling import Kind, Learnt, Steadiness, by_kind, pairs_among, steadiness
from erag.study.decisions import Decision, read_decisions
from erag.study.pairs import Table, folds
from erag.study.shown import Shown
from erag.study.textconfig import AdapterDistil, ChoiceDistil, CrossDistil

Floats = npt.NDArray[np.float64]
Figures = dict[str, dict[str, Interval]]  # by split, then by who is judged
QUESTIONS, SETS = "unseen questions", "unseen sets of cards"
STRICT = "the same, copies told apart"
_TIMED = 200  # decisions asked one by one


@dataclass(frozen=True)
class Report:
    """What came of it: agreement with the teacher by split and selector, area under the ROC curve by split and scorer,
    milliseconds a decision with and without the embedding of new texts, seconds by stage, how steady the teacher is
    by how alike questions are and by what they ask, and what students say that were taught fewer questions."""

    out: Path
    bytes: int
    decisions: int
    questions: int
    sets: int
    cards: int
    chance: float
    agreement: Mapping[str, Mapping[str, Interval]]
    area: Mapping[str, Mapping[str, Interval]]
    milliseconds: Mapping[str, float]
    seconds: Mapping[str, float]
    steadiness: Sequence[Steadiness] = ()
    kinds: Sequence[Kind] = ()
    curve: Sequence[Learnt] = ()

    def table(self) -> Shown:
        """The figures for the terminal."""
        rows = [
            (name, *(str(self.agreement[split][name]) for split in self.agreement)) for name in self.agreement[SETS]
        ]
        return Shown(("selector", *self.agreement), rows)


def decisions_of(config: ChoiceDistil) -> list[Decision]:
    """What a student is taught. Raises InputError for decisions that cannot be read, or where there are none."""
    return [d for d in read_decisions(config.decisions) if config.without is None or not config.without.holds(d)]


def splits_of(decisions: Sequence[Decision]) -> dict[str, list[str]]:
    """What each decision has in common with others, by split: its question, or its set of cards."""
    return {QUESTIONS: [d.query for d in decisions], SETS: [d.group for d in decisions]}


def left_out(
    groups: Sequence[str], count: int, seed: int, judged: Callable[[int, list[int], list[int]], Floats]
) -> Floats:
    """(n, m) logits of n decisions by students that have seen nothing of their groups.

    `judged` trains a student for the fold of a number on the decisions of the first list, and returns its logits of
    those of the second.
    """
    fold = folds(groups, count, seed)
    found: dict[int, npt.NDArray[np.float64]] = {}
    for number in range(count):
        out = np.flatnonzero(fold == number).tolist()
        if out:
            logits = judged(number, np.flatnonzero(fold != number).tolist(), out)
            found.update(zip(out, logits, strict=True))
    return np.stack([found[row] for row in range(len(groups))])


def pairs_of(logits: Floats, data: Table) -> tuple[Floats, Floats]:
    """Logits (p,) of all pairs of decision and card, and whether the card was chosen (p,)."""
    there = (data.shown >= 0).numpy()
    return logits[there], data.right.numpy()[there].astype(np.float64)


def stand(
    config: ChoiceDistil, students: Mapping[str, Mapping[str, Floats]], decisions: Sequence[Decision], data: Table,
    store: ModelStore,
) -> tuple[Figures, Figures]:  # fmt: skip
    """Agreement by split and selector, and area under the ROC curve by split and scorer.

    `students` are logits (n, m) by split and name; the last one is judged with copies told apart as well.
    """
    compared = {name: _picks(_backend(model, store), decisions) for name, model in config.compare.items()}
    agreement: Figures = {}
    area: Figures = {}
    for name, groups in splits_of(decisions).items():
        agreement[name] = _agreement(students[name], decisions, data, groups, compared, config.resamples)
        owners = np.repeat(np.array(groups), (data.shown >= 0).sum(dim=1).numpy()).tolist()
        scored = {"cosine": _cosine(data), **students[name]}
        area[name] = {who: areas(*pairs_of(own, data), owners, config.resamples) for who, own in scored.items()}
    return agreement, area


def written(
    config: AdapterDistil | CrossDistil, decisions: Sequence[Decision], data: Table, students: Mapping[str, Floats],
    figures: tuple[Figures, Figures], milliseconds: Mapping[str, float], seconds: Mapping[str, float],
    card: Callable[[Report], str], curve: Sequence[Learnt] = (),
) -> Report:  # fmt: skip
    """The report of a student whose checkpoint is written; its card is put beside it, the figures in `work`.

    `students` are logits (n, m) by name, of questions left out.
    """
    pairs = pairs_among(decisions, data)
    splits = splits_of(decisions)
    report = Report(
        config.out, config.out.stat().st_size, len(decisions), len(set(splits[QUESTIONS])), len(set(splits[SETS])),
        len(data.whole), float(np.mean([1 / len(d.cards) for d in decisions])), *figures, milliseconds, seconds,
        steadiness(pairs, config.resamples), by_kind(decisions, pairs, students, config.resamples), curve,
    )  # fmt: skip
    config.out.with_suffix(".md").write_text(card(report), encoding="utf-8")
    (config.work / "figures.json").write_text(json.dumps(asdict(report), indent=1, default=str), encoding="utf-8")
    return report


def timed(decisions: Sequence[Decision]) -> Sequence[Decision]:
    """The decisions on which a student is timed."""
    return decisions[:: max(1, len(decisions) // _TIMED)]


def milliseconds(selector: Selector, tasks: Sequence[SelectTask]) -> float:
    """The median time of a decision, asked one at a time."""
    taken = []
    for task in tasks:
        start = time.perf_counter()
        selector.select([task], 1)
        taken.append(time.perf_counter() - start)
    return float(np.median(taken)) * 1000


def _cosine(data: Table) -> Floats:
    return np.where((data.shown >= 0).numpy(), data.features[:, :, 0].numpy(), -np.inf)


def _agreement(
    students: Mapping[str, Floats], decisions: Sequence[Decision], data: Table, groups: Sequence[str],
    compared: Mapping[str, Sequence[int]], resamples: int,
) -> dict[str, Interval]:  # fmt: skip
    picks = {"always first": [0] * len(decisions), "cosine": _cosine(data).argmax(axis=1).tolist(), **compared}
    picks |= {name: logits.argmax(axis=1).tolist() for name, logits in students.items()}
    right = {name: [float(d.agrees(p)) for p, d in zip(own, decisions, strict=True)] for name, own in picks.items()}
    judged = picks[list(students)[-1]]
    right[STRICT] = [float(p == d.chosen) for p, d in zip(judged, decisions, strict=True)]
    return {name: clustered_bootstrap(own, groups, samples=resamples) for name, own in right.items()}


def _backend(model: object, store: ModelStore) -> Selector:
    return build_backend(BackendConfig.model_validate({"models": {"one": model}, "roles": {"select": "one"}}), store)


def _picks(selector: Selector, decisions: Sequence[Decision]) -> list[int]:
    return [picks[0] for picks in selector.select([SelectTask(d.query, d.cards) for d in decisions], 1)]
