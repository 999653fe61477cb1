"""The Pareto plot of a comparison: what is lost against how long it takes, a panel a trial."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from erag.compare.rows import Row, pareto

_WIDTH, _HEIGHT, _ACROSS = 4.6, 3.5, 3  # inches a panel, panels a line
_LEAST = 1e-6  # seconds: a logarithm needs more than none
_LOCAL, _CLOUD, _CONTROL, _FRONT = "#1f5fa8", "#2a8a4a", "#999999", "#d07020"


def plotted(rows: Sequence[Row], path: Path) -> bool:
    """Draw the plot; whether there was anything to draw, and something to draw it with."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
        from matplotlib.ticker import FormatStrFormatter, NullFormatter
    except ImportError:
        return False
    trials = list(dict.fromkeys(r.trial for r in rows if r.seconds is not None and r.judgement))
    if not trials:
        return False
    across = min(_ACROSS, len(trials))
    down = -(-len(trials) // across)
    figure = Figure(figsize=(_WIDTH * across, _HEIGHT * down + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for axes, trial in zip(panels, trials, strict=False):
        _panel(axes, [r for r in rows if r.trial == trial and r.judgement])
        axes.xaxis.set_major_formatter(FormatStrFormatter("%g"))
        axes.xaxis.set_minor_formatter(NullFormatter())
    for axes in panels[len(trials) :]:
        axes.set_axis_off()
    figure.suptitle("Loss and seconds\ndiscs: peak memory; line: what no other beats", fontsize=10)
    figure.savefig(path, dpi=110)
    return True


def _panel(axes: Any, rows: Sequence[Row]) -> None:
    local = [r for r in rows if r.seconds is not None]
    axes.set_xscale("log")
    for row in rows:
        if row.kind != "local" and row.judgement:
            colour, style = (_CLOUD, "-") if row.kind == "cloud" else (_CONTROL, ":")
            axes.axhline(row.judgement.loss.value, color=colour, linestyle=style, linewidth=1)
            axes.annotate(
                row.backend, (0.99, row.judgement.loss.value), xycoords=("axes fraction", "data"), fontsize=6.5,
                color=colour, ha="right", va="bottom",
            )  # fmt: skip
    front = pareto(rows)
    axes.plot(
        [r.seconds for r in front], [_loss(r) for r in front], color=_FRONT, linewidth=1.2, drawstyle="steps-post"
    )
    for number, row in enumerate(sorted(local, key=lambda r: r.seconds or 0.0)):
        _point(axes, row, above=number % 2 == 0)
    known = [max(r.seconds, _LEAST) for r in local if r.seconds is not None]
    axes.set_xlim(min(known) / 3, max(known) * 10)  # room for names to the right
    axes.margins(y=0.2)
    axes.set_title(f"{rows[0].trial} ({rows[0].role})", fontsize=9)
    axes.set_xlabel("seconds an item", fontsize=8)
    axes.set_ylabel(f"loss against {rows[0].against}", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.2)


def _point(axes: Any, row: Row, above: bool) -> None:
    if row.judgement is None or row.seconds is None:
        return
    loss, x = row.judgement.loss, max(row.seconds, _LEAST)
    axes.errorbar(x, loss.value, yerr=[[loss.value - loss.low], [loss.high - loss.value]], color=_LOCAL, linewidth=0.8)
    axes.scatter(
        [x], [loss.value], s=10 + 2.2 * math.sqrt(row.peak_mb or 0), color=_LOCAL, alpha=0.65, linewidths=0, zorder=3
    )
    axes.annotate(
        row.backend, (x, loss.value), textcoords="offset points", xytext=(7, 7 if above else -7), fontsize=7,
        va="bottom" if above else "top", zorder=4,
    )  # fmt: skip


def _loss(row: Row) -> float:
    return math.nan if row.judgement is None else row.judgement.loss.value
