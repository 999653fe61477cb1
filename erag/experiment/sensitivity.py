"""What the tables would say with other judges: without the models of the run, without each judge, by the stack."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
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
PanelOf = Callable[[str], Probability]  # the panel that judges a system


def sensitivity(
    config: ExperimentConfig,
    predictions: Sequence[Prediction],
    questions: Sequence[QuestionRecord],
    votes: Sequence[Voted],
    facts: Mapping[str, Any],
) -> list[Sheet]:
    """A sheet a data set, a row a system and column that rests on votes, a column a panel. None for a panel of one."""
    columns = {(c.set, c.metric, c.mode): c for t in config.tables for c in t.columns if c.metric in METRICS}
    panels = _panels(config, facts.get("systems", {}), votes)
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
        notes = (
            "The mean of a column by the whole panel, and by what is left of it; a dash where nobody is. *Its own* are "
            "the judges that share a model with the system of the row, *the run's* those that share one with any.",
        )
        if rows:
            made.append(Sheet(f"sensitivity-{data}", title, ("column", "system", *panels), tuple(rows), notes))
    return made


def _panels(config: ExperimentConfig, used: Mapping[str, Sequence[str]], votes: Sequence[Voted]) -> dict[str, PanelOf]:
    """The panels by what is said of them; `used` are the models of each system."""
    panel = config.panel
    models = {n: panel.models(n, config.similarity) for n in panel.judges if any(n in v.votes for v in votes)}
    own = {system: frozenset(n for n, m in models.items() if m & set(theirs)) for system, theirs in used.items()}
    sharing = frozenset[str]().union(*own.values())
    made: dict[str, PanelOf] = {"all judges": lambda _: mean_vote()}
    if sharing:
        made[f"without the run's ({', '.join(sorted(sharing))})"] = lambda _: mean_vote(sharing)
        made["without its own"] = lambda system: mean_vote(own.get(system, frozenset()))
    if len(models) > 1:
        made |= {f"without {name}": _without(name) for name in models}
    if any(v.stack is not None for v in votes):
        made["stack"] = lambda _: stacked
    return made


def _without(name: str) -> PanelOf:
    return lambda _: mean_vote(frozenset({name}))


def _rows(
    column: ColumnConfig,
    data: str,
    predictions: Sequence[Prediction],
    questions: Sequence[QuestionRecord],
    votes: Sequence[Voted],
    panels: Mapping[str, PanelOf],
) -> dict[str, list[str]]:
    asked = [q for q in questions if q.data == data and column.set in q.sets and (q.stated or not column.stated)]
    kept: dict[str, list[Prediction]] = {}
    for prediction in predictions:
        if prediction.data == data and prediction.mode == column.mode:
            kept.setdefault(prediction.system, []).append(prediction)
    rows = {n: [_mean(column.metric, p, asked, votes, of(n)) for of in panels.values()] for n, p in kept.items()}
    return {name: cells for name, cells in rows.items() if any(cell != NONE for cell in cells)}


def _mean(
    metric: str,
    predictions: Sequence[Prediction],
    questions: Sequence[QuestionRecord],
    votes: Sequence[Voted],
    probability: Probability,
) -> str:
    """The mean of a system; none where a panel without some judges leaves a pair without a vote."""
    try:
        scores = scored(predictions, questions, votes, (), probability)
    except InputError:
        return NONE
    values = [one.values[metric] for one in scores if metric in one.values]
    return f"{fmean(values):.3f}" if values else NONE
