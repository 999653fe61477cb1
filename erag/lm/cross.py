"""The `cross_encoder` backend: select and score by a small BERT that reads query and card together."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from erag.core.errors import ModelError
from erag.lm.checkpoints import load_into, read_header, shipped
from erag.lm.cross_header import RULES, CrossHeader
from erag.lm.cross_tokens import PairTokens
from erag.lm.ledger import Ledger
from erag.lm.local import LocalModel, versions
from erag.lm.odds import Chooser, Pair
from erag.lm.probe import Dtype, DtypeWish, choose_dtype
from erag.lm.roles import Vectors
from erag.lm.weights import ModelStore

if TYPE_CHECKING:
    from erag.lm.cross_network import CrossNetwork

HEADER = "cross_encoder"
SHIPPED = "cross-encoder.safetensors"
REPAIR = "erag distil --config configs/distil/cross-encoder.yaml"
MOST_BYTES = 25_000_000
CHARS = 4000  # read of a query and of a card before they become tokens
CUT = "pairs cut to the cross-encoder's length"
RUNTIME = ("torch", "tokenizers", "safetensors")


class CrossEncoderConfig(BaseModel):
    """The `cross_encoder` backend: a checkpoint (None: the one that comes with the project) over a BERT of the store.

    `batch_size` counts distinct pairs.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["cross_encoder"] = "cross_encoder"
    checkpoint: Path | None = None
    dtype: DtypeWish = "auto"
    batch_size: int = Field(32, ge=1, le=4096, description="pairs computed together; part of the batch plan")
    call_size: int = Field(256, ge=1, le=65_536, description="decisions or pairs recorded together")


def header_of(path: Path) -> CrossHeader:
    """The header of a checkpoint. Raises ModelError for a file that is none, or of other rules."""
    header = read_header(path, HEADER, CrossHeader, REPAIR, most=MOST_BYTES)
    if header.rules != RULES:
        what = f"was trained by rules {header.rules}"
        raise ModelError(what, where=str(path), allowed=f"rules {RULES}", repair=REPAIR)
    return header


class CrossEncoder(Chooser, LocalModel[CrossEncoderConfig]):
    """The select and score roles. Weights are verified and loaded at the first decision."""

    def __init__(self, config: CrossEncoderConfig, store: ModelStore, ledger: Ledger | None = None) -> None:
        super().__init__(config, store, ledger)
        self._path, self._dtype = config.checkpoint or shipped(SHIPPED), choose_dtype(config.dtype)
        self._known: tuple[CrossHeader, str] | None = None
        self._loaded: tuple[PairTokens, CrossNetwork] | None = None

    def _stated(self) -> Mapping[str, Any]:
        header, digest = self._header()
        return {"kind": "cross_encoder", "weights": digest, "base": header.weights}

    def _runtime(self) -> Mapping[str, Any]:
        size = self._config.batch_size
        return {"dtype": self._dtype, "batch_size": size, **versions(RUNTIME, "sentence")}

    def log_odds(self, pairs: Sequence[Pair], owners: Sequence[int] | None = None) -> Vectors:
        """(p,) float32; each pair is judged on its own."""
        del owners
        header, _ = self._header()
        return header.slope * self._logits(pairs) + header.offset

    def _logits(self, pairs: Sequence[Pair]) -> Vectors:
        """(p,) float32."""
        import torch

        if not pairs:
            return np.empty(0, np.float32)
        tokens, network = self._load()
        texts = list(dict.fromkeys(text[:CHARS] for pair in pairs for text in pair))
        ids = dict(zip(texts, tokens.encode(texts), strict=True))
        both = [(ids[query[:CHARS]], ids[card[:CHARS]]) for query, card in pairs]
        if cut := sum(network.frame.cuts(*pair) for pair in both):
            self._ledger.events[CUT] += cut
        with torch.inference_mode():
            found: Vectors = network.logits(both, self._config.batch_size).numpy()
        return found

    def _header(self) -> tuple[CrossHeader, str]:
        """The header and the sha256 of the checkpoint. Raises ModelError where it stands on other weights."""
        if self._known is None:
            header = header_of(self._path)
            there = self._store.fingerprint(header.base)
            if there != header.weights:
                what = f"was trained on {header.base} with the fingerprint {header.weights}"
                raise ModelError(what, where=str(self._path), allowed=there, repair=REPAIR)
            self._known = header, hashlib.sha256(self._path.read_bytes()).hexdigest()
        return self._known

    def _load(self) -> tuple[PairTokens, CrossNetwork]:
        if self._loaded is None:
            header, _ = self._header()
            self._loaded = load_network(self._path, header, self._store, self._dtype)
        return self._loaded


def load_network(path: Path, header: CrossHeader, store: ModelStore, dtype: Dtype) -> tuple[PairTokens, CrossNetwork]:
    """The network of a checkpoint, ready. Raises ModelError where weights do not fit the header or are not finite."""
    versions(RUNTIME, "sentence")
    from erag.lm.cross_network import build

    folder = store.path(header.base)
    tokens = PairTokens(folder, header.max_tokens)
    network = build(folder, header, tokens.frame, dtype)
    load_into(path, network.upper, REPAIR)
    if not all(bool(weight.isfinite().all()) for weight in network.upper.parameters()):
        raise ModelError("some of its weights are not finite", where=str(path), repair=REPAIR)
    return tokens, network.at_work(dtype)
