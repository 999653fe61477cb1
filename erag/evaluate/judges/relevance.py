"""A judge without a language model that knows what things are good for: our model of relevance, over the truth."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from erag.core.types import NO_PARENT, Edges, Forest, Frame, Observation, Pose, TopoMap
from erag.evaluate.judges.protocol import Floats
from erag.evaluate.truth import NodeTruth, Pair
from erag.retrieve.corpus import Corpus, split_sentences
from erag.retrieve.relevance import EvidenceTable, RelevanceScorer, fitted
from erag.retrieve.scoring import Batch
from erag.retrieve.uses import KnownEmbedder, shipped_lexicon


@dataclass(frozen=True, eq=False)
class RelevanceJudge:
    """P = the probability that `erag.retrieve.relevance` gives to a node whose text is the truth about it.

    It is told apart from a retriever by what it reads alone, and its weights are those of `tiny` and `standard`: where
    one of them is judged, it is a model of the run. It abstains on a truth without text and on an empty question.
    """

    row: Mapping[str, int]
    scorer: RelevanceScorer | None
    embedder: KnownEmbedder
    name: str = "relevance"
    models: frozenset[str] = frozenset()

    @classmethod
    def over(cls, truths: Iterable[NodeTruth], embedder: KnownEmbedder) -> RelevanceJudge:
        """A judge for an environment: what is rare or fits best is so among its `truths`."""
        known = [truth for truth in truths if truth.texts]
        if not known:
            return cls({}, None, embedder)
        table = EvidenceTable(_corpus(known, embedder), shipped_lexicon(embedder))
        return cls({truth.node: i for i, truth in enumerate(known)}, RelevanceScorer(table, fitted()), embedder)

    def probabilities(self, pairs: Sequence[Pair]) -> Floats:
        """See `Judge`. Every distinct question is asked once."""
        asked = sorted({p.asked.text for p in pairs if p.asked.text.strip()})
        out = np.full(len(pairs), np.nan)
        if not asked or self.scorer is None:
            return out
        found = self.scorer.scores(Batch(tuple(asked), self.embedder.embed(asked, "query")))
        place = {text: i for i, text in enumerate(asked)}
        for i, pair in enumerate(pairs):
            row, column = place.get(pair.asked.text), self.row.get(pair.truth.node)
            if row is not None and column is not None:
                out[i] = found[row, column]
        return out


def _corpus(truths: Sequence[NodeTruth], embedder: KnownEmbedder) -> Corpus:
    """The truths as a map of texts alone, without places, edges and forest; each listed object is a sentence."""
    texts = tuple(" ".join([*truth.captions, *(f"{part}." for part in truth.parts)]) for truth in truths)
    said, rows = split_sentences(texts)
    whole, each = (np.asarray(embedder.embed(some, "document"), np.float32) for some in (texts, said))
    nodes = tuple(Observation(truth.node, "place", Pose(0.0, 0.0)) for truth in truths)
    roots, leaves = np.full(len(nodes), NO_PARENT), np.zeros(len(nodes), np.int64)
    forest = Forest(tuple(node.id for node in nodes), (), roots, leaves, whole)
    return Corpus(TopoMap(Frame.METRIC, nodes, Edges.empty()), forest, texts, whole, each, rows, whole[:0])
