"""Ground truth as tensors, in the order of the student's words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from erag.lm.features import COLUMNS, ROWS
from erag.lm.roles import Vectors
from erag.study.examples import Example, Instance, Thing, Words

if TYPE_CHECKING:
    import torch

_UNSURE = 0.5  # of the least share: what covers less than it and more than this is neither there nor absent
UNKNOWN = -1
_FEW = 2  # more instances than this are several
_NEAR = 20.0  # metres, beyond which a thing is in the distance


@dataclass(frozen=True)
class Targets:
    """What the outputs for n examples should be.

    `presence` (n, c) 1, 0, or -1 where it does not count; `centre` (n, c, 2); `looks` (n, c, a) of colours and then
    shapes, 1, 0 or -1; `many` and `far` (n, c) 1, 0 or -1; `cells` (n, c, r, k) uint8, 255 is a cell fully covered;
    `places`, `lights` (n,) int64, -1 unknown; `vector` (n, d) of the caption.
    """

    presence: torch.Tensor
    centre: torch.Tensor
    looks: torch.Tensor
    many: torch.Tensor
    far: torch.Tensor
    cells: torch.Tensor
    places: torch.Tensor
    lights: torch.Tensor
    vector: torch.Tensor

    def rows(self, index: torch.Tensor) -> Targets:
        """The targets of some examples."""
        return Targets(*(getattr(self, f.name)[index] for f in fields(self)))


def targets(examples: Sequence[Example], words: Words, vectors: Vectors, least: float) -> Targets:
    """The targets of `examples`; `vectors` (n, d) are their captions' embeddings."""
    import torch

    n, c = len(examples), len(words.objects)
    row = {name: i for i, name in enumerate(words.objects)}
    presence, centre = np.zeros((n, c), np.int8), np.zeros((n, c, 2), np.float32)
    many, far = (np.full((n, c), UNKNOWN, np.int8) for _ in range(2))
    looks = np.full((n, c, len(words.colours) + len(words.shapes)), UNKNOWN, np.int8)
    cells = np.zeros((n, c, ROWS, COLUMNS), np.uint8)
    for i, example in enumerate(examples):
        for thing in example.things:
            if thing.name not in row:
                continue
            j = row[thing.name]
            largest = thing.largest
            presence[i, j] = 1 if largest.share >= least else UNKNOWN if largest.share >= least * _UNSURE else 0
            cells[i, j] = np.round(np.max([_covered(item) for item in thing.instances], axis=0) * 255)
            if largest.share >= least:
                centre[i, j] = thing.centre
                many[i, j], far[i, j] = _count(thing, least) > _FEW, largest.metres > _NEAR
                looks[i, j] = (*_code(words.colours, largest.colour), *_code(words.shapes, largest.shape))
    return Targets(
        torch.from_numpy(presence), torch.from_numpy(centre), torch.from_numpy(looks), torch.from_numpy(many),
        torch.from_numpy(far), torch.from_numpy(cells),
        places=torch.tensor(_codes(words.places, [e.place for e in examples])),
        lights=torch.tensor(_codes(words.lights, [e.light for e in examples])),
        vector=torch.from_numpy(vectors),
    )  # fmt: skip


def _code(known: Sequence[str], said: str) -> list[int]:
    """1 for the word that is said, 0 for the others; where nothing is said, nothing is known."""
    return [int(word == said) for word in known] if said else [UNKNOWN] * len(known)


def _codes(known: Sequence[str], said: Sequence[str]) -> list[int]:
    code = {word: i for i, word in enumerate(known)}
    return [code.get(word, UNKNOWN) for word in said]


def _count(thing: Thing, least: float) -> int:
    """How many instances can be told apart: those that cover at least a quarter of the least share."""
    return sum(item.share >= least / 4 for item in thing.instances)


def _covered(item: Instance) -> npt.NDArray[np.float32]:
    """(ROWS, COLUMNS) how much of each cell an instance covers, as if it filled its box evenly."""
    left, top, right, bottom = item.box
    area = max((right - left) * (bottom - top), 1e-6)
    across, down = _overlap(left, right, COLUMNS), _overlap(top, bottom, ROWS)
    return (np.outer(down, across) * min(1.0, item.share / area)).astype(np.float32)


def _overlap(start: float, end: float, cells: int) -> npt.NDArray[np.float64]:
    """(cells,) the share of each of the equal parts of [0, 1] that lies in [start, end]."""
    edges = np.linspace(0, 1, cells + 1)
    inside: npt.NDArray[np.float64] = np.clip(np.minimum(edges[1:], end) - np.maximum(edges[:-1], start), 0, None)
    return inside * cells
