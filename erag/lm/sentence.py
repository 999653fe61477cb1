"""Sentence embeddings in torch from a local sentence-transformers folder."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from erag.core.errors import ModelError
from erag.lm.bert import BertEncoder, is_plain_bert
from erag.lm.ledger import Ledger
from erag.lm.local import LocalModel, versions
from erag.lm.offline import go_offline
from erag.lm.probe import Dtype, choose_dtype
from erag.lm.roles import RoleName, TextKind, Vectors
from erag.lm.weights import ModelStore

if TYPE_CHECKING:
    import torch

    from erag.lm.int8 import Int8

Encode = Callable[[Sequence[str]], "torch.Tensor"]

RUNTIME = ("torch", "tokenizers", "safetensors")
Precision = Literal["auto", "float32", "bfloat16", "int8", "int8_products"]


class SentenceConfig(BaseModel):
    """The `sentence` backend: a model of the store, its precision, and how many texts a batch holds.

    `int8` keeps the layers' matrices in a quarter of the memory, `int8_products` multiplies in whole numbers too; both
    for a plain BERT only.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["sentence"] = "sentence"
    model: str = "minilm-l6"
    dtype: Precision = "auto"
    batch_size: int = Field(32, ge=1, le=4096, description="texts computed together; part of the batch plan")
    call_size: int = Field(512, ge=1, le=65_536, description="texts recorded together in one transaction")


class SentenceEmbedder(LocalModel[SentenceConfig]):
    """The embed role. Weights are verified and loaded at the first text."""

    roles: frozenset[RoleName] = frozenset({"embed"})

    def __init__(self, config: SentenceConfig, store: ModelStore, ledger: Ledger | None = None) -> None:
        super().__init__(config, store, ledger)
        self._dtype, self._int8 = _precision(config.dtype)
        self._encode: Encode | None = None

    def _stated(self) -> Mapping[str, Any]:
        return {"kind": "sentence", "weights": self._store.fingerprint(self._config.model)}

    def _runtime(self) -> Mapping[str, Any]:
        dtype = self._int8 or self._dtype
        return {"dtype": dtype, "batch_size": self._config.batch_size, **versions(RUNTIME, "sentence")}

    def embed(self, texts: Sequence[str], kind: TextKind) -> Vectors:
        """(n, d) float32 unit rows; texts of similar length are computed together. `kind` makes no difference here."""
        del kind
        if not texts:
            return np.empty((0, 0), np.float32)
        if self._encode is None:
            self._encode = self._load()
        order = sorted(range(len(texts)), key=lambda i: (len(texts[i]), texts[i]))
        size = self._config.batch_size
        batches = [order[i : i + size] for i in range(0, len(order), size)]
        rows = np.concatenate([self._encode([texts[i] for i in batch]).numpy() for batch in batches])
        vectors = np.empty_like(rows, dtype=np.float32)
        vectors[order] = rows
        return vectors

    def _load(self) -> Encode:
        versions(RUNTIME, "sentence")
        folder = self._store.path(self._config.model)
        import torch

        dtype = getattr(torch, self._dtype)
        if not is_plain_bert(folder):
            if self._int8 is not None:
                raise ModelError(
                    "is no plain BERT", where=f"model {self._config.model}", allowed=f"{self._int8} of one"
                )
            return self._load_library(str(folder), dtype)
        encoder = BertEncoder(folder, dtype) if self._int8 is None else _int8(folder, self._int8)

        def encode(texts: Sequence[str]) -> torch.Tensor:
            ids, cut = encoder.tokenise(texts)
            if cut:
                self._ledger.events["texts cut to the embedder's length"] += cut
            return encoder.encode(ids)

        return encode

    def _load_library(self, folder: str, dtype: torch.dtype) -> Encode:
        """Any other architecture goes through sentence-transformers itself."""
        go_offline()
        from sentence_transformers import SentenceTransformer

        model = SentenceTransformer(folder, device="cpu", local_files_only=True).to(dtype)

        def encode(texts: Sequence[str]) -> torch.Tensor:
            vectors: torch.Tensor = model.encode(
                list(texts), batch_size=len(texts), convert_to_tensor=True, normalize_embeddings=True
            )
            return vectors.float()

        return encode


def _int8(folder: Path, form: Int8) -> BertEncoder:
    from erag.lm.int8 import Int8Encoder

    return Int8Encoder(folder, form)


def _precision(wish: Precision) -> tuple[Dtype, Int8 | None]:
    """In what is computed, and the form of the layers' matrices where it is another one."""
    if wish == "int8" or wish == "int8_products":
        return "float32", wish
    return choose_dtype(wish), None
