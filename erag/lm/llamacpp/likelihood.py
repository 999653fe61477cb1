"""Log-probabilities of continuations: logits only where a token of the continuation is due, beginnings read once."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from erag.lm.llamacpp.native import Logits, NativeContext
from erag.lm.llamacpp.plan import Reading, pieces, reading
from erag.lm.textmodel import Likelihood

OUTPUTS = 64  # rows of logits held at once


@dataclass(frozen=True, slots=True)
class Due:
    """The tokens of a prompt (not empty) and those whose probability after it is asked."""

    prompt: tuple[int, ...]
    continuation: tuple[int, ...]

    @property
    def path(self) -> tuple[int, ...]:
        """What the model has to read: all but the last token."""
        return (self.prompt + self.continuation)[:-1]

    @property
    def wanted(self) -> range:
        """The positions of `path` after which a token of the continuation follows."""
        return range(len(self.prompt) - 1, len(self.prompt) + len(self.continuation) - 1)


def likelihoods(context: NativeContext, dues: Sequence[Due]) -> list[Likelihood]:
    """One likelihood a due, same order; each is what it is alone."""
    asked = sorted({due for due in dues if due.continuation}, key=lambda due: (due.path, due.continuation))
    plan = reading([due.path for due in asked], [due.wanted for due in asked])
    due_at: dict[tuple[int, int], list[tuple[int, int]]] = defaultdict(list)  # (step, row) -> (due, token)
    for i, due in enumerate(asked):
        for place, token in zip(plan.at[i], due.continuation, strict=True):
            due_at[place].append((i, token))
    totals = np.zeros(len(asked))
    for place, logits in _logits(context, plan):
        indices, tokens = zip(*due_at[place], strict=True)
        np.add.at(totals, list(indices), log_probabilities(logits, tokens))
    known = {due: float(total) for due, total in zip(asked, totals, strict=True)}
    return [Likelihood(known.get(due, 0.0), len(due.continuation), len(due.prompt)) for due in dues]


def _logits(context: NativeContext, plan: Reading) -> Iterator[tuple[tuple[int, int], Logits]]:
    """(step, row) and logits (v,) of every wanted row, valid until the next."""
    context.clear()
    for s, step in enumerate(plan.steps):
        context.keep(0, step.keep)
        wanted = iter([(s, j) for j, row in enumerate(step.rows) if row.wanted])
        for piece in pieces(step.rows, context.room.batch, context.room.outputs):
            for logits in context.decode(piece):
                yield next(wanted), logits


def log_probabilities(logits: Logits, tokens: Sequence[int]) -> npt.NDArray[np.float64]:
    """log-softmax of logits (v,) at some tokens, in float64."""
    top = float(logits.max())
    mass = np.exp(logits.astype(np.float64) - top).sum()
    return np.asarray(logits[list(tokens)].astype(np.float64) - top - np.log(mass))
