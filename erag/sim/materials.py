"""Materials: what a surface looks like and how much red and near infrared light it reflects."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from erag.sim.textures import TEXTURES
from erag.sim.vocabulary import read_words, validated

Season = Literal["spring", "summer", "autumn", "winter"]
Byte = int


class Material(BaseModel):
    """A surface: `scale` is how many metres its texture spans, `red` and `nir` its reflectances in 0..1."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    texture: str
    first: tuple[Byte, Byte, Byte]
    second: tuple[Byte, Byte, Byte] = (128, 128, 128)
    scale: float = Field(1.0, gt=0)
    red: float = Field(ge=0, le=1)
    nir: float = Field(ge=0, le=1)
    noun: str = ""
    glow: bool = False
    seasons: dict[str, str] = {}

    @model_validator(mode="after")
    def _known(self) -> Material:
        if self.texture not in TEXTURES:
            raise ValueError(f"there is no texture {self.texture!r}; allowed: {', '.join(TEXTURES)}")
        return self

    @property
    def ndvi(self) -> float:
        """(NIR − R) / (NIR + R), in −1..1 (paper, section on data)."""
        return (self.nir - self.red) / (self.nir + self.red)


@cache
def materials() -> Mapping[str, Material]:
    """All materials by name, from `words/materials.yaml`."""
    return {name: validated(Material, raw, f"materials.yaml: {name}") for name, raw in read_words("materials").items()}


def in_season(name: str, season: Season, *, snow: bool) -> str:
    """The material that stands for `name` in a season; with `snow` lying, what is outdoors may be white."""
    swaps = materials()[name].seasons
    return (swaps.get("snow") if snow else None) or swaps.get(season, name)
