"""BERT encoders (MiniLM and its kin) straight from their sentence-transformers folder.

Reading the folder ourselves starts in a third of the time that importing sentence-transformers takes, which is what a
first query waits for; a test holds the vectors against that library's.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from erag.core.errors import ModelError

if TYPE_CHECKING:
    import torch
    from tokenizers import Tokenizer

_LAYER = "encoder.layer.{}."
_PLAIN_STEPS = ("Transformer", "Pooling", "Normalize")


def is_plain_bert(folder: Path) -> bool:
    """Whether the folder is a BERT with mean pooling and unit output, which `BertEncoder` computes exactly."""
    steps = [str(m["type"]).rsplit(".", 1)[-1] for m in _json(folder / "modules.json")]
    config, pooling = _json(folder / "config.json"), _json(folder / "1_Pooling/config.json")
    others = [k for k, v in pooling.items() if k.startswith("pooling_mode_") and v and k != "pooling_mode_mean_tokens"]
    return (
        tuple(steps) == _PLAIN_STEPS
        and config.get("model_type") == "bert"
        and config.get("hidden_act") == "gelu"
        and config.get("position_embedding_type", "absolute") == "absolute"
        and bool(pooling.get("pooling_mode_mean_tokens"))
        and not others
    )


@dataclass(frozen=True, slots=True)
class BertShape:
    """The sizes of a BERT: layers, heads, width, inner width, rows of its tables, and the term of its norms."""

    layers: int
    heads: int
    dim: int
    wide: int
    words: int
    positions: int
    types: int
    eps: float

    @classmethod
    def of(cls, folder: Path) -> BertShape:
        """The shape that a folder's `config.json` states. Raises ModelError where it cannot be read."""
        said = _json(folder / "config.json")
        return cls(
            layers=int(said["num_hidden_layers"]), heads=int(said["num_attention_heads"]), dim=int(said["hidden_size"]),
            wide=int(said["intermediate_size"]), words=int(said["vocab_size"]),
            positions=int(said["max_position_embeddings"]), types=int(said["type_vocab_size"]),
            eps=float(said["layer_norm_eps"]),
        )  # fmt: skip


def bert_weights(folder: Path) -> dict[str, torch.Tensor]:
    """The weights of a folder by the names that BERT gives them, in the precision of the file."""
    from safetensors.torch import load_file

    found = load_file(folder / "model.safetensors").items()
    return {name.removeprefix("bert."): tensor for name, tensor in found if tensor.is_floating_point()}


def tokenizer_of(folder: Path) -> Tokenizer:
    """The tokenizer of a folder; it neither pads nor cuts."""
    from tokenizers import Tokenizer

    tokenizer = Tokenizer.from_file(str(folder / "tokenizer.json"))
    tokenizer.no_truncation()
    tokenizer.no_padding()
    return tokenizer


class BertEncoder:
    """Texts to unit vectors: tokenise, encode, mean over tokens, normalise."""

    def __init__(self, folder: Path, dtype: torch.dtype) -> None:
        shape = BertShape.of(folder)
        self._heads, self._layers, self._eps, self.dim = shape.heads, shape.layers, shape.eps, shape.dim
        self._weights: Mapping[str, torch.Tensor] = {
            name: tensor.to(dtype) for name, tensor in bert_weights(folder).items()
        }
        self.max_tokens = int(_json(folder / "sentence_bert_config.json")["max_seq_length"])
        self._tokenizer = tokenizer_of(folder)
        self._tokenizer.enable_truncation(self.max_tokens)

    def tokenise(self, texts: Sequence[str]) -> tuple[list[list[int]], int]:
        """Token ids of each text, cut to `max_tokens`, and how many texts were cut."""
        encoded = self._tokenizer.encode_batch(list(texts))
        return [list(e.ids) for e in encoded], sum(bool(e.overflowing) for e in encoded)

    @property
    def nbytes(self) -> int:
        """Bytes of the weights in memory."""
        return sum(weight.nbytes for weight in self._weights.values())

    def encode(self, ids: Sequence[Sequence[int]]) -> torch.Tensor:
        """(b, d) float32 unit rows for token ids, padded to the longest."""
        import torch
        import torch.nn.functional as nnf

        length = max(map(len, ids))
        tokens = torch.tensor([[*row, *[0] * (length - len(row))] for row in ids])  # (b, t)
        mask = torch.tensor([[True] * len(row) + [False] * (length - len(row)) for row in ids])  # (b, t)
        with torch.inference_mode():
            hidden = self._embed(tokens)  # (b, t, d)
            for layer in range(self._layers):
                hidden = self._block(hidden, mask[:, None, None, :], _LAYER.format(layer))
            kept = hidden.float() * mask[:, :, None]
            return nnf.normalize(kept.sum(1) / mask.sum(1, keepdim=True), dim=1)

    def _embed(self, tokens: torch.Tensor) -> torch.Tensor:
        import torch

        w = self._weights
        positions = w["embeddings.position_embeddings.weight"][: tokens.shape[1]]
        types = w["embeddings.token_type_embeddings.weight"][0]
        words = torch.nn.functional.embedding(tokens, w["embeddings.word_embeddings.weight"])
        return self._norm(words + positions + types, "embeddings.LayerNorm.")

    def _block(self, x: torch.Tensor, mask: torch.Tensor, prefix: str) -> torch.Tensor:
        import torch.nn.functional as nnf

        b, t, d = x.shape
        q, k, v = (
            self._linear(x, f"{prefix}attention.self.{part}.").view(b, t, self._heads, -1).transpose(1, 2)
            for part in ("query", "key", "value")
        )
        mixed = nnf.scaled_dot_product_attention(q, k, v, attn_mask=mask).transpose(1, 2).reshape(b, t, d)
        x = self._norm(
            x + self._linear(mixed, f"{prefix}attention.output.dense."), f"{prefix}attention.output.LayerNorm."
        )
        wide = nnf.gelu(self._linear(x, f"{prefix}intermediate.dense."))
        return self._norm(x + self._linear(wide, f"{prefix}output.dense."), f"{prefix}output.LayerNorm.")

    def _linear(self, x: torch.Tensor, prefix: str) -> torch.Tensor:
        import torch.nn.functional as nnf

        return nnf.linear(x, self._weights[f"{prefix}weight"], self._weights[f"{prefix}bias"])

    def _norm(self, x: torch.Tensor, prefix: str) -> torch.Tensor:
        import torch.nn.functional as nnf

        w = self._weights
        return nnf.layer_norm(x, x.shape[-1:], w[f"{prefix}weight"], w[f"{prefix}bias"], self._eps)


def _json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ModelError(
            f"cannot read {path.name}: {error}", where=str(path.parent), repair="erag models verify"
        ) from error
