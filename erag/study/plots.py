"""Plots of studies, as PNG. This module imports matplotlib; it is itself imported only where one is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from erag.study.front import front

Point = tuple[str, int, float, float]  # name, bytes, loss, speed
_NEAR = 0.02  # of the size, and of the range of losses


def pareto(path: Path, title: str, points: Sequence[Point], knee: str) -> None:
    """Size against loss, the area of a dot by speed, the front as a line and its knee ringed."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter

    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.add_subplot()
    fastest = max(p[3] for p in points)
    axes.scatter(
        [p[1] / 1e6 for p in points], [p[2] for p in points], s=[30 + 220 * p[3] / fastest for p in points],
        alpha=0.55, color="#2a6f97", edgecolors="none", zorder=3,
    )  # fmt: skip
    line = [next(p for p in points if p[0] == name) for name in front({p[0]: (p[1], p[2]) for p in points})]
    axes.plot([p[1] / 1e6 for p in line], [p[2] for p in line], color="#2a6f97", linewidth=1, zorder=2)
    for names, size, loss in _labels(points):
        axes.annotate(names, (size / 1e6, loss), xytext=(7, 6), textcoords="offset points", fontsize=8)
    for _, size, loss, _ in (p for p in points if p[0] == knee):
        axes.scatter([size / 1e6], [loss], s=420, facecolors="none", edgecolors="#c1121f", linewidths=1.6, zorder=4)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 1.5, 2, 3, 5, 7)))
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("file, MB (log)")
    axes.set_ylabel("nats a token of captions (less is better)")
    axes.set_title(f"{title}: size against loss; a dot's area is its speed of writing", fontsize=10)
    axes.grid(alpha=0.3)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=140, metadata={"Software": None})


def _labels(points: Sequence[Point]) -> list[tuple[str, int, float]]:
    """Names where they stand; what lies on another point shares its label."""
    spread = max(p[2] for p in points) - min(p[2] for p in points)
    out: list[tuple[str, int, float]] = []
    for name, size, loss, _ in points:
        same = [i for i, (_, s, at) in enumerate(out) if abs(s / size - 1) < _NEAR and abs(at - loss) <= _NEAR * spread]
        if same:
            names, first, at = out[same[0]]
            out[same[0]] = (f"{names}, {name}", first, at)
        else:
            out.append((name, size, loss))
    return out
