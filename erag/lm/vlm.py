"""The `vlm` captioner: a GGUF language model with its image projector (mmproj) in llama.cpp."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from erag.core.errors import BadModelOutput, ModelError
from erag.lm.images import Picture, Pixels, resized
from erag.lm.llamacpp.chats import Chats
from erag.lm.llamacpp.config import KernelWish
from erag.lm.llamacpp.library import library_version
from erag.lm.llamacpp.native import NativeContext, NativeModel, Room, Row
from erag.lm.llamacpp.probe import Candidate
from erag.lm.llamacpp.probed import ProbedModel
from erag.lm.llamacpp.vision import MARKER, Projector
from erag.lm.local import ImageCaptioner
from erag.lm.probe import cpu
from erag.lm.roles import Caption, ImagePath
from erag.lm.weights import ModelStore

RULES = 1  # changes when other captions would come out of the same weights
PROMPT = (
    "Describe this view for a robot's memory in two or three sentences: the kind of place, the objects you can see and "
    "where they are, their colours, and any text on signs. Say only what is visible."
)


class VlmConfig(BaseModel):
    """The `vlm` backend: a model of the store with a GGUF and an mmproj, what it is asked, and how it is computed.

    Images are made smaller until neither side is longer than `max_side`; `context` holds an image, the prompt and the
    caption. `kernels` as for `llamacpp`.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["vlm"] = "vlm"
    model: str
    prompt: str = Field(PROMPT, min_length=1, max_length=4000)
    max_tokens: int = Field(120, ge=4, le=1024)
    max_side: int = Field(768, ge=64, le=4096, description="pixels")
    context: int = Field(4096, ge=512, le=131_072, multiple_of=256, description="tokens")
    threads: int | None = Field(None, ge=1, le=1024, description="None: as many as there are CPUs")
    batch_size: int = Field(1024, ge=64, le=8192, description="tokens computed together")
    call_size: int = Field(4, ge=1, le=1024, description="images recorded together in one transaction")
    kernels: KernelWish = "auto"
    probe_seconds: float = Field(300, gt=0)

    @field_validator("prompt")
    @classmethod
    def _no_marker(cls, prompt: str) -> str:
        if MARKER in prompt:
            raise ValueError(f"the prompt contains {MARKER}, which stands for the image and is added by itself")
        return prompt


@dataclass(frozen=True, slots=True)
class _Loaded:
    model: NativeModel
    projector: Projector
    context: NativeContext
    text: str  # the rendered prompt, the marker in it


class Vlm(ImageCaptioner[VlmConfig], ProbedModel[VlmConfig]):
    """The caption role by a language model that sees; each image is read by a clean context.

    Weights are tried in a child process before they are loaded. Raises ContextError for an image that takes more tokens
    than there are.
    """

    def _stated(self) -> Mapping[str, Any]:
        parts = self._config.model_dump(include={"kind", "prompt", "max_tokens", "max_side"})
        return {**parts, "rules": RULES, "weights": self._store.fingerprint(self._config.model)}

    def _runtime(self) -> Mapping[str, Any]:
        return {
            "llama-cpp-python": library_version(), "kernels": self._config.kernels, "architecture": cpu().architecture,
            "batch_size": self._config.batch_size,
        }  # fmt: skip

    def _caption(self, picture: Picture, path: ImagePath) -> Caption:
        loaded = self._loaded
        loaded.context.clear()
        small = _bounded(picture.pixels, self._config.max_side)
        end = loaded.projector.read(loaded.context, loaded.text, small, self._config.max_tokens)
        tokens: list[int] = []
        ended = False
        while not ended and len(tokens) < self._config.max_tokens:
            best = int(loaded.context.last().argmax())
            ended = best in loaded.model.vocabulary.control
            if not ended:
                loaded.context.decode([Row(best, end + len(tokens), 0, True)])
                tokens.append(best)
        text = " ".join(loaded.model.vocabulary.decode(tokens, cut=not ended).split())
        if not text:
            raise BadModelOutput("an empty caption", where=str(path), allowed="at least a word")
        if not ended:
            self._ledger.events["captions cut at their cap of tokens"] += 1
        return Caption(text if ended else _whole(text))

    @cached_property
    def _loaded(self) -> _Loaded:
        config, threads = self._config, self._threads
        model_path, projector_path = _parts(self._store, config.model)
        candidate = Candidate(config.model, model_path, self._store.fingerprint(config.model), projector_path)
        choice = self._probe().survive(candidate, config.kernels)
        model = NativeModel(model_path, choice.kernels)
        projector = Projector(model, projector_path, threads)
        context = NativeContext(model, Room(config.context, 1, config.batch_size, 1, threads))
        text = Chats(model, config.context, self._command).text([("user", f"{MARKER}\n{config.prompt}")])
        return _Loaded(model, projector, context, text)


def _parts(store: ModelStore, model: str) -> tuple[Path, Path]:
    """The verified language model and projector of a model folder. Raises ModelError where there is not one of each."""
    files = [file.path for file in store.manifest(model).files]
    projectors = [path for path in files if "mmproj" in Path(path).name.lower()]
    models = [path for path in files if path.endswith(".gguf") and path not in projectors]
    if len(projectors) != 1 or len(models) != 1:
        allowed = "a GGUF and a file with mmproj in its name"
        raise ModelError(f"has the files {', '.join(files)}", where=f"model {model}", allowed=allowed)
    folder = store.path(model)
    return folder / models[0], folder / projectors[0]


def _bounded(pixels: Pixels, side: int) -> Pixels:
    """The pixels, made smaller until neither side is longer than `side`."""
    height, width, _ = pixels.shape
    scale = min(1.0, side / max(height, width))
    return pixels if scale == 1.0 else resized(pixels, max(1, round(width * scale)), max(1, round(height * scale)))


def _whole(text: str) -> str:
    """A caption that was cut, up to its last whole sentence; as it is where there is none."""
    end = max(text.rfind(mark) for mark in ".!?")
    return text[: end + 1] if end > 0 else text
