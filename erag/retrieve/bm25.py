"""The lexical retriever: BM25 over the words of the texts, by bm25s."""

from __future__ import annotations

import numpy as np

from erag.core.text import singular, words
from erag.retrieve.config import Bm25Config
from erag.retrieve.corpus import Corpus
from erag.retrieve.scoring import NOT_FOUND, Batch, Scores


class Bm25Scorer:
    """Words in common with the query. A query's best node scores 1, a node without a common word is not found.

    The index holds the nodes that have a text and is made once.
    """

    def __init__(self, corpus: Corpus, config: Bm25Config) -> None:
        from bm25s import BM25
        from bm25s.stopwords import STOPWORDS_EN_PLUS

        self._stop = frozenset(STOPWORDS_EN_PLUS if config.stop_words == "english" else ())
        self._nodes, self._rows = len(corpus.texts), np.flatnonzero(corpus.searchable)
        self._vocabulary: dict[str, int] = {}
        documents = [self._ids(corpus.texts[row]) for row in self._rows]
        self._index = BM25(k1=config.k1, b=config.b)
        if self._vocabulary:
            self._index.index((documents, self._vocabulary), create_empty_token=False, show_progress=False)

    def scores(self, batch: Batch) -> Scores:
        """(q, n): the BM25 score divided by the query's best; `NOT_FOUND` where no word is shared."""
        out = np.full((len(batch), self._nodes), NOT_FOUND, np.float32)
        for row, text in enumerate(batch.texts):
            known = [self._vocabulary[t] for t in self._tokens(text) if t in self._vocabulary]
            if known:
                found = self._index.get_scores_from_ids(known)
                out[row, self._rows] = np.where(found > 0, found / found.max(), NOT_FOUND)
        return out

    def _ids(self, text: str) -> list[int]:
        """The tokens of a document as numbers, new ones added to the vocabulary in the order they come."""
        return [self._vocabulary.setdefault(token, len(self._vocabulary)) for token in self._tokens(text)]

    def _tokens(self, text: str) -> list[str]:
        return [singular(word) for word in words(text) if word not in self._stop]
