"""Conditions weighed: not in the view, near, away from, denied by a text, unknown; and nothing where none is set."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from retrieve_worlds import corpus_of

from erag.core.types import Observation, Pose, Query
from erag.lm.compose import compose
from erag.lm.fake import Fake
from erag.lm.roles import LMBackend, Roles
from erag.retrieve.conditions import FLOOR, Conditions, spacing
from erag.retrieve.config import RelevanceConfig, RetrieveConfig
from erag.retrieve.corpus import Corpus
from erag.retrieve.engine import Found, Retriever
from erag.retrieve.lexical import LexicalIndex
from erag.retrieve.scoring import Batch, Scores

STEP = 10.0


class Words:
    """A scorer of 0.8 for a text that has the last word of the query, 0.05 otherwise; it counts its calls."""

    def __init__(self, corpus: Corpus) -> None:
        self._texts, self.calls = corpus.texts, 0

    def scores(self, batch: Batch) -> Scores:
        self.calls += 1
        return np.array([[0.8 if q.split()[-1] in t else 0.05 for t in self._texts] for q in batch.texts], np.float32)


def world(*captions: str) -> Corpus:
    """Nodes in a row, 10 m apart, with the vectors of the fake embedder."""
    nodes = [Observation(f"n{i}", "place", Pose(STEP * i, 0), caption=text) for i, text in enumerate(captions)]
    vectors = Fake().embed(list(captions), "document")
    return replace(
        corpus_of(nodes), node_vectors=vectors, sentence_vectors=vectors, sentence_rows=np.arange(len(captions))
    )


def reader(corpus: Corpus, scorer: Words) -> Conditions:
    return Conditions(corpus, scorer, LexicalIndex(corpus.texts), Fake())


def factors(corpus: Corpus, text: str) -> list[float]:
    batch, _ = reader(corpus, Words(corpus)).read(Batch((text,), Fake().embed([text], "query")), [True])
    assert batch.factors is not None
    return [float(f) for f in batch.factors.by[0]]


def model() -> LMBackend:
    return compose({"m": Fake()}, Roles(dict.fromkeys(("embed", "select", "score", "generate"), "m")))


def ask(corpus: Corpus, *queries: Query, read: bool = True) -> list[Found]:
    backend, config = model(), RetrieveConfig(retriever=RelevanceConfig(uses=False), conditions=read)
    vectors = backend.embed([q.text or "" for q in queries], "query")
    return Retriever(corpus, config, backend=backend).retrieve(list(queries), vectors)


def test_what_is_denied_counts_by_its_probability() -> None:
    found = factors(world("a bench", "a bench and a fountain", "a tree"), "a bench without a fountain")
    assert found == pytest.approx([1 - 0.4 * 0.05, 0.1, 1 - 0.4 * 0.05])


def test_near_falls_and_away_rises_with_the_distance() -> None:
    corpus = world("a fountain", "a bench", "a bench", "a bench")
    near, away = factors(corpus, "a bench near the fountain"), factors(corpus, "a bench away from the fountain")
    reach = 2 * STEP
    assert near == pytest.approx([FLOOR + (1 - FLOOR) * np.exp(-i * STEP / reach) for i in range(4)], abs=1e-6)
    assert away == pytest.approx(
        [(1 - np.exp(-i * STEP / reach)) * (0.1 if i == 0 else 0.98) for i in range(4)], abs=1e-6
    )


def test_a_text_that_denies_a_thing_does_not_show_it() -> None:
    corpus = world("a bench by a road full of cars", "a bench. There are no cars.", "a bench. No dogs, but cars.")
    found = factors(corpus, "a bench without cars")
    assert found[1] == 1.0
    assert max(found[0], found[2]) < 0.2


def test_a_thing_that_nothing_shows_draws_nothing_near() -> None:
    corpus = world("a bench", "a tree")
    text = "a bench near the volcano"
    batch, told = reader(corpus, Words(corpus)).read(Batch((text,), Fake().embed([text], "query")), [True])
    assert batch.factors is not None
    assert (batch.factors.by == 1).all()
    assert told == ["near: volcano (not known here)"]


def test_all_things_of_a_batch_are_scored_in_one_call_and_others_are_left_alone() -> None:
    corpus = world("a bench", "a fountain and cars")
    scorer, texts = Words(corpus), ("a bench", "a bench near the fountain", "a tree without cars or dogs")
    plain = Batch(texts, Fake().embed(texts, "query"))
    batch, told = reader(corpus, scorer).read(plain, [True] * 3)
    assert scorer.calls == 1
    assert batch.texts == ("a bench", "a bench", "a tree")
    assert told == ["", "near: fountain", "not: cars or dogs"]
    assert batch.factors is not None
    assert (batch.factors.by[0] == 1).all()
    assert (batch.vectors[0] == plain.vectors[0]).all()
    assert (plain.vectors == Fake().embed(texts, "query")).all()  # what was handed in is as it was


def test_without_conditions_the_batch_is_handed_back_itself() -> None:
    corpus, text = world("a bench", "a tree"), "a bench near me"
    batch = Batch((text,), Fake().embed([text], "query"))
    assert reader(corpus, scorer := Words(corpus)).read(batch, [True])[0] is batch
    away = Batch(("a bench near the tree",), batch.vectors)
    assert reader(corpus, scorer).read(away, [False])[0] is away
    assert scorer.calls == 0


def test_the_retriever_reads_conditions_and_tells_them() -> None:
    corpus = world("A bench under a tree.", "A bench beside a fountain.", "A lamp.", "A bin.")
    query = Query("a bench without a tree")
    read, unread = ask(corpus, query)[0], ask(corpus, query, read=False)[0]
    assert (read.hits[0].node, unread.hits[0].node) == ("n1", "n0")
    assert "conditions: not: tree" in read.notes
    assert not any(note.startswith("conditions") for note in unread.notes)
    assert read.probability is not None
    assert 0 < read.probability <= 1
    explained = ask(corpus, replace(query, kind="explain"))[0]
    assert explained == unread


def test_conditions_alone_rank_everything_that_meets_them() -> None:
    corpus = world("A road with cars.", "A lamp.", "A bin.")
    found = ask(corpus, Query("somewhere without cars"))[0]
    assert {hit.node for hit in found.hits[:2]} == {"n1", "n2"}
    assert found.hits[1].score > 0.5 > found.hits[2].score


def test_a_query_without_conditions_is_answered_alike_bit_for_bit() -> None:
    corpus = world("A bench under a tree.", "A bench beside a fountain.", "A lamp.", "A bin.")
    plain, other = Query("a bench under a tree"), Query("a bench near the fountain")
    alone = ask(corpus, plain, read=False)[0]
    assert ask(corpus, plain)[0] == alone
    assert ask(corpus, plain, other)[0] == alone


def test_spacing_is_that_of_places() -> None:
    assert spacing(world("a", "b", "c").topomap) == STEP
    assert spacing(world("a").topomap) == 0.0
    doubled = corpus_of([Observation(f"n{i}", "place", Pose(STEP * (i // 2), 0), caption="a") for i in range(6)])
    assert spacing(doubled.topomap) == STEP
