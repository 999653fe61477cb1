"""The `blip` captioner: BLIP by transformers from a local folder, without torchvision: images are prepared here."""

from __future__ import annotations

import importlib
import json
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from erag.core.errors import BadModelOutput, ModelError
from erag.lm.images import Picture, Pixels
from erag.lm.local import ImageCaptioner, versions
from erag.lm.offline import go_offline
from erag.lm.probe import choose_dtype
from erag.lm.roles import Caption, ImagePath

if TYPE_CHECKING:
    import torch

RULES = 1  # changes when other captions would come out of the same weights
RUNTIME = ("torch", "transformers", "tokenizers", "pillow")
Precision = Literal["auto", "float32", "bfloat16", "int8"]
_ALLOWED = "a folder of BlipForConditionalGeneration with safetensors"
_MAX_SIDE = 2048  # pixels an image may be enlarged to by the folder's own settings


class BlipConfig(BaseModel):
    """The `blip` backend: a model folder of the store, its precision, and how long a caption may be.

    `auto` is bfloat16 where the CPU multiplies it in hardware, else float32; `int8` quantises the linear layers as the
    model is loaded (their inputs at run time).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["blip"] = "blip"
    model: str
    precision: Precision = "auto"
    max_tokens: int = Field(40, ge=4, le=256)
    beams: int = Field(1, ge=1, le=16)
    call_size: int = Field(8, ge=1, le=1024, description="images recorded together in one transaction")


class _Size(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")

    height: int = Field(ge=1, le=_MAX_SIDE)
    width: int = Field(ge=1, le=_MAX_SIDE)


class Preparation(BaseModel):
    """How the folder's `preprocessor_config.json` wants images; its defaults are BLIP's."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    size: _Size = _Size(height=384, width=384)
    rescale_factor: float = Field(1 / 255, gt=0)
    image_mean: tuple[float, float, float] = (0.48145466, 0.4578275, 0.40821073)
    image_std: tuple[float, float, float] = (0.26862954, 0.26130258, 0.27577711)

    def __call__(self, pixels: Pixels) -> torch.Tensor:
        """(1, 3, h, w) float32 from (h', w', 3) pixels: bicubic to the size, proportions given up, normalised."""
        import torch
        from PIL import Image

        size = (self.size.width, self.size.height)
        small = np.asarray(Image.fromarray(pixels).resize(size, Image.Resampling.BICUBIC), np.float32)
        scaled = (small * self.rescale_factor - np.array(self.image_mean, np.float32)) / np.array(
            self.image_std, np.float32
        )
        return torch.from_numpy(scaled).permute(2, 0, 1)[None].contiguous()


@dataclass(frozen=True, slots=True)
class _Loaded:
    prepare: Preparation
    model: Any
    tokenizer: Any
    dtype: torch.dtype


class Blip(ImageCaptioner[BlipConfig]):
    """The caption role by BLIP."""

    @cached_property
    def _precision(self) -> Precision:
        return choose_dtype("auto") if self._config.precision == "auto" else self._config.precision

    def _stated(self) -> Mapping[str, Any]:
        parts = self._config.model_dump(include={"kind", "max_tokens", "beams"})
        return {**parts, "rules": RULES, "weights": self._store.fingerprint(self._config.model)}

    def _runtime(self) -> Mapping[str, Any]:
        return {"precision": self._precision, **versions(RUNTIME, "blip")}

    def _caption(self, picture: Picture, path: ImagePath) -> Caption:
        import torch

        loaded = self._loaded
        pixels = loaded.prepare(picture.pixels).to(loaded.dtype)
        with torch.inference_mode():
            tokens = loaded.model.generate(
                pixel_values=pixels, max_new_tokens=self._config.max_tokens, num_beams=self._config.beams,
                do_sample=False,
            )  # fmt: skip
        text = " ".join(loaded.tokenizer.decode(tokens[0], skip_special_tokens=True).split())
        if not text:
            raise BadModelOutput("an empty caption", where=str(path), allowed="at least a word")
        return Caption(f"{text[:1].upper()}{text[1:]}{'' if text.endswith('.') else '.'}")

    @cached_property
    def _loaded(self) -> _Loaded:
        versions(RUNTIME, "blip")
        go_offline()
        folder = self._store.path(self._config.model)
        import torch
        from safetensors import SafetensorError
        from transformers import AutoTokenizer, BlipForConditionalGeneration

        if not any(folder.glob("*.safetensors")):
            raise ModelError("holds no safetensors", where=str(folder), allowed=_ALLOWED)
        dtype = torch.bfloat16 if self._precision == "bfloat16" else torch.float32
        prepare = _preparation(folder)
        try:
            model: Any = BlipForConditionalGeneration.from_pretrained(
                folder, local_files_only=True, use_safetensors=True, dtype=dtype
            )
            tokenizer = AutoTokenizer.from_pretrained(folder, local_files_only=True)
        except (OSError, ValueError, RuntimeError, KeyError, SafetensorError) as error:
            what = f"is no BLIP captioner: {error}"
            raise ModelError(what, where=str(folder), allowed=_ALLOWED) from error
        model.eval()
        return _Loaded(prepare, _eight_bit(model) if self._precision == "int8" else model, tokenizer, dtype)


def _eight_bit(model: Any) -> Any:
    """The model with the weights of its linear layers in 8 bits, its activations quantised as they come."""
    import torch

    try:
        quantisation: Any = importlib.import_module("torch.ao.quantization")
    except ImportError as error:
        raise ModelError("this torch has no dynamic quantisation", allowed="precision float32 or bfloat16") from error
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # on its move to another package
        return quantisation.quantize_dynamic(model, {torch.nn.Linear}, dtype=torch.qint8)


def _preparation(folder: Path) -> Preparation:
    path = folder / "preprocessor_config.json"
    try:
        raw: Mapping[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
        return Preparation.model_validate(raw)
    except (OSError, ValueError, ValidationError) as error:
        raise ModelError(f"cannot be used: {error}", where=str(path), repair="erag models verify") from error
