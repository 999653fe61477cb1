"""Wishes to teach query understanding with: needs said in several ways, the same ones for the same seed."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, Field

OPENINGS = (
    "I want to {}.", "I need to {}.", "I would like to {}.", "Where can I {}?", "Where could I {}?",
    "Is there somewhere to {}?", "Find a place where I can {}.", "Take me somewhere I can {}.", "I have to {}.",
    "Where would one go to {}?", "Somewhere to {}, please.",
)  # fmt: skip


class Needs(BaseModel):
    """Needs as verb phrases (`do`), and as whole sentences (`feel`)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    do: tuple[str, ...] = Field(min_length=1)
    feel: tuple[str, ...] = Field(min_length=1)


@cache
def needs() -> Needs:
    """The needs of `words/needs.yaml`."""
    text = files("erag.study").joinpath("words/needs.yaml").read_text(encoding="utf-8")
    return Needs.model_validate(yaml.safe_load(text))


def wishes(ways: int, seed: int) -> list[tuple[int, str]]:
    """The number of a need and how it is said: `do` in `ways` ways, `feel` as it is; an order that mixes them.

    Any beginning of the list has wishes of all kinds. Wishes of one need belong on the same side of a split.
    """
    rng = np.random.default_rng(seed)
    known, said = needs(), []
    for number, need in enumerate(known.do):
        chosen = rng.choice(len(OPENINGS), min(ways, len(OPENINGS)), replace=False)
        said += [(number, OPENINGS[way].format(need)) for way in chosen]
    said += [(len(known.do) + i, sentence) for i, sentence in enumerate(known.feel)]
    return [said[row] for row in rng.permutation(len(said))]
