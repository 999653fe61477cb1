"""A judge that is shown the listed objects one by one: a small model knows a bench from a list of one thing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from erag.evaluate.judges.protocol import Floats, Judge
from erag.evaluate.truth import NodeTruth, Pair, SeenObject


@dataclass(frozen=True)
class EachJudge:
    """P = the largest vote over the objects seen at a place, each shown as a place where nothing else is.

    Of an object its class, look and sign are shown, or without `looks` the class alone, of which there are few. Where
    nothing is seen P is 0. Where nobody listed objects the place is shown as it is; without `looks` it abstains.
    """

    judge: Judge
    looks: bool = True

    @property
    def name(self) -> str:
        return f"{self.judge.name}, each"

    @property
    def models(self) -> frozenset[str]:
        return self.judge.models

    def probabilities(self, pairs: Sequence[Pair]) -> Floats:
        """See `Judge`. The judge is called once, with all objects of all pairs."""
        parts = {key: _parts(truth, self.looks) for key, truth in {id(p.truth): p.truth for p in pairs}.items()}
        counts = [len(parts[id(p.truth)]) for p in pairs]
        votes = self.judge.probabilities([Pair(p.asked, part) for p in pairs for part in parts[id(p.truth)]])
        out = np.array([np.nan if p.truth.objects is None else 0.0 for p in pairs], np.float64)
        first = np.cumsum([0, *counts])[:-1]
        spoken = np.flatnonzero(counts)
        if len(spoken):
            out[spoken] = np.fmax.reduceat(np.asarray(votes, np.float64), first[spoken])  # passes over abstentions
        return out


def _parts(truth: NodeTruth, looks: bool) -> tuple[NodeTruth, ...]:
    """The places to be shown, those that read alike once."""
    if truth.objects is None:
        return (truth,) if looks else ()
    alike = {seen.words: seen for seen in (truth.seen if looks else (SeenObject(o.name) for o in truth.seen))}
    return tuple(NodeTruth(truth.node, (seen,)) for seen in alike.values())
