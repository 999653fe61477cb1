"""The descent against a recursive reference, and what it can never lose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from retrieve_worlds import DIM, corpus_of, embed, random_corpus, random_queries

from erag.core.types import Cluster, Forest, IntArray, Observation, Pose, Query
from erag.retrieve.config import (
    Bm25Config,
    FlatConfig,
    FusionConfig,
    NodeConfig,
    RetrieveConfig,
    SentenceConfig,
    TreeConfig,
)
from erag.retrieve.corpus import Corpus
from erag.retrieve.engine import Found, Retriever
from erag.retrieve.scoring import Batch
from erag.retrieve.spans import leaf_spans
from erag.retrieve.tree import Choice

SEEDS = st.integers(0, 10_000)
FLAT: tuple[FlatConfig, ...] = (NodeConfig(), SentenceConfig(), Bm25Config(), FusionConfig())
ALL = 1000  # more hits than any map here has nodes


def retrieve(corpus: Corpus, seed: int, retriever: TreeConfig | FlatConfig, top: int = ALL) -> list[Found]:
    queries, vectors = random_queries(seed, top=top)
    return Retriever(corpus, RetrieveConfig(retriever=retriever)).retrieve(queries, vectors)


@settings(max_examples=40, deadline=None)
@given(SEEDS, st.sampled_from(FLAT), st.integers(1, 4), st.sampled_from(["all", "best"]))
def test_with_evidence_alone_the_flat_winner_comes_first(seed: int, flat: FlatConfig, k: int, leaves: str) -> None:
    corpus = random_corpus(seed)
    tree = TreeConfig(branches=k, evidence=1.0, scores=flat, leaves=leaves)  # type: ignore[arg-type]
    for found, expected in zip(retrieve(corpus, seed, tree), retrieve(corpus, seed, flat, top=1), strict=True):
        assert [h.node for h in found.hits[:1]] == [h.node for h in expected.hits]
        assert [h.score for h in found.hits[:1]] == [h.score for h in expected.hits]


@settings(max_examples=40, deadline=None)
@given(SEEDS, st.sampled_from(FLAT), st.integers(1, 4), st.sampled_from(["sum", "product"]), st.floats(0, 1))
def test_where_it_is_located_the_flat_winner_from_there_comes_first(
    seed: int, flat: FlatConfig, k: int, location: str, weight: float
) -> None:
    corpus, (queries, vectors) = random_corpus(seed), random_queries(seed, top=1)
    queries = [replace(query, at=Pose(3.0 * i, 40.0)) for i, query in enumerate(queries)]

    def first(retriever: TreeConfig | FlatConfig) -> list[list[tuple[str, float]]]:
        given = {"retriever": retriever, "location": location, "alpha_rank": weight, "pool": "all"}
        found = Retriever(corpus, RetrieveConfig.model_validate(given)).retrieve(queries, vectors)
        return [[(hit.node, hit.score) for hit in f.hits] for f in found]

    assert first(TreeConfig(branches=k, evidence=1.0, scores=flat, located=True)) == first(flat)


@settings(max_examples=20, deadline=None)
@given(SEEDS, st.sampled_from(FLAT), st.floats(0, 1))
def test_with_every_branch_open_the_tree_is_the_flat_search(seed: int, flat: FlatConfig, evidence: float) -> None:
    corpus = random_corpus(seed)
    tree = TreeConfig(branches=ALL, evidence=evidence, scores=flat)
    found, expected = retrieve(corpus, seed, tree), retrieve(corpus, seed, flat)
    assert [[h.node for h in f.hits] for f in found] == [[h.node for h in f.hits] for f in expected]


def descent(corpus: Corpus, vector: np.ndarray, k: int, leaves: str) -> tuple[set[int], int]:
    """The paper's phase 1 in plain words: rows reached and rows looked at by one query."""
    forest, n = corpus.forest, corpus.forest.n_leaves
    spoken = corpus.summary_vectors.any(axis=1, keepdims=True)
    vectors = np.vstack([corpus.node_vectors, np.where(spoken, corpus.summary_vectors, forest.embeddings[n:])])

    def has_text(row: int) -> bool:
        return bool(corpus.texts[row]) if row < n else any(has_text(int(r)) for r in forest.children[row])

    def open_(rows: Sequence[int]) -> tuple[set[int], int]:
        rows = [row for row in rows if has_text(row)]
        judged = rows if leaves == "best" else [row for row in rows if row >= n]
        best = sorted(judged, key=lambda row: -float(vectors[row].astype(float) @ vector.astype(float)))[:k]
        reached = {row for row in (best if leaves == "best" else rows) if row < n}
        looked = set(judged) | reached
        parts = [open_([int(r) for r in forest.children[row]]) for row in best if row >= n]
        return reached.union(*(p[0] for p in parts)), len(looked) + sum(p[1] for p in parts)

    return open_([int(r) for r in forest.roots])


