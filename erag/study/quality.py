"""How well objects and places are named: precision, recall and F1 with bootstrap intervals over images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Counts = npt.NDArray[np.int64]  # (n, c, 3) true positives, false positives, false negatives an image and class


@dataclass(frozen=True, slots=True)
class Measured:
    """A figure with its 95 % interval."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.3f} [{self.low:.3f}, {self.high:.3f}]"


@dataclass(frozen=True, slots=True)
class ClassScore:
    """One class: in how many images it is, and how it was named."""

    name: str
    images: int
    precision: float
    recall: float
    f1: float


@dataclass(frozen=True)
class Quality:
    """Figures of a captioner on n images: micro-averaged over all classes, each class, and the place."""

    images: int
    precision: Measured
    recall: Measured
    f1: Measured
    macro_f1: float
    place: Measured
    classes: tuple[ClassScore, ...]


def counted(said: Sequence[frozenset[str]], truth: Sequence[frozenset[str]], names: Sequence[str]) -> Counts:
    """Hits and errors of each image and class of `names`; what is said beyond them does not count."""
    told = np.array([[name in s for name in names] for s in said], bool).reshape(len(said), -1)
    true = np.array([[name in t for name in names] for t in truth], bool).reshape(len(truth), -1)
    return np.stack([told & true, told & ~true, ~told & true], axis=2).astype(np.int64)


def scores(counts: npt.NDArray[np.integer]) -> npt.NDArray[np.float64]:
    """(…, 3) precision, recall and F1 of (…, 3) counts; 0 where nothing was said or there was nothing."""
    hits, wrong, missed = np.moveaxis(counts.astype(np.float64), -1, 0)
    parts = [hits / np.maximum(hits + wrong, 1), hits / np.maximum(hits + missed, 1)]
    parts.append(2 * hits / np.maximum(2 * hits + wrong + missed, 1))
    found: npt.NDArray[np.float64] = np.stack(parts, axis=-1)
    return found


def quality(
    counts: Counts, places: Sequence[bool], names: Sequence[str], resamples: int = 1000, seed: int = 0
) -> Quality:
    """The figures of `counts` (n, c, 3) and of whether each image's place was named rightly."""
    n = len(counts)
    parts = measured(counts.sum(axis=1), resamples, seed)
    drawn = np.random.default_rng(seed).integers(0, n, (resamples, n))
    right = np.array(places, np.float64)
    each = scores(counts.sum(axis=0))
    support = (counts[:, :, 0] + counts[:, :, 2]).sum(axis=0)
    classes = tuple(
        ClassScore(name, int(support[i]), *map(float, each[i])) for i, name in enumerate(names) if support[i]
    )
    macro = float(np.mean([c.f1 for c in classes])) if classes else 0.0
    return Quality(n, *parts, macro, _measured(float(right.mean()), right[drawn].mean(axis=1)), classes)


def measured(counts: npt.NDArray[np.int64], resamples: int, seed: int = 0) -> tuple[Measured, Measured, Measured]:
    """Precision, recall and F1 of the sums of (n, 3) counts an image, with intervals over images drawn anew."""
    drawn = np.random.default_rng(seed).integers(0, len(counts), (resamples, len(counts)))
    value, spread = scores(counts.sum(axis=0)), scores(counts[drawn].sum(axis=1))  # (3,), (resamples, 3)
    first, second, third = (_measured(float(value[i]), spread[:, i]) for i in range(3))
    return first, second, third


def _measured(value: float, spread: npt.NDArray[np.float64]) -> Measured:
    low, high = np.quantile(spread, (0.025, 0.975))
    return Measured(value, float(low), float(high))


def best_thresholds(
    chances: npt.NDArray[np.float32], truth: npt.NDArray[np.int8], steadiness: float = 20.0
) -> npt.NDArray[np.float64]:
    """For each class the probability from which on F1 is best, for (n, c) `chances` and `truth` (1, 0, -1 unknown).

    Classes seen rarely keep close to the best common threshold: their own counts as much as their examples do against
    `steadiness`.
    """
    grid = np.arange(0.1, 0.91, 0.02)
    known = truth >= 0
    told = chances[None] >= grid[:, None, None]  # (t, n, c)
    hits = (told & (truth == 1)).sum(axis=1)
    wrong = (told & (truth == 0) & known).sum(axis=1)
    missed = (~told & (truth == 1)).sum(axis=1)
    counts = np.stack([hits, wrong, missed], axis=2)  # (t, c, 3)
    common = float(grid[scores(counts.sum(axis=1))[:, 2].argmax()])
    own = grid[scores(counts)[:, :, 2].argmax(axis=0)]
    support = (truth == 1).sum(axis=0)
    chosen: npt.NDArray[np.float64] = (own * support + common * steadiness) / (support + steadiness)
    return chosen
