"""The `student` captioner: our own small network over frozen features; also images as vectors that text can find."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from erag.core.errors import ModelError
from erag.lm.efficientnet import EfficientNetLite0, load_network
from erag.lm.features import RULES, features, shrunk
from erag.lm.images import Picture
from erag.lm.local import ImageCaptioner, versions
from erag.lm.roles import Caption, ImagePath, Vectors
from erag.lm.student_checkpoint import load, read_words, shipped
from erag.lm.student_words import StudentWords
from erag.lm.wording import Sighting, article, describe, third

if TYPE_CHECKING:
    import torch

    from erag.lm.student_network import Seen, StudentNetwork

PHRASES = 2  # changes when other captions would be said of the same outputs
RUNTIME = ("torch", "pillow", "safetensors")
_SURE = 0.5  # probability from which on an attribute or "several" is said


class StudentConfig(BaseModel):
    """The `student` backend: a checkpoint (None: the one that comes with the project), and images a call."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["student"] = "student"
    checkpoint: Path | None = None
    call_size: int = Field(16, ge=1, le=4096, description="images recorded together in one transaction")


@dataclass(frozen=True, slots=True)
class Found:
    """An object the student sees: its class, how sure it is, where (x right, y down, 0 to 1), and what it is like."""

    name: str
    chance: float
    x: float
    y: float
    share: float
    colour: str = ""
    shape: str = ""
    many: bool = False
    far: bool = False


@dataclass(frozen=True, slots=True)
class View:
    """What the student sees in an image: the place and the light, and the objects, surest first."""

    place: str
    place_chance: float
    light: str
    objects: tuple[Found, ...]


@dataclass(frozen=True, slots=True)
class _Loaded:
    words: StudentWords
    network: StudentNetwork
    backbone: EfficientNetLite0


class Student(ImageCaptioner[StudentConfig]):
    """The caption role, and `vectors` of images."""

    @cached_property
    def _path(self) -> Path:
        return self._config.checkpoint or shipped()

    @cached_property
    def _digest(self) -> str:
        """The bytes of the checkpoint, which names its backbone's; raises ModelError where there is none."""
        read_words(self._path)
        return hashlib.sha256(self._path.read_bytes()).hexdigest()

    def _stated(self) -> Mapping[str, Any]:
        return {"kind": "student", "phrases": PHRASES, "weights": self._digest}

    def _runtime(self) -> Mapping[str, Any]:
        return {"dtype": "float32", **versions(RUNTIME, "eyes")}

    def _caption(self, picture: Picture, path: ImagePath) -> Caption:
        del path
        return spoken(self._view(picture))

    def look(self, images: Sequence[ImagePath]) -> list[View]:
        """What is seen in each image, same order. Raises BadImages."""
        return [self._view(picture) for picture in self._pictures(images)]

    def vectors(self, images: Sequence[ImagePath]) -> Vectors:
        """(n, d) float32 unit rows in the space of the text embedder named by `embedder`. Raises BadImages."""
        rows = [self._run(picture).vector.numpy() for picture in self._pictures(images)]
        return np.concatenate(rows) if rows else np.empty((0, 0), np.float32)

    @property
    def embedder(self) -> str:
        """The identity of the text embedder whose vectors `vectors` can be compared with."""
        return self._loaded.words.embedder

    def _view(self, picture: Picture) -> View:
        return read_view(self._loaded.words, self._run(picture))

    def _run(self, picture: Picture) -> Seen:
        import torch

        maps = features(self._loaded.backbone, [shrunk(picture.pixels)])
        with torch.inference_mode():
            return self._loaded.network.both_ways(maps.fine, maps.coarse)

    @cached_property
    def _loaded(self) -> _Loaded:
        words, network = load(self._path)
        return _Loaded(words, network, self._backbone(words))

    def _backbone(self, words: StudentWords) -> EfficientNetLite0:
        found = self._store.fingerprint(words.backbone)
        if (found, RULES) != (words.weights, words.rules):
            what = f"was trained on features of {words.backbone} {words.weights[:12]}… (rules {words.rules})"
            have = f"{found[:12]}… (rules {RULES})"
            raise ModelError(what, where=str(self._path), allowed=have, repair="train it anew: erag distil")
        return load_network(self._store.path(words.backbone))


def read_view(words: StudentWords, seen: Seen, row: int = 0) -> View:
    """The outputs for one image in words."""
    chances = seen.presence[row].float().sigmoid().tolist()
    shares = (seen.cells[row].float().sigmoid() > _SURE).float().mean(dim=(1, 2)).tolist()
    found = [
        Found(
            name, chances[i], float(seen.centre[row, i, 0]), float(seen.centre[row, i, 1]), shares[i],
            *_look(words, seen.looks[row, i]), bool(seen.many[row, i] > 0), bool(seen.far[row, i] > 0),
        )
        for i, name in enumerate(words.objects)
        if chances[i] >= words.thresholds[i]
    ]  # fmt: skip
    places = seen.places[row].float().softmax(0)
    place = int(places.argmax())
    light = words.lights[int(seen.lights[row].argmax())]
    order = sorted(found, key=lambda f: (-f.chance, f.name))
    return View(words.places[place], float(places[place]), light, tuple(order))


def _look(words: StudentWords, logits: torch.Tensor) -> tuple[str, str]:
    """The likeliest colour and the likeliest shape, each "" where it is less likely than not."""
    split = len(words.colours)
    return _best(words.colours, logits[:split]), _best(words.shapes, logits[split:])


def _best(known: Sequence[str], logits: torch.Tensor) -> str:
    if not known:
        return ""
    best = int(logits.argmax())
    return known[best] if logits[best].sigmoid() >= _SURE else ""


def spoken(view: View) -> Caption:
    """A view as a caption: the place, where it is of a kind, and the light, then objects from the largest down."""
    opening = f"{article(view.place or 'place')}{f' {view.light}' if view.light else ''}."
    sightings = [
        Sighting(f.name, third(f.x), tuple(filter(None, (f.colour, f.shape))), area=f.share, many=f.many, far=f.far)
        for f in view.objects
    ]
    return describe(opening, sightings)
