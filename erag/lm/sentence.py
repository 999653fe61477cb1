"""Sentence embeddings in torch from a local sentence-transformers folder."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from erag.lm.bert import BertEncoder, is_plain_bert
from erag.lm.ledger import Ledger
from erag.lm.local import LocalModel, versions
from erag.lm.offline import go_offline
from erag.lm.probe import DtypeWish, choose_dtype
from erag.lm.roles import RoleName, TextKind, Vectors
from erag.lm.weights import ModelStore

if TYPE_CHECKING:
    import torch

Encode = Callable[[Sequence[str]], "torch.Tensor"]

RUNTIME = ("torch", "tokenizers", "safetensors")


class SentenceConfig(BaseModel):
    """The `sentence` backend: a model of the store, its precision, and how many texts a batch holds."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["sentence"] = "sentence"
    model: str = "minilm-l6"
    dtype: DtypeWish = "auto"
    batch_size: int = Field(32, ge=1, le=4096, description="texts computed together; part of the batch plan")
    call_size: int = Field(512, ge=1, le=65_536, description="texts recorded together in one transaction")


class SentenceEmbedder(LocalModel[SentenceConfig]):
    """The embed role. Weights are verified and loaded at the first text."""

    roles: frozenset[RoleName] = frozenset({"embed"})

    def __init__(self, config: SentenceConfig, store: ModelStore, ledger: Ledger | None = None) -> None:
        super().__init__(config, store, ledger)
        self._dtype = choose_dtype(config.dtype)
        self._encode: Encode | None = None

    def _stated(self) -> Mapping[str, Any]:
        return {"kind": "sentence", "weights": self._store.fingerprint(self._config.model)}

    def _runtime(self) -> Mapping[str, Any]:
        return {"dtype": self._dtype, "batch_size": self._config.batch_size, **versions(RUNTIME, "sentence")}

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
            return self._load_library(str(folder), dtype)
        encoder = BertEncoder(folder, dtype)

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
