"""A student's checkpoint: one safetensors file with 8-bit weights, and the words they stand for in its header."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import ValidationError

from erag.core.errors import ModelError
from erag.lm.student_words import StudentWords

if TYPE_CHECKING:
    import torch

    from erag.lm.student_network import StudentNetwork

MAX_BYTES = 64 * 1024 * 1024
SHIPPED = "captioner.safetensors"
_HEADER = "student"
_LEVELS = 127
_REPAIR = "erag distil --config configs/distil/captioner.yaml"


def shipped() -> Path:
    """The student that comes with the project: `checkpoints/` of a checkout, or its copy in an installed package."""
    package = Path(str(files("erag")))
    checkout = package.parent / "checkpoints" / SHIPPED
    return checkout if checkout.is_file() else package / "_checkpoints" / SHIPPED


def quantised(state: Mapping[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """A state dict with its matrices as int8 (`NAME.int8`) and a scale an output (`NAME.scale`, float32).

    What has one dimension, and the normalisation of the features, stays float32.
    """
    import torch

    small: dict[str, torch.Tensor] = {}
    for name, tensor in state.items():
        if tensor.ndim < 2 or name.endswith("_scale"):
            small[name] = tensor.float().contiguous()
            continue
        rows = tensor.float().flatten(1)
        scale = (rows.abs().amax(dim=1) / _LEVELS).clamp_min(1e-12)
        small[f"{name}.int8"] = (
            (tensor.float() / scale.view(-1, *[1] * (tensor.ndim - 1))).round().to(torch.int8).contiguous()
        )
        small[f"{name}.scale"] = scale
    return small


def restored(small: Mapping[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """The float32 state dict of a `quantised` one."""
    state = {name: tensor for name, tensor in small.items() if not name.endswith((".int8", ".scale"))}
    for name, tensor in small.items():
        if name.endswith(".int8"):
            scale = small[f"{name.removesuffix('.int8')}.scale"]
            state[name.removesuffix(".int8")] = tensor.float() * scale.view(-1, *[1] * (tensor.ndim - 1))
    return state


def save(path: Path, words: StudentWords, state: Mapping[str, torch.Tensor]) -> None:
    """Write a checkpoint; the same weights and words give the same bytes."""
    from safetensors.torch import save as dump

    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_name(f".{path.name}.{os.getpid()}")
    fresh.write_bytes(dump(quantised(state), metadata={_HEADER: words.model_dump_json()}))
    fresh.replace(path)


def read_words(path: Path) -> StudentWords:
    """The words of a checkpoint. Raises ModelError for a file that is missing or no student."""
    from safetensors import SafetensorError, safe_open

    if not path.is_file():
        raise ModelError("there is no such checkpoint", where=str(path), repair=_REPAIR)
    if path.stat().st_size > MAX_BYTES:
        raise ModelError("too large for a student", where=str(path), allowed=f"up to {MAX_BYTES} bytes")
    try:
        with safe_open(path, framework="pt") as file:
            header = file.metadata() or {}
        return StudentWords.model_validate(json.loads(header.get(_HEADER, "null")))
    except (SafetensorError, OSError, ValidationError, ValueError) as error:
        raise ModelError(f"is no student's checkpoint: {error}", where=str(path), repair=_REPAIR) from error


def load(path: Path) -> tuple[StudentWords, StudentNetwork]:
    """The words and the network of a checkpoint, ready to look. Raises ModelError for a file that is no student."""
    from safetensors import SafetensorError
    from safetensors.torch import load_file

    from erag.lm.student_network import StudentNetwork

    words = read_words(path)
    network = StudentNetwork(words)
    try:
        network.load_state_dict(restored(load_file(path)))
    except (SafetensorError, OSError, KeyError, RuntimeError) as error:
        raise ModelError(f"its weights do not fit its words: {error}", where=str(path), repair=_REPAIR) from error
    return words, network.eval().requires_grad_(False)
