"""The decoder of a GGUF model with low-rank terms that can be trained; its own weights stay as they are.

This module imports torch; it is itself imported only where an adapter is trained.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
import torch
import torch.nn.functional as nnf

from erag.lm.torchlm.decoder import rotated, rotations
from erag.lm.torchlm.lora import DOWN, UP, factor_name, factor_sizes
from erag.lm.torchlm.shape import EMBEDDING, FINAL_NORM, HEAD, Shape

Parts = Mapping[str, torch.Tensor]  # factors (layers, rank, …) in the precision of the products
Seen = tuple[torch.Tensor, torch.Tensor]  # keys and values (b, kv, t, hd) of a layer


class LowRank(torch.nn.Module):
    """As `Decoder`, differentiable and without a cache: W x + scale × up^T (down x) for every projection W.

    `tensors` are those of `dequantised`. They are no parameters, so that a checkpoint of this module holds the factors
    alone; `factors` begin with `up` zero, so that nothing is changed before the first step.
    """

    def __init__(
        self, shape: Shape, tensors: Mapping[str, torch.Tensor], rank: int, alpha: float,
        rope_factors: npt.NDArray[np.float32] | None = None,
    ) -> None:  # fmt: skip
        super().__init__()
        self.shape, self._rank, self._scale = shape, rank, alpha / rank
        self._tensors = dict(tensors)
        self._turns = rotations(shape, rope_factors)
        self.factors = torch.nn.ParameterDict()
        for name, size in factor_sizes(shape, rank).items():
            first = torch.randn(size) * size[1] ** -0.5 if name.endswith(DOWN) else torch.zeros(size)
            self.factors[name] = torch.nn.Parameter(first)

    @property
    def dtype(self) -> torch.dtype:
        """What products are computed in; the factors are float32 and rounded to it."""
        return self._tensors[EMBEDDING].dtype

    def forward(self, prefix: torch.Tensor, rows: torch.Tensor) -> torch.Tensor:
        """Hidden states (b, s, d) of the tokens `rows` (b, s), each row after the tokens `prefix` (p,) or none."""
        parts = {name: self._rounded(name).view(self.shape.layers, self._rank, -1) for name in self.factors}
        seen: Sequence[Seen] | None = None
        if len(prefix):
            _, seen = self._read(prefix[None], None, parts)
        return self._read(rows, seen, parts)[0]

    def logits(self, hidden: torch.Tensor) -> torch.Tensor:
        """(n, vocabulary) of hidden states (n, d)."""
        head = self._tensors[EMBEDDING if self.shape.tied else HEAD]
        return nnf.linear(self._normed(hidden, FINAL_NORM), head)

    def _rounded(self, name: str) -> torch.Tensor:
        """A factor in the precision of the products, `up` with the scale of the adapter."""
        factor: torch.Tensor = self.factors[name]
        return (factor if name.endswith(DOWN) else factor * self._scale).to(self.dtype)

    def _read(self, tokens: torch.Tensor, past: Sequence[Seen] | None, parts: Parts) -> tuple[torch.Tensor, list[Seen]]:
        """Hidden states (b, s, d), and what each layer has seen of these tokens."""
        start = past[0][0].shape[2] if past else 0
        turns = self._turns[start : start + tokens.shape[1], None]  # (s, 1, hd/2)
        x = nnf.embedding(tokens, self._tensors[EMBEDDING])
        seen: list[Seen] = []
        for i in range(self.shape.layers):
            layer = {name: part[i] for name, part in parts.items()}
            x, own = self._attended(x, f"blk.{i}.", layer, turns, past[i] if past else None)
            x = self._transformed(x, f"blk.{i}.", layer)
            seen.append(own)
        return x, seen

    def _attended(
        self, x: torch.Tensor, prefix: str, parts: Parts, turns: torch.Tensor, past: Seen | None
    ) -> tuple[torch.Tensor, Seen]:
        """x (b, s, d) after attention over `past` (one row for all) and itself, and its own keys and values."""
        b, s, _ = x.shape
        h = self._normed(x, f"{prefix}attn_norm.weight")
        q, k, v = (self._product(h, prefix, f"attn_{name}", parts).view(b, s, -1, self.shape.head) for name in "qkv")
        own = rotated(k, turns).transpose(1, 2), v.transpose(1, 2)
        keys, values = own if past is None else tuple(map(_joined, past, own))
        mixed = _attention(rotated(q, turns).transpose(1, 2), keys, values).transpose(1, 2)  # (b, s, h, hd)
        return x + self._product(mixed.flatten(2), prefix, "attn_output", parts), own

    def _transformed(self, x: torch.Tensor, prefix: str, parts: Parts) -> torch.Tensor:
        """x (b, s, d) after the SwiGLU."""
        h = self._normed(x, f"{prefix}ffn_norm.weight")
        gate, up = (self._product(h, prefix, name, parts) for name in ("ffn_gate", "ffn_up"))
        return x + self._product(nnf.silu(gate) * up, prefix, "ffn_down", parts)

    def _product(self, x: torch.Tensor, prefix: str, projection: str, parts: Parts) -> torch.Tensor:
        down, up = (parts[factor_name(projection, side)] for side in (DOWN, UP))
        weight, bias = (self._tensors.get(f"{prefix}{projection}.{kind}") for kind in ("weight", "bias"))
        whole = nnf.linear(x, weight, bias).flatten(0, 1)  # type: ignore[arg-type]
        return torch.addmm(whole, nnf.linear(x, down).flatten(0, 1), up).view(*x.shape[:2], -1)

    def _normed(self, x: torch.Tensor, name: str) -> torch.Tensor:
        weight = self._tensors[name]
        return nnf.rms_norm(x, weight.shape, weight, self.shape.epsilon)


def _joined(past: torch.Tensor, own: torch.Tensor) -> torch.Tensor:
    """What one row (1, kv, p, hd) has seen before what each of several (b, kv, s, hd) has."""
    return torch.cat([past.expand(len(own), -1, -1, -1), own], 2)


def _attention(q: torch.Tensor, k: torch.Tensor, v: torch.Tensor) -> torch.Tensor:
    """q (b, h, s, hd) over k and v (b, kv, t, hd), of which the last s are of the same tokens: (b, h, s, hd).

    At the sizes of lessons this takes a third of the time of PyTorch's fused attention on a CPU, backward above all.
    """
    b, heads, s, width = q.shape
    kv, t = k.shape[1:3]
    scores = (q.reshape(b, kv, -1, width) @ k.transpose(2, 3)).view(b, heads, s, t) * width**-0.5
    later = torch.ones(s, t, dtype=torch.bool).triu(t - s + 1)
    shares = scores.masked_fill(later, -torch.inf).softmax(-1)
    mixed: torch.Tensor = shares.view(b, kv, -1, t) @ v
    return mixed.view(b, heads, s, width)
