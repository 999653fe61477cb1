"""The closed registry of trials: a configuration becomes one."""

from __future__ import annotations

from erag.compare.choosing import Decisions, Relevance, Search
from erag.compare.config import (
    AnswersTrial,
    CaptionsTrial,
    CompareConfig,
    DecisionsTrial,
    ObjectsTrial,
    RelevanceTrial,
    SearchTrial,
    SummariesTrial,
)
from erag.compare.seeing import Captions, Objects
from erag.compare.telling import Answers, ClusterSummaries
from erag.compare.trial import Trial
from erag.lm.weights import ModelStore


def trial_of(config: CompareConfig, name: str, store: ModelStore) -> Trial:
    """The trial of a configuration; nothing is read yet."""
    match config.trials[name]:
        case ObjectsTrial() as chosen:
            return Objects(chosen)
        case CaptionsTrial() as chosen:
            return Captions(chosen)
        case SummariesTrial() as chosen:
            return ClusterSummaries(chosen)
        case DecisionsTrial() as chosen:
            return Decisions(chosen)
        case RelevanceTrial() as chosen:
            return Relevance(chosen)
        case SearchTrial() as chosen:
            return Search(chosen)
        case AnswersTrial() as chosen:
            return Answers(chosen, store, config.judge, config.out / "memories")
