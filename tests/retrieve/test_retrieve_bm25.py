"""BM25 against the formula, and its words."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from retrieve_worlds import corpus_of, embed, random_corpus, random_queries

from erag.core.text import singular, words
from erag.core.types import Observation, Pose, Query
from erag.data.contract import read_queries
from erag.data.registry import read
from erag.retrieve.bm25 import Bm25Scorer
from erag.retrieve.config import Bm25Config, RetrieveConfig
from erag.retrieve.corpus import Corpus
from erag.retrieve.engine import Retriever
from erag.retrieve.scoring import NOT_FOUND, Batch


def scores_of(corpus: Corpus, text: str, **config: object) -> list[float]:
    scorer = Bm25Scorer(corpus, Bm25Config.model_validate(config))
    return [float(s) for s in scorer.scores(Batch((text,), embed([text])))[0]]


def by_formula(texts: list[str], query: str, k1: float, b: float) -> list[float]:
    """Lucene's BM25 over the texts that are not empty, divided by the best."""
    documents = {i: [singular(w) for w in words(t)] for i, t in enumerate(texts) if t}
    mean = sum(map(len, documents.values())) / len(documents)
    raw = [0.0] * len(texts)
    for token in (singular(w) for w in words(query)):
        holding = sum(token in d for d in documents.values())
        idf = math.log(1 + (len(documents) - holding + 0.5) / (holding + 0.5))
        for i, document in documents.items():
            tf = Counter(document)[token]
            raw[i] += idf * tf / (tf + k1 * (1 - b + b * len(document) / mean))
    best = max(raw)
    return [s / best if s > 0 else float(NOT_FOUND) for s in raw]


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([(1.5, 0.75), (0.9, 0.4)]))
def test_scores_equal_the_formula(seed: int, parameters: tuple[float, float]) -> None:
    corpus, (k1, b) = random_corpus(seed), parameters
    for query in random_queries(seed)[0]:
        expected = by_formula(list(corpus.texts), query.text or "", k1, b)
        assert scores_of(corpus, query.text or "", k1=k1, b=b) == pytest.approx(expected, abs=1e-5)


def test_unknown_words_find_nothing() -> None:
    assert scores_of(caption_corpus("A bench.", "A tree."), "zeppelin quokka") == [-1.0, -1.0]


def test_a_map_without_words_finds_nothing() -> None:
    assert scores_of(caption_corpus("", "..."), "bench") == [-1.0, -1.0]
    assert scores_of(caption_corpus(), "bench") == []


def test_the_best_node_scores_one_and_nodes_without_a_common_word_are_not_found() -> None:
    found = scores_of(caption_corpus("A bench and a bench.", "A bench by a very long road.", "Trees.", ""), "benches")
    assert found[0] == 1.0
    assert 0 < found[1] < 1
    assert found[2:] == [-1.0, -1.0]


def test_stop_words_are_dropped_on_demand() -> None:
    corpus = caption_corpus("This is where I was.", "A bench.")
    assert scores_of(corpus, "where is it")[0] == 1.0
    assert scores_of(corpus, "where is it", stop_words="english") == [-1.0, -1.0]


def test_indexing_and_asking_are_silent(capfd: pytest.CaptureFixture[str]) -> None:
    scores_of(caption_corpus("A bench.", "A tree."), "bench")
    assert capfd.readouterr() == ("", "")


@pytest.mark.shared
def test_bm25_on_the_street_view_map(shared: Path) -> None:
    """25 explicit queries name what they seek, and words alone find it; 14 implicit ones do not."""
    reading = read(shared / "data" / "cmu_500" / "topological_map.gml", "auto")
    corpus = corpus_of(reading.observations, frame=reading.frame)
    retriever = Retriever(corpus, RetrieveConfig(retriever=Bm25Config()))
    lines = [q.raw for q in read_queries(shared / "queries" / "dev.jsonl", {"environment": "cmu_500"}) if q.raw]
    for kind, published in (("explicit", 1.00), ("implicit", 0.14)):
        asked = [line for line in lines if line["kind"] == kind]
        found = retriever.retrieve([Query(str(line["query"])) for line in asked], embed([""] * len(asked)))
        first = [f.hits[0].node in line["relevant"] for f, line in zip(found, asked, strict=True) if f.hits]
        assert sum(first) / len(asked) == pytest.approx(published, abs=0.04)


def caption_corpus(*captions: str) -> Corpus:
    return corpus_of([Observation(f"n{i}", "place", Pose(i, 0), caption=c or None) for i, c in enumerate(captions)])
