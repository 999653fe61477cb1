"""Trials end to end: whole systems are asked the same questions about the same environments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from erag.compare.config import MemoriesTrial, WorldsConfig
from erag.compare.seeing import rendered
from erag.compare.trial import LABELS, Judgement, Outputs, Trial, drawn
from erag.data.registry import read
from erag.evaluate.dataset import Environment, Question
from erag.evaluate.datasets import simulated
from erag.evaluate.datasets.catalogue import load_dataset
from erag.evaluate.ranking import precision_at
from erag.evaluate.statistics import bootstrap
from erag.lm.roles import Embedder

TOP = 5
_ASKED = ("id", "query", "since", "until")  # of a question: its text and its time


class Memories(Trial):
    """Precision of the first node, and of the first five, that a whole system answers a question with."""

    role, measure = "all", "P@1"

    def __init__(self, config: MemoriesTrial, worlds: WorldsConfig) -> None:
        self._config, self._worlds = config, worlds
        self.against, self.given = config.cloud or LABELS, config.given

    @cached_property
    def environments(self) -> Mapping[str, Environment]:
        """The environments by name. Raises InputError for a data set that is not there."""
        config = self._config
        own = config.root is None and config.dataset == simulated.NAME
        root = rendered(self._worlds) if own else config.root
        found = load_dataset(config.dataset, root, config.queries).environments
        return {e.name: e for e in found if not own or e.name in self._worlds.names}

    @cached_property
    def items(self) -> Sequence[Any]:
        asked = [(name, q) for name, e in self.environments.items() for q in e.questions if self._fits(q)]
        kept = drawn(asked, self._config.count, self._config.seed, f"data set {self._config.dataset}")
        return [_item(name, question) for name, question in kept]

    def _fits(self, question: Question) -> bool:
        raw = question.line.raw or {}
        wanted = self._config.where.items()
        return bool(question.text and question.relevant) and all(str(raw.get(key, "")) in v for key, v in wanted)

    def controls(self) -> Mapping[str, Outputs]:
        rng = np.random.default_rng(self._config.seed)
        nodes = {name: [o.id for o in read(e.source, e.reader).observations] for name, e in self.environments.items()}
        chance = [{"hits": [str(n) for n in rng.permutation(nodes[i["environment"]])[:TOP]]} for i in self.items]
        return {"any, by chance": chance}

    def judge(self, outputs: Outputs, embedder: Embedder) -> Judgement:
        del embedder
        hits = [[] if output is None else output["hits"] for output in outputs]
        pairs = [(found, item["relevant"]) for found, item in zip(hits, self.items, strict=True)]
        first, five = ([precision_at(found, relevant, k) for found, relevant in pairs] for k in (1, TOP))
        kinds = dict.fromkeys(item["kind"] for item in self.items)
        by_kind = {
            f"P@1, {kind}": bootstrap([v for v, i in zip(first, self.items, strict=True) if i["kind"] == kind])
            for kind in kinds
            if len(kinds) > 1
        }
        return Judgement.of(first, {"P@5": bootstrap(five), **by_kind})


def _item(environment: str, question: Question) -> dict[str, Any]:
    raw = question.line.raw or {}
    asked = {key: raw[key] for key in _ASKED if raw.get(key) is not None}
    relevant = sorted(question.relevant or ())
    return {"environment": environment, "asked": asked, "kind": question.kind, "relevant": relevant}
