"""The `adapter` backend: select and score by a small trained network over frozen sentence embeddings."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from erag.lm.adapter_header import RULES, AdapterHeader, head, parts, stems
from erag.lm.checkpoints import check_embedder, load_into, read_header, shipped
from erag.lm.fake import Fake, FakeConfig
from erag.lm.ledger import Ledger
from erag.lm.odds import Chooser, Pair
from erag.lm.roles import RoleName, Vectors
from erag.lm.sentence import SentenceConfig, SentenceEmbedder
from erag.lm.weights import ModelStore

if TYPE_CHECKING:
    import torch

    from erag.lm.adapter_network import AdapterNetwork, Forms

HEADER = "adapter"
SHIPPED = "selector.safetensors"
REPAIR = "erag distil --config configs/distil/selector.yaml"
Embed = Callable[[Sequence[str]], Vectors]
AnyEmbedder = SentenceEmbedder | Fake


EmbedderConfig = Annotated[SentenceConfig | FakeConfig, Field(discriminator="kind")]


def embedder_of(config: SentenceConfig | FakeConfig, store: ModelStore, ledger: Ledger | None = None) -> AnyEmbedder:
    """The embedder an adapter stands on; nothing is loaded yet."""
    return Fake(config) if isinstance(config, FakeConfig) else SentenceEmbedder(config, store, ledger)


class AdapterConfig(BaseModel):
    """The `adapter` backend: a checkpoint (None: the one that comes with the project) over an embedder.

    `kept`: how many queries and how many cards are remembered with their vectors; a card is embedded in parts once.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["adapter"] = "adapter"
    checkpoint: Path | None = None
    embedder: EmbedderConfig = SentenceConfig()
    card_chars: int = Field(4000, ge=16, le=32_000, description="read of a card")
    call_size: int = Field(256, ge=1, le=65_536, description="decisions or pairs recorded together")
    kept: int = Field(20_000, ge=1)


@dataclass(frozen=True, slots=True, eq=False)
class Text:
    """A query or a card: vectors of the whole (d,), of its head (d,) and of its parts (p, d), unit rows; its words."""

    whole: Vectors
    head: Vectors
    parts: Vectors
    stems: frozenset[str]


def features(query: Text, card: Text) -> list[float]:
    """The `FEATURES` of a pair."""
    common = len(query.stems & card.stems) / len(query.stems) if query.stems else 0.0
    best = float((card.parts @ query.whole).max())
    return [float(query.whole @ card.whole), float(query.whole @ card.head), best, common]


def queries(texts: Sequence[str], embed: Embed) -> dict[str, Text]:
    """Each distinct text as a query: only the whole of it counts."""
    distinct = list(dict.fromkeys(texts))
    rows = embed(distinct) if distinct else ()
    return {t: Text(row, row, row[None], stems(t)) for t, row in zip(distinct, rows, strict=True)}


def cards(texts: Sequence[str], embed: Embed) -> dict[str, Text]:
    """Each distinct text as a card."""
    pieces = {t: (t, head(t), *parts(t)) for t in dict.fromkeys(texts)}
    distinct = sorted({piece for some in pieces.values() for piece in some})
    rows = dict(zip(distinct, embed(distinct), strict=True)) if distinct else {}
    return {
        t: Text(rows[some[0]], rows[some[1]], np.stack([rows[piece] for piece in some[2:]]), stems(t))
        for t, some in pieces.items()
    }


@dataclass(frozen=True, slots=True, eq=False)
class _Form:
    """A text with what the network makes of it: a query's (members, rank), a card's numbers in one row."""

    text: Text
    form: torch.Tensor


