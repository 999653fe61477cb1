"""Figures without the global state of pyplot, in one look."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

OURS, INK, MUTED, PAPER_INK, FILL, GRID = "#0b6e4f", "#1f3a5f", "#8a99ab", "#b0552b", "#9db4cc", "#e6e6e6"
_DPI = 130


@dataclass(frozen=True)
class Picture:
    """A file in the folder of the run, what it shows, and the sheet it stands below."""

    file: str
    told: str
    sheet: str


def figure(columns: int, width: float, height: float, rows: int = 1) -> tuple[Any, list[Any]]:
    """A figure of so many inches and its axes, row by row."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    made = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(made)
    grid = made.subplots(rows, columns, squeeze=False)
    axes = [axis for row in grid for axis in row]
    for axis in axes:
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(axis="x", color=GRID, linewidth=0.7)
        axis.set_axisbelow(True)
    return made, axes


def save(made: Any, folder: Path, name: str) -> str:
    """Write a figure; the same figure gives the same bytes."""
    made.savefig(folder / name, dpi=_DPI, metadata={"Software": None})
    return name
