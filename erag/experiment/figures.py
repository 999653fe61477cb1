"""Pictures of a run: each table as dots with intervals, quality over cost, the panel's agreement, sweeps as curves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from typing import Any

from erag.experiment.agreement import AgreementRow
from erag.experiment.config import AxisConfig, ExperimentConfig
from erag.experiment.scoring import Scored
from erag.experiment.sheets import slug
from erag.experiment.sweep import point
from erag.experiment.tables import Cell, Table

INK, PAPER_INK, FILL = "#1f3a5f", "#b0552b", "#9db4cc"
_DPI = 130
Picture = tuple[str, str]  # file name, what it shows
Curve = tuple[list[float | int | str], list[Cell]]


def draw(
    config: ExperimentConfig,
    tables: Sequence[Table],
    scores: Sequence[Scored],
    agreement: Sequence[AgreementRow],
    folder: Path,
) -> list[Picture]:
    """Draw all pictures into `folder`; none where matplotlib is not installed."""
    for old in folder.glob("*.png"):
        old.unlink()
    if find_spec("matplotlib") is None:
        return []
    made = [_dots(table, folder) for table in tables if not config.sweep and len(table.rows) > 1]
    made += [found for table in tables if (found := _quality(table, scores, folder))] if not config.sweep else []
    if config.sweep is not None:
        for table in tables:
            made += list(_sweeps(config, table, folder))
    return made + ([_agreement(agreement, folder)] if agreement else [])


def _figure(columns: int, width: float, height: float, rows: int = 1) -> tuple[Any, list[Any]]:
    """A figure and its axes, row by row, without the global state of pyplot."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(rows, columns, squeeze=False)
    axes = [axis for row in grid for axis in row]
    for axis in axes:
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(axis="x", color="#e4e4e4", linewidth=0.7)
        axis.set_axisbelow(True)
    return figure, axes


def _save(figure: Any, folder: Path, name: str) -> str:
    figure.savefig(folder / name, dpi=_DPI, metadata={"Software": None})
    return name


def _dots(table: Table, folder: Path) -> Picture:
    names = list(table.rows)[::-1]
    figure, axes = _figure(len(table.columns), 2.2 + 2.3 * len(table.columns), 1.3 + 0.28 * len(names))
    for i, (column, axis) in enumerate(zip(table.columns, axes, strict=True)):
        for row, name in enumerate(names):
            _dot(axis, row, table.rows[name][i])
        axis.set_title(column.title, fontsize=9)
        axis.set_yticks(range(len(names)), names if i == 0 else [""] * len(names), fontsize=8)
        axis.set_ylim(-0.6, len(names) - 0.4)
        axis.tick_params(axis="x", labelsize=8)
    figure.suptitle(f"{table.title}: {table.data}", fontsize=10)
    told = f"{table.title}, {table.data}: means with 95 % intervals, the paper's figures in brown"
    return _save(figure, folder, f"{slug(table.title, table.data)}.png"), told


def _dot(axis: Any, row: int, cell: Cell | None) -> None:
    if cell is None:
        return
    if cell.interval is None:
        axis.plot([cell.value], [row], "D", color=PAPER_INK, markersize=4)
        return
    axis.plot([cell.interval.low, cell.interval.high], [row, row], color=INK, linewidth=1.2)
    axis.plot([cell.value], [row], "o", color=INK, markersize=4)


def _quality(table: Table, scores: Sequence[Scored], folder: Path) -> Picture | None:
    """The first column of a table over the median seconds a question takes."""
    seconds: dict[str, list[float]] = {}
    for one in scores:
        if one.prediction.data == table.data and one.prediction.first and one.prediction.error is None:
            seconds.setdefault(one.prediction.system, []).append(one.prediction.seconds)
    points = [(n, max(median(seconds[n]), 1e-4), c[0]) for n, c in table.rows.items() if n in seconds and c[0]]
    if len(points) < 2:
        return None
    figure, (axis,) = _figure(1, 6.2, 4)
    for name, x, cell in points:
        axis.plot([x], [cell.value], "o", color=INK, markersize=5)
        axis.annotate(name, (x, cell.value), xytext=(5, 3), textcoords="offset points", fontsize=7)
    axis.set_xscale("log")
    axis.margins(x=0.2)
    axis.set_xlabel("median seconds a question", fontsize=8)
    axis.set_ylabel(table.columns[0].title, fontsize=8)
    axis.tick_params(labelsize=8)
    axis.set_title(f"{table.title}: {table.data}", fontsize=9)
    told = f"{table.columns[0].title} over the time a question takes, {table.data}"
    return _save(figure, folder, f"{slug(table.title, table.data, 'cost')}.png"), told


