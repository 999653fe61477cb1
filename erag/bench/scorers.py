"""The selector that asks no model: the card whose node a flat retriever scores best among all of its map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from erag.bench.decisions import Decision
from erag.pipeline.query import Asker
from erag.retrieve.config import FlatConfig
from erag.retrieve.corpus import Corpus, split_sentences
from erag.retrieve.scoring import Batch, LeafScorer, Scores
from erag.retrieve.searches import leaf_scorer


class ByScore:
    """Chooses by the scores of a flat retriever, which are those of the whole map; equal ones by their text."""

    def __init__(self, maps: Sequence[Asker], config: FlatConfig) -> None:
        self._maps, self._config = maps, config
        self._scorers = [self._scorer(asker, asker.corpus) for asker in maps]

    def choose(self, asked: Sequence[Decision], obeying: bool) -> list[int]:
        """The card of each decision; `obeying`: in a map in which the node of one card gives an order."""
        return [self._pick(decision, obeying) for decision in asked]

    def _pick(self, decision: Decision, obeying: bool) -> int:
        asker = self._maps[decision.map]
        batch = Batch((decision.query,), np.asarray(asker.embed([decision.query], "query")))
        cards, scorer = decision.cards, self._scorers[decision.map]
        if obeying:
            cards, scorer = decision.diverting, self._scorer(asker, _changed(asker, decision))
        scores: Scores = scorer.scores(batch)[0][list(decision.rows)]
        return min(range(len(cards)), key=lambda i: (-float(scores[i]), cards[i], i))

    def _scorer(self, asker: Asker, corpus: Corpus) -> LeafScorer:
        return leaf_scorer(corpus, self._config, asker.embedder)


def _changed(asker: Asker, decision: Decision) -> Corpus:
    """The map with the order in the text of one node."""
    corpus, row = asker.corpus, decision.rows[decision.order]
    text = decision.diverting[decision.order]
    texts = (*corpus.texts[:row], text, *corpus.texts[row + 1 :])
    nodes = corpus.node_vectors.copy()
    nodes[row] = asker.embed([text], "document")[0]
    said, _ = split_sentences([text])
    first, last = np.searchsorted(corpus.sentence_rows, [row, row + 1])
    vectors = np.concatenate(
        [corpus.sentence_vectors[:first], asker.embed(said, "document"), corpus.sentence_vectors[last:]]
    )
    rows = np.concatenate([corpus.sentence_rows[:first], np.full(len(said), row), corpus.sentence_rows[last:]])
    return replace(corpus, texts=texts, node_vectors=nodes, sentence_vectors=vectors, sentence_rows=rows)
