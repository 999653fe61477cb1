"""Flat retrievers against brute force."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from retrieve_worlds import corpus_of, embed, random_corpus, random_queries

from erag.core.text import sentences
from erag.core.types import Observation, Pose
from erag.retrieve.bm25 import Bm25Scorer
from erag.retrieve.config import Bm25Config
from erag.retrieve.corpus import Corpus
from erag.retrieve.flat import NodeScorer, SentenceScorer
from erag.retrieve.fusion import FusionScorer
from erag.retrieve.scoring import NOT_FOUND, Batch, FlatSearch, best_first, similarity

SEEDS = st.integers(0, 10_000)


def batch_of(seed: int, count: int = 5) -> Batch:
    queries, vectors = random_queries(seed, count)
    return Batch(tuple(q.text or "" for q in queries), vectors)


def best_sentence(text: str, vector: np.ndarray) -> float:
    return max(float(embed([s])[0] @ vector) for s in sentences(text))


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_node_and_sentence_scores_equal_brute_force(seed: int) -> None:
    corpus, batch = random_corpus(seed), batch_of(seed)
    nodes, spoken = NodeScorer(corpus).scores(batch), SentenceScorer(corpus).scores(batch)
    for q, vector in enumerate(batch.vectors):
        for row, text in enumerate(corpus.texts):
            if not text:
                assert nodes[q, row] == spoken[q, row] == NOT_FOUND
                continue
            assert nodes[q, row] == pytest.approx(float(embed([text])[0] @ vector), abs=1e-6)
            assert spoken[q, row] == pytest.approx(best_sentence(text, vector), abs=1e-6)


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_a_few_leaves_scored_alone_have_the_scores_of_the_full_scan(seed: int) -> None:
    corpus, batch = random_corpus(seed), batch_of(seed)
    rng = np.random.default_rng(seed)
    queries, rows = rng.integers(0, len(batch), 60), rng.integers(0, len(corpus.texts), 60)
    for scorer in (NodeScorer(corpus), SentenceScorer(corpus)):
        expected = scorer.scores(batch)[queries, rows]
        assert scorer.pair_scores(batch, queries, rows) == pytest.approx(expected, abs=1e-6)


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_scores_of_a_query_do_not_depend_on_its_batch(seed: int) -> None:
    corpus, batch = random_corpus(seed), batch_of(seed, 37)
    parts = (NodeScorer(corpus), SentenceScorer(corpus), Bm25Scorer(corpus, Bm25Config()))
    for scorer in (*parts, FusionScorer(parts, 60.0)):
        together = scorer.scores(batch)
        for q in (0, 15, 16, 36):
            alone = scorer.scores(Batch(batch.texts[q : q + 1], batch.vectors[q : q + 1]))
            assert np.array_equal(alone[0], together[q])


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_fusion_equals_brute_force(seed: int) -> None:
    corpus, batch = random_corpus(seed), batch_of(seed)
    parts = (NodeScorer(corpus), SentenceScorer(corpus), Bm25Scorer(corpus, Bm25Config()))
    fused = FusionScorer(parts, 60.0).scores(batch)
    tables = [part.scores(batch) for part in parts]
    for q in range(len(batch)):
        for row in range(len(corpus.texts)):
            expected = sum(
                1 / (60 + 1 + sum(other > table[q, row] for other in table[q]))
                for table in tables
                if table[q, row] >= 0
            )
            assert fused[q, row] == pytest.approx(expected * 61 / 3 if expected else NOT_FOUND, abs=1e-6)


def test_fusion_of_a_node_that_is_first_everywhere_is_one() -> None:
    corpus = caption_corpus("A red bench.", "A river.", "A hill.")
    parts = (NodeScorer(corpus), SentenceScorer(corpus), Bm25Scorer(corpus, Bm25Config()))
    scores = FusionScorer(parts, 60.0).scores(Batch(("a red bench",), embed(["a red bench"])))
    assert scores[0, 0] == pytest.approx(1.0)
    assert 0 < scores[0, 1] < 1


def test_negative_cosines_score_zero_and_are_still_found() -> None:
    corpus = caption_corpus("bench", "river")
    batch = Batch(("away",), -corpus.node_vectors[:1])
    for scorer in (NodeScorer(corpus), SentenceScorer(corpus)):
        assert scorer.scores(batch)[0].tolist() == [0.0, 0.0]


def test_products_are_plain_cosines_for_any_number_of_queries() -> None:
    rng = np.random.default_rng(0)
    table, vectors = rng.normal(size=(7, 5)).astype(np.float32), rng.normal(size=(33, 5)).astype(np.float32)
    assert similarity(table, vectors) == pytest.approx(vectors @ table.T, abs=1e-5)
    assert similarity(table[:0], vectors).shape == (33, 0)


def test_a_search_returns_only_what_is_eligible_and_counts_the_whole_scan() -> None:
    corpus = caption_corpus("bench", "river", "")
    eligible = np.array([[False, True, True]])
    found = FlatSearch(NodeScorer(corpus), 2).search(Batch(("bench",), embed(["bench"])), eligible)[0]
    assert (found.rows.tolist(), found.visited) == ([1], 2)


def test_best_first_breaks_ties_in_the_order_given() -> None:
    scores, near = np.array([0.5, 0.9, 0.5, 0.5]), np.array([3.0, 0.0, 1.0, 1.0])
    assert best_first(scores, near, np.array([0, 1, 3, 2])).tolist() == [1, 3, 2, 0]


def caption_corpus(*captions: str) -> Corpus:
    return corpus_of([Observation(f"n{i}", "place", Pose(i, 0), caption=c or None) for i, c in enumerate(captions)])
