"""How well objects and places are named: precision, recall and F1 with bootstrap intervals over images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from erag.evaluate.statistics import Interval, bootstrap, bootstrap_sums

Counts = npt.NDArray[np.int64]  # (n, c, 3) true positives, false positives, false negatives an image and class


@dataclass(frozen=True, slots=True)
class ClassScore:
    """One class: in how many images it is, and how it was named."""

    name: str
    images: int
    precision: float
    recall: float
    f1: float


@dataclass(frozen=True)
class Naming:
    """Figures of a captioner on n images: micro-averaged over all classes, each class, and the place."""

    images: int
    precision: Interval
    recall: Interval
    f1: Interval
    macro_f1: float
    place: Interval
    classes: tuple[ClassScore, ...]


def counted(said: Sequence[frozenset[str]], truth: Sequence[frozenset[str]], names: Sequence[str]) -> Counts:
    """Hits and errors of each image and class of `names`; what is said beyond them does not count."""
    told = np.array([[name in s for name in names] for s in said], bool).reshape(len(said), -1)
    true = np.array([[name in t for name in names] for t in truth], bool).reshape(len(truth), -1)
    return np.stack([told & true, told & ~true, ~told & true], axis=2).astype(np.int64)


def scores(counts: npt.NDArray[np.number]) -> npt.NDArray[np.float64]:
    """(…, 3) precision, recall and F1 of (…, 3) counts; 0 where nothing was said or there was nothing."""
    hits, wrong, missed = np.moveaxis(counts.astype(np.float64), -1, 0)
    parts = [hits / np.maximum(hits + wrong, 1), hits / np.maximum(hits + missed, 1)]
    parts.append(2 * hits / np.maximum(2 * hits + wrong + missed, 1))
    found: npt.NDArray[np.float64] = np.stack(parts, axis=-1)
    return found


def naming(counts: Counts, places: Sequence[bool], names: Sequence[str], samples: int = 1000, seed: int = 0) -> Naming:
    """The figures of `counts` (n, c, 3) and of whether each image's place was named rightly."""
    each = scores(counts.sum(axis=0))
    support = (counts[:, :, 0] + counts[:, :, 2]).sum(axis=0)
    classes = tuple(
        ClassScore(name, int(support[i]), *map(float, each[i])) for i, name in enumerate(names) if support[i]
    )
    macro = float(np.mean([c.f1 for c in classes])) if classes else 0.0
    place = bootstrap([float(right) for right in places], samples=samples, seed=seed)
    return Naming(len(counts), *micro(counts.sum(axis=1), samples, seed), macro, place, classes)


def micro(counts: npt.NDArray[np.int64], samples: int = 1000, seed: int = 0) -> tuple[Interval, Interval, Interval]:
    """Precision, recall and F1 of the sums of (n, 3) counts an image, with intervals over images drawn anew."""
    precision, recall, f1 = bootstrap_sums(counts, scores, samples=samples, seed=seed)
    return precision, recall, f1


def universe(names: Sequence[str], truth: Sequence[frozenset[str]]) -> list[str]:
    """The classes that count: those a captioner is asked for (`names`), and all of the truth."""
    return sorted(set(names).union(*truth))
