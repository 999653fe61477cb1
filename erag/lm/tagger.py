"""The `tagger` captioner: ImageNet classes of EfficientNet-Lite0 in several views, and what the pixels say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib.resources import files
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field

from erag.lm.efficientnet import CLASSES, SIDE, EfficientNetLite0, batch, load_network
from erag.lm.images import Picture, Pixels, resized
from erag.lm.local import ImageCaptioner, versions
from erag.lm.roles import Caption, ImagePath
from erag.lm.scenery import scenery
from erag.lm.views import VIEWS, views
from erag.lm.wording import Sighting, article, describe, listed

RULES = 1  # changes when other captions would come out of the same weights
RUNTIME = ("torch", "pillow")


class TaggerConfig(BaseModel):
    """The `tagger` backend: how sure the network must be of a class to say it, and how many images a batch holds."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["tagger"] = "tagger"
    model: str = "efficientnet-lite0"
    sure: float = Field(0.25, gt=0, le=1, description="probability from which on an object is said to be in view")
    perhaps: float = Field(0.1, gt=0, le=1, description="probability from which on it is said with a doubt")
    call_size: int = Field(16, ge=1, le=4096, description="images recorded together in one transaction")


@dataclass(frozen=True, slots=True)
class Label:
    """An ImageNet class: its name, the everyday word for it, and the place it speaks of ("" for none)."""

    name: str
    word: str
    place: str = ""


@lru_cache(maxsize=1)
def labels() -> tuple[Label, ...]:
    """The 1,000 classes in the network's order. A line of `imagenet.txt` is `name [= word] [@ place]`."""
    lines = (files("erag.lm") / "imagenet.txt").read_text(encoding="utf-8").splitlines()
    return tuple(_label(line) for line in lines)


def _label(line: str) -> Label:
    rest, _, place = line.partition(" @ ")
    name, _, word = rest.partition(" = ")
    return Label(name, word or name, place)


class Tagger(ImageCaptioner[TaggerConfig]):
    """The caption role by the classes of ImageNet."""

    def _stated(self) -> Mapping[str, Any]:
        parts = self._config.model_dump(include={"kind", "sure", "perhaps"})
        return {**parts, "rules": RULES, "weights": self._store.fingerprint(self._config.model)}

    def _runtime(self) -> Mapping[str, Any]:
        return {"dtype": "float32", **versions(RUNTIME, "eyes")}

    @cached_property
    def _network(self) -> EfficientNetLite0:
        return load_network(self._store.path(self._config.model))

    def _caption(self, picture: Picture, path: ImagePath) -> Caption:
        del path
        chances = self.chances(picture.pixels)  # (4, 1000)
        return describe(self._opening(chances, picture.pixels), self._sightings(chances), self._doubts(chances))

    def chances(self, pixels: Pixels) -> npt.NDArray[np.float32]:
        """(4, 1000) probabilities of the classes in the whole image, its left, its middle and its right."""
        import torch

        shown = [resized(view, SIDE, SIDE) for view in views(pixels)]
        with torch.inference_mode():
            chances: npt.NDArray[np.float32] = self._network.logits(batch(shown)).softmax(dim=1).numpy()
        return chances

    def _opening(self, chances: npt.NDArray[np.float32], pixels: Pixels) -> str:
        places = [(float(chances[0, i]), label.place) for i, label in enumerate(labels()) if label.place]
        best, place = max(places)
        sentence = scenery(pixels).sentence()
        return f"{place}. {sentence}" if best >= self._config.sure else sentence

    def _sightings(self, chances: npt.NDArray[np.float32]) -> list[Sighting]:
        """Words of the classes the network is sure of, each at the side where it is surest."""
        words = _by_word(chances)
        found = []
        for word, row in words.items():
            view = int(row.argmax())
            if row[view] >= self._config.sure:
                found.append(Sighting(word, VIEWS[view][1], area=float(row[view])))
        return found

    def _doubts(self, chances: npt.NDArray[np.float32]) -> str:
        words = {word: float(row.max()) for word, row in _by_word(chances).items()}
        low, high = self._config.perhaps, self._config.sure
        maybe = sorted((-chance, word) for word, chance in words.items() if low <= chance < high)
        return f"Perhaps there is {listed([article(word) for _, word in maybe[:3]])}." if maybe else ""


def _by_word(chances: npt.NDArray[np.float32]) -> Mapping[str, npt.NDArray[np.float32]]:
    """For each everyday word the summed probabilities (views,) of its classes."""
    sums: dict[str, npt.NDArray[np.float32]] = {}
    for i in np.flatnonzero(chances.max(axis=0) > 1 / CLASSES):
        word = labels()[i].word
        sums[word] = sums.get(word, np.zeros(len(chances), np.float32)) + chances[:, i]
    return sums
