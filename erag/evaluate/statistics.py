"""Means over queries, their uncertainty, and tests between systems that answered the same queries."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
EXACT_UP_TO = 14  # queries that differ, up to which all 2^n signs are tried
_BLOCK = 1024  # resamples drawn at once by the permutation test


def mean(values: Sequence[float]) -> float:
    """The mean over queries. Raises ValueError for no value or one that is not finite."""
    return float(_finite(values).mean())


@dataclass(frozen=True, slots=True)
class Interval:
    """A figure (mostly a mean over queries or images) and the interval `low` to `high` it lies in."""

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        return self.shown(2)

    def shown(self, digits: int) -> str:
        """The figure and its interval with so many digits behind the point."""
        return f"{self.mean:.{digits}f} [{self.low:.{digits}f}, {self.high:.{digits}f}]"


@dataclass(frozen=True, slots=True)
class Comparison:
    """`system` against `baseline` on the same queries: mean difference with its interval, and how sure it is.

    `p` is the two-sided p-value of the permutation test, `adjusted` the same after Holm's correction over all
    comparisons made together. `wins`, `ties` and `losses` count queries.
    """

    system: str
    baseline: str
    difference: Interval
    p: float
    adjusted: float
    wins: int
    ties: int
    losses: int

    def line(self) -> str:
        """The comparison in one line."""
        sign = self.difference
        return (
            f"{self.system} - {self.baseline}: {sign.mean:+.3f} [{sign.low:+.3f}, {sign.high:+.3f}], p = {self.p:.4f} "
            f"(Holm {self.adjusted:.4f}), {self.wins} wins, {self.ties} ties, {self.losses} losses"
        )


def bootstrap(values: Sequence[float], *, confidence: float = 0.95, samples: int = 2000, seed: int = 0) -> Interval:
    """A percentile bootstrap interval of the mean: queries drawn with replacement, `samples` times.

    The same seed gives the same interval. Raises ValueError for no value, one that is not finite, a confidence outside
    (0, 1) or samples < 1.
    """
    known = _finite(values)

    def draw(rng: np.random.Generator) -> float:
        return float(known[rng.integers(len(known), size=len(known))].mean())

    return _percentiles(float(known.mean()), draw, confidence, samples, seed)


def bootstrap_sums(
    rows: npt.NDArray[np.number],
    figures: Callable[[Floats], Floats],
    *,
    confidence: float = 0.95,
    samples: int = 2000,
    seed: int = 0,
) -> list[Interval]:
    """Percentile bootstrap intervals of figures (k,) of the sums over n items, such as F1 of hits and errors an image.

    `rows` (n, …) are added up over items drawn with replacement; all k figures of a draw come from the same items.
    Raises ValueError for no item, or as `bootstrap`.
    """
    if not len(rows):
        raise ValueError("a figure of sums needs one or more items")
    value = figures(rows.sum(axis=0).astype(np.float64))

    def draw(rng: np.random.Generator) -> Floats:
        return figures(rows[rng.integers(len(rows), size=len(rows))].sum(axis=0).astype(np.float64))

    low, high = _bounds(draw, confidence, samples, seed)
    return [Interval(float(v), float(a), float(b)) for v, a, b in zip(value, low, high, strict=True)]


def clustered_bootstrap(
    values: Sequence[float], groups: Sequence[str], *, confidence: float = 0.95, samples: int = 2000, seed: int = 0
) -> Interval:
    """As `bootstrap`, but whole groups (environments) are drawn, since queries about one place are not independent.

    `groups` names the group of each value. With one group only the interval is a point and says nothing. Raises
    ValueError as `bootstrap`, and for groups that are not as many as values.
    """
    known = _finite(values)
    member = _members(groups, len(known))
    count = np.bincount(member).astype(np.float64)
    total = np.bincount(member, weights=known)

    def draw(rng: np.random.Generator) -> float:
        drawn = rng.integers(len(count), size=len(count))
        return float(total[drawn].sum() / count[drawn].sum())

    return _percentiles(float(known.mean()), draw, confidence, samples, seed)


def paired_bootstrap(
    system: Sequence[float],
    baseline: Sequence[float],
    groups: Sequence[str] | None = None,
    *,
    confidence: float = 0.95,
    samples: int = 2000,
    seed: int = 0,
) -> Interval:
    """The bootstrap interval of the mean difference `system` - `baseline`, query by query; `groups` are drawn whole."""
    differences = list(_differences(system, baseline))
    if groups is None:
        return bootstrap(differences, confidence=confidence, samples=samples, seed=seed)
    return clustered_bootstrap(differences, groups, confidence=confidence, samples=samples, seed=seed)


def permutation_test(
    system: Sequence[float],
    baseline: Sequence[float],
    groups: Sequence[str] | None = None,
    *,
    samples: int = 10_000,
    seed: int = 0,
) -> float:
    """The two-sided p-value of the paired permutation test: were the two interchangeable on each query (signs flipped)?

    With `groups` (environments) the signs of a whole group are flipped together, since its queries are not independent.
    Queries or groups on which both are equal say nothing. Up to 14 others all signs are tried and the value is exact,
    else `samples` random ones are, and it is (1 + as extreme) / (1 + samples), never 0. Raises ValueError for no value,
    one that is not finite, unequal lengths or samples < 1.
    """
    if samples < 1:
        raise ValueError(f"samples {samples} must be at least 1")
    differences = _differences(system, baseline)
    if groups is not None:
        differences = np.bincount(_members(groups, len(differences)), weights=differences).astype(np.float64)
    differences = differences[differences != 0]
    if not len(differences):
        return 1.0
    least = abs(differences.sum()) * (1 - 1e-12)  # sums of the same numbers in another order
    if len(differences) <= EXACT_UP_TO:
        signs = np.array(list(product((-1.0, 1.0), repeat=len(differences))))
        return float((np.abs(signs @ differences) >= least).mean())
    rng, extreme = np.random.default_rng(seed), 0
    for start in range(0, samples, _BLOCK):
        signs = rng.choice((-1.0, 1.0), size=(min(_BLOCK, samples - start), len(differences)))
        extreme += int((np.abs(signs @ differences) >= least).sum())
    return (1 + extreme) / (1 + samples)


def holm(p_values: Mapping[str, float]) -> dict[str, float]:
    """p-values adjusted for several comparisons (Holm, 1979), under the same names and in the same order.

    The i-th smallest of m is multiplied by m - i + 1, never falls below a smaller one's, and is at most 1. Raises
    ValueError for a value outside [0, 1].
    """
    if not all(0 <= p <= 1 for p in p_values.values()):
        raise ValueError(f"p-values must lie in [0, 1], got {dict(p_values)}")
    adjusted, least = dict[str, float](), 0.0
    for place, (name, p) in enumerate(sorted(p_values.items(), key=lambda item: item[1])):
        least = max(least, min(1.0, (len(p_values) - place) * p))
        adjusted[name] = least
    return {name: adjusted[name] for name in p_values}


def compare(
    baseline: str,
    scores: Mapping[str, Sequence[float]],
    groups: Sequence[str] | None = None,
    *,
    samples: int = 10_000,
    seed: int = 0,
) -> list[Comparison]:
    """Every system of `scores` (one value a query, the same queries in the same order) against `baseline`.

    `groups` names the environment of each query, where there are several. Raises KeyError when the baseline is not
    among them, ValueError as `permutation_test`.
    """
    reference = scores[baseline]
    others = [name for name in scores if name != baseline]
    p = {name: permutation_test(scores[name], reference, groups, samples=samples, seed=seed) for name in others}
    adjusted = holm(p)
    made = []
    for name in others:
        differences = _differences(scores[name], reference)
        wins, losses = int((differences > 0).sum()), int((differences < 0).sum())
        interval = paired_bootstrap(scores[name], reference, groups, seed=seed)
        ties = len(differences) - wins - losses
        made.append(Comparison(name, baseline, interval, p[name], adjusted[name], wins, ties, losses))
    return made


def drawn_interval(value: float, draw: Callable[[np.random.Generator], float], samples: int, seed: int = 0) -> Interval:
    """A figure with the 95 % percentile interval of what `draw` gives; draws without a figure (NaN) do not count."""
    rng = np.random.default_rng(seed)
    low, high = np.nanpercentile([draw(rng) for _ in range(samples)], [2.5, 97.5])
    return Interval(value, float(low), float(high))


def _percentiles(
    value: float, draw: Callable[[np.random.Generator], float], confidence: float, samples: int, seed: int
) -> Interval:
    low, high = _bounds(draw, confidence, samples, seed)
    return Interval(value, float(low), float(high))


def _bounds(
    draw: Callable[[np.random.Generator], float | Floats], confidence: float, samples: int, seed: int
) -> tuple[Floats, Floats]:
    """The percentiles that bound what `draw` gives, each of its form."""
    if not 0 < confidence < 1 or samples < 1:
        raise ValueError(f"confidence {confidence} must lie in (0, 1) and samples {samples} be at least 1")
    rng = np.random.default_rng(seed)
    drawn = np.array([draw(rng) for _ in range(samples)])
    low, high = np.quantile(drawn, [(1 - confidence) / 2, (1 + confidence) / 2], axis=0)
    return low, high


def _differences(system: Sequence[float], baseline: Sequence[float]) -> Floats:
    a, b = _finite(system), _finite(baseline)
    if len(a) != len(b):
        raise ValueError(f"{len(a)} values of one system and {len(b)} of the other: not the same queries")
    return a - b


def _members(groups: Sequence[str], values: int) -> npt.NDArray[np.int64]:
    """(n,) the number of each value's group."""
    if len(groups) != values:
        raise ValueError(f"{len(groups)} groups for {values} values")
    return np.unique(np.array(list(groups), dtype=np.str_), return_inverse=True)[1].astype(np.int64)


def _finite(values: Sequence[float]) -> Floats:
    known = np.asarray(values, np.float64)
    if known.ndim != 1 or not known.size or not np.isfinite(known).all():
        raise ValueError(f"a mean needs one or more finite values, got {list(values)[:5]}")
    return known
