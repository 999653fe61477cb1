"""Matrices as int8 with a scale an output, and encoders made of them.

This module imports torch; it is itself imported only where one is made.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import torch
import torch.nn.functional as nnf

from erag.core.errors import ModelError
from erag.lm.bert import BertEncoder

Int8 = Literal["int8", "int8_products"]
_LEVELS = 127


class Int8Matrix:
    """A weight (o, i) in int8 with its bias.

    `int8` widens it again where it is used; with `int8_products` the inputs become int8 as well, with a scale a row,
    and whole numbers are multiplied.
    """

    def __init__(self, weight: torch.Tensor, bias: torch.Tensor | None, form: Int8) -> None:
        self._values, self._scale = _rows(weight)
        self._bias, self._multiply = bias, _products() if form == "int8_products" else None

    def __call__(self, x: torch.Tensor) -> torch.Tensor:
        """x: (…, i) → (…, o), in the precision of x."""
        if self._multiply is None:
            return nnf.linear(x, self._values.to(x.dtype) * self._scale.to(x.dtype), self._bias)
        rows, scale = _rows(x.reshape(-1, x.shape[-1]))
        found: torch.Tensor = (self._multiply(rows, self._values.T).float() * scale * self._scale.T).to(x.dtype)
        return (found if self._bias is None else found + self._bias).view(*x.shape[:-1], -1)

    @property
    def nbytes(self) -> int:
        """Bytes of values, scales and bias."""
        return self._values.nbytes + self._scale.nbytes + (0 if self._bias is None else self._bias.nbytes)


class Int8Encoder(BertEncoder):
    """An encoder whose layers' matrices are int8; word embeddings stay float32."""

    def __init__(self, folder: Path, form: Int8) -> None:
        super().__init__(folder, torch.float32)
        names = [n for n, w in self._weights.items() if w.ndim == 2 and n.startswith("encoder.layer.")]
        prefixes = tuple(name.removesuffix("weight") for name in names)
        weights = self._weights
        self._small = {p: Int8Matrix(weights[f"{p}weight"], weights[f"{p}bias"], form) for p in prefixes}
        taken = {f"{p}{part}" for p in prefixes for part in ("weight", "bias")}
        self._weights = {name: weight for name, weight in weights.items() if name not in taken}

    def _linear(self, x: torch.Tensor, prefix: str) -> torch.Tensor:
        return self._small[prefix](x)

    @property
    def nbytes(self) -> int:
        """Bytes of the weights in memory."""
        return super().nbytes + sum(matrix.nbytes for matrix in self._small.values())


def _rows(rows: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """(n, d) int8 and (n, 1) float32."""
    scale = (rows.float().abs().amax(dim=1, keepdim=True) / _LEVELS).clamp_min(1e-12)
    return (rows.float() / scale).round().to(torch.int8), scale


def _products() -> Any:
    multiply = getattr(torch, "_int_mm", None)
    if multiply is None:
        raise ModelError("this torch has no int8 products", allowed="a torch with _int_mm")
    return multiply
