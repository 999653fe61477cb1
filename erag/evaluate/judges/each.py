"""A judge that is shown the listed objects one by one: a small model knows a bench from a list of one thing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from erag.evaluate.judges.protocol import Floats, Judge
from erag.evaluate.truth import NodeTruth, Pair


@dataclass(frozen=True)
class EachJudge:
    """P = the largest vote over the objects seen at a place, each shown as a place where nothing else is.

    A place whose objects nobody listed is shown as it is, one where nothing is seen has P 0.
    """

    judge: Judge

    @property
    def name(self) -> str:
        return f"{self.judge.name}, each"

    @property
    def models(self) -> frozenset[str]:
        return self.judge.models

    def probabilities(self, pairs: Sequence[Pair]) -> Floats:
        """See `Judge`. The judge is called once, with all objects of all pairs."""
        parts = {key: _parts(truth) for key, truth in {id(p.truth): p.truth for p in pairs}.items()}
        counts = [len(parts[id(p.truth)]) for p in pairs]
        votes = self.judge.probabilities([Pair(p.asked, part) for p in pairs for part in parts[id(p.truth)]])
        out, first = np.zeros(len(pairs)), np.cumsum([0, *counts])[:-1]
        spoken = np.flatnonzero(counts)
        if len(spoken):
            out[spoken] = np.fmax.reduceat(np.asarray(votes, np.float64), first[spoken])  # passes over abstentions
        return out


def _parts(truth: NodeTruth) -> tuple[NodeTruth, ...]:
    """The places to be shown, those that read alike once."""
    if truth.objects is None:
        return (truth,)
    alike = {seen.words: seen for seen in truth.seen}
    return tuple(NodeTruth(truth.node, (seen,)) for seen in alike.values())
