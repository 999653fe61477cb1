"""What is read as a condition, and what only looks like one."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.retrieve.clauses import MOST_CLAUSES, read_clauses


@pytest.mark.parametrize(
    ("text", "wanted", "conditions"),
    [
        ("Find a bench away from traffic.", "Find a bench.", ["away from: traffic"]),
        ("somewhere to play, not the tennis courts", "somewhere to play", ["not: tennis courts"]),
        ("a way into the library without stairs", "a way into the library", ["not: stairs"]),
        ("a bench near the fountain", "a bench", ["near: fountain"]),
        ("a seat next to a tree", "a seat", ["near: tree"]),
        ("a quiet place with trees but no cars", "a quiet place with trees", ["not: cars"]),
        ("a café not far from the library", "a café", ["near: library"]),
        ("a bench not too far away from the pond", "a bench", ["near: pond"]),
        ("a place that isn't near the road", "", ["away from: road"]),
        ("any rack other than the one at the library", "any rack", ["not: library"]),
        ("a toilet, but not the one next to the canteen", "a toilet", ["away from: canteen"]),
        ("a bench with a bin nearby", "a bench", ["near: bin"]),
        ("a bench with no cars around", "a bench", ["away from: cars"]),
        ("a bench near a bin or a lamp", "a bench", ["near: bin or lamp"]),
        ("a desk near a window and a plant", "a desk", ["near: window", "near: plant"]),
        ("a place without cars, people or signs", "", ["not: cars or people or signs"]),
        ("the clock tower with no market in front of it", "the clock tower", ["not: market"]),
        ("a bin by the bus stop", "a bin", ["near: bus stop"]),
        ("a car-free street", "a street", ["not: car"]),
        ("a bench near the swimming pool", "a bench", ["near: swimming pool"]),
        ("a hall that is not behind scaffolding", "a hall", ["not: scaffolding"]),
        (
            "I would like to sit near the pond, away from cars and people, but not on a bench",
            "I would like to sit",
            ["near: pond", "away from: cars or people", "not: bench"],
        ),
        ('a bin near the sign "Not the way, no entry"', "a bin", ['near: sign "Not the way, no entry"']),
    ],
)
def test_conditions_are_told_from_what_is_wanted(text: str, wanted: str, conditions: list[str]) -> None:
    read = read_clauses(text)
    assert (read.wanted, [str(c) for c in read.clauses]) == (wanted, conditions)


@pytest.mark.parametrize(
    "text",
    [
        "Where is the no entry sign?",
        'Find the sign that says "do not enter near the gate".',
        "Somewhere to eat without having to walk far",
        "Is there a toilet near me?",
        "a bench near here",
        "Take me to the nearest bench",
        "My bottle is empty and I do not want to pay for a new one.",
        "My tyre is flat and I have no tools.",
        "I have no car and want to get into town without waiting in the rain.",
        "My dog ran off near the pond.",
        "There is no hot water this morning.",
        "I want to ride into town without a car.",
        "Keep it away from children.",
        "food to take away from a van",
        "a wall covered by the ivy",
        "By the way, where is the pond?",
        "Find nothing near nothing",
        "without a doubt the best bench",
        "I am not near the door",
        "What is near the library?",
        "without",
        "near",
        "",
    ],
)
def test_what_only_looks_like_a_condition_is_left_alone(text: str) -> None:
    read = read_clauses(text)
    assert (read.wanted, read.clauses) == (text, ())


_PIECES = [
    "near",
    "the",
    "not",
    "without",
    "a",
    "bench",
    "and",
    "or",
    ",",
    "away from",
    "no",
    '"',
    "next to",
    "\ue100",
    "é",
]


@given(st.lists(st.sampled_from(_PIECES), max_size=40).map(" ".join))
def test_any_text_can_be_read(text: str) -> None:
    read = read_clauses(text)
    assert all(thing.strip() for clause in read.clauses for thing in clause.things)
    assert len(read.clauses) <= MOST_CLAUSES * 40
    assert read.clauses or read.wanted == text
