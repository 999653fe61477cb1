"""Low-rank adapters of a GGUF model: their checkpoint, and the weights of the model with one merged in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import BaseModel, ConfigDict, Field

from erag.core.errors import ModelError
from erag.lm.checkpoints import load_tensors, read_header
from erag.lm.torchlm.shape import Shape
from erag.lm.weights.digest import sha256_of

if TYPE_CHECKING:
    import torch

HEADER = "lora"
REPAIR = "erag distil --config C.yaml, one of configs/distil/lora-*.yaml"
PROJECTIONS = ("attn_q", "attn_k", "attn_v", "attn_output", "ffn_gate", "ffn_up", "ffn_down")
DOWN, UP = "down", "up"


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
class Adapter:
    """An adapter in a file that was read as far as its header."""

    path: Path
    header: LoraHeader
    sha256: str

    def add_to(self, tensors: Mapping[str, torch.Tensor], shape: Shape) -> None:
        """Change the float32 weights of the model, in place. Raises ModelError where the factors do not fit them."""
        factors = read_factors(self.path, self.header, shape)
        add(tensors, factors, shape.layers, self.header.alpha / self.header.rank)


def adapter_of(path: Path) -> Adapter:
    """The adapter in a file. Raises ModelError for a file that is none."""
    header = read_header(path, HEADER, LoraHeader, REPAIR, called="adapter of a language model")
    return Adapter(path, header, sha256_of(path))


def check_base(adapter: Adapter, fingerprint: str) -> None:
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


def add(tensors: Mapping[str, torch.Tensor], factors: Mapping[str, torch.Tensor], layers: int, scale: float) -> None:
    """Add the products of the factors to the float32 weights of a model, in place."""
    for projection in PROJECTIONS:
        down, up = (factors[factor_name(projection, side)] for side in (DOWN, UP))
        each = zip(down.chunk(layers), up.chunk(layers), strict=True)
        for layer, (first, second) in enumerate(each):
            tensors[weight_name(layer, projection)].addmm_(second.T, first, alpha=scale)
