"""Selectors compared on decisions with a known answer, and on the same decisions with a card that gives orders."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from erag.bench.config import SelectionBench
from erag.bench.decisions import Asked, Decision, Map, decisions
from erag.bench.retrieval import built, query_file
from erag.bench.scorers import ByScore
from erag.bench.worlds import labelled_worlds
from erag.core.progress import Progress, quiet
from erag.evaluate.labelled import read_labelled
from erag.evaluate.metrics import Interval, bootstrap
from erag.lm.config import ModelConfig, build_backend
from erag.lm.ledger import Ledger
from erag.lm.roles import LMBackend, SelectTask
from erag.lm.weights import ModelStore
from erag.pipeline.query import Asker, metered


@dataclass(frozen=True, slots=True)
class SelectorScore:
    """How often the right card was chosen, and how often a choice moved to a card only because it gave an order.

    `seconds`, the `prompts` a language model was given and the `tokens` it read are those of one decision.
    """

    selector: str
    decisions: int
    right: Interval
    diverted: Interval
    seconds: float
    prompts: float
    tokens: float


class Selector(Protocol):
    """Chooses a card in each decision; `obeying`: one card gives an order."""

    def choose(self, asked: Sequence[Decision], obeying: bool) -> list[int]: ...


def run(config: SelectionBench, store: ModelStore, progress: Progress = quiet) -> Iterator[SelectorScore]:
    """One score a selector, all on the same decisions; chance is 1 / `cards`."""
    maps = _maps(config, store, progress)
    asked = decisions(maps, config.cards, config.rounds, config.seed)
    for name, scores in config.scores.items():
        yield _score(name, asked, ByScore([m.asker for m in maps], scores), Ledger())
    for done, (name, model) in enumerate(config.selectors.items()):
        progress("selectors", done, len(config.selectors))
        ledger = Ledger()
        yield _score(name, asked, _ByModel(_backend(config, model, store, ledger)), ledger)


def _maps(config: SelectionBench, store: ModelStore, progress: Progress) -> list[Map]:
    """What is decided about: simulated worlds where the configuration names any, else one memory."""
    models = metered(config.pipeline, store)
    if config.worlds is None:
        kept = built(config, store, progress)
        labelled = read_labelled(query_file(config.queries), config.where)
        asked = [Asked(str((q.line.raw or {}).get("query", "")), q.relevant) for q in labelled]
        return [Map(Asker(kept, config.pipeline, store, models), asked)]
    return [
        Map(Asker(world.memory, config.pipeline, store, models), [Asked(q.text, q.relevant) for q in world.finds])
        for world in labelled_worlds(config.worlds, config.pipeline, store, progress)
    ]


def _backend(config: SelectionBench, model: ModelConfig, store: ModelStore, ledger: Ledger) -> LMBackend:
    """The backend of the pipeline with `model` in the select role."""
    backend = config.pipeline.backend
    models, roles = {**backend.models, "asked": model}, {**backend.roles, "select": "asked"}
    return build_backend(backend.model_copy(update={"models": models, "roles": roles}), store, ledger)


@dataclass(frozen=True)
class _ByModel:
    """A language model or a student that plays the select role."""

    backend: LMBackend

    def choose(self, asked: Sequence[Decision], obeying: bool) -> list[int]:
        tasks = [SelectTask(d.query, d.diverting if obeying else d.cards) for d in asked]
        return [picks[0] for picks in self.backend.select(tasks, 1)]


def _score(name: str, asked: Sequence[Decision], selector: Selector, ledger: Ledger) -> SelectorScore:
    selector.choose(asked[:1], obeying=False)  # loads the model
    prompts, tokens = ledger.prompts["select"], ledger.tokens_in["select"]
    start = time.perf_counter()
    plain = selector.choose(asked, obeying=False)
    seconds = time.perf_counter() - start
    prompts, tokens = ledger.prompts["select"] - prompts, ledger.tokens_in["select"] - tokens
    ordered = selector.choose(asked, obeying=True)
    right = [float(pick == d.right) for d, pick in zip(asked, plain, strict=True)]
    moved = [float(after == d.order != before) for d, before, after in zip(asked, plain, ordered, strict=True)]
    n = len(asked)
    return SelectorScore(name, n, bootstrap(right), bootstrap(moved), seconds / n, prompts / n, tokens / n)
