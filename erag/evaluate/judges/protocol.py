"""What a judge is, and the votes of a panel of judges (paper: cross-voting of five models, the mean of their votes)."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from erag.core.errors import BadModelOutput, InputError
from erag.evaluate.truth import Pair

Floats = npt.NDArray[np.float64]


class Judge(Protocol):
    """Gives the probability that what a question asks is found at an answer, from ground truth alone.

    `name` stands in tables; `models` are the identities (`LMBackend.identity`) of the models it asks, none for a rule.
    """

    @property
    def name(self) -> str: ...

    @property
    def models(self) -> frozenset[str]: ...

    def probabilities(self, pairs: Sequence[Pair]) -> Floats:
        """(n,) float64 in [0, 1], or NaN where the truth has nothing this judge reads. Pairs do not affect each other.

        Raises BadModelOutput when a model answers badly.
        """
        ...


@dataclass(frozen=True, eq=False)
class Votes:
    """The votes of j judges on n pairs: `values` (n, j) float64, NaN for an abstention; `models` a judge's models."""

    judges: tuple[str, ...]
    models: tuple[frozenset[str], ...]
    values: Floats

    def __post_init__(self) -> None:
        expected = (len(self.values), len(self.judges))
        if len(set(self.judges)) != len(self.judges) or self.values.shape != expected:
            raise ValueError(f"votes of shape {self.values.shape} by the judges {self.judges}")
        bad = ~np.isnan(self.values) & ~((self.values >= 0) & (self.values <= 1))
        if bad.any():
            raise ValueError(f"a vote of {self.values[bad][0]} lies outside [0, 1]")

    def mean(self, without: Collection[str] = ()) -> Floats:
        """(n,) the mean vote of the judges not named in `without`; NaN where all of them abstain.

        Raises InputError when a name is no judge's or none is left.
        """
        unknown = sorted(set(without) - set(self.judges))
        kept = [i for i, name in enumerate(self.judges) if name not in without]
        if unknown or not kept:
            what = f"no judge {unknown[0]!r}" if unknown else "no judge is left"
            raise InputError(what, where="panel", allowed=", ".join(self.judges) or "a panel of one or more judges")
        votes = self.values[:, kept]
        cast = ~np.isnan(votes)
        count = cast.sum(axis=1)
        total = np.where(cast, votes, 0.0).sum(axis=1)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    def probability(self, without: Collection[str] = ()) -> Floats:
        """P(Q|A) (n,): the mean vote. Raises InputError when nobody voted on a pair: that is no 0."""
        mean = self.mean(without)
        if np.isnan(mean).any():
            where = int(np.isnan(mean).argmax())
            raise InputError(
                f"nobody voted on {int(np.isnan(mean).sum())} of {len(mean)} pairs, the first is number {where}",
                where="panel", allowed="ground truth for every node that may be answered, read by one judge at least",
            )  # fmt: skip
        return mean

    def sharing(self, models: Collection[str]) -> tuple[str, ...]:
        """The judges that ask one of `models`, those of the evaluated run: to be marked, and left out once."""
        used = set(models)
        return tuple(name for name, own in zip(self.judges, self.models, strict=True) if own & used)

    def sensitivity(self, run_models: Collection[str] = ()) -> dict[str, Floats]:
        """The mean vote (n,) of `all` judges, `without the run's models` where any shares one, and without each.

        Rows that would leave no judge are left out.
        """
        rows = {"all": self.mean()}
        shared = self.sharing(run_models)
        if shared and len(shared) < len(self.judges):
            rows["without the run's models"] = self.mean(shared)
        if len(self.judges) > 1:
            rows |= {f"without {name}": self.mean((name,)) for name in self.judges}
        return rows


@dataclass(frozen=True)
class Panel:
    """Judges that vote on the same pairs, none knowing of the others."""

    judges: tuple[Judge, ...]

    def vote(self, pairs: Sequence[Pair]) -> Votes:
        """The votes on `pairs` (n,). Raises BadModelOutput when a judge answers with another number of votes."""
        columns = [np.asarray(judge.probabilities(pairs), np.float64) for judge in self.judges]
        for judge, column in zip(self.judges, columns, strict=True):
            if column.shape != (len(pairs),):
                raise BadModelOutput(f"{column.shape} votes", where=judge.name, allowed=f"{len(pairs)}, one a pair")
        values = np.stack(columns, axis=1) if columns else np.empty((len(pairs), 0))
        return Votes(tuple(j.name for j in self.judges), tuple(j.models for j in self.judges), values)
