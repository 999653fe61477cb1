"""The `clip` captioner: open_clip from a local folder ranks a vocabulary of objects, places, lights and colours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt
import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from erag.core.errors import BadModelOutput, ConfigError, ModelError
from erag.core.text import content_hash
from erag.lm.images import Picture
from erag.lm.local import ImageCaptioner, versions
from erag.lm.offline import go_offline
from erag.lm.probe import DtypeWish, choose_dtype
from erag.lm.roles import Caption, ImagePath
from erag.lm.views import VIEWS, views
from erag.lm.wording import Sighting, article, describe

if TYPE_CHECKING:
    import torch

RULES = 1  # changes when other captions would come out of the same weights and words
RUNTIME = ("torch", "torchvision", "open_clip_torch", "pillow")
_MAX_WORDS_BYTES = 1 << 20
_TEMPLATES = {
    "objects": ("a photo of {}.", "a photo that shows {}."), "places": ("a photo taken in {}.",),
    "lights": ("a photo taken {}.",), "colours": ("a photo of something {}.",),
}  # fmt: skip
Matrix = npt.NDArray[np.float32]


class ClipConfig(BaseModel):
    """The `clip` backend: a model folder of the store, the words it looks for (None: those that come with `erag`).

    An object is said to be in view where its probability among all objects is at least `sure`; at most `most` are.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["clip"] = "clip"
    model: str
    words: Path | None = None
    dtype: DtypeWish = "auto"
    sure: float = Field(0.12, gt=0, le=1)
    most: int = Field(6, ge=1, le=50)
    call_size: int = Field(8, ge=1, le=1024, description="images recorded together in one transaction")


class SceneWords(BaseModel):
    """What is looked for, as in `scene_words.yaml`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    places: tuple[str, ...] = Field(min_length=1, max_length=10_000)
    lights: tuple[str, ...] = Field(min_length=1, max_length=1_000)
    colours: tuple[str, ...] = Field(min_length=1, max_length=1_000)
    objects: tuple[str, ...] = Field(min_length=1, max_length=10_000)


def read_words(path: Path | None) -> SceneWords:
    """The words of a file, or those that come with `erag`. Raises ConfigError naming what is wrong."""
    source = files("erag.lm") / "scene_words.yaml" if path is None else path
    where = "scene_words.yaml" if path is None else str(path)
    try:
        text = source.read_text(encoding="utf-8")
        if len(text) > _MAX_WORDS_BYTES:
            raise ConfigError(f"{len(text)} characters", where=where, allowed=f"up to {_MAX_WORDS_BYTES}")
        return SceneWords.model_validate(yaml.safe_load(text))
    except (OSError, UnicodeDecodeError, yaml.YAMLError, ValidationError) as error:
        raise ConfigError(f"cannot be used as words: {error}", where=where, allowed="as scene_words.yaml") from error


@dataclass(frozen=True, slots=True)
class _Loaded:
    """The model, its own preparation of images, and a unit row a word for each part of the vocabulary."""

    model: Any
    prepare: Any
    rows: dict[str, torch.Tensor]
    dtype: torch.dtype


class Clip(ImageCaptioner[ClipConfig]):
    """The caption role by a ranked vocabulary."""

    @cached_property
    def _dtype(self) -> str:
        return choose_dtype(self._config.dtype)

    @cached_property
    def words(self) -> SceneWords:
        """What is looked for; read at first use."""
        return read_words(self._config.words)

    def _stated(self) -> Mapping[str, Any]:
        parts = self._config.model_dump(include={"kind", "sure", "most"})
        words = content_hash(self.words.model_dump_json()).hex()
        weights = self._store.fingerprint(self._config.model)
        return {**parts, "rules": RULES, "words": words, "weights": weights}

    def _runtime(self) -> Mapping[str, Any]:
        return {"dtype": self._dtype, **versions(RUNTIME, "clip")}

    def _caption(self, picture: Picture, path: ImagePath) -> Caption:
        chances = self._chances(picture)
        if not all(np.isfinite(part).all() for part in chances.values()):
            raise BadModelOutput("probabilities that are not numbers", where=str(path))
        words = self.words
        place = words.places[int(chances["places"][0].argmax())]
        light = words.lights[int(chances["lights"][0].argmax())]
        return describe(f"{article(place)} {light}.", self._sightings(chances))

    def _sightings(self, chances: dict[str, Matrix]) -> list[Sighting]:
        """The likeliest objects, each where it is likeliest, with the colour that goes with that part of the view."""
        objects, colours = chances["objects"], chances["colours"]
        best = objects.max(axis=0)
        found = []
        for i in sorted(range(len(best)), key=lambda i: (-best[i], i))[: self._config.most]:
            if best[i] >= self._config.sure:
                view = int(objects[:, i].argmax())
                colour = self.words.colours[int(colours[view].argmax())]
                sure = colours[view].max() >= 0.5
                side = VIEWS[view][1]
                found.append(Sighting(self.words.objects[i], side, (colour,) if sure else (), area=float(best[i])))
        return found

    def _chances(self, picture: Picture) -> dict[str, Matrix]:
        """For each part of the vocabulary (views, words) probabilities."""
        import torch
        from PIL import Image

        loaded = self._loaded
        shown = torch.stack([loaded.prepare(Image.fromarray(view)) for view in views(picture.pixels)])
        with torch.inference_mode():
            seen = torch.nn.functional.normalize(loaded.model.encode_image(shown.to(loaded.dtype)).float(), dim=1)
            scale = loaded.model.logit_scale.exp().float()
            return {part: (scale * seen @ rows.T).softmax(dim=1).numpy() for part, rows in loaded.rows.items()}

    @cached_property
    def _loaded(self) -> _Loaded:
        versions(RUNTIME, "clip")
        words = self.words
        go_offline()
        folder = self._store.path(self._config.model)
        import open_clip
        import torch

        dtype = getattr(torch, self._dtype)
        try:
            model, _, prepare = open_clip.create_model_and_transforms(f"local-dir:{folder}", weights_only=True)
            tokenise = open_clip.get_tokenizer(f"local-dir:{folder}")
        except (OSError, ValueError, RuntimeError, KeyError, TypeError) as error:
            allowed = "a folder with open_clip_config.json and open_clip weights"
            raise ModelError(f"is no open_clip model: {error}", where=str(folder), allowed=allowed) from error
        model = model.to(dtype).eval()
        rows = {part: _rows(model, tokenise, getattr(words, part), forms) for part, forms in _TEMPLATES.items()}
        return _Loaded(model, prepare, rows, dtype)


def _rows(model: Any, tokenise: Any, words: Sequence[str], forms: Sequence[str]) -> torch.Tensor:
    """(n, d) float32 unit rows: the mean over the templates of each word's text vectors."""
    import torch
    from torch.nn.functional import normalize

    total: Any = 0.0
    with torch.inference_mode():
        for form in forms:
            said = [form.format(word if word.startswith(("in ", "under ", "at ")) else article(word)) for word in words]
            parts = [model.encode_text(tokenise([text])).float() for text in said]
            total = total + normalize(torch.cat(parts), dim=1)
        rows: torch.Tensor = normalize(total, dim=1)
    return rows
