"""A judge that compares meanings: how near does a sentence of the ground truth come to the question?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from erag.core.text import sentences
from erag.evaluate.judges.protocol import Floats
from erag.evaluate.truth import Pair
from erag.lm.roles import Embedder

_QUERIES = 32  # questions compared at once: bounds the memory of (sentences, questions) arrays


@dataclass(frozen=True)
class EmbeddingJudge:
    """P = the largest cosine of the question and a sentence of the truth's texts, negative ones 0.

    A cosine ranks, it is no probability: calibrate it (`calibration.Calibrated`). `name` says which embedder,
    `models` its identity. It abstains on a truth without text and on an empty question.
    """

    name: str
    embedder: Embedder
    models: frozenset[str] = frozenset()

    def probabilities(self, pairs: Sequence[Pair]) -> Floats:
        """See `Judge`. Every distinct question and sentence is embedded once."""
        truths = {id(p.truth): p.truth for p in pairs}
        said = {key: tuple(s for text in truth.texts for s in sentences(text)) for key, truth in truths.items()}
        askable = [i for i, p in enumerate(pairs) if p.asked.text.strip() and said[id(p.truth)]]
        out = np.full(len(pairs), np.nan)
        if not askable:
            return out
        questions, spoken = sorted({pairs[i].asked.text for i in askable}), sorted({s for s in said.values() if s})
        found = self._similarities(questions, spoken)
        column, row = ({value: i for i, value in enumerate(values)} for values in (questions, spoken))
        out[askable] = [found[row[said[id(pairs[i].truth)]], column[pairs[i].asked.text]] for i in askable]
        return out

    def _similarities(self, questions: Sequence[str], spoken: Sequence[tuple[str, ...]]) -> Floats:
        """(t, q): the best cosine over the sentences of each of t truths, for each question."""
        distinct = sorted({s for one in spoken for s in one})
        number = {s: i for i, s in enumerate(distinct)}
        order = np.array([number[s] for one in spoken for s in one], np.int64)
        first = np.cumsum([0, *(len(one) for one in spoken[:-1])])
        documents = np.asarray(self.embedder.embed(distinct, "document"), np.float64)
        asked = np.asarray(self.embedder.embed(questions, "query"), np.float64)
        out = np.empty((len(spoken), len(questions)))
        for start in range(0, len(questions), _QUERIES):
            part = slice(start, start + _QUERIES)
            out[:, part] = np.maximum.reduceat((documents @ asked[part].T)[order], first, axis=0)
        return np.clip(out, 0.0, 1.0)
