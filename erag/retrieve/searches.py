"""Which search a configuration asks for: flat, tree, or the rules of other systems, with models where it says so."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import cast

from erag.lm.roles import LMBackend
from erag.retrieve.bm25 import Bm25Scorer
from erag.retrieve.collapsed import CollapsedSearch
from erag.retrieve.community import CommunitySearch
from erag.retrieve.conditions import ConditionedScorer, Conditions
from erag.retrieve.config import (
    Bm25Config,
    CollapsedConfig,
    CommunityConfig,
    DualConfig,
    FlatConfig,
    FusionConfig,
    NodeConfig,
    RelevanceConfig,
    RetrieveConfig,
    TreeConfig,
)
from erag.retrieve.corpus import Corpus
from erag.retrieve.dual import DualSearch
from erag.retrieve.expand import ExpandedScorer
from erag.retrieve.flat import NodeScorer, SentenceScorer
from erag.retrieve.fusion import FusionScorer
from erag.retrieve.judge import ModelJudge, Shortlisted
from erag.retrieve.rank import Nearness
from erag.retrieve.relevance import EvidenceTable, RelevanceScorer, fitted
from erag.retrieve.scoring import FlatSearch, LeafScorer, Search
from erag.retrieve.tree import ClusterJudge, TreeSearch
from erag.retrieve.uses import shipped_lexicon

Decide = Callable[[ClusterJudge], ClusterJudge]  # the judge that follows the scores -> the judge that decides


def leaf_scorer(corpus: Corpus, config: FlatConfig, backend: LMBackend | None = None) -> LeafScorer:
    """The flat retriever a configuration asks for; a lexicon of uses is embedded by `backend`, and left out without."""
    if isinstance(config, NodeConfig):
        return NodeScorer(corpus)
    if isinstance(config, Bm25Config):
        return Bm25Scorer(corpus, config)
    if isinstance(config, FusionConfig):
        parts = (NodeScorer(corpus), SentenceScorer(corpus), Bm25Scorer(corpus, config.bm25))
        return FusionScorer(parts, config.k)
    if isinstance(config, RelevanceConfig):
        lexicon = shipped_lexicon(backend) if config.uses and backend is not None else None
        return RelevanceScorer(EvidenceTable(corpus, lexicon), fitted(), literal=config.literal)
    return SentenceScorer(corpus)


def scorer_of(corpus: Corpus, config: RetrieveConfig, backend: LMBackend | None = None) -> LeafScorer | None:
    """What scores the leaves of the configured search; None for the rules of other systems."""
    kind = config.retriever
    if isinstance(kind, CollapsedConfig | CommunityConfig | DualConfig):
        return None
    return leaf_scorer(corpus, kind.scores if isinstance(kind, TreeConfig) else kind, backend)


def search_of(
    corpus: Corpus,
    config: RetrieveConfig,
    backend: LMBackend | None = None,
    judge: ClusterJudge | None = None,
    scorer: LeafScorer | None = None,
    nearness: Nearness | None = None,
) -> Search:
    """The search a configuration asks for; `judge` takes the decisions of a tree, `scorer` is what `scorer_of` gave.

    By `nearness` a tree looks at where a query is asked from.
    """
    kind = config.retriever
    if isinstance(kind, CollapsedConfig):
        return CollapsedSearch(corpus, kind)
    if isinstance(kind, CommunityConfig):
        return CommunitySearch(corpus, kind)
    if isinstance(kind, DualConfig):
        return DualSearch(corpus, kind)
    scorer = scorer or leaf_scorer(corpus, kind.scores if isinstance(kind, TreeConfig) else kind, backend)
    if isinstance(scorer, RelevanceScorer):
        scorer = ConditionedScorer(scorer)
    elif config.expand is not None:
        scorer = ExpandedScorer(scorer, config.expand.weight)
    if isinstance(kind, TreeConfig):
        return TreeSearch(corpus, kind, scorer, _decider(corpus, kind, backend, judge), nearness)
    return FlatSearch(scorer, int(corpus.searchable.sum()))


def _decider(
    corpus: Corpus, config: TreeConfig, backend: LMBackend | None, judge: ClusterJudge | None
) -> Decide | None:
    """Who decides in a tree in place of the judge that follows the scores; None where that one does."""
    asked = config.judge
    if judge is None and (asked is None or backend is None):
        return None
    model = judge or ModelJudge(corpus, cast(LMBackend, backend), asked is not None and asked.evidence)
    if asked is None or asked.shortlist is None:
        return lambda _: model
    return partial(Shortlisted, then=model, shortlist=asked.shortlist)


def conditions_of(
    corpus: Corpus, config: RetrieveConfig, scorer: LeafScorer | None, backend: LMBackend | None
) -> Conditions | None:
    """The reader of conditions; None where it is off, without an embedder, and for scores that are no probabilities."""
    if not config.conditions or backend is None or not isinstance(scorer, RelevanceScorer):
        return None
    return Conditions(corpus, scorer, scorer.index, backend)


def asks_models(config: RetrieveConfig) -> bool:
    """Whether a configuration gives a decision of retrieval to a language model."""
    judged = isinstance(config.retriever, TreeConfig) and config.retriever.judge is not None
    return judged or config.expand is not None or config.rescore is not None
