"""Pictures of a run: each table as dots with intervals, quality over cost, the panel's agreement with labels."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from typing import Any

from erag.experiment.agreement import AgreementRow
from erag.experiment.canvas import FILL, INK, MUTED, OURS, PAPER_INK, Picture, figure, save
from erag.experiment.config import ExperimentConfig
from erag.experiment.curves import curves
from erag.experiment.scoring import Scored
from erag.experiment.sheets import slug
from erag.experiment.tables import Cell, Choices, Table

WIDE = 4  # columns of a table side by side
FEW = 30  # questions below which a dot is hollow
_GAP = 0.045  # between the labels of a picture, as a share of its height


def draw(
    config: ExperimentConfig,
    tables: Sequence[Table],
    scores: Sequence[Scored],
    agreement: Sequence[AgreementRow],
    choices: Choices,
    folder: Path,
) -> list[Picture]:
    """Draw all pictures into `folder`; none where matplotlib is not installed."""
    for old in folder.glob("*.png"):
        old.unlink()
    if find_spec("matplotlib") is None:
        return []
    if config.sweep is not None:
        made = [picture for table in tables for picture in curves(config.sweep, table, folder)]
    else:
        made = [_dots(table, choices, folder) for table in tables if len(table.rows) > 1]
        made += [found for table in tables if (found := _quality(table, scores, choices, folder))]
    return made + ([found] if (found := _agreement(agreement, folder)) else [])


def _dots(table: Table, choices: Choices, folder: Path) -> Picture:
    names = list(table.rows)[::-1]
    side = min(WIDE, len(table.columns))
    high = -(-len(table.columns) // side)
    made, axes = figure(side, 2.4 + 2.5 * side, 0.5 + high * (0.75 + 0.25 * len(names)), high)
    for axis in axes[len(table.columns) :]:
        axis.set_visible(False)
    for i, (column, axis) in enumerate(zip(table.columns, axes, strict=False)):
        for row, name in enumerate(names):
            _dot(axis, row, table.rows[name][i], OURS if name in choices.ours else INK)
        axis.set_title(column.title, fontsize=9)
        axis.set_yticks(range(len(names)), names if i % side == 0 else [""] * len(names), fontsize=8)
        for label in axis.get_yticklabels():
            label.set_color(_ink(label.get_text(), choices))
        axis.set_ylim(-0.6, len(names) - 0.4)
        axis.set_xlim(left=min(0.0, *(_lowest(table.rows[name][i]) for name in names)))
        axis.tick_params(axis="x", labelsize=8)
        axis.tick_params(axis="y", length=0)
    made.suptitle(f"{table.title}: {table.data}", fontsize=10)
    told = (
        f"{table.title}, {table.data}: means with 95 % intervals, ours in green, the paper's figures in brown, "
        f"hollow below {FEW} questions"
    )
    name = slug(table.title, table.data)
    return Picture(save(made, folder, f"{name}.png"), told, name)


def _lowest(cell: Cell | None) -> float:
    return 0.0 if cell is None else cell.value if cell.interval is None else cell.interval.low


def _ink(name: str, choices: Choices) -> str:
    return PAPER_INK if name.endswith(" (paper)") else OURS if name in choices.ours else INK


def _dot(axis: Any, row: int, cell: Cell | None, colour: str) -> None:
    if cell is None:
        return
    if cell.interval is None:
        axis.plot([cell.value], [row], "D", color=PAPER_INK, markersize=4)
        return
    face = "white" if (cell.n or 0) < FEW else colour
    axis.plot([cell.interval.low, cell.interval.high], [row, row], color=colour, linewidth=1.3)
    axis.plot([cell.value], [row], "o", color=colour, markerfacecolor=face, markersize=4.5)


def _quality(table: Table, scores: Sequence[Scored], choices: Choices, folder: Path) -> Picture | None:
    """The first column of a table over the median seconds a question takes."""
    seconds: dict[str, list[float]] = {}
    for one in scores:
        if one.prediction.data == table.data and one.prediction.first and one.prediction.error is None:
            seconds.setdefault(one.prediction.system, []).append(one.prediction.seconds)
    points = [(n, max(median(seconds[n]), 1e-4), c[0]) for n, c in table.rows.items() if n in seconds and c[0]]
    if len(points) < 2:
        return None
    from matplotlib.ticker import NullFormatter

    made, (axis,) = figure(1, 7.4, 4.2)
    for name, x, cell in points:
        axis.plot([x], [cell.value], "o", color=_ink(name, choices), markersize=5.5)
    axis.set_xscale("log")
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.set_xlim(min(x for _, x, _ in points) / 2, max(x for _, x, _ in points) * 2)
    axis.set_ylim(*_room([cell.value for _, _, cell in points]))
    axis.set_xlabel("median seconds a question", fontsize=8)
    axis.set_ylabel(table.columns[0].title, fontsize=8)
    axis.tick_params(labelsize=8)
    axis.set_title(f"{table.title}: {table.data}", fontsize=9)
    _labels(axis, [(name, x, cell.value) for name, x, cell in points], choices)
    told = f"{table.columns[0].title} over the time a question takes, {table.data}"
    return Picture(
        save(made, folder, f"{slug(table.title, table.data, 'cost')}.png"), told, slug(table.title, table.data)
    )


def _room(values: Sequence[float]) -> tuple[float, float]:
    """From where to where an axis goes: a tenth at least, so that small differences do not look large."""
    low, high = min(values), max(values)
    spare = max(0.1 * (high - low), (0.1 - (high - low)) / 2)
    return low - spare, high + spare


def _labels(axis: Any, points: Sequence[tuple[str, float, float]], choices: Choices) -> None:
    """The names in a column at the right, moved apart, each with a line to its point."""
    low, high = axis.get_ylim()
    wanted = sorted(points, key=lambda point: (point[2], point[1]))
    places = _apart([(y - low) / (high - low) for _, _, y in wanted])
    for (name, x, y), place in zip(wanted, places, strict=True):
        axis.annotate(
            name, (x, y), xytext=(1.03, place), textcoords="axes fraction", fontsize=7.5, va="center",
            color=_ink(name, choices), arrowprops={"arrowstyle": "-", "color": MUTED, "linewidth": 0.5},
        )  # fmt: skip


def _apart(places: Sequence[float]) -> list[float]:
    """Ascending places moved up until each is a gap above the one before, then down until all are inside."""
    up: list[float] = []
    for place in places:
        up.append(max(place, up[-1] + _GAP) if up else place)
    down, top = list[float](), 1.0
    for place in reversed(up):
        down.append(min(place, top))
        top = down[-1] - _GAP
    return down[::-1]


def _agreement(rows: Sequence[AgreementRow], folder: Path) -> Picture | None:
    """AUC of each judge on the pairs that were answered and on the head of rankings, by data set and kind."""
    head = [r for r in rows if r.over != "all" and r.auc is not None]
    parts = list(dict.fromkeys((r.data, r.kind) for r in head))
    judges = list(dict.fromkeys(r.judge for r in head))[::-1]
    if not parts:
        return None
    side = min(WIDE - 1, len(parts))
    high = -(-len(parts) // side)
    made, axes = figure(side, 2 + 2.6 * side, 0.6 + high * (0.7 + 0.26 * len(judges)), high)
    for axis in axes[len(parts) :]:
        axis.set_visible(False)
    for i, (part, axis) in enumerate(zip(parts, axes, strict=False)):
        axis.axvline(0.5, color=FILL, linewidth=1)
        axis.axvline(0.85, color=PAPER_INK, linewidth=1, linestyle=":")
        for over, face in (("answered", INK), ("top", "white")):
            found = {r.judge: r.auc for r in head if (r.data, r.kind) == part and r.over.startswith(over)}
            at = [(value, row) for row, judge in enumerate(judges) if (value := found.get(judge)) is not None]
            axis.plot([v for v, _ in at], [r for _, r in at], "o", color=INK, markerfacecolor=face, markersize=5)
        axis.set_title(f"{part[0]}, {part[1]}", fontsize=9)
        axis.set_yticks(range(len(judges)), judges if i % side == 0 else [""] * len(judges), fontsize=8)
        axis.set_ylim(-0.6, len(judges) - 0.4)
        axis.set_xlim(min(0.45, *(r.auc - 0.03 for r in head if r.auc is not None)), 1.02)
        axis.tick_params(axis="x", labelsize=8)
        axis.tick_params(axis="y", length=0)
    made.suptitle("AUC of the judges against labels", fontsize=10)
    told = "AUC of the judges: filled, pairs that were answered; hollow, the head of rankings; dotted .85; line: chance"
    return Picture(save(made, folder, "agreement.png"), told, "agreement")
