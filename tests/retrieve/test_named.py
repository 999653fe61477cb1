"""Requests that name what they want, and how the name is read."""

import pytest

from erag.retrieve.named import named_thing, names_what_it_wants


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("Find barriers closing a path.", "barrier"),
        ("Find a bench to sit on.", "bench"),
        ("Is there a vending machine around here?", "vending machine"),
        ("Where are the bike racks?", "bike rack"),
        ("Please take me to the nearest parking garage.", "parking garage"),
        ("Find a green parking lot", "green parking lot"),
        ("Find a cyclist on the road.", "cyclist"),
        ("Show me the place where a workbench was seen last.", ""),  # a place is no thing
        ("I would like to sit down.", ""),
        ("Find the", ""),
        ("", ""),
    ],
)
def test_the_name_of_the_thing(text: str, said: str) -> None:
    assert " ".join(named_thing(text)) == said
    assert names_what_it_wants(text) or not said
