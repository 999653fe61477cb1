"""Pictures of a sweep: a curve for each axis, and a field for each pair of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from erag.experiment.canvas import FILL, INK, Picture, figure, save
from erag.experiment.config import AxisConfig, SweepConfig
from erag.experiment.sheets import slug
from erag.experiment.sweep import point
from erag.experiment.tables import Cell, Table

Curve = tuple[list[float | int | str], list[Cell]]
Axis = tuple[str, AxisConfig]


def curves(sweep: SweepConfig, table: Table, folder: Path) -> Iterator[Picture]:
    """A picture for each axis and each pair, drawn into `folder`."""
    for axis in sweep.axes.items():
        yield _curves(table, axis, folder)
    for a, b in sweep.grid:
        yield _field(table, (a, sweep.axes[a]), (b, sweep.axes[b]), folder)


def _curves(table: Table, swept: Axis, folder: Path) -> Picture:
    name, config = swept
    made, axes = figure(len(table.columns), 1 + 2.5 * len(table.columns), 2.8)
    for i, (column, axis) in enumerate(zip(table.columns, axes, strict=True)):
        values, cells = _curve(table, swept, i)
        places = list(range(len(values)))
        lows = [c.interval.low if c.interval else c.value for c in cells]
        highs = [c.interval.high if c.interval else c.value for c in cells]
        axis.fill_between(places, lows, highs, color=FILL, alpha=0.4, linewidth=0)
        axis.plot(places, [c.value for c in cells], "o-", color=INK, markersize=4, linewidth=1.2)
        axis.set_xticks(places, [str(v) for v in values], fontsize=7, rotation=45 if len(values) > 5 else 0)
        axis.set_xlabel(name, fontsize=8)
        axis.set_title(column.title, fontsize=9)
        axis.tick_params(axis="y", labelsize=8)
    made.suptitle(f"{config.path}: {table.data}", fontsize=10)
    told = f"{name} (`{config.path}`) on {table.data}: means with 95 % intervals"
    file = f"{slug('sweep', name, table.title, table.data)}.png"
    return Picture(save(made, folder, file), told, slug(table.title, table.data))


def _curve(table: Table, swept: Axis, column: int) -> Curve:
    name, config = swept
    found = [(v, table.rows[row][column]) for v in config.values if (row := point((name, v))) in table.rows]
    known = [(v, cell) for v, cell in found if cell is not None]
    return [v for v, _ in known], [cell for _, cell in known]


def _field(table: Table, a: Axis, b: Axis, folder: Path) -> Picture:
    (first, rows), (second, columns) = a, b
    made, axes = figure(len(table.columns), 1.2 + 2.9 * len(table.columns), 1.3 + 0.42 * len(rows.values))
    for i, (column, axis) in enumerate(zip(table.columns, axes, strict=True)):
        values = [[_value(table.rows, point((first, x), (second, y)), i) for y in columns.values] for x in rows.values]
        axis.grid(False)
        image = axis.imshow(values, cmap="Blues", aspect="auto")
        made.colorbar(image, ax=axis, shrink=0.8).ax.tick_params(labelsize=7)
        for r, line in enumerate(values):
            for c, value in enumerate(line):
                axis.text(c, r, _number(value), ha="center", va="center", fontsize=7, color=_on(value, values))
        axis.set_xticks(range(len(columns.values)), [str(v) for v in columns.values], fontsize=7)
        axis.set_yticks(range(len(rows.values)), [str(v) for v in rows.values], fontsize=7)
        axis.set_xlabel(second, fontsize=8)
        axis.set_ylabel(first, fontsize=8)
        axis.set_title(column.title, fontsize=9)
    made.suptitle(f"{first} × {second}: {table.data}", fontsize=10)
    file = f"{slug('grid', first, second, table.title, table.data)}.png"
    told = f"{first} and {second} together on {table.data}"
    return Picture(save(made, folder, file), told, slug(table.title, table.data))


def _value(rows: Mapping[str, Sequence[Cell | None]], name: str, column: int) -> float:
    cell = rows[name][column] if name in rows else None
    return float("nan") if cell is None else cell.value


def _number(value: float) -> str:
    return f"{value:.2f}" if abs(value) < 10 else f"{value:.0f}"


def _on(value: float, values: Sequence[Sequence[float]]) -> str:
    """White on dark fields."""
    known = [v for line in values for v in line if v == v]
    low, high = min(known, default=0.0), max(known, default=1.0)
    return "white" if high > low and (value - low) / (high - low) > 0.6 else "black"
