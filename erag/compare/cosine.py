"""An embedder that selects and scores by the cosine of its vectors: the choice that needs no language model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from erag.lm.roles import Embedder, Model, RoleName, SelectTask, Vectors


class Cosine:
    """The select and score roles of an embedder. A card without text comes last."""

    roles: frozenset[RoleName] = frozenset({"select", "score"})

    def __init__(self, model: Model, embedder: Embedder) -> None:
        self._model, self._embedder = model, embedder

    def identity(self, role: RoleName) -> str:
        return f"{role} by cosine of {self._model.identity('embed')}"

    def fingerprint(self, role: RoleName) -> str:
        return f"{role} by cosine of {self._model.fingerprint('embed')}"

    def batch_size(self, role: RoleName) -> int:
        del role
        return self._model.batch_size("embed")

    def select(self, tasks: Sequence[SelectTask], k: int) -> list[list[int]]:
        """See `Selector`; equal cards in the order of their texts."""
        scores = iter(self.score([(task.query, card) for task in tasks for card in task.cards]))
        return [_best(task, [float(next(scores)) for _ in task.cards], k) for task in tasks]

    def score(self, pairs: Sequence[tuple[str, str]]) -> Vectors:
        """(n,) in [0, 1]: half of one plus the cosine."""
        queries = sorted({query for query, _ in pairs})
        texts = sorted({text for _, text in pairs if text.strip()})
        asked = dict(zip(queries, self._embedder.embed(queries, "query"), strict=True)) if queries else {}
        said = dict(zip(texts, self._embedder.embed(texts, "document"), strict=True)) if texts else {}
        near = [float(asked[query] @ said[text]) if text in said else -1.0 for query, text in pairs]
        return np.clip((1 + np.array(near, np.float32)) / 2, 0, 1)


def _best(task: SelectTask, scores: Sequence[float], k: int) -> list[int]:
    return sorted(range(len(task.cards)), key=lambda i: (-scores[i], task.cards[i], i))[:k]
