"""The `signs` captioner: another captioner, and what is written in the view, read by OCR (rapidocr)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from erag.core.errors import ModelError
from erag.lm.blip import BlipConfig
from erag.lm.clip import ClipConfig
from erag.lm.images import Pixels, load_all
from erag.lm.local import versions
from erag.lm.roles import Caption, Captioner, ImagePath, Model, RoleName
from erag.lm.student import StudentConfig
from erag.lm.tagger import TaggerConfig
from erag.lm.vlm import VlmConfig

RULES = 1  # changes when other words would be read of the same images
RUNTIME = ("rapidocr", "onnxruntime", "pillow")
_LONGEST = 60  # characters of one sign
_MODELS = ("det", "rec")  # parts of the names of the models that must lie in the package


class SignsConfig(BaseModel):
    """The `signs` backend: a captioner whose captions get the texts that are read in the image.

    A text counts from the certainty `sure` on and with at least `letters` letters or digits; the surest `most` stay.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["signs"] = "signs"
    captioner: Annotated[
        TaggerConfig | StudentConfig | ClipConfig | BlipConfig | VlmConfig, Field(discriminator="kind")
    ]
    sure: float = Field(0.8, gt=0, le=1)
    letters: int = Field(2, ge=1, le=20)
    most: int = Field(4, ge=1, le=20)


class Reader:
    """Texts in images. The models come with the package; nothing is downloaded."""

    def __init__(self, sure: float, letters: int, most: int) -> None:
        self._sure, self._letters, self._most = sure, letters, most
        self._engine: Any = None

    def read(self, pixels: Pixels) -> tuple[str, ...]:
        """What is written in (h, w, 3) pixels, from top to bottom, each text printable and of bounded length."""
        if self._engine is None:
            self._engine = _engine()
        found = self._engine(np.ascontiguousarray(pixels[:, :, ::-1]))  # it wants blue first
        if found.txts is None:
            return ()
        lines = zip(found.boxes, found.txts, found.scores, strict=True)
        kept = [(score, float(box[:, 1].min()), _plain(text)) for box, text, score in lines if score >= self._sure]
        kept = [line for line in kept if sum(map(str.isalnum, line[2])) >= self._letters]
        best = sorted(kept, key=lambda line: (-line[0], line[1:]))[: self._most]
        return tuple(dict.fromkeys(text for _, _, text in sorted(best, key=lambda line: line[1])))


class Signs:
    """The caption role of another model, with what is written in the images."""

    roles: frozenset[RoleName] = frozenset({"caption"})

    def __init__(self, config: SignsConfig, captioner: Model) -> None:
        self._config, self._captioner = config, captioner
        self._reader = Reader(config.sure, config.letters, config.most)

    def identity(self, role: RoleName) -> str:
        parts = self._config.model_dump(include={"kind", "sure", "letters", "most"})
        return json.dumps({**parts, "rules": RULES, "captioner": self._captioner.identity(role)}, sort_keys=True)

    def fingerprint(self, role: RoleName) -> str:
        inner = self._captioner.fingerprint(role)
        return json.dumps({**json.loads(self.identity(role)), **versions(RUNTIME, "ocr"), "inner": inner})

    def batch_size(self, role: RoleName) -> int:
        return self._captioner.batch_size(role)

    def caption(self, images: Sequence[ImagePath]) -> list[Caption]:
        """The other captioner's captions, each followed by the texts that are read; raises what it raises."""
        pictures = load_all(images)
        captioner: Captioner = self._captioner  # type: ignore[assignment]
        captions = captioner.caption(images)
        return [told(c, self._reader.read(p.pixels)) for c, p in zip(captions, pictures, strict=True)]


def told(caption: Caption, texts: Sequence[str]) -> Caption:
    """A caption with a sentence on what is written; without texts as it is."""
    if not texts:
        return caption
    quoted = [f'"{text}"' for text in texts]
    said = quoted[0] if len(quoted) == 1 else f"{', '.join(quoted[:-1])} and {quoted[-1]}"
    return replace(caption, text=f"{caption.text} There is writing that reads {said}.")


def _plain(text: str) -> str:
    """A text of the world as data: printable, without quotation marks, of bounded length."""
    shown = "".join(c if c.isprintable() and c not in '"“”„' else " " for c in text)
    return " ".join(shown.split())[:_LONGEST]


@lru_cache(maxsize=1)
def _engine() -> Any:
    """The OCR engine on the models of its package. Raises ModelError where one is missing: it would be fetched."""
    versions(RUNTIME, "ocr")
    spec = find_spec("rapidocr")
    folder = Path(next(iter(spec.submodule_search_locations or ()))) / "models" if spec else Path()
    here = [path.name for path in folder.glob("*.onnx")]
    missing = [part for part in _MODELS if not any(f"_{part}_" in name for name in here)]
    if missing:
        raise ModelError(f"rapidocr comes without its models for {missing}", repair="pip install 'rapidocr>=3.10'")
    from rapidocr import RapidOCR

    return RapidOCR(params={"Global.use_cls": False, "Global.log_level": "error"})
