"""Matrix products of the decoder: oneDNN with weights laid out in advance, PyTorch's plain linear, or int8.

Measured on an AMD EPYC with AVX-512: packed float32 is 3–4 times as fast as plain (which goes through MKL), packed
bfloat16 up to twice as fast for the few rows of a decoding step.
"""

from __future__ import annotations

import platform
from typing import TYPE_CHECKING, Literal, Protocol

from erag.core.errors import ModelError

if TYPE_CHECKING:
    import torch

    from erag.lm.int8 import Int8

Kernels = Literal["packed", "plain", "int8", "int8_products"]
KernelsWish = Literal["auto", "packed", "plain", "int8", "int8_products"]
_ROWS_HINT = 16  # how many rows oneDNN lays the weights out for; larger and smaller products run as fast


class Linear(Protocol):
    """A weight (o, i), with a bias or not, and the products of it that the decoder needs. x: (…, i) → (…, o)."""

    def __call__(self, x: torch.Tensor) -> torch.Tensor: ...

    def silu(self, x: torch.Tensor) -> torch.Tensor:
        """silu(Wx)"""
        ...

    def plus(self, x: torch.Tensor, other: torch.Tensor) -> torch.Tensor:
        """Wx + other"""
        ...

    def times(self, x: torch.Tensor, other: torch.Tensor) -> torch.Tensor:
        """Wx · other, element by element"""
        ...


def choose_kernels(wish: KernelsWish) -> Kernels:
    """`wish`, or for `auto` packed on x86-64, where PyTorch brings oneDNN, else plain."""
    if wish == "auto":
        return "packed" if platform.machine() in {"x86_64", "AMD64"} else "plain"
    return wish


def wide(kernels: Kernels) -> Kernels:
    """The kernels of what does not become int8: the output head, whose logits are compared to the last bits."""
    return kernels if kernels in ("packed", "plain") else choose_kernels("auto")


def linear(weight: torch.Tensor, bias: torch.Tensor | None, kernels: Kernels) -> Linear:
    """The weight under the chosen kernels. Raises ModelError when this PyTorch or this CPU has no such kernels."""
    if kernels == "plain":
        return _Plain(weight, bias)
    if kernels == "int8" or kernels == "int8_products":
        return _Narrow(weight, bias, kernels)
    try:
        return _Packed(weight, bias)
    except (AttributeError, RuntimeError) as error:
        what = f"no packed {weight.dtype} kernels here: {error}"
        raise ModelError(what, where="torchlm", repair="--set kernels=plain, or dtype=float32") from error


def product(x: torch.Tensor, weight: torch.Tensor, kernels: Kernels) -> torch.Tensor:
    """x (m, i) times a weight (o, i) that is used once and not laid out, nor made int8: (m, o)."""
    import torch

    if wide(kernels) == "plain":
        return torch.nn.functional.linear(x, weight)
    out: torch.Tensor = torch.ops.mkldnn._linear_pointwise.default(x, weight, None, "none", [], "")
    return out


class _Plain:
    def __init__(self, weight: torch.Tensor, bias: torch.Tensor | None) -> None:
        self._weight, self._bias = weight, bias

    def __call__(self, x: torch.Tensor) -> torch.Tensor:
        from torch.nn.functional import linear

        return linear(x, self._weight, self._bias)

    def silu(self, x: torch.Tensor) -> torch.Tensor:
        from torch.nn.functional import silu

        return silu(self(x), inplace=True)

    def plus(self, x: torch.Tensor, other: torch.Tensor) -> torch.Tensor:
        return self(x).add_(other)

    def times(self, x: torch.Tensor, other: torch.Tensor) -> torch.Tensor:
        return self(x).mul_(other)


class _Narrow(_Plain):
    """A weight in int8."""

    def __init__(self, weight: torch.Tensor, bias: torch.Tensor | None, form: Int8) -> None:
        from erag.lm.int8 import Int8Matrix

        self._matrix = Int8Matrix(weight, bias, form)

    def __call__(self, x: torch.Tensor) -> torch.Tensor:
        return self._matrix(x)


class _Packed:
    def __init__(self, weight: torch.Tensor, bias: torch.Tensor | None) -> None:
        import torch

        self._run = torch.ops.mkldnn._linear_pointwise.default
        self._run_with = torch.ops.mkldnn._linear_pointwise.binary
        self._weight, self._bias = torch.ops.mkldnn._reorder_linear_weight(weight, _ROWS_HINT), bias

    def __call__(self, x: torch.Tensor) -> torch.Tensor:
        out: torch.Tensor = self._run(x, self._weight, self._bias, "none", [], "")
        return out

    def silu(self, x: torch.Tensor) -> torch.Tensor:
        out: torch.Tensor = self._run(x, self._weight, self._bias, "swish", [], "")
        return out

    def plus(self, x: torch.Tensor, other: torch.Tensor) -> torch.Tensor:
        out: torch.Tensor = self._run_with(x, other, self._weight, self._bias, "add")
        return out

    def times(self, x: torch.Tensor, other: torch.Tensor) -> torch.Tensor:
        out: torch.Tensor = self._run_with(x, other, self._weight, self._bias, "mul")
        return out
