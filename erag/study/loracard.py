"""Cards of adapters of a language model: what they are, how they were made, how good they are, how they are used."""

from __future__ import annotations

from textwrap import shorten
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from erag.study.lora import Report
    from erag.study.loraconfig import LoraDistil

_CELL = 160  # characters of an example


def lora_card(config: LoraDistil, report: Report) -> str:
    """The card of an adapter."""
    columns = list(next(iter(report.figures.values())))
    rows = [
        f"| {way} | {report.counted[way]} | {' | '.join(own[c].shown(3) for c in columns)} | {_size(report, way)} |"
        for way, own in report.figures.items()
    ]
    table = "\n".join(
        [f"| answered by | items | {' | '.join(columns)} | file |", f"|---|---:|{'---|' * (len(columns) + 1)}", *rows]
    )
    training = config.training
    left_out = "each left out once" if config.judged == config.folds else f"of which {config.judged} left out"
    return f"""# {config.out.stem}

A low-rank adapter (rank {config.rank}, alpha {config.alpha:g}) on the attention and MLP projections of {config.base},
taught {config.task.kind}. {report.bytes:,} bytes, factors in 8 bits. With `lora: {config.out}` a `torchlm`
model merges it as it is loaded; `erag models merge {config.out}` writes a GGUF file of the result.

Made by `erag distil` (`kind: lora`) from {report.lessons:,} lessons of {report.taught:,} of {report.items:,} items
in {report.groups:,} groups ({training.epochs} epochs in batches of {training.batch_size}, rate {training.rate:g},
seed {training.seed}).

{config.taught_by}

## On groups it has not seen

{config.folds} folds of groups, {left_out}: {report.judged:,} of {report.items:,} items are judged, by adapters that had
seen nothing of their groups, rounded and merged as the shipped one. 95 % intervals are over the
{report.judged_groups} groups that they are in.

{table}
{_examples(config, report)}"""


def _examples(config: LoraDistil, report: Report) -> str:
    if not report.examples:
        return ""
    rows = "\n".join(f"| {' | '.join(map(_cell, example))} |" for example in report.examples)
    return f"""
| asked | teacher | {config.base}, untaught | student, not having seen the group |
|---|---|---|---|
{rows}
"""


def _cell(text: str) -> str:
    """A text for a table: what is longer is cut."""
    return shorten(text.replace("|", "/"), _CELL, placeholder=" …")


def _size(report: Report, way: str) -> str:
    return f"{report.files[way] / 1e6:.0f} MB" if way in report.files else "none"
