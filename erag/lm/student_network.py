"""The student's network: features of an image to objects with place in view and attributes, scene, and a text vector.

This module imports torch; it is itself imported only where a student is trained or loaded.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import cast

import torch
import torch.nn.functional as nnf
from torch import nn

from erag.lm.features import COARSE, FINE
from erag.lm.student_words import StudentWords

_RARE = -4.0  # logit with which a cell starts: most cells do not show most classes


@dataclass(frozen=True, slots=True)
class Seen:
    """What the network says of b images.

    `presence` (b, c) logits that a class is visible, `centre` (b, c, 2) where (x right, y down, 0 to 1), `looks`
    (b, c, a) logits of colours and then shapes, `many` and `far` (b, c) logits of several instances and of being far
    away, `cells` (b, c, ROWS, COLUMNS) evidence a cell,
    `places` (b, p) logits, `lights` (b, l) logits, `vector` (b, d) unit rows in the space of the text embedder.
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

    def mirrored(self) -> Seen:
        """What would be seen in the mirror images."""
        centre = torch.stack([1 - self.centre[..., 0], self.centre[..., 1]], dim=2)
        return replace(self, centre=centre, cells=self.cells.flip(3))


class _Mix(nn.Module):
    """Neighbours (depthwise 5 × 5), then channels; added to what went in."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.near = nn.Conv2d(width, width, 5, padding=2, groups=width)
        self.norm = nn.GroupNorm(1, width)
        self.wide = nn.Conv2d(width, 2 * width, 1)
        self.back = nn.Conv2d(2 * width, width, 1)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        with torch.autocast("cpu", enabled=False):  # in bfloat16 the gradient takes three times as long
            near = self.near(x.float())
        return cast(torch.Tensor, x + self.back(nnf.gelu(self.wide(self.norm(near)))))


class StudentNetwork(nn.Module):
    """About half a million weights over frozen features."""

    def __init__(self, words: StudentWords) -> None:
        super().__init__()
        classes, width = len(words.objects), words.width
        self.fine, self.coarse = nn.Conv2d(FINE, width, 1), nn.Conv2d(COARSE, width, 1)
        self.fine_scale = nn.Buffer(torch.ones(2, FINE))  # mean and 1/deviation of each channel
        self.coarse_scale = nn.Buffer(torch.ones(2, COARSE))
        self.body = nn.ModuleList(_Mix(width) for _ in range(words.depth))
        self.context = nn.Linear(2 * width, width)
        self.norm = nn.GroupNorm(1, width)
        self.cells = nn.Conv2d(width, classes, 1)
        nn.init.constant_(cast(torch.Tensor, self.cells.bias), _RARE)
        self.sharpness = nn.Parameter(torch.zeros(classes))
        self.presence = nn.Linear(2 * width, classes)
        self.own = nn.Parameter(torch.zeros(classes, width))
        self.many, self.far = nn.Linear(width, classes), nn.Linear(width, classes)
        self.looks = nn.Linear(width, len(words.colours) + len(words.shapes))
        self.places = nn.Linear(2 * width, len(words.places))
        self.lights = nn.Linear(2 * width, len(words.lights))
        self.project = nn.Sequential(
            nn.Linear(2 * width + classes, 2 * width), nn.GELU(), nn.Linear(2 * width, words.dim)
        )

    def normalise(self, fine: torch.Tensor, coarse: torch.Tensor) -> None:
        """Take mean and deviation of each channel from a sample of features."""
        for buffer, maps in ((self.fine_scale, fine), (self.coarse_scale, coarse)):
            deviation, mean = torch.std_mean(maps.float(), dim=(0, 2, 3))
            buffer.copy_(torch.stack([mean, 1 / deviation.clamp_min(1e-3)]))

    def forward(self, fine: torch.Tensor, coarse: torch.Tensor) -> Seen:
        """`fine` (b, FINE, ROWS, COLUMNS) and `coarse` (b, COARSE, ROWS/2, COLUMNS/2), as `features` gives them."""
        grid = self._grid(fine, coarse)  # (b, w, r, k)
        whole = _pooled(grid)  # (b, 2w)
        around = self._withheld(whole)
        grid = self.norm(grid + self.context(around)[:, :, None, None])
        cells = self.cells(grid)  # (b, c, r, k)
        flat = cells.flatten(2)
        weight = (flat * nnf.softplus(self.sharpness + 0.5)[:, None]).softmax(dim=2)  # (b, c, r·k)
        own = weight @ grid.flatten(2).transpose(1, 2)  # (b, c, w)
        loudest = torch.logsumexp(flat, dim=2) - 3.0  # an object of about e³ = 20 cells reaches its own evidence
        presence = loudest + self.presence(around) + (own * self.own).sum(dim=2)
        centre = weight @ _positions(cells)  # (b, c, 2)
        vector = self.project(torch.cat([whole, presence.detach().sigmoid()], dim=1))
        return Seen(
            presence, centre, self.looks(own), _own(self.many, own), _own(self.far, own), cells,
            self.places(whole), self.lights(whole),
            nnf.normalize(vector.float(), dim=1),
        )  # fmt: skip

    def both_ways(self, fine: torch.Tensor, coarse: torch.Tensor) -> Seen:
        """What is seen in the images and in their mirror images, taken together; as `forward` otherwise."""
        seen, mirrored = self(fine, coarse), self(fine.flip(3), coarse.flip(3)).mirrored()
        mean = {field.name: (getattr(seen, field.name) + getattr(mirrored, field.name)) / 2 for field in fields(Seen)}
        return Seen(**mean | {"vector": nnf.normalize(mean["vector"], dim=1)})

    def _withheld(self, whole: torch.Tensor) -> torch.Tensor:
        """In training, half of the images without their context: what is in view has to be recognised by itself."""
        if not self.training:
            return whole
        return whole * (torch.rand(len(whole), 1) < 0.5)

    def _grid(self, fine: torch.Tensor, coarse: torch.Tensor) -> torch.Tensor:
        near: torch.Tensor = self.fine(_scaled(fine, self.fine_scale))
        far: torch.Tensor = self.coarse(_scaled(coarse, self.coarse_scale))
        x = near + nnf.interpolate(far, size=near.shape[2:], mode="bilinear", align_corners=False)
        for mix in self.body:
            x = mix(x)
        return x


def _scaled(maps: torch.Tensor, scale: torch.Tensor) -> torch.Tensor:
    mean, inverse = scale[0][:, None, None], scale[1][:, None, None]
    return ((maps - mean) * inverse).clamp(-6, 6).contiguous(memory_format=torch.channels_last)


def _pooled(grid: torch.Tensor) -> torch.Tensor:
    """(b, 2w): the mean and the maximum over the cells."""
    return torch.cat([grid.mean(dim=(2, 3)), grid.amax(dim=(2, 3))], dim=1)


def _own(layer: nn.Linear, own: torch.Tensor) -> torch.Tensor:
    """(b, c): the output of each class for its own features (b, c, w)."""
    return (own * layer.weight).sum(dim=2) + layer.bias


def _positions(cells: torch.Tensor) -> torch.Tensor:
    """(r·k, 2) centres of the cells, x right and y down, 0 to 1."""
    rows, columns = cells.shape[2:]
    y = (torch.arange(rows, dtype=cells.dtype) + 0.5) / rows
    x = (torch.arange(columns, dtype=cells.dtype) + 0.5) / columns
    return torch.stack([x.repeat(rows), y.repeat_interleave(columns)], dim=1)
