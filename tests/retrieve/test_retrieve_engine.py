"""Queries end to end: text, place, sensors, time, and everything that can be wrong with them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from retrieve_worlds import DIM, corpus_of, embed, permuted, random_corpus, random_queries

from erag.core.errors import InputError
from erag.core.geometry import distance
from erag.core.types import Frame, IntArray, Interval, Observation, Pose, Query
from erag.retrieve.config import (
    Bm25Config,
    FusionConfig,
    NodeConfig,
    RelevanceConfig,
    RescoreConfig,
    RetrieveConfig,
    SentenceConfig,
    TreeConfig,
)
from erag.retrieve.corpus import Corpus
from erag.retrieve.engine import Found, Retriever
from erag.retrieve.rows import cluster_vectors

SEEDS = st.integers(0, 10_000)
HERE = Pose(3.0, -4.0)
FLAT = (NodeConfig(), SentenceConfig(), Bm25Config(), FusionConfig())
PROBABLE = RelevanceConfig(uses=False)
RETRIEVERS = (*FLAT, TreeConfig(), TreeConfig(evidence=1.0))
NO_TEXT = np.zeros((1, DIM), np.float32)


def ask(corpus: Corpus, query: Query, **config: object) -> Found:
    retriever = Retriever(corpus, RetrieveConfig.model_validate(config))
    return retriever.retrieve([query], embed([query.text or ""]))[0]


def nodes_of(found: Found) -> list[str]:
    return [hit.node for hit in found.hits]


@settings(max_examples=30, deadline=None)
@given(SEEDS, st.sampled_from((*RETRIEVERS, PROBABLE)), st.booleans(), st.booleans(), st.integers(1, 60))
def test_hits_are_unique_sorted_in_range_and_no_more_than_asked(
    seed: int, retriever: object, located: bool, sensed: bool, top: int
) -> None:
    corpus, (queries, vectors) = random_corpus(seed), random_queries(seed, top=top)
    extra = {"at": HERE if located else None, "sensors": {"ndvi": "low"} if sensed else {}}
    asked = [replace(query, **extra) for query in queries]  # type: ignore[arg-type]
    for found in Retriever(corpus, RetrieveConfig(retriever=retriever)).retrieve(asked, vectors):  # type: ignore[arg-type]
        names, scores = nodes_of(found), [hit.score for hit in found.hits]
        assert len(set(names)) == len(names) <= top
        assert scores == sorted(scores, reverse=True)
        assert all(corpus.texts[corpus.topomap.row[name]] for name in names)
        for hit in found.hits:
            parts = [p for p in (hit.score, hit.semantic, hit.spatial, hit.sensor) if p is not None]
            assert all(0 <= p <= 1 for p in parts)
            assert (hit.semantic is not None, hit.spatial is not None) == (True, located)
            assert hit.path == corpus.forest.path(corpus.topomap.row[hit.node])
            assert hit.position == corpus.topomap.nodes[corpus.topomap.row[hit.node]].pose.xyz


@settings(max_examples=40, deadline=None)
@given(SEEDS, st.sampled_from(FLAT), st.booleans())
def test_the_order_of_the_nodes_matters_only_among_ties(seed: int, retriever: object, located: bool) -> None:
    corpus, (queries, vectors) = random_corpus(seed), random_queries(seed, top=60)
    check_permuted(corpus, [replace(q, at=HERE if located else None) for q in queries], vectors, retriever, seed)


@settings(max_examples=40, deadline=None)
@given(SEEDS, st.sampled_from([0.0, 0.5, 1.0]), st.sampled_from(["all", "best"]))
def test_where_nothing_ties_the_tree_does_not_know_the_order_of_the_nodes(
    seed: int, evidence: float, leaves: str
) -> None:
    corpus, (queries, vectors) = random_corpus(seed, distinct=True), random_queries(seed, top=60)
    assume(not siblings_tie(corpus, vectors))
    tree = TreeConfig(branches=2, evidence=evidence, scores=NodeConfig(), leaves=leaves)  # type: ignore[arg-type]
    check_permuted(corpus, queries, vectors, tree, seed)


def siblings_tie(corpus: Corpus, vectors: np.ndarray) -> bool:
    """Whether two rows below one cluster are as similar to a query: short captions can have one mean."""
    rows = np.concatenate([corpus.node_vectors, cluster_vectors(corpus, "summary")])
    similar, parent = np.round(vectors @ rows.T, 6), corpus.forest.parent
    told = rows.any(axis=1)
    families = [np.flatnonzero(told & (parent == above)) for above in np.unique(parent)]
    return any(len(np.unique(row[family])) < len(family) for row in similar for family in families)


def check_permuted(corpus: Corpus, queries: list[Query], vectors: np.ndarray, retriever: object, seed: int) -> None:
    order = np.random.default_rng(seed).permutation(len(corpus.texts))
    config = RetrieveConfig(retriever=retriever, pool=100)  # type: ignore[arg-type]
    found = Retriever(corpus, config).retrieve(queries, vectors)
    moved = Retriever(permuted(corpus, order), config).retrieve(queries, vectors)
    for one, other in zip(found, moved, strict=True):
        assert [h.score for h in one.hits] == pytest.approx([h.score for h in other.hits], abs=1e-9)
        assert {h.node: h.score for h in one.hits} == pytest.approx({h.node: h.score for h in other.hits}, abs=1e-9)


@settings(max_examples=20, deadline=None)
@given(SEEDS, st.sampled_from(RETRIEVERS))
def test_without_weight_the_location_changes_nothing(seed: int, retriever: object) -> None:
    corpus, (queries, vectors) = random_corpus(seed), random_queries(seed, top=60)
    asker = Retriever(corpus, RetrieveConfig(retriever=retriever, alpha_rank=0.0))  # type: ignore[arg-type]
    plain = asker.retrieve(queries, vectors)
    located = asker.retrieve([replace(q, at=HERE) for q in queries], vectors)
    assert [nodes_of(f) for f in located] == [nodes_of(f) for f in plain]
    assert [[h.score for h in f.hits] for f in located] == [[h.score for h in f.hits] for f in plain]


@settings(max_examples=20, deadline=None)
@given(SEEDS, st.sampled_from(RETRIEVERS), st.integers(1, 20))
def test_with_all_weight_the_pool_is_sorted_by_distance(seed: int, retriever: object, pool: int) -> None:
    corpus, (queries, vectors) = random_corpus(seed), random_queries(seed, top=pool)
    plain = Retriever(corpus, RetrieveConfig(retriever=retriever)).retrieve(queries, vectors)  # type: ignore[arg-type]
    # With so small a theta every spatial score is 0, and distances still decide.
    near = RetrieveConfig(retriever=retriever, alpha_rank=1.0, pool=pool, theta_rank=1e-6)  # type: ignore[arg-type]
    located = Retriever(corpus, near).retrieve([replace(q, at=HERE) for q in queries], vectors)
    for one, other in zip(plain, located, strict=True):
        assert nodes_of(other) == sorted(nodes_of(one), key=lambda name: metres(corpus, name))


def metres(corpus: Corpus, name: str) -> float:
    row = corpus.topomap.row[name]
    return float(distance(corpus.topomap.frame, HERE.xyz, corpus.topomap.positions[row]))


def test_text_and_place_are_weighed() -> None:
    corpus = corpus_of([place("far", 100.0, "bench"), place("near", 10.0, "bench grass")])
    weights = {"retriever": NodeConfig(), "alpha_rank": 0.25, "theta_rank": 50.0}
    hits = {h.node: h for h in ask(corpus, Query("bench", at=Pose(0, 0)), **weights).hits}
    near = hits["near"]
    assert near.spatial == pytest.approx(math.exp(-10 / 50))
    assert near.semantic == pytest.approx(float(embed(["bench"])[0] @ embed(["bench grass"])[0]), abs=1e-6)
    assert near.score == pytest.approx(0.75 * (near.semantic or 0) + 0.25 * (near.spatial or 0))
    assert hits["far"].semantic == pytest.approx(1.0, abs=1e-6)


def test_how_location_counts_follows_from_what_the_scores_are() -> None:
    chance, other = RetrieveConfig(retriever=TreeConfig(scores=RelevanceConfig())), RetrieveConfig()
    assert (chance.form, chance.location_weight, chance.ranked(5, sensed=False)) == ("product", 0.6, None)
    assert (other.form, other.location_weight, other.ranked(60, sensed=False)) == ("sum", 0.2, 60)
    assert chance.ranked(5, sensed=True) == other.ranked(5, sensed=True) == 50  # sensors are added
    assert RetrieveConfig(retriever=RelevanceConfig(), rescore=RescoreConfig()).form == "sum"
    said = RetrieveConfig(retriever=RelevanceConfig(), location="sum", alpha_rank=0.3, pool=7)
    assert (said.form, said.location_weight, said.ranked(5, sensed=False)) == ("sum", 0.3, 7)


@settings(max_examples=30, deadline=None)
@given(SEEDS)
def test_what_is_known_does_not_depend_on_where_the_robot_stands(seed: int) -> None:
    """A located descent passes by what is far; how sure the memory is of an answer stays. Asked alone or in company."""
    corpus, (queries, vectors) = random_corpus(seed), random_queries(seed)
    tree = TreeConfig(branches=1, evidence=1.0, scores=PROBABLE, located=True)
    retriever = Retriever(corpus, RetrieveConfig(retriever=tree, alpha_rank=0.9))
    some = [replace(query, at=HERE) if i % 2 else query for i, query in enumerate(queries)]
    together, blind = retriever.retrieve(some, vectors), retriever.retrieve(queries, vectors)
    assert together == [retriever.retrieve([q], v[None])[0] for q, v in zip(some, vectors, strict=True)]
    assert [found.probability for found in together] == [found.probability for found in blind]


def test_as_a_product_nearness_counts_for_what_answers() -> None:
    corpus = corpus_of([place("far", 100.0, "bench"), place("near", 10.0, "bench grass"), place("here", 0.0, "river")])
    weights = {"retriever": NodeConfig(), "alpha_rank": 0.75, "theta_rank": 50.0, "location": "product"}
    hits = {h.node: h for h in ask(corpus, Query("bench", at=Pose(0, 0)), **weights).hits}
    for hit in hits.values():
        assert hit.score == pytest.approx((hit.semantic or 0) * (0.25 + 0.75 * (hit.spatial or 0)))
    assert next(iter(hits)) == "near"
    alone = ask(corpus, Query(at=Pose(0, 0)), **weights).hits
    assert [h.score for h in alone] == [h.spatial for h in alone]


def test_without_a_pool_all_that_was_reached_is_re_ranked() -> None:
    corpus = corpus_of([place(f"n{i}", 100.0 + i, "bench") for i in range(60)] + [place("near", 1.0, "bench grass")])
    asked = {"retriever": NodeConfig(), "alpha_rank": 0.5}
    assert nodes_of(ask(corpus, Query("bench", at=Pose(0, 0), top=1), **asked)) == ["n0"]
    assert nodes_of(ask(corpus, Query("bench", at=Pose(0, 0), top=1), pool="all", **asked)) == ["near"]


def test_only_the_pool_is_re_ranked() -> None:
    corpus = corpus_of([place("far", 100.0, "bench"), place("near", 1.0, "river")])
    asked = {"retriever": NodeConfig(), "alpha_rank": 1.0}
    assert nodes_of(ask(corpus, Query("bench", at=Pose(0, 0), top=1), pool=1, **asked)) == ["far"]
    assert nodes_of(ask(corpus, Query("bench", at=Pose(0, 0), top=1), pool=2, **asked)) == ["near"]
    assert nodes_of(ask(corpus, Query("bench", at=Pose(0, 0), top=2), pool=1, **asked)) == ["near", "far"]


def test_a_place_alone_ranks_all_that_shows_something_by_distance() -> None:
    nodes = [
        place("captioned", 30.0, "a bench"),
        Observation("named", "object", Pose(20, 0), name="Chair_7"),
        Observation("pictured", "place", Pose(10, 0), image="a.jpg"),
        Observation("bare", "place", Pose(0, 0)),
    ]
    found = ask(corpus_of(nodes), Query(at=Pose(0, 0)), theta_rank=10.0)
    assert nodes_of(found) == ["pictured", "named", "captioned"]
    assert [h.score for h in found.hits] == pytest.approx([math.exp(-1), math.exp(-2), math.exp(-3)])
    assert all(h.semantic is None and h.score == h.spatial for h in found.hits)
    assert found.visited == 3


@dataclass
class Streets:
    """Distances that are twice the straight line, along edges for all but the first node."""

    corpus: Corpus

    def path_or_straight(self, start: Pose, rows: IntArray, /) -> tuple[np.ndarray, np.ndarray]:
        straight = distance(self.corpus.topomap.frame, start.xyz, self.corpus.topomap.positions[rows])
        return np.where(rows > 0, 2 * straight, straight), rows > 0


def test_distances_follow_the_router_and_straight_lines_are_told() -> None:
    corpus = corpus_of([place("a", 15.0, "bench"), place("b", 10.0, "bench")])
    retriever = Retriever(corpus, RetrieveConfig(theta_rank=10.0), Streets(corpus))
    found = retriever.retrieve([Query(at=Pose(0, 0))], NO_TEXT)[0]
    assert [h.spatial for h in found.hits] == pytest.approx([math.exp(-1.5), math.exp(-2)])
    assert nodes_of(found) == ["a", "b"]
    assert found.notes == ("1 of 2 distances are straight lines, not along edges of the map",)


def test_a_sensor_wish_re_ranks_and_a_missing_reading_neither_gains_nor_loses() -> None:
    nodes = [place("lush", 0.0, "grass", ndvi=0.9), place("dry", 0.0, "grass", ndvi=0.1), place("blind", 0.0, "grass")]
    found = ask(corpus_of(nodes), Query("grass", sensors={"ndvi": "low"}), retriever=NodeConfig(), sensor_weight=0.5)
    hits = {h.node: h for h in found.hits}
    assert hits["dry"].score == hits["dry"].sensor == pytest.approx(1.0, abs=1e-6)
    assert (hits["lush"].sensor, hits["lush"].score) == pytest.approx((0.0, 0.5), abs=1e-6)
    assert hits["blind"].sensor is None
    assert hits["blind"].score == hits["blind"].semantic
    assert found.notes == ("1 of 3 hits have no reading of ndvi",)


def test_place_and_sensors_without_text() -> None:
    nodes = [place("near", 1.0, "grass", ndvi=0.9), place("far", 50.0, "grass", ndvi=0.1)]
    asked = Query(at=Pose(0, 0), sensors={"ndvi": "low"})
    assert nodes_of(ask(corpus_of(nodes), asked, sensor_weight=0.0, theta_rank=50.0)) == ["near", "far"]
    assert nodes_of(ask(corpus_of(nodes), asked, sensor_weight=0.9, theta_rank=50.0)) == ["far", "near"]


def test_declared_ranges_are_used_for_ranges_that_are_wished_for() -> None:
    corpus = corpus_of([place("a", 0.0, "grass", ndvi=0.2), place("b", 0.0, "grass", ndvi=0.4)])
    retriever = Retriever(corpus, RetrieveConfig(retriever=NodeConfig()), sensors={"ndvi": (0.0, 1.0)})
    hits = retriever.retrieve([Query("grass", sensors={"ndvi": (0.4, 0.5)})], embed(["grass"]))[0].hits
    assert {h.node: h.sensor for h in hits} == {"a": pytest.approx(0.8), "b": pytest.approx(1.0)}


def test_hours_of_the_day_leave_out_what_was_seen_at_others() -> None:
    nodes = [
        replace(place(n, 0.0, "bench"), time=Interval(h * 3600.0, h * 3600.0)) for n, h in (("dawn", 6), ("noon", 12))
    ]
    found = ask(corpus_of(nodes), Query("bench", hours=(5, 10)), retriever=NodeConfig())
    assert nodes_of(found) == ["dawn"]


def test_another_place_comes_before_a_further_view_unless_it_is_much_worse() -> None:
    texts = {"pond": (0.0, "pond bench"), "bench": (0.8, "bench"), "river": (1.6, "river bench")}
    texts["far"] = (9.0, "hill grass lamp")
    corpus = corpus_of([place(name, *said) for name, said in texts.items()])
    plain = ask(corpus, Query("bench", top=3), retriever=NodeConfig())
    assert nodes_of(plain)[0] == "bench"
    assert "far" not in nodes_of(plain)
    assert plain.notes == ()
    once = ask(corpus, Query("bench", top=2), retriever=NodeConfig(), places={"further": 0.0})
    assert nodes_of(once) == ["bench", "far"]
    assert once.notes == ("left out for other places: 1 further views of these",)
    every = ask(corpus, Query("bench", top=3), retriever=NodeConfig(), places={"further": 1.0})
    assert (nodes_of(every), every.notes) == (nodes_of(plain), ())
    apart = ask(corpus, Query("bench", top=3), retriever=NodeConfig(), places={"metres": 0.5, "further": 0.0})
    assert nodes_of(apart) == nodes_of(plain)


@settings(max_examples=30, deadline=None)
@given(SEEDS, st.sampled_from(RETRIEVERS), st.floats(0, 60), st.sampled_from([0.0, 0.7, 1.0]))
def test_hits_spread_over_places_are_the_best_of_them(
    seed: int, retriever: object, metres: float, further: float
) -> None:
    corpus, (queries, vectors) = random_corpus(seed), random_queries(seed, top=6)
    config = {"retriever": retriever, "pool": 100}
    plain = Retriever(corpus, RetrieveConfig.model_validate(config)).retrieve(queries, vectors)
    config["places"] = {"metres": metres, "further": further}
    spread = Retriever(corpus, RetrieveConfig.model_validate(config)).retrieve(queries, vectors)
    for all_, found in zip(plain, spread, strict=True):
        scores = [hit.score for hit in found.hits]
        assert scores == sorted(scores, reverse=True)
        assert len(found.hits) == len(all_.hits)
        assert nodes_of(found)[:1] == nodes_of(all_)[:1]
        left = set(nodes_of(all_)) - set(nodes_of(found))
        at = {name: corpus.topomap.positions[corpus.topomap.row[name]] for name in (*left, *nodes_of(found))}
        for name in left:
            assert any(math.dist(at[name], at[other]) <= metres for other in nodes_of(found))
        assert further < 1 or not left
        assert bool(left) == any("further views" in note for note in found.notes)


def test_hits_that_an_answer_rests_on_come_first() -> None:
    corpus = corpus_of([place(n, 0.0, text) for n, text in (("a", "bench"), ("b", "bench pond"), ("c", "pond"))])
    retriever = Retriever(corpus, RetrieveConfig(retriever=NodeConfig()))
    hits = retriever.retrieve([Query("bench")], embed(["bench"]))[0].hits
    led = retriever.led(hits, [2, 1], 3)
    assert [h.node for h in led] == ["c", "b", "a"]
    assert [h.score for h in led] == sorted((h.score for h in led), reverse=True)
    assert retriever.led((), [2], 3)[0].path[-1] == "c"


@pytest.mark.parametrize("retriever", RETRIEVERS)
def test_a_time_window_leaves_out_what_lies_outside_and_what_is_unknown(retriever: object) -> None:
    nodes = [place("may", 0.0, "bench"), place("june", 0.0, "bench"), place("some day", 0.0, "bench")]
    nodes[0] = replace(nodes[0], time=Interval(0, 10))
    nodes[1] = replace(nodes[1], time=Interval(10, 20))
    corpus = corpus_of(nodes)
    found = ask(corpus, Query("bench", since=10.0, until=20.0), retriever=retriever)
    assert nodes_of(found) == ["june"]
    assert found.notes == ("1 nodes of unknown time were left out",)
    assert found.visited == 3
    assert nodes_of(ask(corpus, Query("bench", until=10.0), retriever=retriever)) == ["may"]
    assert nodes_of(ask(corpus, Query(at=Pose(0, 0), since=5.0), retriever=retriever)) == ["may", "june"]
    late = ask(corpus, Query("bench", since=20.0), retriever=retriever)
    assert late.hits == ()
    assert late.notes[-1] == "nothing was observed in the time window"


@pytest.mark.parametrize("retriever", RETRIEVERS)
def test_nothing_to_find_is_an_answer_with_a_note(retriever: object) -> None:
    empty, silent = corpus_of([]), corpus_of([Observation("a", "place", Pose(0, 0))])
    for query in (Query("bench"), Query(at=Pose(0, 0)), Query("bench", at=Pose(0, 0), sensors={})):
        assert ask(empty, query, retriever=retriever) == Found((), 0, ("the map is empty",))
    assert ask(silent, Query("bench"), retriever=retriever) == Found((), 0, ("no node of this map has a text",))
    assert ask(silent, Query(at=HERE), retriever=retriever) == Found((), 0, ("no node of this map shows anything",))


def test_unknown_words_are_told() -> None:
    found = ask(corpus_of([place("a", 0.0, "bench")]), Query("zeppelin"), retriever=Bm25Config())
    assert found == Found((), 1, ("no text shares a word with the query",))


@pytest.mark.parametrize(
    ("query", "message"),
    [
        (Query(id="7"), "query 7: neither a text nor a position"),
        (Query("  "), "the query: neither a text nor a position"),
        (Query("bench", top=0), "top is 0; allowed: at least 1"),
        (Query("bench", at=Pose(40.4, -91.0)), "latitude -91"),
        (Query("bench", since=2.0, until=1.0), "since 2.0 > until 1.0"),
        (Query("bench", sensors={"ndvi": "low"}), "no sensor channel 'ndvi'; allowed: none"),
    ],
)
def test_a_query_that_cannot_be_asked_is_refused(query: Query, message: str) -> None:
    corpus = corpus_of([place("a", 0.0, "bench")], frame=Frame.WGS84)
    with pytest.raises(InputError, match=message):
        ask(corpus, query)


def test_in_metres_any_position_will_do() -> None:
    assert nodes_of(ask(corpus_of([place("a", 0.0, "bench")]), Query("bench", at=Pose(0, 1e6)))) == ["a"]


def test_vectors_that_do_not_fit_are_refused() -> None:
    retriever = Retriever(corpus_of([place("a", 0.0, "bench")]), RetrieveConfig())
    with pytest.raises(ValueError, match=r"shape \(1, 3\), expected \(1, 12\)"):
        retriever.retrieve([Query("bench")], np.ones((1, 3), np.float32))
    with pytest.raises(ValueError, match="'bench' came without a vector"):
        retriever.retrieve([Query("bench")], NO_TEXT)
    assert retriever.retrieve([], np.empty((0, DIM), np.float32)) == []


def test_bm25_needs_no_vectors() -> None:
    retriever = Retriever(corpus_of([place("a", 0.0, "bench")]), RetrieveConfig(retriever=Bm25Config()))
    assert nodes_of(retriever.retrieve([Query("bench")], np.empty((1, 0), np.float32))[0]) == ["a"]


def test_a_forest_of_another_map_is_refused() -> None:
    corpus, other = corpus_of([place("a", 0.0, "bench")]), corpus_of([place("b", 0.0, "bench")])
    with pytest.raises(ValueError, match="not the nodes of the map"):
        Retriever(replace(corpus, forest=other.forest), RetrieveConfig())


def test_mixed_batches_keep_their_order() -> None:
    corpus = corpus_of([place("a", 0.0, "bench"), place("b", 50.0, "river")])
    queries = [Query(at=Pose(50, 0)), Query("bench"), Query(at=Pose(0, 0)), Query("river")]
    found = Retriever(corpus, RetrieveConfig()).retrieve(queries, embed(["", "bench", "", "river"]))
    assert [f.hits[0].node for f in found] == ["b", "a", "a", "b"]


@pytest.mark.parametrize(
    "config",
    [
        {"alpha_rank": 1.5},
        {"theta_rank": 0},
        {"theta_rank": "near"},
        {"pool": 0},
        {"retriever": {"kind": "magic"}},
        {"retriever": {"kind": "node", "k": 3}},
        {"retriever": {"kind": "tree", "scores": {"kind": "tree"}}},
        {"retriever": {"kind": "tree", "branches": 0}},
        {"retriever": {"kind": "tree", "evidence": float("nan")}},
    ],
)
def test_a_wrong_configuration_is_refused(config: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        RetrieveConfig.model_validate(config)


def test_configurations_choose_by_kind() -> None:
    raw = {"retriever": {"kind": "tree", "branches": 5, "scores": {"kind": "sentence"}}, "theta_rank": 20}
    config = RetrieveConfig.model_validate(raw)
    assert config.retriever == TreeConfig(branches=5, scores=SentenceConfig())
    assert RetrieveConfig.model_validate_json(config.model_dump_json()) == config


def place(name: str, x: float, caption: str, **sensors: float) -> Observation:
    return Observation(name, "place", Pose(x, 0.0), caption=caption, sensors=sensors)
