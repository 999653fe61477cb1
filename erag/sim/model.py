"""What an object's builder gives and gets: parts of one material each, and the style they are made in."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from erag.sim.mesh import Mesh, merge

Tint = tuple[float, float, float]  # red, green, blue in 0..1, multiplies the texture
WHITE: Tint = (1.0, 1.0, 1.0)

PALETTE: Mapping[str, Tint] = {
    "red": (0.78, 0.10, 0.09), "blue": (0.12, 0.29, 0.68), "green": (0.10, 0.45, 0.19), "yellow": (0.95, 0.78, 0.10),
    "orange": (0.93, 0.47, 0.08), "white": (0.95, 0.95, 0.93), "black": (0.10, 0.10, 0.11), "grey": (0.52, 0.53, 0.55),
    "silver": (0.75, 0.77, 0.80), "brown": (0.42, 0.26, 0.14), "purple": (0.43, 0.18, 0.52), "pink": (0.93, 0.55, 0.66),
    "turquoise": (0.12, 0.62, 0.62), "cream": (0.93, 0.88, 0.74), "beige": (0.80, 0.70, 0.54),
    "dark blue": (0.07, 0.12, 0.32), "dark green": (0.05, 0.24, 0.12), "light blue": (0.55, 0.75, 0.92),
    "maroon": (0.42, 0.07, 0.12), "olive": (0.44, 0.45, 0.16), "gold": (0.83, 0.64, 0.18),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Picture:
    """What is drawn on a fitted face: a text on a ground, or a motif known to `lettering`."""

    motif: str = "text"
    text: str = ""
    ink: Tint = (0.1, 0.1, 0.1)
    ground: Tint = WHITE
    aspect: float = 1.0  # width / height
    seed: int = 0


@dataclass(frozen=True, slots=True)
class Part:
    """A mesh of one material, tinted; `picture` replaces the material's texture."""

    mesh: Mesh
    material: str
    tint: Tint = WHITE
    picture: Picture | None = None


Parts = list[Part]


@dataclass(frozen=True)
class Style:
    """How one instance is made: the `shape` variant, its colour, what is written on it, and its own randomness."""

    shape: int = 0
    colour: str = ""
    text: str = ""
    seed: int = 0
    extent: float | None = None  # metres across, for what is made to measure

    @cached_property
    def rng(self) -> np.random.Generator:
        """The generator of what differs between instances of one look."""
        return np.random.default_rng(self.seed)

    @property
    def tint(self) -> Tint:
        """The colour as a tint; white where there is none."""
        return PALETTE.get(self.colour, WHITE)


Builder = Callable[[Style], Parts]


def part(material: str, *meshes: Mesh, tint: Tint = WHITE, picture: Picture | None = None) -> Part:
    """Meshes of one material as one part."""
    return Part(merge(meshes), material, tint, picture)
