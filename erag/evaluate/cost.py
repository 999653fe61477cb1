"""What answers cost: seconds, rows visited, model calls and tokens, over the queries of a run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from erag.data.contract import Result
from erag.lm.ledger import Ledger
from erag.lm.roles import Generation


@dataclass(frozen=True, slots=True)
class Tokens:
    """Tokens read and written by generators, and how many texts were cut at their cap."""

    read: int = 0
    written: int = 0
    truncated: int = 0

    @classmethod
    def of(cls, generations: Iterable[Generation]) -> Tokens:
        """The sum over generations."""
        known = list(generations)
        return cls(
            sum(g.tokens_in for g in known), sum(g.tokens_out for g in known), sum(bool(g.truncated) for g in known)
        )

    def __add__(self, other: Tokens) -> Tokens:
        return Tokens(self.read + other.read, self.written + other.written, self.truncated + other.truncated)


@dataclass(frozen=True, slots=True)
class Spread:
    """Mean, median, 95th percentile and largest of what the queries took."""

    mean: float
    median: float
    p95: float
    largest: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """Of one or more values. Raises ValueError for none or one that is negative or not finite."""
        known = np.asarray(values, np.float64)
        if not known.size or not np.isfinite(known).all() or (known < 0).any():
            raise ValueError(f"costs must be finite and not negative, got {list(values)[:5]}")
        return cls(float(known.mean()), float(np.median(known)), float(np.quantile(known, 0.95)), float(known.max()))


@dataclass(frozen=True)
class Cost:
    """The cost of a run: `seconds` and `visited` a query, `calls` by role in all, `tokens` in all, failed queries."""

    queries: int
    seconds: Spread
    visited: Spread
    calls: Mapping[str, int] = field(default_factory=dict)
    tokens: Tokens = Tokens()
    errors: int = 0

    def per_query(self, role: str) -> float:
        """Calls of a role a query."""
        return self.calls.get(role, 0) / self.queries


def cost(results: Sequence[Result], tokens: Tokens = Tokens()) -> Cost:
    """The cost of answered queries; a query that failed is counted and has no other cost. Raises ValueError for none.

    `seconds` are without loading, `calls` without replayed ones, as the results state them.
    """
    answered = [r for r in results if r.error is None]
    calls: Counter[str] = Counter()
    for result in answered:
        calls.update(result.calls)
    return Cost(
        len(answered),
        Spread.of([r.seconds for r in answered]),
        Spread.of([float(r.visited) for r in answered]),
        dict(sorted(calls.items())),
        tokens,
        len(results) - len(answered),
    )


def build_cost(ledger: Ledger, seconds: Mapping[str, float]) -> dict[str, float]:
    """The cost of a build as flat numbers: `seconds` by stage and in all, and computed, replayed, seconds by role."""
    out = {f"seconds.{stage}": float(value) for stage, value in seconds.items()}
    out["seconds"] = float(sum(seconds.values()))
    for role in sorted(set(ledger.calls) | set(ledger.replayed)):
        out |= {
            f"computed.{role}": float(ledger.calls[role]),
            f"replayed.{role}": float(ledger.replayed[role]),
            f"model_seconds.{role}": float(ledger.seconds[role]),
        }
    return out | {f"event.{name}": float(count) for name, count in sorted(ledger.events.items())}
