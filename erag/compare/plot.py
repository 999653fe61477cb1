"""The Pareto plot of a comparison: what is lost against how long it takes, a panel a trial."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from erag.compare.page import played
from erag.compare.rows import Row, pareto

_WIDTH, _HEIGHT, _ACROSS = 4.8, 3.6, 3  # inches a panel, panels a line
_LEAST = 1e-6  # seconds: a logarithm needs more than none
_NAMES, _LINE = 0.52, 0.055  # of a panel: where names begin, and how high a line of them is
_LOCAL, _FRONT = "#1f5fa8", "#d07020"
_LINES = {"cloud": ("#2a8a4a", "-"), "truth": ("#2a8a4a", "--"), "control": ("#999999", ":")}


def plotted(rows: Sequence[Row], path: Path) -> bool:
    """Draw the plot; whether there was anything to draw, and something to draw it with."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        return False
    known = [row for row in rows if row.judgement]
    trials = list(dict.fromkeys(row.trial for row in known if row.kind == "local"))
    if not trials:
        return False
    across = min(_ACROSS, len(trials))
    down = -(-len(trials) // across)
    figure = Figure(figsize=(_WIDTH * across, _HEIGHT * down + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for axes, trial in zip(panels, trials, strict=False):
        _panel(axes, [row for row in known if row.trial == trial])
    for axes in panels[len(trials) :]:
        axes.set_axis_off()
    figure.suptitle("Loss and seconds\ndiscs: peak memory; line: what no other beats", fontsize=10)
    figure.savefig(path, dpi=110, metadata={"Software": None})
    return True


def _panel(axes: Any, rows: Sequence[Row]) -> None:
    from matplotlib.ticker import FormatStrFormatter, NullFormatter

    local = sorted((row for row in rows if row.kind == "local"), key=_seconds)
    for row in (row for row in rows if row.kind != "local"):
        colour, style = _LINES[row.kind]
        axes.axhline(_loss(row), color=colour, linestyle=style, linewidth=1)
        axes.annotate(
            row.backend, (0.01, _loss(row)), xycoords=("axes fraction", "data"), fontsize=6, color=colour, va="bottom"
        )
    front = pareto(rows)
    axes.plot([_seconds(r) for r in front], [_loss(r) for r in front], color=_FRONT, lw=1.2, drawstyle="steps-post")
    for row in local:
        _point(axes, row)
    axes.set_xscale("log")
    first, last = _seconds(local[0]) / 2, _seconds(local[-1]) * 1.3
    axes.set_xlim(first, first * (last / first) ** (1 / _NAMES))
    axes.margins(y=0.1)
    _names(axes, local)
    axes.xaxis.set_major_formatter(FormatStrFormatter("%g"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_title(f"{rows[0].trial} ({played(rows[0])})", fontsize=9)
    axes.set_xlabel("seconds an item", fontsize=8)
    axes.set_ylabel(f"loss against {rows[0].against}", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.2)


def _point(axes: Any, row: Row) -> None:
    if row.judgement is None:
        return
    loss, x = row.judgement.loss, _seconds(row)
    spread = [[loss.mean - loss.low], [loss.high - loss.mean]]
    axes.errorbar(x, loss.mean, yerr=spread, color=_LOCAL, linewidth=0.8)
    size = 10 + 2.2 * math.sqrt(row.peak_mb or 0)
    axes.scatter([x], [loss.mean], s=size, color=_LOCAL, alpha=0.65, linewidths=0, zorder=3)


def _names(axes: Any, rows: Sequence[Row]) -> None:
    """The names to the right, each with a line to its point, in the order of the losses and none on another."""
    low, high = axes.get_ylim()
    wanted = sorted(rows, key=lambda row: (_loss(row), -_seconds(row)))
    for row, at in zip(wanted, apart([(_loss(row) - low) / (high - low) for row in wanted], _LINE), strict=True):
        axes.annotate(
            row.backend, (_seconds(row), _loss(row)), (_NAMES + 0.03, at), textcoords="axes fraction", fontsize=6,
            va="center", arrowprops={"arrowstyle": "-", "color": "#aaaaaa", "linewidth": 0.5, "shrinkB": 3}, zorder=4,
        )  # fmt: skip


def apart(places: Sequence[float], gap: float) -> list[float]:
    """Rising places between 0 and 1 moved as little as it takes to lie `gap` apart, or less where there is no room."""
    gap = min(gap, 1 / max(1, len(places)))
    found: list[float] = []
    for place in places:
        found.append(max(place, found[-1] + gap if found else gap / 2))
    ceiling = 1 - gap / 2
    for i in reversed(range(len(found))):
        found[i] = min(found[i], ceiling)
        ceiling = found[i] - gap
    return found


def _seconds(row: Row) -> float:
    return max(row.seconds or 0.0, _LEAST)


def _loss(row: Row) -> float:
    return math.nan if row.judgement is None else row.judgement.loss.mean
