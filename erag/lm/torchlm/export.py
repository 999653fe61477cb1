"""Writing a GGUF file: the metadata of one that exists, with other weights."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from erag.core.errors import ModelError
from erag.lm.torchlm.container import Container
from erag.lm.torchlm.shape import ROPE_FACTORS, Shape
from erag.lm.torchlm.weights import as_in_file, rope_factors

if TYPE_CHECKING:
    import torch

_OF_THE_SOURCE = frozenset({"general.architecture", "general.file_type", "general.alignment"})  # stated anew


def write_gguf(source: Container, shape: Shape, tensors: Mapping[str, torch.Tensor], target: Path) -> None:
    """Write a file with the metadata of `source` and these tensors (names and order of rows as `dequantised` has them).

    Matrices are F16 and vectors F32, as llama.cpp's converter writes them. Raises ModelError for numbers beyond F16.
    """
    from gguf import GGUFReader, GGUFValueType, GGUFWriter, LlamaFileType

    writer = GGUFWriter(target, str(source.metadata["general.architecture"]))
    for field in GGUFReader(source.path).fields.values():
        if field.name not in _OF_THE_SOURCE and not field.name.startswith("GGUF."):
            kind = field.types[0]
            writer.add_key_value(
                field.name, field.contents(), kind, field.types[-1] if kind == GGUFValueType.ARRAY else None
            )
    writer.add_file_type(LlamaFileType.MOSTLY_F16)
    for name in source.tensors:
        if name in tensors:
            writer.add_tensor(name, _stored(as_in_file(tensors[name].float().numpy(), name, shape), name, source.path))
    if (factors := rope_factors(source)) is not None:
        writer.add_tensor(ROPE_FACTORS, factors)
    writer.write_header_to_file()
    writer.write_kv_data_to_file()
    writer.write_tensors_to_file()
    writer.close()


def _stored(numbers: npt.NDArray[np.float32], name: str, path: Path) -> npt.NDArray[np.float16 | np.float32]:
    if numbers.ndim < 2:
        return numbers
    if not np.abs(numbers).max() < np.finfo(np.float16).max:
        raise ModelError(f"tensor {name} holds numbers that F16 cannot", where=path.name, allowed="up to 65,504")
    return np.ascontiguousarray(numbers.astype(np.float16))
