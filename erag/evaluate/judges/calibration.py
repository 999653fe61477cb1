"""Votes made into probabilities: Platt's scaling, fitted on labelled pairs of other queries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize
from scipy.special import expit, logit

from erag.core.errors import InputError
from erag.evaluate.judges.protocol import Floats, Judge
from erag.evaluate.truth import Pair

_EDGE = 1e-3  # votes of 0 and 1 have a logit of about ±7
Labels = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Platt:
    """p ↦ σ(`slope` · logit p + `intercept`), `slope` ≥ 0: it never turns a ranking around."""

    slope: float
    intercept: float

    def __call__(self, votes: Floats) -> Floats:
        """Votes (n,) in [0, 1] as probabilities; NaN stays NaN."""
        return np.asarray(expit(self.slope * _logits(votes) + self.intercept), np.float64)


@dataclass(frozen=True)
class Calibrated:
    """A judge whose votes are scaled; its name and models are those of the judge."""

    judge: Judge
    scale: Platt

    @property
    def name(self) -> str:
        return self.judge.name

    @property
    def models(self) -> frozenset[str]:
        return self.judge.models

    def probabilities(self, pairs: Sequence[Pair]) -> Floats:
        """See `Judge`."""
        return self.scale(np.asarray(self.judge.probabilities(pairs), np.float64))


def fit_platt(votes: Floats, labels: Labels) -> Platt:
    """The scaling of greatest likelihood for votes (n,) and labels (n,), abstentions left out (Platt, 1999).

    Labels are drawn towards ½ as Platt does, so that pairs that are told apart perfectly have a finite scaling too.
    Raises InputError where there are not both labels.
    """
    known = ~np.isnan(votes)
    x, right = _logits(votes[known]), labels[known]
    positives, negatives = int(right.sum()), int((~right).sum())
    if not positives or not negatives:
        raise InputError(
            f"{positives} positive and {negatives} negative pairs", where="calibration", allowed="one or more of each"
        )
    target = np.where(right, (positives + 1) / (positives + 2), 1 / (negatives + 2))

    def loss(at: Floats) -> tuple[float, Floats]:
        z = at[0] * x + at[1]
        error = expit(z) - target
        return float((np.logaddexp(0, z) - target * z).mean()), np.array([(error * x).mean(), error.mean()])

    start = np.array([1.0, float(logit(target.mean()))])
    found = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=[(0, None), (None, None)])
    return Platt(float(found.x[0]), float(found.x[1]))


def cross_calibrated(votes: Floats, labels: Labels, groups: Sequence[str], folds: int = 5) -> Floats:
    """Votes (n,) scaled by what was fitted on the other folds, whole `groups` (queries) in a fold.

    Groups are dealt to folds in the order of their names. Raises InputError for fewer than two groups, or where the
    other folds lack a label.
    """
    names = sorted(set(groups))
    if len(names) < 2:
        raise InputError(f"{len(names)} groups", where="calibration", allowed="two or more queries")
    fold = {name: i % min(folds, len(names)) for i, name in enumerate(names)}
    member = np.array([fold[g] for g in groups], np.int64)
    out = np.full(len(votes), np.nan)
    for one in np.unique(member):
        inside = member == one
        out[inside] = fit_platt(votes[~inside], labels[~inside])(votes[inside])
    return out


def _logits(votes: Floats) -> Floats:
    return np.asarray(logit(np.clip(votes, _EDGE, 1 - _EDGE)), np.float64)