def _agreement(rows: Sequence[AgreementRow], folder: Path) -> Picture:
    """AUC of each judge on the head of rankings, a panel a data set and kind of question."""
    head = [r for r in rows if r.over != "all" and r.auc is not None]
    parts = list(dict.fromkeys((r.data, r.kind) for r in head))
    judges = list(dict.fromkeys(r.judge for r in head))[::-1]
    if not parts:
        return _empty(folder)
    figure, axes = _figure(len(parts), 1.8 + 2 * len(parts), 1.3 + 0.3 * len(judges))
    for i, (part, axis) in enumerate(zip(parts, axes, strict=True)):
        known = {r.judge: r.auc for r in head if (r.data, r.kind) == part}
        axis.plot([known.get(j) for j in judges], range(len(judges)), "o", color=INK, markersize=5)
        axis.axvline(0.5, color=FILL, linewidth=1)
        axis.axvline(0.85, color=PAPER_INK, linewidth=1, linestyle=":")
        axis.set_title(f"{part[0]}, {part[1]}", fontsize=9)
        axis.set_yticks(range(len(judges)), judges if i == 0 else [""] * len(judges), fontsize=8)
        axis.set_xlim(0.3, 1.02)
        axis.tick_params(axis="x", labelsize=8)
    figure.suptitle("AUC against labels, head of rankings", fontsize=10)
    return _save(figure, folder, "agreement.png"), "AUC of the judges against labels; dotted: .85, line: chance"


def _empty(folder: Path) -> Picture:
    figure, (axis,) = _figure(1, 3, 1)
    axis.text(0.5, 0.5, "no pairs of both labels", ha="center", fontsize=9)
    axis.set_axis_off()
    return _save(figure, folder, "agreement.png"), "No pairs of both labels"


def _sweeps(config: ExperimentConfig, table: Table, folder: Path) -> Iterator[Picture]:
    if config.sweep is None:
        return
    for axis_name, axis in config.sweep.axes.items():
        yield _curves(table, axis_name, axis, folder)
    for a, b in config.sweep.grid:
        yield _heat(table, (a, config.sweep.axes[a]), (b, config.sweep.axes[b]), folder)


def _curves(table: Table, name: str, swept: AxisConfig, folder: Path) -> Picture:
    figure, axes = _figure(len(table.columns), 1 + 2.7 * len(table.columns), 2.9)
    for i, (column, axis) in enumerate(zip(table.columns, axes, strict=True)):
        values, cells = _curve(table, name, swept, i)
        places = list(range(len(values)))
        lows = [c.interval.low if c.interval else c.value for c in cells]
        highs = [c.interval.high if c.interval else c.value for c in cells]
        axis.fill_between(places, lows, highs, color=FILL, alpha=0.4, linewidth=0)
        axis.plot(places, [c.value for c in cells], "o-", color=INK, markersize=4, linewidth=1.2)
        axis.set_xticks(places, [str(v) for v in values], fontsize=7, rotation=45 if len(values) > 5 else 0)
        axis.set_xlabel(name, fontsize=8)
        axis.set_title(column.title, fontsize=9)
        axis.tick_params(axis="y", labelsize=8)
    figure.suptitle(f"{swept.path}: {table.data}", fontsize=10)
    told = f"{name} (`{swept.path}`) on {table.data}: means with 95 % intervals"
    return _save(figure, folder, f"{slug('sweep', name, table.title, table.data)}.png"), told


def _curve(table: Table, name: str, swept: AxisConfig, column: int) -> Curve:
    found = [(v, table.rows[row][column]) for v in swept.values if (row := point((name, v))) in table.rows]
    known = [(v, cell) for v, cell in found if cell is not None]
    return [v for v, _ in known], [cell for _, cell in known]


def _heat(table: Table, a: tuple[str, AxisConfig], b: tuple[str, AxisConfig], folder: Path) -> Picture:
    (first, rows), (second, columns) = a, b
    figure, axes = _figure(len(table.columns), 1.2 + 2.9 * len(table.columns), 1.3 + 0.42 * len(rows.values))
    for i, (column, axis) in enumerate(zip(table.columns, axes, strict=True)):
        values = [[_value(table.rows, point((first, x), (second, y)), i) for y in columns.values] for x in rows.values]
        axis.grid(False)
        image = axis.imshow(values, cmap="Blues", aspect="auto")
        figure.colorbar(image, ax=axis, shrink=0.8).ax.tick_params(labelsize=7)
        for r, line in enumerate(values):
            for c, value in enumerate(line):
                axis.text(c, r, f"{value:.2f}", ha="center", va="center", fontsize=7, color=_on(value, values))
        axis.set_xticks(range(len(columns.values)), [str(v) for v in columns.values], fontsize=7)
        axis.set_yticks(range(len(rows.values)), [str(v) for v in rows.values], fontsize=7)
        axis.set_xlabel(second, fontsize=8)
        axis.set_ylabel(first, fontsize=8)
        axis.set_title(column.title, fontsize=9)
    figure.suptitle(f"{first} × {second}: {table.data}", fontsize=10)
    told = f"{first} and {second} together on {table.data}"
    return _save(figure, folder, f"{slug('grid', first, second, table.title, table.data)}.png"), told


def _value(rows: Mapping[str, Sequence[Cell | None]], name: str, column: int) -> float:
    cell = rows[name][column] if name in rows else None
    return float("nan") if cell is None else cell.value


def _on(value: float, values: Sequence[Sequence[float]]) -> str:
    """White on dark fields."""
    known = [v for line in values for v in line if v == v]
    low, high = min(known, default=0.0), max(known, default=1.0)
    return "white" if high > low and (value - low) / (high - low) > 0.6 else "black"