class Adapter(Chooser):
    """The select and score roles. Weights are verified and loaded at the first decision."""

    def __init__(self, config: AdapterConfig, store: ModelStore, ledger: Ledger | None = None) -> None:
        self._config, self._embedder = config, embedder_of(config.embedder, store, ledger)
        self._path = config.checkpoint or shipped(SHIPPED)
        self._digest: str | None = None
        self._loaded: tuple[AdapterHeader, AdapterNetwork] | None = None
        self._queries: dict[str, _Form] = {}
        self._cards: dict[str, _Form] = {}

    def identity(self, role: RoleName) -> str:
        """The bytes of the checkpoint and the embedder's weights; raises ModelError where there is no checkpoint."""
        del role
        if self._digest is None:
            read_header(self._path, HEADER, AdapterHeader, REPAIR)
            self._digest = hashlib.sha256(self._path.read_bytes()).hexdigest()
        parts = {"kind": "adapter", "weights": self._digest, "card_chars": self._config.card_chars}
        return json.dumps({**parts, "embedder": self._embedder.identity("embed")}, sort_keys=True)

    def fingerprint(self, role: RoleName) -> str:
        """The identity with that of the embedder's run."""
        return json.dumps({**json.loads(self.identity(role)), "embedder": self._embedder.fingerprint("embed")})

    def batch_size(self, role: RoleName) -> int:
        del role
        return self._config.call_size

    def log_odds(self, pairs: Sequence[Pair], owners: Sequence[int] | None = None) -> Vectors:
        """(p,) float32; cards of one choice are trusted together."""
        header, _ = self._load()
        return header.slope * self._logits(pairs, owners) + header.offset

    def _logits(self, pairs: Sequence[Pair], owners: Sequence[int] | None = None) -> Vectors:
        """(p,) float32, the mean of the members; `owners` numbers the choice that each card is part of."""
        import torch

        if not pairs:
            return np.empty(0, np.float32)
        _, network = self._load()
        pairs = [(query, card[: self._config.card_chars]) for query, card in pairs]
        asked, shown = self._prepared(pairs, network)
        both = list(zip(asked, shown, strict=True))
        with torch.inference_mode():
            forms = _unpacked(torch.stack([card.form for card in shown]), network)
            if owners is not None:
                forms = forms.together(torch.tensor(owners))
            seen = torch.tensor([features(query.text, card.text) for query, card in both])
            found = network.logits(torch.stack([query.form for query in asked]), forms, seen)
            mean: Vectors = found.mean(dim=1).numpy()
        return mean

    def _prepared(self, pairs: Sequence[Pair], network: AdapterNetwork) -> tuple[list[_Form], list[_Form]]:
        """Queries and cards of the pairs, what is new embedded first."""
        import torch

        asked = [query for query, _ in pairs if query not in self._queries]
        shown = [card for _, card in pairs if card not in self._cards]
        with torch.inference_mode():
            for name, text in queries(asked, self._embed).items():
                form = network.queries(torch.from_numpy(text.whole)[None])[0]
                self._queries[name] = _Form(text, form)
            for name, text in cards(shown, self._embed).items():
                whole, first = torch.from_numpy(text.whole)[None], torch.from_numpy(text.head)[None]
                self._cards[name] = _Form(text, _packed(network.cards(whole, first)))
        found = [self._queries[query] for query, _ in pairs], [self._cards[card] for _, card in pairs]
        self._queries = _newest(self._queries, self._config.kept)
        self._cards = _newest(self._cards, self._config.kept)
        return found

    def _embed(self, texts: Sequence[str]) -> Vectors:
        return self._embedder.embed(texts, "document")

    def _load(self) -> tuple[AdapterHeader, AdapterNetwork]:
        if self._loaded is None:
            header = read_header(self._path, HEADER, AdapterHeader, REPAIR)
            check_embedder(self._path, header, self._embedder, RULES, REPAIR)
            self._loaded = header, load_network(self._path, header)
        return self._loaded


def _packed(forms: Forms) -> torch.Tensor:
    """The numbers of one card in a row: form, bias, trust."""
    import torch

    return torch.cat([forms.form.flatten(), forms.bias.flatten(), forms.trust])


def _unpacked(rows: torch.Tensor, network: AdapterNetwork) -> Forms:
    from erag.lm.adapter_network import Forms

    members = network.base.shape[0]
    form = rows[:, : -members - 1].view(len(rows), members, -1)
    return Forms(form, rows[:, -members - 1 : -1], rows[:, -1])


def load_network(path: Path, header: AdapterHeader) -> AdapterNetwork:
    """The network of a checkpoint, ready. Raises ModelError where its weights do not fit its header."""
    from erag.lm.adapter_network import AdapterNetwork

    network = AdapterNetwork(header)
    load_into(path, network, REPAIR)
    return network


def _newest(known: dict[str, _Form], most: int) -> dict[str, _Form]:
    return known if len(known) <= most else dict(list(known.items())[-most:])
