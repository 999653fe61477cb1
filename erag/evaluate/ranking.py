"""Retrieval metrics of one query's hits against the nodes that answer it: pure functions of ids."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence

from erag.evaluate.statistics import mean


def precision_at(hits: Sequence[str], relevant: Collection[str], k: int) -> float:
    """The share of the first k places that hold a relevant node: always divided by k, so missing hits count 0.

    A node that is returned twice counts once. Raises ValueError for k < 1 or no relevant node.
    """
    return len(_found(hits, relevant, k)) / k


def recall_at(hits: Sequence[str], relevant: Collection[str], k: int) -> float:
    """The share of the relevant nodes that stand in the first k places. Raises ValueError as `precision_at`."""
    return len(_found(hits, relevant, k)) / len(_wanted(relevant))


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


def ndcg_at(hits: Sequence[str], relevant: Collection[str] | Mapping[str, float], k: int) -> float:
    """nDCG of the first k places: Σ gain / log2(1 + place), divided by that of the best possible order.

    A mapping gives each node its gain (linear, as trec_eval has it), a collection gain 1. A node that is returned twice
    keeps both places and gains once. Raises ValueError for k < 1, no node with a gain above 0, or a gain that is
    negative or not finite.
    """
    gains = _gains(relevant)
    _check_k(k)
    first = dict.fromkeys(hits[:k])
    dcg = sum(gains.get(hit, 0.0) / math.log2(2 + hits.index(hit)) for hit in first)
    ideal = sorted(gains.values(), reverse=True)[:k]
    return float(dcg / sum(gain / math.log2(2 + place) for place, gain in enumerate(ideal)))


def average_precision(hits: Sequence[str], relevant: Collection[str]) -> float:
    """The mean over the relevant nodes of the precision at their place, 0 for one that is not returned.

    A node that is returned twice keeps both places and counts once. Raises ValueError for no relevant node.
    """
    wanted, found, total = _wanted(relevant), set[str](), 0.0
    for place, hit in enumerate(hits, start=1):
        if hit in wanted and hit not in found:
            found.add(hit)
            total += len(found) / place
    return total / len(wanted)


def _found(hits: Sequence[str], relevant: Collection[str], k: int) -> set[str]:
    _check_k(k)
    return _wanted(relevant).intersection(hits[:k])


def _check_k(k: int) -> None:
    if k < 1:
        raise ValueError(f"k must be at least 1, got {k}")


def _wanted(relevant: Collection[str]) -> set[str]:
    if isinstance(relevant, str) or not relevant:
        raise ValueError(f"a query needs a collection of relevant nodes, got {relevant!r}")
    return set(relevant)


def _gains(relevant: Collection[str] | Mapping[str, float]) -> Mapping[str, float]:
    if not isinstance(relevant, Mapping):
        return dict.fromkeys(_wanted(relevant), 1.0)
    if not all(math.isfinite(gain) and gain >= 0 for gain in relevant.values()) or not any(relevant.values()):
        raise ValueError(f"gains must be finite, none negative and one above 0, got {list(relevant.values())[:5]}")
    return relevant
