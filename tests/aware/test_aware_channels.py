"""Words that wish for one end of a sensor's readings, and words that do not."""

from __future__ import annotations

import pytest

from erag.aware.channels import ChannelWords, lexicon, named, shipped, unread, wishes

ALL = ("ndvi", "noise", "temperature")


@pytest.mark.parametrize(
    ("text", "channel", "wish"),
    [
        ("Find a lush lawn", "ndvi", "high"),
        ("high NDVI", "ndvi", "high"),
        ("a picnic spot with poor grass", "ndvi", "low"),
        ("where the grass is dry", "ndvi", "low"),
        ("somewhere that is not lush", "ndvi", "low"),
        ("grass of poor quality", "ndvi", "low"),
        ("NDVI between 0.2 and 0.4", "ndvi", (0.2, 0.4)),
        ("a quiet bench", "noise", "low"),
        ("the lowest temperature", "temperature", "low"),
    ],
)
def test_words_are_read_as_a_wish_for_a_channel(text: str, channel: str, wish: object) -> None:
    (found,) = wishes(text, ALL, shipped())
    assert (found.channel, found.wish) == (channel, wish)
    assert found.words in text.lower()


@pytest.mark.parametrize(
    "text",
    ["Find a bench.", "I am cold and could do with another jacket.", "It is getting dark and I want to see where I am.",
     "What grows on the grass?", "I would like to relax in hot water."],
)  # fmt: skip
def test_ordinary_words_wish_for_nothing(text: str) -> None:
    assert wishes(text, ("ndvi", "temperature", "light"), shipped()) == ()


def test_only_channels_the_map_has_are_wished_for_and_the_others_are_told() -> None:
    assert wishes("Find a lush lawn", ("noise",), shipped()) == ()
    assert unread("Find a place of low NDVI", ("noise",), shipped()) == ("ndvi",)
    assert unread("Find a place of low NDVI", ("ndvi",), shipped()) == ()
    assert named("How is the vegetation?", ("ndvi", "noise"), shipped()) == ("ndvi",)


def test_a_configuration_adds_words_and_channels() -> None:
    words = lexicon(
        {"ndvi": ChannelWords(high=("jungle-like",)), "radon": ChannelWords(about="radon", high=("radioactive",))}
    )
    assert wishes("a jungle-like corner", ("ndvi",), words)[0].wish == "high"
    assert wishes("a lush corner", ("ndvi",), words)[0].wish == "high"
    assert wishes("somewhere radioactive", ("radon",), words)[0].channel == "radon"


def test_a_channel_nobody_described_is_called_by_its_name() -> None:
    (found,) = wishes("a place of low soil_ph2", ("soil_ph2",), shipped()) or wishes(
        "low soil ph2", ("soil_ph2",), shipped()
    )
    assert (found.channel, found.wish) == ("soil_ph2", "low")
