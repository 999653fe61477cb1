"""The weights of a GGUF file as torch tensors: dequantised once, then read from a cache of safetensors."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, ValidationError

from erag.core.errors import ModelError
from erag.lm.ledger import Ledger
from erag.lm.probe import Dtype
from erag.lm.torchlm.container import Container, TensorEntry
from erag.lm.torchlm.lora import Terms
from erag.lm.torchlm.shape import ROPE_FACTORS, Shape
from erag.lm.weights.digest import Stamp, replace_durably, sha256_of, write_durably

if TYPE_CHECKING:
    import torch

LAYOUT = "erag-torchlm-1"  # changes when the tensors in the cache would
SPARE = 256 << 20  # bytes of disk left free
_ROTATED = ("attn_q.weight", "attn_k.weight", "attn_q.bias", "attn_k.bias")

REBUILT = "decoder caches found damaged and made anew"
NOT_KEPT = "decoder caches not kept (no room or no permission)"


class _Record(BaseModel):
    """What is known of a cache file: its sha256, and the stamp it had when that was computed."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    sha256: str
    stamp: Stamp


@dataclass(frozen=True)
class WeightCache:
    """Where the tensors of one GGUF file (by its sha256) in one dtype are kept."""

    folder: Path
    sha256: str
    dtype: Dtype

    @property
    def file(self) -> Path:
        return self.folder / f"{self.sha256}-{self.dtype}.safetensors"

    @property
    def record(self) -> Path:
        return self.file.with_suffix(".json")

    def load(self, source: Container, shape: Shape, ledger: Ledger) -> dict[str, torch.Tensor]:
        """The tensors by GGUF name, q and k ordered for rotating neighbouring pairs.

        From the cache where it is whole (a damaged one is counted in `ledger` and made anew), else dequantised. Raises
        ModelError when the GGUF holds a tensor that cannot be dequantised.
        """
        if self.file.exists():
            tensors = self._read(shape)
            if tensors is not None:
                return tensors
            ledger.events[REBUILT] += 1
        tensors = dequantised(source, shape, self.dtype)
        if self._keep(tensors):
            return self._read(shape) or tensors  # backed by the file, so that memory is not held twice
        ledger.events[NOT_KEPT] += 1
        return tensors

    def _read(self, shape: Shape) -> dict[str, torch.Tensor] | None:
        from safetensors import SafetensorError, safe_open

        if not self._verified():
            return None
        try:
            with safe_open(self.file, framework="pt", device="cpu") as archive:
                if (archive.metadata() or {}).get("source") != self._source:
                    return None
                tensors = {name: archive.get_tensor(name) for name in archive.keys()}  # noqa: SIM118
        except (OSError, SafetensorError):
            return None
        found = {name: (tuple(t.shape), str(t.dtype)) for name, t in tensors.items()}
        expected = {name: (size, f"torch.{self.dtype}") for name, size in shape.sizes().items()}
        return tensors if found == expected else None

    def _verified(self) -> bool:
        """Whether the file is byte for byte what was written; it is hashed only when its stamp has changed."""
        try:
            record, stamp = _Record.model_validate_json(self.record.read_bytes()), Stamp.of(self.file)
        except (OSError, ValidationError):
            return False
        if record.stamp == stamp:
            return True
        return record.stamp.size == stamp.size and record.sha256 == sha256_of(self.file)

    def _keep(self, tensors: dict[str, torch.Tensor]) -> bool:
        from safetensors import SafetensorError
        from safetensors.torch import save_file

        fresh = self.file.with_name(f".{self.file.name}.{os.getpid()}")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            if shutil.disk_usage(self.folder).free < sum(t.nbytes for t in tensors.values()) + SPARE:
                return False
            try:
                save_file(tensors, fresh, metadata={"source": self._source})
                digest = sha256_of(fresh)
                replace_durably(fresh, self.file)
            finally:
                fresh.unlink(missing_ok=True)
            record = _Record(sha256=digest, stamp=Stamp.of(self.file))
            write_durably(self.record, record.model_dump_json())
        except (OSError, SafetensorError):
            return False
        return True

    @property
    def _source(self) -> str:
        return json.dumps([LAYOUT, self.sha256, self.dtype])


def cache_folder() -> Path:
    """The user's folder for decoder caches."""
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "erag" / "torchlm"


def dequantised(source: Container, shape: Shape, dtype: Dtype, terms: Terms | None = None) -> dict[str, torch.Tensor]:
    """All tensors of the network in `dtype`, with the terms of an adapter added.

    Raises ModelError for types that cannot be dequantised, and for NaN.
    """
    import torch

    tensors = {}
    for name in shape.sizes():
        numbers = _numbers(source, source.tensors[name])
        if not np.isfinite(numbers).all():
            raise ModelError(f"tensor {name} holds numbers that are not finite", where=source.path.name)
        if not shape.interleaved and name.endswith(_ROTATED):
            numbers = _paired(numbers, shape.head)
        weight = torch.from_numpy(np.ascontiguousarray(numbers))
        if terms is not None:
            terms.add_to(name, weight)
        tensors[name] = weight.to(getattr(torch, dtype))
    return tensors


def rope_factors(source: Container) -> npt.NDArray[np.float32] | None:
    """The divisors (hd/2,) of the rotary frequencies, for models that have such a table."""
    entry = source.tensors.get(ROPE_FACTORS)
    return None if entry is None else _numbers(source, entry)


def _numbers(source: Container, entry: TensorEntry) -> npt.NDArray[np.float32]:
    """A tensor in float32."""
    from gguf import GGML_QUANT_SIZES, GGMLQuantizationType
    from gguf.quants import dequantize

    kinds = {int(kind): kind for kind in GGMLQuantizationType}
    block, size = GGML_QUANT_SIZES[kinds[entry.kind]] if entry.kind in kinds else (1, 0)
    *outer, inner = entry.shape
    if not size or inner % block:
        raise ModelError(f"tensor {entry.name} has the type {entry.kind} in rows of {inner}", where=source.path.name)
    shape = (*outer, inner // block * size)
    try:
        raw = np.memmap(source.path, np.uint8, "r", entry.start, shape).view(np.ndarray)  # slices of maps are slow
        numbers = dequantize(raw, kinds[entry.kind]).astype(np.float32, copy=False).reshape(entry.shape)
        return np.require(numbers, requirements=["C", "W"])  # torch takes no memory that is mapped to be read only
    except (ValueError, NotImplementedError) as error:
        what = f"tensor {entry.name} cannot be read: {error}"
        raise ModelError(what, where=source.path.name, repair="erag models verify") from error


def _paired(numbers: npt.NDArray[np.float32], head: int) -> npt.NDArray[np.float32]:
    """Rows ordered for rotating halves, reordered for rotating pairs: (h·hd, …), row 2i from i and 2i+1 from hd/2+i."""
    rows = numbers.reshape(-1, 2, head // 2, prod(numbers.shape[1:]))  # (h, 2, hd/2, d)
    return rows.swapaxes(1, 2).reshape(numbers.shape)


def as_in_file(numbers: npt.NDArray[np.float32], name: str, shape: Shape) -> npt.NDArray[np.float32]:
    """A tensor of `dequantised`, its rows in the order that a file of this architecture has them."""
    if shape.interleaved or not name.endswith(_ROTATED):
        return numbers
    rows = numbers.reshape(-1, shape.head // 2, 2, prod(numbers.shape[1:]))  # (h, hd/2, 2, d)
    return rows.swapaxes(1, 2).reshape(numbers.shape)
