"""Low-rank adapters of a GGUF model: their checkpoint, and the weights of the model with one merged in."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import BaseModel, ConfigDict, Field

from erag.core.errors import ModelError
from erag.lm.checkpoints import load_tensors, read_header, shipped
from erag.lm.torchlm.shape import Shape
from erag.lm.weights.digest import sha256_of

if TYPE_CHECKING:
    import torch

HEADER = "lora"
REPAIR = "erag distil --config C.yaml, one of configs/distil/lora-*.yaml"
PROJECTIONS = ("attn_q", "attn_k", "attn_v", "attn_output", "ffn_gate", "ffn_up", "ffn_down")
DOWN, UP = "down", "up"
_WEIGHT = re.compile(r"blk\.(\d+)\.(\w+)\.weight")


class LoraHeader(BaseModel):
    """Which model an adapter belongs to (its id in the store and the sha256 of its file), and what it was taught.

    Of each projection and layer W becomes W + `alpha` / `rank` × up^T · down.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    base: str = Field(max_length=64)
    weights: str = Field(pattern=r"^[0-9a-f]{64}$")
    taught: str = Field(pattern=r"^[a-z0-9]{1,24}$", description="part of the merged model's id")
    rank: int = Field(ge=1, le=512)
    alpha: float = Field(gt=0, allow_inf_nan=False)
    taught_by: str = Field("", max_length=500)


@dataclass(frozen=True, slots=True)
class LoraFile:
    """An adapter in a file that was read as far as its header."""

    path: Path
    header: LoraHeader
    sha256: str

    def terms(self, shape: Shape) -> Terms:
        """What it adds to the weights of a model. Raises ModelError where it does not fit, or was replaced since."""
        factors = read_factors(self.path, self.header, shape)
        if sha256_of(self.path) != self.sha256:
            raise ModelError("was replaced while it was in use", where=str(self.path), repair="run the command again")
        return Terms(factors, shape.layers, self.header.alpha / self.header.rank)


@dataclass(frozen=True, slots=True, eq=False)
class Terms:
    """The factors of an adapter, and what their products are multiplied by."""

    factors: Mapping[str, torch.Tensor]
    layers: int
    scale: float

    def add_to(self, name: str, weight: torch.Tensor) -> None:
        """Add the term of a tensor, if it has one, to its float32 weight, in place."""
        found = _WEIGHT.fullmatch(name)
        if found and found[2] in PROJECTIONS:
            names = (factor_name(found[2], side) for side in (DOWN, UP))
            down, up = (self.factors[name].chunk(self.layers)[int(found[1])] for name in names)
            weight.addmm_(up.T, down, alpha=self.scale)


def located(path: Path) -> Path:
    """A file as it is named; a bare name without a suffix is that of an adapter that comes with the project."""
    return path if path.suffix or path.parent != Path() else shipped(f"{path}.safetensors")


def lora_file(path: Path) -> LoraFile:
    """The adapter in a file, or of the project by its name (`located`). Raises ModelError for a file that is none."""
    path = located(path)
    header = read_header(path, HEADER, LoraHeader, REPAIR, called="adapter of a language model")
    return LoraFile(path, header, sha256_of(path))


def check_base(adapter: LoraFile, fingerprint: str) -> None:
    """Raise ModelError where an adapter was trained on other weights than those of this sha256."""
    if adapter.header.weights != fingerprint:
        what = f"was trained on {adapter.header.base} with the sha256 {adapter.header.weights}"
        raise ModelError(what, where=str(adapter.path), allowed=fingerprint, repair=REPAIR)


def factor_name(projection: str, side: str) -> str:
    """The name of a factor among the tensors of an adapter."""
    return f"{projection}_{side}"


def factor_sizes(shape: Shape, rank: int) -> dict[str, tuple[int, int]]:
    """The factors of an adapter: for each projection `down` and `up` (layers × rank, inputs or outputs)."""
    sizes = shape.sizes()
    found: dict[str, tuple[int, int]] = {}
    for projection in PROJECTIONS:
        outputs, inputs = sizes[weight_name(0, projection)]
        found[factor_name(projection, DOWN)] = (shape.layers * rank, inputs)
        found[factor_name(projection, UP)] = (shape.layers * rank, outputs)
    return found


def weight_name(layer: int, projection: str) -> str:
    """The GGUF name of the weight that an adapter adds to."""
    return f"blk.{layer}.{projection}.weight"


def read_factors(path: Path, header: LoraHeader, shape: Shape) -> dict[str, torch.Tensor]:
    """The factors of a checkpoint, float32. Raises ModelError where they do not fit its header and the model."""
    import torch

    factors = {name: torch.from_numpy(values) for name, values in load_tensors(path, REPAIR).items()}
    found = {name: tuple(factor.shape) for name, factor in factors.items()}
    if found != factor_sizes(shape, header.rank):
        what = f"its factors do not fit {header.base} and rank {header.rank}: {found}"
        raise ModelError(what, where=str(path), repair=REPAIR)
    return factors
