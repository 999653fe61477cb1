"""How far judges agree with labels: AUC and calibration, over all pairs and over the head of a ranking."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.stats import rankdata

from erag.evaluate.judges.protocol import Floats, Votes
from erag.evaluate.statistics import Interval, bootstrap

PANEL = "panel"
TOP = 50
BINS = 10
Labels = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Bin:
    """Pairs whose vote lies in [`low`, `high`): how many, their mean vote, and the share of them that is right."""

    low: float
    high: float
    pairs: int
    vote: float
    share: float


@dataclass(frozen=True, slots=True)
class Agreement:
    """One judge (or the panel) on a set of pairs it voted on: `pairs`, of which `positives` are labelled right.

    `auc` is over all pairs at once, `query_auc` the mean of the queries that have both labels, with its interval over
    queries; None where there is no such query. `brier` is the mean squared error, `ece` the expected calibration error
    over ten bins. `over` says which pairs, `abstained` how many of them the judge left out.
    """

    judge: str
    over: str
    pairs: int
    positives: int
    auc: float | None
    query_auc: Interval | None
    brier: float
    ece: float
    bins: tuple[Bin, ...]
    abstained: int

    def line(self) -> str:
        """The agreement in one line."""
        auc = "none" if self.auc is None else f"{self.auc:.3f}"
        by_query = "none" if self.query_auc is None else str(self.query_auc)
        return (
            f"{self.judge:<24} {self.over:<8} {self.pairs:7d} pairs ({self.positives} right, {self.abstained} "
            f"abstained)  AUC {auc}, by query {by_query}  Brier {self.brier:.3f}  ECE {self.ece:.3f}"
        )


def auc(votes: Floats, labels: Labels) -> float | None:
    """The chance that a right pair has the higher vote than a wrong one, ties ½ (Mann-Whitney); None without both.

    Votes (n,) without NaN.
    """
    right, wrong = int(labels.sum()), int((~labels).sum())
    if not right or not wrong:
        return None
    ranks = rankdata(votes)
    return float((ranks[labels].sum() - right * (right + 1) / 2) / (right * wrong))


def reliability(votes: Floats, labels: Labels, bins: int = BINS) -> tuple[Bin, ...]:
    """The non-empty of `bins` equal bins of [0, 1], the last one closed."""
    number = np.minimum((votes * bins).astype(np.int64), bins - 1)
    made = []
    for i in np.unique(number):
        inside = number == i
        vote, share = float(votes[inside].mean()), float(labels[inside].mean())
        made.append(Bin(int(i) / bins, (int(i) + 1) / bins, int(inside.sum()), vote, share))
    return tuple(made)


def calibration_error(bins: Sequence[Bin]) -> float:
    """The expected calibration error: |mean vote − share right| over bins, weighted by their pairs; 0 without pairs."""
    pairs = sum(b.pairs for b in bins)
    return sum(b.pairs * abs(b.vote - b.share) for b in bins) / pairs if pairs else 0.0


def agreement(judge: str, over: str, votes: Floats, labels: Labels, queries: Sequence[str]) -> Agreement | None:
    """The agreement of votes (n,) with labels (n,), pairs of one of `queries` (n,) together; None without a vote."""
    known = ~np.isnan(votes)
    if not known.any():
        return None
    cast, right = votes[known], labels[known]
    asked = np.array(list(queries), dtype=np.str_)[known]
    by_query = [auc(cast[asked == q], right[asked == q]) for q in np.unique(asked)]
    both = [value for value in by_query if value is not None]
    bins = reliability(cast, right)
    return Agreement(
        judge=judge,
        over=over,
        pairs=len(cast),
        positives=int(right.sum()),
        auc=auc(cast, right),
        query_auc=bootstrap(both) if both else None,
        brier=float(((cast - right) ** 2).mean()),
        ece=calibration_error(bins),
        bins=bins,
        abstained=int((~known).sum()),
    )


def panel_agreement(
    votes: Votes, labels: Labels, queries: Sequence[str], places: npt.NDArray[np.int64], top: int = TOP
) -> list[Agreement]:
    """Every judge's agreement and the panel's, over `all` pairs and over the `top` places of each query's ranking.

    `labels` (n,), `queries` (n,) and `places` (n,) belong to the pairs of `votes`; places count from 1. What nobody
    voted on is left out.
    """
    columns = {name: votes.values[:, i] for i, name in enumerate(votes.judges)} | {PANEL: votes.mean()}
    asked, made = np.array(list(queries), dtype=np.str_), []
    for over, kept in (("all", np.ones(len(labels), np.bool_)), (f"top {top}", places <= top)):
        for name, column in columns.items():
            found = agreement(name, over, column[kept], labels[kept], asked[kept].tolist())
            made.extend([found] if found else [])
    return made