@settings(max_examples=40, deadline=None)
@given(SEEDS, st.sampled_from([NodeConfig(), SentenceConfig()]), st.integers(1, 4), st.sampled_from(["all", "best"]))
def test_without_evidence_it_is_the_descent_of_the_paper(seed: int, flat: FlatConfig, k: int, leaves: str) -> None:
    corpus, (queries, vectors) = random_corpus(seed), random_queries(seed, top=ALL)
    tree = TreeConfig(branches=k, evidence=0.0, scores=flat, leaves=leaves)  # type: ignore[arg-type]
    found = retrieve(corpus, seed, tree)
    scores = [{h.node: h.score for h in f.hits} for f in retrieve(corpus, seed, flat)]
    for q in range(len(queries)):
        reached, looked = descent(corpus, vectors[q], k, leaves)
        assert {h.node for h in found[q].hits} == {f"n{row}" for row in reached}
        assert all(h.score == pytest.approx(scores[q][h.node], abs=1e-6) for h in found[q].hits)
        assert found[q].visited == looked


@settings(max_examples=20, deadline=None)
@given(SEEDS, st.sampled_from([0.0, 0.5, 1.0]), st.sampled_from(FLAT))
def test_a_batch_answers_as_its_queries_do_alone(seed: int, evidence: float, flat: FlatConfig) -> None:
    corpus, (queries, vectors) = random_corpus(seed), random_queries(seed, 35)
    retriever = Retriever(corpus, RetrieveConfig(retriever=TreeConfig(evidence=evidence, scores=flat)))
    together = retriever.retrieve(queries, vectors)
    alone = [retriever.retrieve([q], v[None])[0] for q, v in zip(queries, vectors, strict=True)]
    assert together == alone


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_spans_are_the_leaves_below_each_cluster(seed: int) -> None:
    forest = random_corpus(seed).forest
    spans, n = leaf_spans(forest), forest.n_leaves
    below: dict[int, set[int]] = {i: set() for i in range(len(forest.clusters))}
    for leaf in range(n):
        for cluster in forest.path(leaf)[:-1]:
            below[int(cluster[1:])].add(leaf)
    assert [set(spans.leaves[a:b]) for a, b in zip(spans.start, spans.end, strict=True)] == list(below.values())
    ranks = np.random.default_rng(seed).integers(0, n + 1, (3, n))
    lowest = spans.lowest(ranks)
    assert np.array_equal(lowest[:, :n], ranks)
    assert all((lowest[:, n + c] == ranks[:, sorted(rows)].min(axis=1)).all() for c, rows in below.items())


def test_clusters_without_leaves_are_passed_by() -> None:
    nodes = [node("a", "bench"), node("b", "river")]
    clusters = (cluster("empty", summary="bench"), cluster("full", "a", "b"))
    parents, levels = np.array([3, 3, -1, -1]), np.array([0, 0, 1, 1])
    forest = Forest(("a", "b"), clusters, parents, levels, np.zeros((4, DIM), np.float32))
    corpus, query = corpus_of(nodes, forest), Query("bench")
    for evidence in (0.0, 0.5):
        tree = TreeConfig(branches=1, evidence=evidence, scores=NodeConfig())
        found = Retriever(corpus, RetrieveConfig(retriever=tree)).retrieve([query], embed(["bench"]))[0]
        assert [h.node for h in found.hits] == ["a", "b"]
        assert found.hits[0].path == ("full", "a")
        assert found.visited == 3


