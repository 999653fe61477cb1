"""The closed registry of trials: a configuration becomes one."""

from __future__ import annotations

from erag.compare.choosing import Decisions, Relevance, Search
from erag.compare.config import (
    AnswersTrial,
    CaptionsTrial,
    CompareConfig,
    DecisionsTrial,
    MemoriesTrial,
    ObjectsTrial,
    RelevanceTrial,
    SearchTrial,
    SummariesTrial,
)
from erag.compare.seeing import Captions, Objects
from erag.compare.telling import Answers, ClusterSummaries
from erag.compare.trial import RoleTrial, Trial
from erag.compare.whole import Memories
from erag.lm.weights import ModelStore


def trial_of(config: CompareConfig, name: str, store: ModelStore) -> Trial:
    """The trial of a configuration; nothing is read yet."""
    if isinstance(config.trials[name], MemoriesTrial):
        return memories_of(config, name)
    return role_trial_of(config, name, store)


def memories_of(config: CompareConfig, name: str) -> Memories:
    """A trial of whole systems. Raises TypeError for one of a role."""
    match config.trials[name]:
        case MemoriesTrial() as chosen:
            return Memories(chosen, config.worlds)
        case other:
            raise TypeError(f"{other.kind} is no trial of whole systems")


def role_trial_of(config: CompareConfig, name: str, store: ModelStore) -> RoleTrial:
    """A trial of one role. Raises TypeError for one of whole systems."""
    match config.trials[name]:
        case ObjectsTrial() as chosen:
            return Objects(chosen, config.worlds)
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
        case other:
            raise TypeError(f"{other.kind} is no trial of one role")
