"""What answers cost: seconds, rows scored, calls, tokens, refusals and errors, by system and data set."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from erag.evaluate.cost import Spread
from erag.experiment.markdown import Sheet
from erag.experiment.scoring import Scored


def costs(scores: Sequence[Scored], systems: Sequence[str]) -> list[Sheet]:
    """A row a system and data set, over the first mode each question was asked in: later ones may find texts known."""
    rows = []
    for data in dict.fromkeys(s.prediction.data for s in scores):
        for name in systems:
            own = [s for s in scores if s.prediction.system == name and s.prediction.data == data]
            first = [s for s in own if s.prediction.first and s.prediction.error is None]
            if own:
                rows.append((data, name, *_row(own, first)))
    columns = (
        "data", "system", "answers", "errors", "refused", "s median", "s mean", "s 95 %", "rows scored",
        "calls a question", "tokens read", "written",
    )  # fmt: skip
    notes = ("Seconds without loading, with whatever else the machine did; calls and tokens are means.",)
    return [Sheet("cost", "What answers cost", columns, tuple(rows), notes)] if rows else []


def _row(own: Sequence[Scored], first: Sequence[Scored]) -> tuple[str, ...]:
    errors = sum(s.prediction.error is not None for s in own)
    refused = sum(s.prediction.refused for s in own)
    head = (f"{len(own):,}", str(errors), str(refused))
    if not first:
        return (*head, *["–"] * 7)
    seconds = Spread.of([s.prediction.seconds for s in first])
    visited = Spread.of([float(s.prediction.visited) for s in first])
    calls: Counter[str] = Counter()
    for one in first:
        calls.update(one.prediction.calls)
    told = ", ".join(f"{role} {n / len(first):.1f}" for role, n in sorted(calls.items())) or "none"
    read, wrote = (sum(v) / len(first) for v in zip(*((s.prediction.tokens_in, s.prediction.tokens_out)
                                                     for s in first), strict=True))  # fmt: skip
    return (
        *head, f"{seconds.median:.3f}", f"{seconds.mean:.3f}", f"{seconds.p95:.3f}", f"{visited.median:,.0f}", told,
        f"{read:,.0f}", f"{wrote:,.0f}",
    )  # fmt: skip
