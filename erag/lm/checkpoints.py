"""Checkpoints of students: one safetensors file with 8-bit matrices and a header of plain values."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ValidationError

from erag.core.errors import ModelError
from erag.lm.student_checkpoint import MAX_BYTES, quantised, restored

if TYPE_CHECKING:
    import torch
    from torch import nn

Header = TypeVar("Header", bound=BaseModel)


def shipped(name: str) -> Path:
    """A student that comes with the project: in `checkpoints/` of a checkout, or its copy in an installed package."""
    package = Path(str(files("erag")))
    checkout = package.parent / "checkpoints" / name
    return checkout if checkout.is_file() else package / "_checkpoints" / name


def save(path: Path, kind: str, header: BaseModel, state: Mapping[str, torch.Tensor]) -> None:
    """Write a checkpoint; the same weights and header give the same bytes."""
    from safetensors.torch import save as dump

    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_name(f".{path.name}.{os.getpid()}")
    fresh.write_bytes(dump(quantised(state), metadata={kind: header.model_dump_json()}))
    fresh.replace(path)


def read_header(path: Path, kind: str, model: type[Header], repair: str) -> Header:
    """The header of a checkpoint. Raises ModelError for a file that is missing, too large, or of another kind."""
    from safetensors import SafetensorError, safe_open

    if not path.is_file():
        raise ModelError("there is no such checkpoint", where=str(path), repair=repair)
    if path.stat().st_size > MAX_BYTES:
        raise ModelError("too large for a student", where=str(path), allowed=f"up to {MAX_BYTES} bytes")
    try:
        with safe_open(path, framework="pt") as file:
            found = file.metadata() or {}
        return model.model_validate(json.loads(found.get(kind, "null")))
    except (SafetensorError, OSError, ValidationError, ValueError) as error:
        raise ModelError(f"is no checkpoint of kind {kind}: {error}", where=str(path), repair=repair) from error


def load_into(path: Path, network: nn.Module, repair: str) -> None:
    """Fill a network with a checkpoint's weights and set it to work. Raises ModelError where they do not fit."""
    try:
        network.load_state_dict(_state(path, repair))
    except (KeyError, RuntimeError) as error:
        raise ModelError(f"its weights do not fit its header: {error}", where=str(path), repair=repair) from error
    network.eval().requires_grad_(False)


def load_tensors(path: Path, repair: str) -> dict[str, npt.NDArray[np.float32]]:
    """The float32 tensors of a checkpoint. Raises ModelError for a file that cannot be read."""
    return {name: tensor.numpy() for name, tensor in _state(path, repair).items()}


def _state(path: Path, repair: str) -> dict[str, torch.Tensor]:
    from safetensors import SafetensorError
    from safetensors.torch import load_file

    try:
        return restored(load_file(path))
    except (SafetensorError, OSError, KeyError) as error:
        raise ModelError(f"its weights cannot be read: {error}", where=str(path), repair=repair) from error
