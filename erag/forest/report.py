"""How a forest was built: cuts, sizes and work per level, as values and as lines for a terminal."""

from __future__ import annotations

import statistics
from dataclasses import dataclass
from typing import Literal

BAR = 40  # characters of the longest bar


@dataclass(frozen=True, slots=True)
class LevelReport:
    """One level: `rows` that were clustered, the `sizes` (in members) of its clusters, `carried` rows that joined none.

    `theta` in metres. `cut` is the height on 1 − S of the highest merge, before clusters above the size limit were
    split. `pairs` were examined on the dense or sparse `path` in `passes` passes; `complete` is False when `max_passes`
    ended the search below the wanted cut.
    """

    level: int
    theta: float
    rows: int
    sizes: tuple[int, ...]
    carried: int
    cut: float
    path: Literal["dense", "sparse"]
    pairs: int
    passes: int
    complete: bool = True

    @property
    def clusters(self) -> int:
        return len(self.sizes)

    @property
    def mean_size(self) -> float:
        return statistics.fmean(self.sizes)

    @property
    def median_size(self) -> float:
        return statistics.median(self.sizes)


@dataclass(frozen=True, slots=True)
class ForestReport:
    """The whole build: α, whether θ was derived from the map, base nodes, levels, number of roots."""

    alpha: float
    theta_auto: bool
    leaves: int
    levels: tuple[LevelReport, ...]
    roots: int

    def lines(self) -> list[str]:
        """A table of levels and a histogram of the sizes of level 1; at most 80 characters wide."""
        nodes = " · ".join(f"{n:,}" for n in (self.leaves, *(level.clusters for level in self.levels)))
        how = "from the map" if self.theta_auto else "given"
        head = [f"nodes per level  {nodes}", f"roots {self.roots:,}   α {self.alpha:g}   θ {how}"]
        if not self.levels:
            return head
        title = f"{'level':>5} {'rows':>9} {'clusters':>9} {'carried':>8} {'θ m':>7} {'cut':>6}   "
        return [
            *head,
            f"{title}members min/median/mean/max",
            *(_level_line(level) for level in self.levels),
            *self._notes(),
            *_histogram(self.levels[0]),
        ]

    def _notes(self) -> list[str]:
        sparse = [
            f"level {level.level}: {level.pairs:,} close pairs in {level.passes} passes instead of a full matrix"
            for level in self.levels
            if level.path == "sparse"
        ]
        short = [
            f"level {level.level}: stopped at cut {level.cut:.3f}, forest.max_passes {level.passes} were used up"
            for level in self.levels
            if not level.complete
        ]
        return sparse + short


def _level_line(level: LevelReport) -> str:
    sizes = f"{min(level.sizes)} / {level.median_size:g} / {level.mean_size:.1f} / {max(level.sizes)}"
    left = f"{level.level:>5} {level.rows:>9,} {level.clusters:>9,} {level.carried:>8,}"
    return f"{left} {level.theta:>7.4g} {level.cut:>6.3f}   {sizes}"


def _histogram(level: LevelReport) -> list[str]:
    """Sizes of the clusters of a level in powers of two: 2–3, 4–7, 8–15, …"""
    exponents = [size.bit_length() - 1 for size in level.sizes]
    counts = [exponents.count(e) for e in range(1, max(exponents) + 1)]
    lines = [f"members per cluster, level {level.level}"]
    for e, count in enumerate(counts, 1):
        bar = "█" * round(BAR * count / max(counts)) or ("▏" if count else "")
        lines.append(f"{f'{2**e}–{2 ** (e + 1) - 1}':>11}  {bar} {count:,}")
    return lines
