"""Cards of students of text roles: what they are, how they were made, how good they are, where they fail."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from erag.evaluate.statistics import Interval
from erag.lm.fake import FakeConfig
from erag.lm.sentence import SentenceConfig

if TYPE_CHECKING:
    from erag.study.selector import Report
    from erag.study.textconfig import AdapterDistil, UnderstandingDistil
    from erag.study.understanding import Report as UnderstandingReport


def selector_card(config: AdapterDistil, report: Report) -> str:
    """The card of an adapter that selects and scores."""
    return f"""# {config.out.stem}

An `adapter` that plays `select` and `score`: {config.members} low-rank forms (rank {config.rank}) over frozen vectors
of {embedder_name(config.embedder)}, with cosines and words in common. {report.bytes:,} bytes, 8-bit weights.

Made by `erag distil --config configs/distil/{config.out.stem}.yaml` from {report.decisions:,} distinct decisions with a
choice: {report.questions} questions, {report.sets} sets of cards, {report.cards} cards
({config.training.epochs} epochs, seed {config.training.seed}).{_left_out(config)}

{config.taught_by}

## Agreement with the teacher

Each decision was judged by an adapter that had seen nothing of its question, or of its set of cards
({config.folds}-fold). 95 % intervals are over questions, or over sets of cards. Chance is {report.chance:.2f}.

{_table("selector", report.agreement)}

Unseen questions are asked of sets of cards that were seen in training: the first column says how well the teacher's
habits in *this* building were learnt. Only the second one says what to expect in another place, and it rests on
{report.sets} sets of one building, however large the number of decisions.

## Area under the ROC curve, every pair of query and card on its own

{_table("scorer", report.area)}

## Time

{"; ".join(f"{value:.2f} ms a decision, {name}" for name, value in report.milliseconds.items())}
(one at a time, median).
"""


def _left_out(config: AdapterDistil) -> str:
    part = config.without
    if part is None:
        return ""
    return f" Part {part.number} of {part.folds} by {part.by} was never seen: `erag compare` asks it."


def embedder_name(config: SentenceConfig | FakeConfig) -> str:
    """What a card calls an embedder."""
    return config.model if isinstance(config, SentenceConfig) else config.kind


def _table(first: str, figures: Mapping[str, Mapping[str, Interval]]) -> str:
    splits = list(figures)
    names = list(figures[splits[0]])
    lines = [f"| {first} | {' | '.join(splits)} |", f"|---|{'---|' * len(splits)}"]
    lines += [f"| {name} | {' | '.join(_precise(figures[split][name]) for split in splits)} |" for name in names]
    return "\n".join(lines)


def _precise(interval: Interval) -> str:
    return f"{interval.mean:.3f} [{interval.low:.3f}, {interval.high:.3f}]"


def understanding_card(config: UnderstandingDistil, report: UnderstandingReport) -> str:
    """The card of a student of query understanding."""
    columns = list(next(iter(report.figures.values())))
    rows = [f"| {name} | {' | '.join(_precise(own[c]) for c in columns)} |" for name, own in report.figures.items()]
    table = "\n".join([f"| named by | {' | '.join(columns)} |", f"|---|{'---|' * len(columns)}", *rows])
    shown = "\n".join(f"| {wish} | {teacher} | {student} |" for wish, teacher, student in report.examples)
    return f"""# {config.out.stem}

An `understanding` backend: it names what would satisfy a query out of {report.things} known things, by the cosine of
query and thing, by a linear projection of the query towards what its teacher named for others, and by how often a thing
was named; over frozen vectors of {embedder_name(config.embedder)}. {report.bytes:,} bytes, 8-bit weights.

Made by `erag distil --config configs/distil/understanding.yaml` from what its teacher named for {report.wishes} wishes
of {report.needs} needs; {report.failed} more left nothing to learn from.

{config.taught_by}

## On needs it has not seen ({config.folds}-fold over needs)

{table}

The student names five things at most. 95 % intervals are over needs. The wishes were written for this purpose; that
a student agrees with its teacher does not say that retrieval gains from it: `docs/students.md` has those figures.

| wish | teacher | student, not having seen the need |
|---|---|---|
{shown}
"""
