"""The network of the `cross_encoder` backend: a BERT reads a query and a card together and says one number.

This module imports torch; it is itself imported only where a cross-encoder is trained or loaded.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
import torch.nn.functional as nnf
from torch import nn

from erag.core.errors import ModelError
from erag.lm.bert import BertShape, bert_weights, is_plain_bert
from erag.lm.cross_header import CrossHeader
from erag.lm.cross_tokens import Frame, Ids
from erag.lm.probe import Dtype

Row = tuple[Ids, Ids]  # the halves of a row, see `Frame.row`
_LAYER = "encoder.layer.{}."


@dataclass(frozen=True, slots=True, eq=False)
class Read:
    """p pairs as tokens, padded on the right: `tokens` and `types` (p, t) int64, `there` (p, t) bool.

    A row is [CLS] query [SEP] card [SEP]; `types` is 0 up to the first [SEP] and 1 from the card on.
    """

    tokens: torch.Tensor
    types: torch.Tensor
    there: torch.Tensor


def padded(rows: Sequence[Row]) -> Read:
    """Rows in one batch."""
    shape = len(rows), max(len(first) + len(second) for first, second in rows)
    read = Read(*(torch.zeros(shape, dtype=dtype) for dtype in (torch.long, torch.long, torch.bool)))
    for place, (first, second) in enumerate(rows):
        length = len(first) + len(second)
        read.tokens[place, :length] = torch.tensor([*first, *second])
        read.types[place, len(first) : length] = 1
        read.there[place, :length] = True
    return read


class Layer(nn.Module):
    """A layer of a BERT; its parameters are called what BERT calls them."""

    def __init__(self, shape: BertShape, dropout: float) -> None:
        super().__init__()
        d, self._heads, self._dropout = shape.dim, shape.heads, dropout
        inner = nn.ModuleDict({part: nn.Linear(d, d) for part in ("query", "key", "value")})
        self.attention = nn.ModuleDict({"self": inner, "output": _closing(d, d, shape.eps)})
        self.intermediate = nn.ModuleDict({"dense": nn.Linear(d, shape.wide)})
        self.output = _closing(shape.wide, d, shape.eps)

    def forward(self, x: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
        """x: (p, t, d) → (p, t, d); `mask` (p, 1, 1, t) bool says which tokens are there."""
        p, t, d = x.shape
        q, k, v = (
            self.attention["self"][part](x).view(p, t, self._heads, -1).transpose(1, 2)  # type: ignore[index]
            for part in ("query", "key", "value")
        )
        mixed = nnf.scaled_dot_product_attention(q, k, v, attn_mask=mask).transpose(1, 2).reshape(p, t, d)
        x = self._closed(self.attention["output"], mixed, x)
        return self._closed(self.output, nnf.gelu(self.intermediate["dense"](x)), x)

    def _closed(self, closing: nn.Module, inner: torch.Tensor, x: torch.Tensor) -> torch.Tensor:
        made = nnf.dropout(closing["dense"](inner), self._dropout, self.training)  # type: ignore[index]
        normed: torch.Tensor = closing["LayerNorm"](x + made)  # type: ignore[index]
        return normed


def _closing(inputs: int, d: int, eps: float) -> nn.ModuleDict:
    return nn.ModuleDict({"dense": nn.Linear(inputs, d), "LayerNorm": nn.LayerNorm(d, eps)})


class Base(nn.Module):
    """The part of a BERT that is left as it is: its embeddings and its lower layers."""

    def __init__(self, shape: BertShape, layers: int) -> None:
        super().__init__()
        self.words = nn.Embedding(shape.words, shape.dim)
        self.positions = nn.Embedding(shape.positions, shape.dim)
        self.types = nn.Embedding(shape.types, shape.dim)
        self.norm = nn.LayerNorm(shape.dim, shape.eps)
        self.layers = nn.ModuleList(Layer(shape, 0.0) for _ in range(layers))

    @torch.no_grad()
    def forward(self, read: Read) -> torch.Tensor:
        """(p, t, d) in the precision of the weights; nothing is learnt here."""
        types = read.types.clamp_max(self.types.num_embeddings - 1)
        places = self.positions.weight[: read.tokens.shape[1]]
        x: torch.Tensor = self.norm(self.words(read.tokens) + places + self.types(types))
        for layer in self.layers:
            x = layer(x, read.there[:, None, None, :])
        return x


class Upper(nn.Module):
    """What is taught: the upper layers, and the one number that is made of what they say."""

    def __init__(self, shape: BertShape, header: CrossHeader, dropout: float) -> None:
        super().__init__()
        self.layers = nn.ModuleList(Layer(shape, dropout) for _ in range(header.layers))
        self.head = nn.Linear(shape.dim, 1)
        self._mean, self._dropout = header.pooling == "mean", dropout

    def forward(self, x: torch.Tensor, there: torch.Tensor) -> torch.Tensor:
        """(p,) float32 logits of p pairs for x (p, t, d) and `there` (p, t) bool."""
        for layer in self.layers:
            x = layer(x, there[:, None, None, :])
        kept = there[:, :, None]
        seen = (x.float() * kept).sum(1) / kept.sum(1) if self._mean else x[:, 0].float()
        seen = nnf.dropout(seen, self._dropout, self.training)
        logits: torch.Tensor = (seen * self.head.weight).sum(1) + self.head.bias  # float32, also within autocast
        return logits


@dataclass(frozen=True, slots=True, eq=False)
class CrossNetwork:
    """A frozen base below what is taught."""

    base: Base
    upper: Upper
    frame: Frame

    def logits(self, pairs: Sequence[tuple[Ids, Ids]], most: int) -> torch.Tensor:
        """(p,) float32 logits of pairs of (query, card), `most` of about equal length at a time.

        Which pairs are computed together follows from what they say, not from their order; equal ones are computed
        once.
        """
        rows = [self.frame.row(query, card) for query, card in pairs]
        distinct = sorted(set(rows), key=lambda row: (len(row[0]) + len(row[1]), row))
        if not distinct:
            return torch.empty(0)
        found = torch.cat([self._some(distinct[i : i + most]) for i in range(0, len(distinct), most)])
        place = {row: number for number, row in enumerate(distinct)}
        return found[torch.tensor([place[row] for row in rows])]

    def at_work(self, dtype: Dtype) -> CrossNetwork:
        """The same, nothing learnt any more and its layers in `dtype`."""
        self.upper.eval().requires_grad_(False)
        self.upper.layers.to(getattr(torch, dtype))
        return self

    def _some(self, rows: Sequence[Row]) -> torch.Tensor:
        read = padded(rows)
        found: torch.Tensor = self.upper(self.base(read), read.there)
        return found


def build(folder: Path, header: CrossHeader, frame: Frame, dtype: Dtype, dropout: float = 0.0) -> CrossNetwork:
    """The network over a sentence-transformers folder of a BERT, its upper layers as they are there.

    The base is in `dtype`, what is taught float32; the head begins near zero. Raises ModelError where the folder is no
    plain BERT, or has fewer layers or positions than the header asks for.
    """
    where = f"model {header.base}"
    if not is_plain_bert(folder):
        raise ModelError("is no plain BERT", where=where, allowed="MiniLM and its kin")
    shape, weights = BertShape.of(folder), bert_weights(folder)
    if header.layers > shape.layers or header.max_tokens > shape.positions:
        asked = f"{header.layers} layers and {header.max_tokens} tokens are asked of it"
        raise ModelError(asked, where=where, allowed=f"up to {shape.layers} layers and {shape.positions} tokens")
    base, upper = Base(shape, shape.layers - header.layers), Upper(shape, header, dropout)
    names = {
        "words.": "embeddings.word_embeddings.", "positions.": "embeddings.position_embeddings.",
        "types.": "embeddings.token_type_embeddings.", "norm.": "embeddings.LayerNorm.",
    }  # fmt: skip
    base.load_state_dict(_renamed(weights, {**names, **_layers(0, len(base.layers))}))
    upper.layers.load_state_dict(_renamed(weights, _layers(len(base.layers), header.layers, "")))
    nn.init.normal_(upper.head.weight, std=0.02)
    nn.init.zeros_(upper.head.bias)
    base.to(getattr(torch, dtype)).eval().requires_grad_(False)
    return CrossNetwork(base, upper, frame)


def _layers(first: int, count: int, under: str = "layers.") -> dict[str, str]:
    """What layers are called here, and what BERT calls them."""
    return {f"{under}{number}.": _LAYER.format(first + number) for number in range(count)}


def _renamed(weights: Mapping[str, torch.Tensor], names: Mapping[str, str]) -> dict[str, torch.Tensor]:
    return {
        ours + name.removeprefix(theirs): tensor.float()
        for ours, theirs in names.items()
        for name, tensor in weights.items()
        if name.startswith(theirs)
    }
