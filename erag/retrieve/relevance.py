"""How probable it is that a node answers a query: all evidence weighed by a model fitted on training worlds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

import numpy as np
import numpy.typing as npt
import yaml
from pydantic import BaseModel, ConfigDict, Field

from erag.retrieve.corpus import Corpus
from erag.retrieve.flat import NodeScorer, SentenceScorer
from erag.retrieve.lexical import LexicalIndex
from erag.retrieve.named import bearers
from erag.retrieve.scoring import NOT_FOUND, Batch, Scores
from erag.retrieve.uses import NOTHING, Lexicon, Uses

Floats = npt.NDArray[np.float64]
SHIPPED = "relevance.yaml"
OWN = ("caption", "sentence", "caption_standard", "sentence_standard", "bm25", "words", "pairs")
SERVES = ("use", "use_rank", "uses", "uses_rank", "use_name", "use_name_rank")
NAMED = tuple(f"{how}_{name}" for how in ("best", "mean") for name in OWN)


class Weights(BaseModel):
    """A logistic model: the weight of each piece of evidence, and `bias`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    bias: float = Field(allow_inf_nan=False)
    weights: Mapping[str, float]

    def probability(self, evidence: Floats, names: Sequence[str]) -> Floats:
        """(n,) in (0, 1) of evidence (n, f) whose columns have `names`."""
        logit = evidence @ np.array([self.weights.get(name, 0.0) for name in names]) + self.bias
        return np.asarray(1 / (1 + np.exp(-np.clip(logit, -50, 50))))


class Fitted(BaseModel):
    """The shipped models: with what a language model named, and without; how they came about."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    fitted: str
    plain: Weights
    named: Weights


@lru_cache(maxsize=1)
def fitted() -> Fitted:
    """The shipped weights."""
    return Fitted.model_validate(yaml.safe_load(files("erag.retrieve").joinpath(SHIPPED).read_text("utf-8")))


@dataclass(frozen=True)
class Evidence:
    """What speaks for each of n nodes, by columns `names`: cosines, words in common, uses, and what a model named."""

    rows: Floats
    names: tuple[str, ...]


class EvidenceTable:
    """Collects the evidence of queries over one corpus."""

    def __init__(self, corpus: Corpus, lexicon: Lexicon | None) -> None:
        self.index = corpus.index
        self.searchable = corpus.searchable
        self._captions, self._sentences = NodeScorer(corpus), SentenceScorer(corpus)
        self.uses = Uses(lexicon, self.index) if lexicon is not None else None

    def of(self, batch: Batch) -> list[Evidence]:
        """The evidence for each query of a batch, rows (n, f)."""
        return [self._evidence(batch, i, own) for i, own in enumerate(self._own(batch))]

    def _evidence(self, batch: Batch, i: int, own: Floats) -> Evidence:
        parts, names = [own], [*OWN]
        if self.uses is not None:
            parts.append(self.uses.scores(batch.vectors[i]))
            names += SERVES
        if batch.named and len(batch.named[i]):
            parts.append(self._things(batch.named[i]))
            names += NAMED
        return Evidence(np.hstack(parts), tuple(names))

    def by_name(self, text: str, evidence: Evidence) -> Evidence:
        """The evidence for a request, without what things are good for at nodes that lack the name it gives.

        As it is where the request names nothing, or by a name that no node has.
        """
        rows = bearers(self.index, text)
        if not len(rows) or SERVES[0] not in evidence.names:
            return evidence
        kept, first = evidence.rows.copy(), evidence.names.index(SERVES[0])
        others = np.setdiff1d(np.arange(self.index.count), rows)
        kept[others, first : first + len(SERVES)] = NOTHING
        return Evidence(kept, evidence.names)

    def _things(self, named: Batch) -> Floats:
        """(n, 14): the best and the mean evidence for the things that would satisfy a query."""
        each = np.stack(self._own(named))
        return np.hstack([each.max(0), each.mean(0)])

    def _own(self, batch: Batch) -> list[Floats]:
        captions, sentences = self._captions.scores(batch), self._sentences.scores(batch)
        return [self._row(*parts) for parts in zip(batch.texts, captions, sentences, strict=True)]

    def _row(self, text: str, captions: Scores, sentences: Scores) -> Floats:
        cosines = np.maximum(np.stack([captions, sentences], axis=1), 0).astype(np.float64)
        known = cosines[self.searchable]
        standard = (cosines - known.mean(0)) / (known.std(0) + 1e-6) if len(known) else cosines
        return np.hstack([cosines, standard, self.index.matches(text)])


class RelevanceScorer:
    """A flat retriever: the probability that a node answers the query.

    With `literal`, a request that names a thing which the map mentions by that name is about what bears the name: what
    things are good for then speaks only for nodes that mention it.
    """

    def __init__(self, table: EvidenceTable, models: Fitted, *, literal: bool = False) -> None:
        self._table, self._models, self._literal = table, models, literal

    @property
    def index(self) -> LexicalIndex:
        """Where the words of the texts stand."""
        return self._table.index

    def scores(self, batch: Batch) -> Scores:
        """(q, n) in (0, 1); `NOT_FOUND` for nodes without text."""
        evidence = self._table.of(batch)
        if self._literal:
            evidence = [self._table.by_name(text, e) for text, e in zip(batch.texts, evidence, strict=True)]
        found = [self._model(e).probability(e.rows, e.names) for e in evidence]
        return np.where(self._table.searchable, np.stack(found), NOT_FOUND).astype(np.float32)

    def _model(self, evidence: Evidence) -> Weights:
        return self._models.named if NAMED[0] in evidence.names else self._models.plain
