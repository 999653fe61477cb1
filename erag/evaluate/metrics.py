"""Retrieval metrics and their uncertainty: pure functions of ids and numbers."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


def precision_at(hits: Sequence[str], relevant: Collection[str], k: int) -> float:
    """The share of the first k places that hold a relevant node: always divided by k, so missing hits count 0.

    A node that is returned twice counts once. Raises ValueError for k < 1 or no relevant node.
    """
    return len(_found(hits, relevant, k)) / k


def success_at(hits: Sequence[str], relevant: Collection[str], k: int) -> float:
    """1 if any of the first k hits is relevant, else 0. Raises ValueError for k < 1 or no relevant node."""
    return float(bool(_found(hits, relevant, k)))


def reciprocal_rank(hits: Sequence[str], relevant: Collection[str]) -> float:
    """1 / the place of the first relevant hit, 0 if there is none. Raises ValueError for no relevant node."""
    wanted = _wanted(relevant)
    return next((1.0 / place for place, hit in enumerate(hits, start=1) if hit in wanted), 0.0)


def mrr(runs: Sequence[Sequence[str]], relevant: Sequence[Collection[str]]) -> float:
    """The mean reciprocal rank over queries: hits and relevant nodes of each. Raises ValueError for no query."""
    return mean([reciprocal_rank(hits, wanted) for hits, wanted in zip(runs, relevant, strict=True)])


def mean(values: Sequence[float]) -> float:
    """The mean over queries. Raises ValueError for no value or one that is not finite."""
    return float(_finite(values).mean())


@dataclass(frozen=True, slots=True)
class Interval:
    """A mean over queries and the interval `low` to `high` it lies in."""

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.mean:.2f} [{self.low:.2f}, {self.high:.2f}]"


def bootstrap(values: Sequence[float], *, confidence: float = 0.95, samples: int = 2000, seed: int = 0) -> Interval:
    """A percentile bootstrap interval of the mean: queries drawn with replacement, `samples` times.

    The same seed gives the same interval. Raises ValueError for no value, one that is not finite, a confidence outside
    (0, 1) or samples < 1.
    """
    known = _finite(values)
    if not 0 < confidence < 1 or samples < 1:
        raise ValueError(f"confidence {confidence} must lie in (0, 1) and samples {samples} be at least 1")
    rng = np.random.default_rng(seed)
    means = [float(known[rng.integers(len(known), size=len(known))].mean()) for _ in range(samples)]
    low, high = np.quantile(means, [(1 - confidence) / 2, (1 + confidence) / 2])
    return Interval(float(known.mean()), float(low), float(high))


def _found(hits: Sequence[str], relevant: Collection[str], k: int) -> set[str]:
    if k < 1:
        raise ValueError(f"k must be at least 1, got {k}")
    return _wanted(relevant).intersection(hits[:k])


def _wanted(relevant: Collection[str]) -> set[str]:
    if isinstance(relevant, str) or not relevant:
        raise ValueError(f"a query needs a collection of relevant nodes, got {relevant!r}")
    return set(relevant)


def _finite(values: Sequence[float]) -> npt.NDArray[np.float64]:
    known = np.asarray(values, np.float64)
    if known.ndim != 1 or not known.size or not np.isfinite(known).all():
        raise ValueError(f"a mean needs one or more finite values, got {list(values)[:5]}")
    return known
