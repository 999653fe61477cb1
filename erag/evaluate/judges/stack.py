"""A stack: the votes of several judges made into one probability by a logistic regression fitted on other questions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from scipy.optimize import minimize
from scipy.special import expit, logit

from erag.core.errors import InputError
from erag.evaluate.judges.protocol import Floats, Votes

_EDGE = 0.02  # votes of 0 and 1 have a logit of about ±4: a rule's certainty must not drown the others
RIDGE = 1e-2  # of the mean loss: columns that say the same share their weight
Labels = npt.NDArray[np.bool_]


class Stack(BaseModel):
    """P = σ(intercept + Σ weight · (logit vote − mean) / deviation), by judge; an abstention adds nothing.

    `fitted_on` says on which questions.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    judges: tuple[str, ...] = Field(min_length=1)
    weights: tuple[float, ...]
    means: tuple[float, ...]
    deviations: tuple[float, ...]
    intercept: float
    fitted_on: str = ""

    @model_validator(mode="after")
    def _lengths(self) -> Stack:
        if not len(self.judges) == len(self.weights) == len(self.means) == len(self.deviations):
            raise ValueError("a stack needs a weight, a mean and a deviation for each judge")
        if any(d <= 0 for d in self.deviations):
            raise ValueError("deviations must be above 0")
        return self

    def probabilities(self, votes: Votes) -> Floats:
        """(n,) in [0, 1], NaN where all its judges abstain. Raises InputError for a judge that is missing."""
        missing = sorted(set(self.judges) - set(votes.judges))
        if missing:
            raise InputError(f"no judge {missing[0]!r}", where="stack", allowed=", ".join(votes.judges))
        columns = votes.values[:, [votes.judges.index(name) for name in self.judges]]
        x = (_logits(columns) - np.array(self.means)) / np.array(self.deviations)
        z = self.intercept + np.where(np.isnan(x), 0.0, x) @ np.array(self.weights)
        return np.where(np.isnan(columns).all(axis=1), np.nan, expit(z))

    def save(self, path: Path) -> None:
        """Write the stack as JSON."""
        path.write_text(self.model_dump_json(indent=1) + "\n", encoding="utf-8")


def read_stack(path: Path) -> Stack:
    """The stack of a file. Raises InputError for anything else."""
    try:
        return Stack.model_validate_json(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, ValidationError) as error:
        raise InputError(f"no stack: {str(error).splitlines()[0]}", where=str(path)) from error


def fit_stack(
    votes: Votes, labels: Labels, judges: Sequence[str], groups: Sequence[str] = (), fitted_on: str = ""
) -> Stack:
    """The stack of greatest likelihood, with a ridge, for votes and labels (n,); every group weighs the same.

    `groups` (n,) names the query of each pair: with it a query with many pairs counts no more than one with few. Raises
    InputError where there are not both labels.
    """
    if not labels.any() or labels.all():
        what = f"{int(labels.sum())} of {len(labels)} pairs are right"
        raise InputError(what, where="stack", allowed="some right and some wrong")
    columns = _logits(votes.values[:, [votes.judges.index(name) for name in judges]])
    known = ~np.isnan(columns)
    means = [float(column[k].mean()) if k.any() else 0.0 for column, k in zip(columns.T, known.T, strict=True)]
    spread = [float(column[k].std()) if k.any() else 1.0 for column, k in zip(columns.T, known.T, strict=True)]
    deviations = [s if s > _EDGE else 1.0 for s in spread]
    x = np.where(known, (columns - means) / deviations, 0.0)
    found = _fitted(x, labels, _weights(groups, len(labels)))
    return Stack(
        judges=tuple(judges), weights=tuple(found[1:].tolist()), means=tuple(means), deviations=tuple(deviations),
        intercept=float(found[0]), fitted_on=fitted_on,
    )  # fmt: skip


def cross_stacked(votes: Votes, labels: Labels, judges: Sequence[str], groups: Sequence[str], folds: int = 5) -> Floats:
    """(n,) what a stack says that was fitted on the other folds, whole `groups` (queries) in a fold.

    Raises InputError for fewer than two groups, or where the other folds lack a label.
    """
    names = sorted(set(groups))
    if len(names) < 2:
        raise InputError(f"{len(names)} groups", where="stack", allowed="two or more queries")
    fold = {name: i % min(folds, len(names)) for i, name in enumerate(names)}
    member = np.array([fold[g] for g in groups], np.int64)
    out, asked = np.full(len(labels), np.nan), np.array(list(groups), dtype=np.str_)
    for one in np.unique(member):
        inside = member == one
        fitted = fit_stack(_rows(votes, ~inside), labels[~inside], judges, asked[~inside].tolist())
        out[inside] = fitted.probabilities(_rows(votes, inside))
    return out


def _rows(votes: Votes, kept: npt.NDArray[np.bool_]) -> Votes:
    return Votes(votes.judges, votes.models, votes.values[kept])


def _fitted(x: Floats, labels: Labels, weights: Floats) -> Floats:
    """(1 + j,) intercept and weights, all weights ≥ 0: a judge that votes higher never makes a place less likely."""
    y = labels.astype(np.float64)

    def loss(at: Floats) -> tuple[float, Floats]:
        z = at[0] + x @ at[1:]
        error = weights * (expit(z) - y)
        value = float((weights * (np.logaddexp(0, z) - y * z)).sum() + RIDGE * (at[1:] ** 2).sum())
        return value, np.concatenate([[error.sum()], x.T @ error + 2 * RIDGE * at[1:]])

    start = np.zeros(1 + x.shape[1])
    bounds = [(None, None), *[(0, None)] * x.shape[1]]
    return np.asarray(minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds).x, np.float64)


def _weights(groups: Sequence[str], n: int) -> Floats:
    """(n,) that sum to 1: every group the same, its pairs alike."""
    if not len(groups):
        return np.full(n, 1 / n)
    counts: Mapping[str, int] = dict(zip(*np.unique(list(groups), return_counts=True), strict=True))
    return np.array([1 / (len(counts) * counts[g]) for g in groups], np.float64)


def _logits(votes: Floats) -> Floats:
    return np.asarray(logit(np.clip(votes, _EDGE, 1 - _EDGE)), np.float64)
