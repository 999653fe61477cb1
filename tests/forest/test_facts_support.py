"""Statements that members bear out, and those that none does."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.forest.facts import cluster_facts
from erag.forest.support import Evidence, Shares, check, coverage, supported
from erag.forest.vocabulary import vocabulary
from erag.lm.roles import Summary

MEMBERS = [
    'Two red cars are parked along the street. A sign reads "Posner Hall". There are no pedestrians visible.',
    "A street lined with tall trees and brick houses. A green bench stands on the sidewalk, 12 m long.",
    "A street lined with trees under an overcast sky in autumn. The sidewalk borders the street.",
]


@pytest.fixture(scope="module")
def evidence() -> Evidence:
    return Evidence.of_texts(MEMBERS)


@pytest.mark.parametrize(
    "statement",
    [
        "Red cars are parked on a street.",
        "Vehicles along the road, with people absent.",  # a car is a vehicle, a street a road
        "Trees line the streets.",
        "A serene area with a harmonious blend of trees and houses.",
        "There are no pedestrians.",
        "The sign says 'Posner Hall'.",
        "Posner Hall stands by the street.",
        "Fall trees.",
        "A place.",
        "The bench is 12 m long.",
        "There are no elephants.",  # nobody says otherwise
    ],
)
def test_what_a_member_says_is_supported(evidence: Evidence, statement: str) -> None:
    assert evidence.supports(statement)


@pytest.mark.parametrize(
    "statement",
    [
        "A swimming pool lies behind the houses.",
        "A green car is parked there.",  # green is the bench of another member
        "Pedestrians walk along the street.",
        "There are no trees.",
        "The sign says 'Wean Hall'.",
        "There are 7 cars.",
        "A snowy winter day.",
        "Elmira is a small coastal town.",
    ],
)
def test_what_no_member_says_is_not(evidence: Evidence, statement: str) -> None:
    assert not evidence.supports(statement)


def test_few_members_do_not_speak_for_many(evidence: Evidence) -> None:
    assert evidence.supports("A street with trees.", least=2)
    assert not evidence.supports("A street with a bench.", least=2)
    assert evidence.supports("A street with houses.", least=1)


def test_things_must_not_stand_otherwise_than_members_say(evidence: Evidence) -> None:
    assert evidence.relates("Street lined with trees")
    assert evidence.relates("Street flanked by trees")
    assert not evidence.relates("Street on trees")
    assert evidence.relates("Cars near street")
    assert not evidence.relates("Cars around the street")


def test_sentences_are_kept_or_removed_whole(evidence: Evidence) -> None:
    kept, removed = supported("Trees line the street. A pool and trees. Cars are parked.", evidence)
    assert kept == ("Trees line the street.", "Cars are parked.")
    assert removed == ("A pool and trees.",)


def test_a_summary_is_checked_in_all_its_parts(evidence: Evidence) -> None:
    summary = Summary("City of Dreams", "Trees line the street. It is a beach.", ("Cars along street", "Boats on lake"))
    checked = check(summary, evidence)
    assert checked.summary == Summary("", "Trees line the street.", ("Cars along street",))
    assert checked.removed == ("It is a beach.", "Boats on lake", "City of Dreams")
    assert checked.rare == ()
    assert checked.statements == 5


def test_details_of_few_members_are_told_apart(evidence: Evidence) -> None:
    summary = Summary("Green bench", "Trees. A green bench. A pool.", ("Cars along street",))
    checked = check(summary, evidence, Shares(text=0.5, name=0.5))
    assert checked.summary == Summary("", "Trees.", ())
    assert checked.removed == ("A pool.",)
    assert checked.rare == ("A green bench.", "Cars along street", "Green bench")


def test_an_empty_summary_has_no_statements(evidence: Evidence) -> None:
    assert check(Summary("", ""), evidence).statements == 0


def test_counts_may_come_from_the_facts() -> None:
    words = vocabulary(MEMBERS)
    facts = cluster_facts(words, np.arange(3))
    assert Evidence(words, np.arange(3), facts).supports("Trees in 2 of 3 views.")
    assert not Evidence(words, np.arange(3), facts).supports("Trees in 9 of 21 views.")
    assert not Evidence(words, np.arange(3), facts).supports("Trees about 5.0 m from cars.")
    assert Evidence(words, np.arange(3), facts, measured=True).supports("Trees about 5.0 m from cars.")


@given(
    st.lists(st.sampled_from(["a street", "red cars", "a bench", "tall trees", "brick houses"]), min_size=1, max_size=4)
)
def test_what_is_made_of_members_phrases_is_supported(things: list[str]) -> None:
    assert Evidence.of_texts(MEMBERS).supports(f"There is {' and '.join(things)}.")


def test_coverage_counts_facts_that_are_mentioned() -> None:
    words = vocabulary(MEMBERS)
    facts = [
        f for f in cluster_facts(words, np.arange(3)) if f.entry.shown in ("street", "trees", "street lined with trees")
    ]
    assert len(facts) == 3
    assert coverage(Summary("Street", "With trees."), facts) == 1.0
    assert coverage(Summary("Road", "Roads."), facts) == pytest.approx(1 / 3)  # `road` is as broad as `street`
    assert coverage(Summary("", ""), facts) == 0.0
    assert coverage(Summary("", ""), []) == 1.0
