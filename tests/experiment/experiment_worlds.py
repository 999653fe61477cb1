"""Small experiments for tests: the sample campus with models that need no weights."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from erag.experiment.config import ExperimentConfig
from erag.experiment.run import Experiment
from erag.lm.weights import default_store

FAKE = "backend={models: {fake: {kind: fake}}, roles: {embed: fake, generate: fake}}"
NEVER = "answer={least_evidence: 0, explain: quotes}"
BM25 = "retrieve.retriever={kind: bm25}"
PRINTED = {"Embodied-RAG": 0.55}
COLUMNS = [
    {"title": "P(Q|A)", "set": "explicit", "metric": "p_q_a@1", "printed": PRINTED},
    {"title": "P(Q|A,L)", "set": "explicit", "metric": "p_q_a_l@1", "mode": "Q,L"},
    {"title": "SS", "set": "global", "metric": "ss"},
]


def raw(work: Path, **changes: Any) -> dict[str, Any]:
    """A configuration: a tree, a flat baseline and Naive-RAG on four questions of each kind."""
    return {
        "title": "Small",
        "work": str(work),
        "similarity": "fake",
        "pictures": False,
        "data": {"campus": {"dataset": "sample", "questions_per_set": 4}},
        "sets": {
            "explicit": {"where": {"kind": "explicit"}, "modes": ["Q", "Q,L"]},
            "global": {"where": {"kind": "global"}},
        },
        "systems": {
            "tree": {"overrides": [FAKE, NEVER]},
            "words": {"overrides": [FAKE, NEVER, BM25]},
            "naive": {"overrides": [FAKE, NEVER], "queries": 2, "naive": {"model": {"kind": "fake"}, "tokens": 500}},
        },
        "panel": {
            "judges": {
                "words": {"kind": "words"},
                "vectors": {"kind": "embedding", "expanded": "targets"},
                "model": {"kind": "model", "model": {"kind": "fake"}},
            },
            "agreement": {"questions": 4, "top": 5, "others": 5},
        },
        "tables": [{"title": "Table", "columns": COLUMNS}],
        **changes,
    }


def config(work: Path, **changes: Any) -> ExperimentConfig:
    """The configuration of `raw`."""
    return ExperimentConfig.model_validate(raw(work, **changes))


def ran(made: ExperimentConfig, out: Path, again: tuple[str, ...] = ()) -> Experiment:
    """The experiment, run in the folder `out`."""
    experiment = Experiment(made, out, default_store())
    experiment.run(again)
    return experiment
