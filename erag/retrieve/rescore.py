"""Phase 2 by a language model: each leaf that was found is scored on its own (paper, retrieval)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from erag.lm.roles import Scorer
from erag.retrieve.config import RescoreConfig
from erag.retrieve.corpus import Corpus
from erag.retrieve.scoring import Batch, Reached, best_first


class Rescorer:
    """Scores the best of what each query reached, all queries in one call."""

    def __init__(self, corpus: Corpus, scorer: Scorer, config: RescoreConfig) -> None:
        self._corpus, self._scorer, self._config = corpus, scorer, config

    def rescored(self, batch: Batch, reached: Sequence[Reached], least: int) -> list[Reached]:
        """What was reached with new scores: the best `pool` (at least `least`) leaves of each query."""
        kept = [self._kept(r, least) for r in reached]
        pairs = [
            (text, self._corpus.texts[row])
            for text, r, rows in zip(batch.texts, reached, kept, strict=True)
            for row in r.rows[rows]
        ]
        scores = self._scorer.score(pairs) if pairs else np.empty(0, np.float32)
        parts = np.split(scores, np.cumsum([len(rows) for rows in kept])[:-1])
        weight = np.float32(self._config.weight)
        return [
            Reached(r.rows[rows], (1 - weight) * r.scores[rows] + weight * said, r.visited)
            for r, rows, said in zip(reached, kept, parts, strict=True)
        ]

    def _kept(self, reached: Reached, least: int) -> np.ndarray:
        """Places (p,) of the leaves that are scored, in the order of their rows."""
        pool = len(reached.rows) if self._config.pool is None else max(self._config.pool, least)
        return np.sort(best_first(reached.scores, reached.rows)[:pool])
