"""Ground truth as tensors, in the order of the student's words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from erag.lm.features import COLUMNS, ROWS
from erag.lm.roles import Vectors
from erag.study.examples import Example, Words

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
    shapes, 1, 0 or -1; `many` and `far` (n, c) 1, 0 or -1; `cells` (n, c, r, k) uint8, 255 is a cell fully covered, and
    `drawn` (n,) whether they are known; `places`, `lights` (n,) int64, -1 unknown; `vector` (n, d) of the caption.
    """

    presence: torch.Tensor
    centre: torch.Tensor
    looks: torch.Tensor
    many: torch.Tensor
    far: torch.Tensor
    cells: torch.Tensor
    drawn: torch.Tensor
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
            presence[i, j] = 1 if thing.share >= least else UNKNOWN if thing.share >= least * _UNSURE else 0
            if thing.cells is not None:
                cells[i, j] = np.round(thing.cells * 255).astype(np.uint8)
            if thing.share >= least:
                centre[i, j] = thing.x, thing.y
                many[i, j], far[i, j] = thing.number > _FEW, thing.metres > _NEAR
                looks[i, j] = (*_code(words.colours, thing.colour), *_code(words.shapes, thing.shape))
    drawn = [any(t.cells is not None for t in e.things) or not e.things for e in examples]
    return Targets(
        torch.from_numpy(presence), torch.from_numpy(centre), torch.from_numpy(looks), torch.from_numpy(many),
        torch.from_numpy(far), torch.from_numpy(cells), torch.tensor(drawn),
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
