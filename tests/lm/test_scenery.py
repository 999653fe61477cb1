"""Light, colours and layout on pictures whose answer is plain."""

import numpy as np
import pytest

from erag.lm.scenery import scenery


def _flat(colour: tuple[int, int, int]) -> np.ndarray:
    return np.full((48, 64, 3), colour, np.uint8)


@pytest.mark.parametrize(
    ("colour", "name"),
    [((200, 20, 20), "red"), ((240, 140, 20), "orange"), ((230, 220, 30), "yellow"), ((30, 160, 40), "green"),
     ((30, 60, 200), "blue"), ((90, 50, 20), "brown"), ((128, 128, 130), "grey"), ((250, 250, 250), "white"),
     ((8, 8, 10), "black"), ((150, 40, 190), "purple")],
)  # fmt: skip
def test_a_plain_colour_is_named(colour: tuple[int, int, int], name: str) -> None:
    assert scenery(_flat(colour)).colours == (name,)


def test_light_goes_from_dark_to_bright() -> None:
    assert scenery(_flat((20, 20, 20))).light == "dark"
    assert scenery(_flat((80, 80, 80))).light == "dim, evenly lit"
    assert scenery(_flat((130, 130, 130))).light == "evenly lit"
    assert scenery(_flat((230, 230, 230))).light == "bright"
    assert scenery(_flat((200, 150, 90))).light == "warmly lit"


def test_sky_above_and_grass_below() -> None:
    view = _flat((90, 150, 230))
    view[24:] = (40, 140, 40)
    found = scenery(view)
    assert found.layout == "smooth blue above, green below"
    assert set(found.colours) == {"blue", "green"}
    assert found.sentence().startswith("The view is ")
