"""The retrieval rules of RAPTOR, GraphRAG and LightRAG over our forest: by hand, and what must hold of any corpus."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from retrieve_worlds import corpus_of, random_corpus, random_queries

from erag.core.types import Cluster, Forest, Observation, Pose, Query
from erag.retrieve.collapsed import CollapsedSearch
from erag.retrieve.community import CommunitySearch, communities
from erag.retrieve.config import CollapsedConfig, CommunityConfig, DualConfig, RetrieveConfig
from erag.retrieve.corpus import Corpus
from erag.retrieve.dual import DualSearch, in_turn
from erag.retrieve.engine import Retriever
from erag.retrieve.rows import UNWRITTEN, ForestRows, distinct, placed, within_budget
from erag.retrieve.scoring import Batch, FlatSearch

KINDS = {"collapsed": CollapsedConfig, "community": CommunityConfig, "dual": DualConfig}


def at(*cosines: float) -> np.ndarray:
    """(n, 2) unit rows with these cosines to (1, 0)."""
    return np.array([(c, (1 - c * c) ** 0.5) for c in cosines], np.float32)


def hand_made(leaves: list[float], clusters: list[tuple[list[int], float, str]], words: int = 1) -> Corpus:
    """Leaves and clusters by their cosine to the query (1, 0); clusters hold rows, and lie a level above them."""
    n = len(leaves)
    nodes = [Observation(f"n{i}", "place", Pose(i, 0), caption=" ".join(["w"] * words)) for i in range(n)]
    parent, level = [-1] * (n + len(clusters)), [0] * n
    for number, (rows, _, _) in enumerate(clusters):
        level.append(1 + max(level[row] for row in rows))
        for row in rows:
            parent[row] = n + number
    made = tuple(
        Cluster(f"c{i}", level[n + i], tuple(f"n{r}" for r in rows), (0.0, 0.0, 0.0), 0.0, summary=text)
        for i, (rows, _, text) in enumerate(clusters)
    )
    vectors = at(*leaves, *(c for _, c, _ in clusters))
    forest = Forest(tuple(o.id for o in nodes), made, np.array(parent), np.array(level), vectors)
    plain = corpus_of(nodes)
    return replace(
        plain, forest=forest, node_vectors=vectors[:n], sentence_vectors=vectors[:n], summary_vectors=vectors[n:]
    )


BATCH = Batch(("q",), at(1.0))
ALL = np.ones((1, 5), np.bool_)
# n0 n1 | n2 n3 | n4 alone: the first cluster fits best, then n2, then the second cluster
TWO = hand_made([0.1, 0.3, 0.8, 0.2, 0.5], [([0, 1], 0.9, "s"), ([2, 3], 0.6, "s")])


def order(search, batch: Batch = BATCH, eligible: np.ndarray = ALL) -> list[int]:
    """The leaves found, best first."""
    (found,) = search.search(batch, eligible)
    assert found.rows.tolist() == sorted(found.rows.tolist())
    return [int(r) for r in found.rows[np.argsort(-found.scores)]]


def test_the_collapsed_tree_takes_leaves_and_clusters_as_they_come() -> None:
    search = CollapsedSearch(TWO, CollapsedConfig())
    assert search.select(BATCH, ALL)[0].tolist() == [5, 2, 6, 4, 1, 3, 0]
    assert order(search) == [1, 0, 2, 3, 4]
    assert search.search(BATCH, ALL)[0].visited == 7


def test_the_collapsed_tree_stops_before_what_does_not_fit() -> None:
    costs = ForestRows(TWO, "summary").tokens
    assert costs.tolist() == [1] * 7
    assert order(CollapsedSearch(TWO, CollapsedConfig(tokens=2))) == [1, 0, 2]
    dear = hand_made([0.1, 0.3, 0.8, 0.2, 0.5], [([0, 1], 0.9, "s" * 400), ([2, 3], 0.6, "s")])
    assert order(CollapsedSearch(dear, CollapsedConfig(tokens=50))) == []  # as theirs: the first one is too long


def test_rows_with_nothing_below_cost_nothing() -> None:
    eligible = np.array([[False, False, True, True, True]])
    assert order(CollapsedSearch(TWO, CollapsedConfig(tokens=1)), eligible=eligible) == [2]


def test_a_cluster_without_a_summary_costs_a_usual_one() -> None:
    bare = hand_made([0.1, 0.3], [([0, 1], 0.9, "")])
    assert ForestRows(bare, "summary").tokens.tolist() == [1, 1, UNWRITTEN]


def test_communities_are_rated_and_those_rated_0_dropped() -> None:
    search = CommunitySearch(TWO, CommunityConfig())
    assert search.reports.tolist() == [4, 5, 6]  # the loose leaf stands for itself
    assert order(search) == [1, 0, 2, 3, 4]
    assert order(CommunitySearch(TWO, CommunityConfig(tokens=1))) == [1, 0]
    useless = hand_made([0.9, 0.8, 0.1, 0.2, 0.3], [([0, 1], 0.004, "s"), ([2, 3, 4], 0.006, "s")])
    assert order(CommunitySearch(useless, CommunityConfig())) == [4, 3, 2]
    assert CommunitySearch(TWO, CommunityConfig()).search(BATCH, ALL)[0].visited == 7


def test_a_model_may_rate_the_reports() -> None:
    class Second:
        def rate(self, batch: Batch, reports: np.ndarray) -> np.ndarray:
            assert reports.tolist() == [4, 5, 6]
            return np.array([[0, 20, 90]] * len(batch))

    assert order(CommunitySearch(TWO, CommunityConfig(), Second())) == [2, 3, 1, 0]

    class Wrong:
        def rate(self, batch: Batch, reports: np.ndarray) -> np.ndarray:
            return np.array([[0, 20, 190]])

    with pytest.raises(ValueError, match="integers from 0 to 100"):
        CommunitySearch(TWO, CommunityConfig(), Wrong()).search(BATCH, ALL)


def test_communities_of_a_level_stand_for_every_leaf_once() -> None:
    """c0 = {n0, n1} on level 1, c1 = {c0, n2} on level 2, n3 a root."""
    steps = hand_made([0.1, 0.1, 0.1, 0.1], [([0, 1], 0.5, "s"), ([4, 2], 0.5, "s")])
    assert communities(steps.forest, 1).tolist() == [3, 4, 5]
    assert communities(steps.forest, 2).tolist() == communities(steps.forest, 9).tolist() == [3, 5]


def test_two_levels_are_merged_in_turn() -> None:
    """Specific: n2 .8, n4 .5, n1 .3 (the rest below .25). Thematic: c0 .9 brings n1, n0, then c1 n2, n3."""
    search = DualSearch(TWO, DualConfig(threshold=0.25))
    assert order(search) == [2, 1, 4, 0, 3]
    assert order(DualSearch(TWO, DualConfig(threshold=0.25, related=1))) == [2, 1, 4]
    assert order(DualSearch(TWO, DualConfig(threshold=0.25, top_k=1))) == [2, 1, 0]
    assert order(DualSearch(TWO, DualConfig(threshold=0.25, tokens=2))) == [2, 1]
    assert order(DualSearch(TWO, DualConfig(threshold=0.95))) == []


def test_a_model_may_name_the_keywords() -> None:
    class Crosswise:
        def vectors(self, batch: Batch) -> tuple[np.ndarray, np.ndarray]:
            return batch.vectors, np.array([[0.0, 1.0]], np.float32)  # themes at right angles: c1 is nearer now

    assert order(DualSearch(TWO, DualConfig(threshold=0.25, related=1, top_k=1), Crosswise())) == [2]
    assert order(DualSearch(TWO, DualConfig(threshold=0.25, related=2, top_k=1), Crosswise())) == [2, 3]


def test_lists_by_hand() -> None:
    assert in_turn(np.array([1, 2, 3]), np.array([7])).tolist() == [1, 7, 2, 3]
    assert in_turn(np.array([], np.int64), np.array([7, 8])).tolist() == [7, 8]
    assert distinct([np.array([3, 1]), np.array([1, 2, 3])]).tolist() == [3, 1, 2]
    assert distinct([]).tolist() == []
    assert within_budget(np.array([2, 0, 1]), np.array([5, 1, 3]), 8).tolist() == [2, 0]
    found = placed(np.array([4, 2]), 9)
    assert (found.rows.tolist(), found.visited) == ([2, 4], 9)
    assert found.scores == pytest.approx([61 / 62, 1.0])


@pytest.mark.parametrize("kind", KINDS)
@given(seed=st.integers(0, 10_000), budget=st.integers(1, 400))
def test_what_holds_of_any_corpus(kind: str, seed: int, budget: int) -> None:
    corpus = random_corpus(seed)
    queries, vectors = random_queries(seed)
    retriever = Retriever(corpus, RetrieveConfig(retriever=KINDS[kind](tokens=budget)))
    found = retriever.retrieve(queries, vectors)
    for one in found:
        nodes = [hit.node for hit in one.hits]
        assert len(set(nodes)) == len(nodes) <= 5
        assert all(corpus.texts[corpus.topomap.row[node]] for node in nodes)
        assert all(0 < hit.score <= 1 for hit in one.hits)
    for query, vector, one in zip(queries, vectors, found, strict=True):
        assert retriever.retrieve([query], vector[None])[0] == one  # a query alone is the query in a batch
    dated = [replace(q, since=200.0, until=600.0) for q in queries]
    for one in retriever.retrieve(dated, vectors):
        times = [corpus.topomap.nodes[corpus.topomap.row[h.node]].time for h in one.hits]
        assert all(time is not None and time.overlaps(200.0, 600.0) for time in times)


@pytest.mark.parametrize("kind", KINDS)
@given(seed=st.integers(0, 10_000), tokens=st.integers(1, 200), more=st.integers(0, 200))
def test_a_larger_context_keeps_what_a_smaller_one_found(kind: str, seed: int, tokens: int, more: int) -> None:
    corpus = random_corpus(seed)
    queries, vectors = random_queries(seed)
    batch = Batch(tuple(q.text or "" for q in queries), vectors)
    eligible = np.tile(corpus.searchable, (len(queries), 1))
    searches = {"collapsed": CollapsedSearch, "community": CommunitySearch, "dual": DualSearch}
    small, large = (
        searches[kind](corpus, KINDS[kind](tokens=t)).search(batch, eligible) for t in (tokens, tokens + more)
    )
    for less, all_ in zip(small, large, strict=True):
        assert set(less.rows) <= set(all_.rows)
        kept = np.isin(all_.rows, less.rows)
        assert all_.scores[kept] == pytest.approx(less.scores)  # and in the same places


@pytest.mark.parametrize("kind", KINDS)
def test_an_empty_map_has_no_answer(kind: str) -> None:
    retriever = Retriever(corpus_of([]), RetrieveConfig(retriever=KINDS[kind]()))
    (found,) = retriever.retrieve([Query("a bench")], np.ones((1, 12), np.float32))
    assert (found.hits, found.visited) == ((), 0)


def test_a_search_made_elsewhere_is_asked() -> None:
    class Last:
        def scores(self, batch: Batch) -> np.ndarray:
            return np.tile(np.arange(5, dtype=np.float32) / 5, (len(batch), 1))

    retriever = Retriever(TWO, RetrieveConfig(), search=FlatSearch(Last(), 5))
    (found,) = retriever.retrieve([Query("q")], at(1.0))
    assert [hit.node for hit in found.hits] == ["n4", "n3", "n2", "n1", "n0"]