def test_evidence_saves_what_a_summary_forgot() -> None:
    """The bench lies in a cluster whose summary does not speak of it."""
    corpus = two_clusters(("a bench", "grass"), "grass hill", ("a river", "a bicycle"), "bench lamp")
    first = {}
    for evidence in (0.0, 1.0):
        tree = TreeConfig(branches=1, evidence=evidence, scores=NodeConfig())
        found = Retriever(corpus, RetrieveConfig(retriever=tree)).retrieve([Query("bench")], embed(["bench"]))[0]
        first[evidence] = (found.hits[0].path[0], found.hits[0].node == "n0", found.visited)
    assert first == {0.0: ("c1", False, 4), 1.0: ("c0", True, 6)}


def test_a_cluster_without_summary_is_judged_by_its_mean() -> None:
    corpus = two_clusters(("bench", "grass"), "", ("river", "bicycle"), "lamp")
    vectors = embed(["grass", "lamp"])
    for kind, second in (("summary", "c1"), ("mean", closest_mean(corpus, vectors[1]))):
        tree = TreeConfig(branches=1, evidence=0.0, scores=NodeConfig(), cluster_embedding=kind)  # type: ignore[arg-type]
        found = Retriever(corpus, RetrieveConfig(retriever=tree)).retrieve([Query("grass"), Query("lamp")], vectors)
        assert [f.hits[0].path[0] for f in found] == ["c0", second]


def closest_mean(corpus: Corpus, vector: np.ndarray) -> str:
    return ("c0", "c1")[int((corpus.forest.embeddings[4:] @ vector).argmax())]


@dataclass
class LastFirst:
    """A judge that takes the last candidates, and remembers what it was asked."""

    asked: list[tuple[str, list[int]]] = field(default_factory=list)

    def choose(self, batch: Batch, choices: Sequence[Choice], k: int) -> list[IntArray]:
        self.asked += [(batch.texts[c.query], c.rows.tolist()) for c in choices]
        return [c.rows[::-1][:k] for c in choices]


def test_a_judge_decides_instead_of_the_scores() -> None:
    corpus, judge = two_clusters(("bench", "grass"), "bench", ("river", "lamp"), "river"), LastFirst()
    tree = TreeConfig(branches=1, scores=NodeConfig(), leaves="best")
    retriever = Retriever(corpus, RetrieveConfig(retriever=tree), judge=judge)
    found = retriever.retrieve([Query("bench")], embed(["bench"]))[0]
    assert [h.node for h in found.hits] == ["n3"]
    assert judge.asked == [("bench", [4, 5]), ("bench", [2, 3])]
    assert found.visited == 4


def node(name: str, caption: str) -> Observation:
    return Observation(name, "place", Pose(0, 0), caption=caption)


def cluster(name: str, *members: str, summary: str = "") -> Cluster:
    return Cluster(name, 1, members, (0.0, 0.0, 0.0), 0.0, summary=summary)


def two_clusters(first: tuple[str, str], summary0: str, second: tuple[str, str], summary1: str) -> Corpus:
    """Nodes n0 n1 in cluster c0, n2 n3 in cluster c1, both roots."""
    texts = (*first, *second)
    clusters = (cluster("c0", "n0", "n1", summary=summary0), cluster("c1", "n2", "n3", summary=summary1))
    means = embed([" ".join(first), " ".join(second)])
    forest = Forest(
        ("n0", "n1", "n2", "n3"),
        clusters,
        np.array([4, 4, 5, 5, -1, -1]),
        np.array([0, 0, 0, 0, 1, 1]),
        np.vstack([embed(texts), means]),
    )
    return corpus_of([node(f"n{i}", text) for i, text in enumerate(texts)], forest)
