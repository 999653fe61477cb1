"""Checkpoints of students: one safetensors file with 8-bit matrices and a header of plain values."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeVar

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ValidationError

from erag.core.errors import ModelError
from erag.lm.roles import RoleName

if TYPE_CHECKING:
    import torch
    from torch import nn

MAX_BYTES = 64 * 1024 * 1024
_LEVELS = 127
Header = TypeVar("Header", bound=BaseModel)


class Grounded(Protocol):
    """A header of what was trained on an embedder's vectors, by rules of a version."""

    @property
    def embedder(self) -> str: ...

    @property
    def rules(self) -> int: ...


class Identified(Protocol):
    """What says which model it is."""

    def identity(self, role: RoleName) -> str: ...


def shipped(name: str) -> Path:
    """A student that comes with the project: in `checkpoints/` of a checkout, or its copy in an installed package."""
    package = Path(str(files("erag")))
    checkout = package.parent / "checkpoints" / name
    return checkout if checkout.is_file() else package / "_checkpoints" / name


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
    """The float32 state dict of a `quantised` one. Raises KeyError or ValueError where its scales do not fit."""
    state = {name: tensor for name, tensor in small.items() if not name.endswith((".int8", ".scale"))}
    for name, tensor in small.items():
        if name.endswith(".int8"):
            scale = small[f"{name.removesuffix('.int8')}.scale"]
            if scale.shape != tensor.shape[:1]:  # else a small file could ask for any amount of memory
                raise ValueError(f"{name} {tuple(tensor.shape)} has a scale {tuple(scale.shape)}")
            state[name.removesuffix(".int8")] = tensor.float() * scale.view(-1, *[1] * (tensor.ndim - 1))
    return state


def save(path: Path, kind: str, header: BaseModel, state: Mapping[str, torch.Tensor]) -> None:
    """Write a checkpoint; the same weights and header give the same bytes."""
    from safetensors.torch import save as dump

    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_name(f".{path.name}.{os.getpid()}")
    fresh.write_bytes(dump(quantised(state), metadata={kind: header.model_dump_json()}))
    fresh.replace(path)


def read_header(
    path: Path, kind: str, model: type[Header], repair: str, called: str = "", most: int = MAX_BYTES
) -> Header:
    """The header of a checkpoint. Raises ModelError for a file that is missing, of more than `most` bytes, or of
    another kind.

    `called` is what such a file is to a user, else a checkpoint of its kind.
    """
    from safetensors import SafetensorError, safe_open

    if not path.is_file():
        raise ModelError("there is no such checkpoint", where=str(path), repair=repair)
    if path.stat().st_size > most:
        raise ModelError("too large for a student", where=str(path), allowed=f"up to {most} bytes")
    try:
        with safe_open(path, framework="pt") as file:
            found = file.metadata() or {}
        if kind not in found:
            raise ValueError(f"its header tells of {', '.join(map(repr, sorted(found))) or 'nothing'}, not of {kind!r}")
        return model.model_validate(json.loads(found[kind]))
    except (SafetensorError, OSError, ValidationError, ValueError) as error:
        what = f"is no {called or f'checkpoint of kind {kind}'}: {error}"
        raise ModelError(what, where=str(path), repair=repair) from error


def check_embedder(path: Path, header: Grounded, embedder: Identified, rules: int, repair: str) -> None:
    """Raise ModelError where a checkpoint was trained on another embedder's vectors, or by other rules."""
    found = embedder.identity("embed")
    if (found, rules) != (header.embedder, header.rules):
        what = f"was trained on vectors of {header.embedder} (rules {header.rules})"
        raise ModelError(what, where=str(path), allowed=f"{found} (rules {rules})", repair=repair)


def load_into(path: Path, network: nn.Module, repair: str) -> None:
    """Fill a network with a checkpoint's weights and set it to work. Raises ModelError where they do not fit."""
    try:
        network.load_state_dict(_state(path, repair))
    except RuntimeError as error:
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
    except (SafetensorError, OSError) as error:
        raise ModelError(f"its weights cannot be read: {error}", where=str(path), repair=repair) from error
    except (KeyError, ValueError) as error:
        raise ModelError(f"its weights do not fit its header: {error}", where=str(path), repair=repair) from error
