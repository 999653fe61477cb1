"""Facts: what is common and what is distinctive, as counts of views."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.core.types import Edges, Frame, Observation, Pose, TopoMap
from erag.forest.evidence import EvidenceConfig, composed, fact_lines, group, representatives, tokens
from erag.forest.facts import Fact, Facts, FactsConfig, cluster_facts, log_odds
from erag.forest.vocabulary import Vocabulary, map_vocabulary, vocabulary

PARK = "A pond lies in the park, with benches along the path. There are no cars. It is autumn."
STREET = 'Parked cars along the street. A sign reads "No Parking". Tall trees. There are no benches.'
TEXTS = [*[PARK] * 6, *[STREET] * 12, "", "A swimming pool."]


@pytest.fixture(scope="module")
def words() -> Vocabulary:
    return vocabulary(TEXTS)


def shown(facts: tuple[Fact, ...]) -> dict[str, int]:
    return {fact.entry.shown: fact.views for fact in facts}


def rows(*numbers: int) -> np.ndarray:
    return np.array(numbers, np.int64)


def test_facts_count_views(words: Vocabulary) -> None:
    facts = cluster_facts(words, rows(0, 1, 2, 6, 18))
    assert facts.of == 4  # the node without text does not count
    assert facts.noun == "views"
    found = {f.entry.shown: (f.views, f.of) for f in facts}
    assert found["pond"] == (3, 4)
    assert found["autumn"] == (3, 4)
    assert found["benches along path"] == (3, 4)
    assert all(0 < f.views <= f.of for f in facts)


def test_what_is_denied_is_no_fact(words: Vocabulary) -> None:
    park = shown(cluster_facts(words, rows(*range(6))).common)
    street = shown(cluster_facts(words, rows(*range(6, 18))).common)
    assert not {"cars", "parked cars"} & set(park)
    assert "benches" in park
    assert "benches" not in street
    assert street["parked cars"] == 12


def test_distinctive_is_what_the_rest_of_the_map_has_less_of(words: Vocabulary) -> None:
    facts = cluster_facts(words, rows(*range(6)), FactsConfig(common=1))
    assert shown(facts.distinctive)
    assert all(f.z > 1.64 for f in facts.distinctive)
    assert cluster_facts(words, np.arange(len(TEXTS))).distinctive == ()  # nothing is outside the whole map


def test_nothing_is_told_twice(words: Vocabulary) -> None:
    facts = cluster_facts(words, rows(*range(6, 18)))
    told = [set(f.entry.words) for f in (*facts.common, *facts.distinctive)]
    assert not any(a <= b for i, a in enumerate(told) for b in told[:i])


def test_seasons_signs_and_attributes_have_lists_of_their_own(words: Vocabulary) -> None:
    park, street = (cluster_facts(words, r) for r in (rows(*range(6)), rows(*range(6, 18))))
    assert shown(park.seasons) == {"autumn": 6}
    assert shown(street.signs) == {"No Parking": 12}
    assert "tall" in vocabulary_kinds(words, "attribute")
    assert not park.signs


def vocabulary_kinds(words: Vocabulary, kind: str) -> set[str]:
    return {entry.shown for entry in words.entries if entry.kind == kind}


def test_a_compound_is_told_whole() -> None:
    texts = ["A fire hydrant and a fire escape near a trash bin."] * 5 + ["A tree."] * 5
    told = shown(cluster_facts(vocabulary(texts), np.arange(5)).common)
    assert "fire hydrant" in told
    assert not {"fire", "hydrant", "bin"} & set(told)


def test_a_cluster_without_text_has_no_facts(words: Vocabulary) -> None:
    assert list(cluster_facts(words, rows(18))) == []
    assert cluster_facts(words, rows(18)).of == 0


def test_objects_are_an_inventory() -> None:
    nodes = [Observation(f"o{i}", "object", Pose(i, 0), name=name) for i, name in enumerate(
        ["chair_office_1", "chair_office_2", "chair_cafe_3", "exitSign", "deskLamp_7"])]  # fmt: skip
    words = map_vocabulary(TopoMap(Frame.METRIC, tuple(nodes), Edges.empty()))
    facts = cluster_facts(words, np.arange(5))
    assert facts.noun == "objects"
    told = shown(facts.common)
    assert told["chair"] == 3
    assert told["exit sign"] == 1
    assert composed(facts).text.startswith("Chair in 3 of 5 objects")


@given(
    inside=st.lists(st.integers(0, 20), min_size=1, max_size=8),
    outside=st.lists(st.integers(0, 100), min_size=8, max_size=8),
    prior=st.floats(0.1, 50),
)
def test_log_odds_are_finite_and_rise_with_the_count(inside: list[int], outside: list[int], prior: float) -> None:
    views = np.array(inside)
    total = views + np.array(outside[: len(views)])
    z = log_odds(views, 20, total, 120, prior)
    assert np.isfinite(z).all()
    more = log_odds(np.array([5, 6]), 20, np.array([10, 11]), 120, prior)
    assert more[1] > more[0]


@given(st.integers(1, 19), st.integers(0, 80))
def test_log_odds_are_odd_in_the_sign_of_the_difference(views: int, outside: int) -> None:
    z = float(log_odds(np.array([views]), 20, np.array([views + outside]), 120, 10.0)[0])
    difference = views / 20 - outside / 100
    assert z * difference >= -1e-9


def test_lines_are_labelled_lists(words: Vocabulary) -> None:
    facts = cluster_facts(words, rows(*range(6, 18)))
    lines = dict(line.split(": ", 1) for line in fact_lines(facts, parts=("A", "B"), counts=True))
    assert lines["often (of 12 views)"].startswith("parked cars 12")
    assert lines["how"] == "cars along street 12"
    assert lines["parts"] == "A; B"
    assert lines["signs"] == "'No Parking' 12"
    assert "12" not in "".join(fact_lines(facts))


def test_a_group_keeps_to_its_budget(words: Vocabulary) -> None:
    facts = cluster_facts(words, rows(*range(18)))
    for budget in (64, 100, 450):
        config = EvidenceConfig(tokens=budget, members=5, parts=9)
        found = group(words, TEXTS, rows(*range(18)), facts, config, ["Name of a part"] * 9)
        assert sum(tokens(text) for text in (*found.facts, *found.texts)) <= budget
    assert found.facts
    assert len(found.texts) == 2  # equal members are quoted once


def test_representatives_show_what_is_not_yet_shown(words: Vocabulary) -> None:
    facts = cluster_facts(words, rows(*range(18)))
    first, second = representatives(words, TEXTS, rows(*range(18)), facts, 2)
    assert {TEXTS[first], TEXTS[second]} == {PARK, STREET}
    assert representatives(words, TEXTS, rows(*range(18)), facts, 0) == []
    assert representatives(words, TEXTS, rows(18), Facts(of=0), 3) == []


def test_excerpts_are_whole_sentences(words: Vocabulary) -> None:
    facts = cluster_facts(words, rows(*range(6)))
    found = group(words, TEXTS, rows(*range(6)), facts, EvidenceConfig(members=1, member_chars=60), ())
    assert found.texts == ("A pond lies in the park, with benches along the path.",)


def test_facts_do_not_depend_on_the_order_of_the_members(words: Vocabulary) -> None:
    mixed = np.random.default_rng(3).permutation(18)
    assert cluster_facts(words, mixed[:9]) == cluster_facts(words, np.sort(mixed[:9]))


def test_composed_names_and_texts_come_from_facts(words: Vocabulary) -> None:
    summary = composed(cluster_facts(words, rows(*range(6))))
    assert summary.name.lower().startswith("autumn p")
    assert "of 6 views" in summary.text
    assert summary.relationships == ("Benches along path",)
    assert composed(Facts(of=0)).name == "Place without description"
