"""From logits to chances, and how well a score ranks pairs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize
from scipy.stats import rankdata

from erag.evaluate.statistics import Interval, drawn_interval

Floats = npt.NDArray[np.float64]
_LEAST_SLOPE = 1e-3


def platt(logits: Floats, right: Floats) -> tuple[float, float]:
    """Slope (> 0) and offset for which slope × logit + offset is the log-odds of being right (Platt, 1999)."""
    rate = float(np.clip(right.mean(), 1e-6, 1 - 1e-6))

    def loss(at: Floats) -> float:
        odds = at[0] * logits + at[1]
        return float(np.mean(np.logaddexp(0, odds) - right * odds))

    found = minimize(loss, np.array([1.0, np.log(rate / (1 - rate))]), method="Nelder-Mead")
    return max(float(found.x[0]), _LEAST_SLOPE), float(found.x[1])


def area(scores: Floats, right: Floats) -> float:
    """The area under the ROC curve: how often a right pair scores above a wrong one, ties counting half."""
    positive = int(right.sum())
    negative = len(right) - positive
    if not positive or not negative:
        return float("nan")
    ranks = rankdata(scores)
    return float((ranks[right > 0].sum() - positive * (positive + 1) / 2) / (positive * negative))


def areas(scores: Floats, right: Floats, groups: Sequence[str], samples: int, seed: int = 0) -> Interval:
    """The area with its 95 % bootstrap interval; whole groups are drawn."""
    names, member = np.unique(np.asarray(groups), return_inverse=True)
    order = np.argsort(member, kind="stable")
    parts = np.split(order, np.cumsum(np.bincount(member))[:-1])

    def draw(rng: np.random.Generator) -> float:
        rows = np.concatenate([parts[i] for i in rng.integers(len(names), size=len(names))])
        return area(scores[rows], right[rows])

    return drawn_interval(area(scores, right), draw, samples, seed)
