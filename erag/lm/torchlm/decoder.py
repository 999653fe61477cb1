"""The network: token ids through a Llama-like decoder to hidden states and logits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy.typing as npt

from erag.lm.torchlm.attention import Attention, Grid, attention
from erag.lm.torchlm.cache import Cache
from erag.lm.torchlm.kernels import Kernels, Linear, linear, product, wide
from erag.lm.torchlm.shape import EMBEDDING, FINAL_NORM, HEAD, Shape

if TYPE_CHECKING:
    import numpy as np
    import torch

_SLACK = 2.0**-6  # relative: twice the rounding of a bfloat16 logit
_SLICE = 8192  # rows of the output head computed in float32 at a time


@dataclass(frozen=True, slots=True)
class _Layer:
    before: torch.Tensor  # norm weights (d,)
    qkv: Linear
    out: Linear
    between: torch.Tensor
    gate: Linear
    up: Linear
    down: Linear


@dataclass(frozen=True, slots=True)
class _Seen:
    """What a layer has seen: keys and values (2, b, kv, columns, hd), columns in use, the trunk's (2, kv, p, hd)."""

    pair: torch.Tensor
    past: int
    trunk: torch.Tensor | None


class Decoder:
    """Weights laid out for this CPU. All methods are to be called in torch's inference mode."""

    def __init__(
        self,
        shape: Shape,
        tensors: Mapping[str, torch.Tensor],
        kernels: Kernels,
        rope_factors: npt.NDArray[np.float32] | None = None,
    ) -> None:
        self.shape = shape
        # What is kept beside the laid out weights is copied, so that the file they were read from can be unmapped.
        self._embedding, self._norm = tensors[EMBEDDING].clone(), tensors[FINAL_NORM].clone()
        self._head_weight = self._embedding if shape.tied else tensors[HEAD].clone()
        self._head = linear(self._head_weight, None, wide(kernels))
        self._layers = [_layer(tensors, f"blk.{i}.", kernels, shape.biased) for i in range(shape.layers)]
        self._turns = rotations(shape, rope_factors)
        self.dtype, self._kernels = self._embedding.dtype, kernels

    def forward(self, tokens: torch.Tensor, cache: Cache, first: int = 0) -> torch.Tensor:
        """Hidden states (b, s, d) of tokens (b, s) that follow what rows `first` … of the cache hold.

        Keys and values are written to the cache's next columns; `cache.advance` makes them count.
        """
        from torch.nn.functional import embedding

        b, s = tokens.shape
        rows = slice(first, first + b)
        unused = max(cache.readable - cache.width - 1, 0) if s == 1 else 0  # all columns: no copy is needed of these
        trunk = cache.trunk
        grid = Grid(b, s, cache.width, cache.holes(first, first + b), unused, trunk.width if trunk else 0)
        look = attention(grid, self.shape.kv_heads, self.shape.group, self.shape.head**-0.5, self.dtype)
        turns = self._turn(cache.lengths[rows], s)
        x = embedding(tokens, self._embedding)
        for i, layer in enumerate(self._layers):
            shared = trunk.layer(i)[:, 0] if trunk else None
            x = self._block(x, layer, _Seen(cache.layer(i)[:, rows], cache.width, shared), look, turns)
        return x

    def logits(self, hidden: torch.Tensor) -> torch.Tensor:
        """(m, d) hidden states to (m, vocabulary) logits."""
        return self._head(self._normed(hidden, self._norm))

    def best(self, hidden: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """The likeliest token of each hidden state: (m,) ids, and the logits (m, vocabulary).

        In bfloat16 the best logits often tie; those within rounding of the best are compared in float32.
        """
        import torch

        normed = self._normed(hidden, self._norm)
        logits = self._head(normed)
        top, ids = logits.max(-1)
        if self.dtype == torch.float32:
            return ids, logits
        close = (logits >= (top - top.abs() * _SLACK)[:, None]).nonzero()  # (c, 2), row by row
        exact = (normed[close[:, 0]].float() * self._head_weight[close[:, 1]].float()).sum(-1)
        table = torch.full((len(ids), len(close)), float("-inf"))
        table[close[:, 0], torch.arange(len(close))] = exact
        return close[table.argmax(-1), 1], logits

    def log_probabilities(self, hidden: torch.Tensor, rows: Sequence[int], targets: Sequence[int]) -> torch.Tensor:
        """(p,) float32 natural log-probabilities of token `targets[i]` after hidden state `rows[i]` of (m, d)."""
        import torch

        normed, goal = self._normed(hidden, self._norm).float(), torch.tensor(targets)
        parts = []
        for start in range(0, self.shape.vocabulary, _SLICE):
            weight = self._head_weight[start : start + _SLICE].float()
            parts.append(torch.logsumexp(product(normed, weight, self._kernels), -1))
        mass = torch.logsumexp(torch.stack(parts), 0)  # (m,)
        index = torch.tensor(rows)
        return (normed[index] * self._head_weight[goal].float()).sum(-1) - mass[index]

    def _block(self, x: torch.Tensor, layer: _Layer, seen: _Seen, look: Attention, turns: torch.Tensor) -> torch.Tensor:
        b, s, _ = x.shape
        q, kv = self.shape.heads, self.shape.kv_heads
        keys, values = seen.pair
        heads = layer.qkv(self._normed(x, layer.before)).view(b, s, q + 2 * kv, self.shape.head)
        turned = rotated(heads[:, :, : q + kv], turns)
        keys[:, :, seen.past : seen.past + s] = turned[:, :, q:].transpose(1, 2)
        values[:, :, seen.past : seen.past + s] = heads[:, :, q + kv :].transpose(1, 2)
        mixed = look(turned[:, :, :q], keys, values, seen.trunk)
        x = layer.out.plus(mixed, x)
        h = self._normed(x, layer.between)
        return layer.down.plus(layer.up.times(h, layer.gate.silu(h)), x)

    def _normed(self, x: torch.Tensor, weight: torch.Tensor) -> torch.Tensor:
        from torch.nn.functional import rms_norm

        return rms_norm(x, weight.shape, weight, self.shape.epsilon)

    def _turn(self, lengths: torch.Tensor, count: int) -> torch.Tensor:
        """(b, s, 1, hd/2) complex rotations of the positions that follow `lengths`."""
        import torch

        places = (lengths[:, None] + torch.arange(count)).clamp_(max=len(self._turns) - 1)  # padding may run over
        return self._turns[places][:, :, None]


def _layer(tensors: Mapping[str, torch.Tensor], prefix: str, kernels: Kernels, biased: bool) -> _Layer:
    import torch

    def one(name: str) -> Linear:
        return linear(tensors[f"{prefix}{name}.weight"], None, kernels)

    def joined(suffix: str) -> torch.Tensor:
        return torch.cat([tensors[f"{prefix}attn_{part}.{suffix}"] for part in "qkv"])

    return _Layer(
        before=tensors[f"{prefix}attn_norm.weight"].clone(),
        qkv=linear(joined("weight"), joined("bias") if biased else None, kernels),
        out=one("attn_output"),
        between=tensors[f"{prefix}ffn_norm.weight"].clone(),
        gate=one("ffn_gate"),
        up=one("ffn_up"),
        down=one("ffn_down"),
    )


def rotations(shape: Shape, factors: npt.NDArray[np.float32] | None) -> torch.Tensor:
    """(context, hd/2) complex64 rotations e^(i·position·frequency)."""
    import torch

    frequencies = shape.rope_base ** (-torch.arange(0, shape.head, 2, dtype=torch.float64) / shape.head)
    if factors is not None:
        frequencies = frequencies / torch.from_numpy(factors)
    angles = torch.outer(torch.arange(shape.context, dtype=torch.float64), frequencies)
    return torch.polar(torch.ones_like(angles), angles).to(torch.complex64)


def rotated(x: torch.Tensor, turns: torch.Tensor) -> torch.Tensor:
    """x (b, s, h, hd) with neighbouring pairs of each head turned, in float32."""
    import torch

    pairs = torch.view_as_complex(x.float().reshape(*x.shape[:-1], -1, 2))  # (b, s, h, hd/2)
    return torch.view_as_real(pairs * turns).flatten(-2).to(x.dtype)
