"""Cards of students of text roles: what they are, how they were made, how good they are, where they fail."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from erag.evaluate.statistics import Interval
from erag.lm.fake import FakeConfig
from erag.lm.sentence import SentenceConfig
from erag.study.ceiling import NEAR

if TYPE_CHECKING:
    from erag.study.ceiling import Kind, Learnt, Steadiness
    from erag.study.standing import Report
    from erag.study.textconfig import AdapterDistil, ChoiceDistil, CrossDistil, TextTraining, UnderstandingDistil
    from erag.study.understanding import Report as UnderstandingReport


def selector_card(config: AdapterDistil, report: Report) -> str:
    """The card of an adapter that selects and scores."""
    forms = f"{config.members} low-rank forms (rank {config.rank})"
    what = f"""An `adapter` that plays `select` and `score`: {forms} over frozen vectors
of {embedder_name(config.embedder)}, with cosines and words in common. {report.bytes:,} bytes, 8-bit weights."""
    return _chooser_card(config, what, "an adapter", config.training, report)


def cross_card(config: CrossDistil, report: Report) -> str:
    """The card of a cross-encoder that selects and scores."""
    seen = "the mean of all tokens" if config.pooling == "mean" else "the first token"
    what = f"""A `cross_encoder` that plays `select` and `score`: {config.base} reads query and card together,
{config.max_tokens} tokens at most; its upper {config.layers} layers were taught, and one score of {seen}.
{report.bytes:,} bytes: the taught weights in 8 bits, of which the figures are too; the rest is {config.base}'s own."""
    if config.beside is not None:
        what += f"""
Beside it stands an adapter on vectors of {embedder_name(config.embedder)}, taught and judged on the same parts;
`both together` goes by the mean of their log-odds, as a `committee` of the two does."""
    return _chooser_card(config, what, "a student", config.training, report)


def _chooser_card(
    config: AdapterDistil | CrossDistil, what: str, student: str, training: TextTraining, report: Report
) -> str:
    return f"""# {config.out.stem}

{what}

Made by `erag distil --config configs/distil/{config.out.stem}.yaml` from {report.decisions:,} distinct decisions with a
choice: {report.questions} questions, {report.sets} sets of cards, {report.cards} cards
({training.epochs} epochs, seed {training.seed}).{_left_out(config)}

{config.taught_by}

## Agreement with the teacher

Each decision was judged by {student} that had seen nothing of its question, or of its set of cards
({config.folds}-fold). 95 % intervals are over questions, or over sets of cards. Chance is {report.chance:.2f}.

{_table("selector", report.agreement)}

Unseen questions are asked of sets of cards that were seen in training: the first column says how well the teacher's
habits in *this* building were learnt. Only the second one says what to expect in another place, and it rests on
{report.sets} sets of one building, however large the number of decisions.

## Area under the ROC curve, every pair of query and card on its own

{_table("scorer", report.area)}

{_bounds(report)}## Time

{"; ".join(f"{value:.2f} ms a decision, {name}" for name, value in report.milliseconds.items())}
(one at a time, median).
"""


def _bounds(report: Report) -> str:
    """What agreement could be at most, as far as the decisions tell."""
    return f"{_kinds(report.kinds)}{_steady(report.steadiness)}{_curve(report.curve)}"


def _kinds(found: Sequence[Kind]) -> str:
    if not found:
        return ""
    names = list(found[0].agreement)
    rows = "\n".join(
        f"| {one.name} | {one.decisions:,} | {' | '.join(one.agreement[name].shown(3) for name in names)} "
        f"| {one.itself.shown(3) if one.itself else 'no such pair'} ({one.pairs}) |"
        for one in found
    )
    return f"""## By what is asked

Agreement on unseen questions; and how often the teacher chose the same for both of two questions of the kind about the
same cards whose cosine is {NEAR:g} or more (so many pairs).

| questions that | decisions | {" | ".join(names)} | the teacher with itself |
|---|---:|{"---|" * len(names)}---|
{rows}

"""


def _steady(found: Sequence[Steadiness]) -> str:
    if not found:
        return ""
    rows = "\n".join(f"| {one.least:g} to {one.most:g} | {one.pairs:,} | {one.same.shown(3)} |" for one in found)
    return f"""## How steady the teacher is

Pairs of different questions about the same cards: how often the teacher chose the same for both. Where the share no
longer rises with the cosine, what is missing is the teacher's own unsteadiness, which no student can learn. Intervals
are over questions.

| cosine of the questions | pairs | chosen the same |
|---|---:|---|
{rows}

"""


def _curve(found: Sequence[Learnt]) -> str:
    if not found:
        return ""
    rows = "\n".join(f"| {one.questions} | {one.agreement.shown(3)} |" for one in found)
    return f"""## What more questions bring

Adapters that were taught fewer questions, in as many steps:

| questions taught | agreement on unseen questions |
|---:|---|
{rows}

"""


def _left_out(config: ChoiceDistil) -> str:
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
    lines += [f"| {name} | {' | '.join(figures[split][name].shown(3) for split in splits)} |" for name in names]
    return "\n".join(lines)


def understanding_card(config: UnderstandingDistil, report: UnderstandingReport) -> str:
    """The card of a student of query understanding."""
    columns = list(next(iter(report.figures.values())))
    rows = [f"| {name} | {' | '.join(own[c].shown(3) for c in columns)} |" for name, own in report.figures.items()]
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
