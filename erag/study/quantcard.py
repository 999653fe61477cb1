"""Reports of quantisation studies: what was measured, by which rule a choice is named, and what the figures rest on."""

from __future__ import annotations

from typing import TYPE_CHECKING

from erag.study.front import RULE
from erag.study.shown import Shown

if TYPE_CHECKING:
    from erag.study.quantconfig import GgufStudy
    from erag.study.variants import Report


def markdown(shown: Shown) -> str:
    """A table as markdown."""
    marks = "|".join("---:" if name in shown.right else "---" for name in shown.header)
    return "\n".join(
        [f"| {' | '.join(shown.header)} |", f"|{marks}|", *(f"| {' | '.join(row)} |" for row in shown.rows)]
    )


def variants_report(config: GgufStudy, report: Report, whole: bool) -> str:
    """The report of GGUF variants."""
    origin = (
        "The variants are made from the whole weights."
        if whole
        else "The shipped file is quantised itself, and the variants are made from it once more: an F16 made of it\n"
        "holds nothing that the shipped file does not, and the others add their own error to the shipped file's."
    )
    first = report.measured[0]
    labels = "decisions of a teacher" if config.decisions else "labelled decisions of the sample"
    return f"""# {config.model} in other formats

{origin}

{markdown(report.table())}

The knee is {report.knee}: {RULE}.
Lost: nats a token against the shipped file, caption by caption, with the 95 % interval over {len(first.nats)} captions
of `{config.source}`. Decisions: {len(first.right)} {labels}, by likelihood. Speed: one prompt of about {config.words}
words at a time, with {config.answer} tokens of answer. Models in PyTorch compute with what the shipped file says; their
MB are that file's, and the knee is not sought among them. Where the rows of a tensor are no multiple of 256 (those of
SmolLM2 are 576 long) llama.cpp takes the nearest older format for it, so that a K format of such a model is larger than
its name says.

![size against loss](pareto.png)
"""
