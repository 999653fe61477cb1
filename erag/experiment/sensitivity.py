"""What the tables would say with other judges: without the models of the run, without each judge, by the stack."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import fmean
from typing import Any

from erag.core.errors import InputError
from erag.experiment.config import ColumnConfig, ExperimentConfig
from erag.experiment.judging import Voted
from erag.experiment.markdown import Sheet
from erag.experiment.predictions import Prediction
from erag.experiment.questions import QuestionRecord
from erag.experiment.scoring import Probability, mean_vote, scored, stacked

METRICS = ("p_q_a@1", "p_q_a@5", "p_q_a_l@1", "p_q_a_l@5")
NONE = "–"


def sensitivity(
    config: ExperimentConfig,
    predictions: Sequence[Prediction],
    questions: Sequence[QuestionRecord],
    votes: Sequence[Voted],
    facts: Mapping[str, Any],
) -> list[Sheet]:
    """A sheet a data set and column that rests on votes: a row a system, a column a panel. None for a panel of one."""
    columns = {(c.set, c.metric, c.mode): c for t in config.tables for c in t.columns if c.metric in METRICS}
    panels = _panels(config, set(facts.get("retrieving", ())), votes)
    if len(panels) < 2 or not columns:
        return []
    made = []
    for data in config.data:
        rows = [
            (f"{column.title} ({column.mode})", name, *cells)
            for column in columns.values()
            for name, cells in _rows(column, data, predictions, questions, votes, panels).items()
        ]
        title = f"With other judges: {data}"
        notes = ("The mean of a column by the whole panel, and by what is left of it.",)
        if rows:
            made.append(Sheet(f"sensitivity-{data}", title, ("column", "system", *panels), tuple(rows), notes))
    return made


def _panels(config: ExperimentConfig, used: set[str], votes: Sequence[Voted]) -> dict[str, Probability]:
    panel = config.panel
    names = [name for name in panel.judges if any(name in v.votes for v in votes)]
    sharing = frozenset(n for n in names if panel.models(n, config.similarity) & used)
    made: dict[str, Probability] = {"all judges": mean_vote()}
    if sharing and len(sharing) < len(names):
        made[f"without the run's models ({', '.join(sorted(sharing))})"] = mean_vote(sharing)
    if len(names) > 1:
        made |= {f"without {name}": mean_vote(frozenset({name})) for name in names}
    if any(v.stack is not None for v in votes):
        made["stack"] = stacked
    return made


def _rows(
    column: ColumnConfig,
    data: str,
    predictions: Sequence[Prediction],
    questions: Sequence[QuestionRecord],
    votes: Sequence[Voted],
    panels: Mapping[str, Probability],
) -> dict[str, list[str]]:
    asked = [q for q in questions if q.data == data and column.set in q.sets and (q.stated or not column.stated)]
    kept = [p for p in predictions if p.data == data and p.mode == column.mode]
    rows: dict[str, list[str]] = {}
    for probability in panels.values():
        means = _means(column.metric, kept, asked, votes, probability)
        for name in dict.fromkeys(p.system for p in kept):
            rows.setdefault(name, []).append(NONE if name not in means else f"{means[name]:.3f}")
    return {name: cells for name, cells in rows.items() if any(cell != NONE for cell in cells)}


def _means(
    metric: str,
    predictions: Sequence[Prediction],
    questions: Sequence[QuestionRecord],
    votes: Sequence[Voted],
    probability: Probability,
) -> dict[str, float]:
    """The mean by system; none where a panel without some judges leaves a pair without a vote."""
    try:
        scores = scored(predictions, questions, votes, (), probability)
    except InputError:
        return {}
    values: dict[str, list[float]] = {}
    for one in scores:
        if metric in one.values:
            values.setdefault(one.prediction.system, []).append(one.values[metric])
    return {name: fmean(known) for name, known in values.items()}
