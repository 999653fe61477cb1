"""Sightings as sentences."""

import pytest

from erag.lm.wording import Sighting, article, describe, listed, phrase, plural, third


@pytest.mark.parametrize(
    ("noun", "said"),
    [
        ("bench", "a bench"), ("umbrella", "an umbrella"), ("uniform", "a uniform"), ("hour glass", "an hour glass"),
        ("people", "people"), ("stairs", "stairs"), ("bus", "a bus"), ("glass", "a glass"),
        ("red apple", "a red apple"),
        ("grass", "grass"), ("orange cone", "an orange cone"), ("railway carriage", "a railway carriage"),
    ],
)  # fmt: skip
def test_articles(noun: str, said: str) -> None:
    assert article(noun) == said


@pytest.mark.parametrize(
    ("noun", "many"),
    [("bench", "benches"), ("berry", "berries"), ("trolley", "trolleys"), ("red car", "red cars"), ("person", "people"),
     ("market stall", "market stalls"), ("bookshelf", "bookshelves"), ("hay", "hay")],
)  # fmt: skip
def test_plurals(noun: str, many: str) -> None:
    assert plural(noun) == many


def test_a_caption_goes_from_side_to_side_and_names_the_largest_first() -> None:
    caption = describe(
        "A park in daylight.",
        [
            Sighting("bench", "left", ("red",), area=0.1),
            Sighting("tree", "middle", area=0.3, many=True),
            Sighting("church", "right", area=0.02, far=True),
            Sighting("bin", "left", area=0.05),
        ],
    )
    assert caption.text == (
        "A park in daylight. In the middle are several trees. On the left are a red bench and a bin. "
        "On the right is a church in the distance."
    )
    assert caption.objects == ("tree", "bench", "bin", "church")


def test_nothing_seen_is_said_as_nothing() -> None:
    assert describe("A wall.", []).text == "A wall."
    assert describe("A wall.", []).objects == ()


def test_parts() -> None:
    assert listed(["a", "b", "c"]) == "a, b and c"
    assert listed(["a"]) == "a"
    assert [third(x) for x in (0.1, 0.5, 0.9)] == ["left", "middle", "right"]
    assert phrase(Sighting("tree", many=True, attributes=("bare",))) == "several bare trees"
