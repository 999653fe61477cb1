"""Trials end to end: whole systems build memories of the same environments and are asked the same questions."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from erag.bench.memory import peak_mb
from erag.compare.config import MemoriesTrial, SystemSpec, WorldsConfig
from erag.compare.seeing import rendered
from erag.compare.trial import LABELS, Judgement, Outputs, Taken, Trial, drawn
from erag.core.output import replacing
from erag.core.text import content_hash
from erag.data.contract import QueryLine, parse_query
from erag.data.registry import read
from erag.evaluate.dataset import Environment, Question
from erag.evaluate.datasets import simulated
from erag.evaluate.datasets.catalogue import load_dataset
from erag.evaluate.ranking import precision_at
from erag.evaluate.statistics import bootstrap
from erag.lm.config import build_backend
from erag.lm.roles import Embedder, LMBackend, RoleName
from erag.lm.weights import ModelStore
from erag.memory.file import MemoryFile
from erag.pipeline.build import BUILD_VERSION, build
from erag.pipeline.config import PipelineConfig, load_config
from erag.pipeline.ingest import ingest
from erag.pipeline.query import Asker, metered

TOP = 5
BUILDING: tuple[RoleName, ...] = ("caption", "embed", "summarise")  # the roles a build calls
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
        pairs = [(output["hits"], i["relevant"]) for i, output in zip(self.items, outputs, strict=True)]
        first, five = ([precision_at(hits, relevant, k) for hits, relevant in pairs] for k in (1, TOP))
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


@dataclass(frozen=True)
class Built:
    """What it took to build memories: seconds in all, and the largest resident size of a process."""

    seconds: float = 0.0
    peak_mb: float = 0.0


@dataclass(frozen=True)
class System:
    """A system over the environments of a trial; its memories lie in `folder`, `given` states the cloud's forest."""

    spec: SystemSpec
    environments: Mapping[str, Environment]
    folder: Path
    store: ModelStore
    given: Path | None = None

    @cached_property
    def config(self) -> PipelineConfig:
        return load_config(self.spec.preset, overrides=self.spec.overrides)

    @cached_property
    def _backend(self) -> LMBackend:
        return build_backend(self.config.backend, self.store)

    def fingerprint(self) -> str:
        """Of all that its answers depend on but the sources."""
        models = {role: self._backend.fingerprint(role) for role in self.config.backend.roles}
        return json.dumps([self.config.model_dump(mode="json"), self.spec.forest, models], sort_keys=True)

    @cached_property
    def _key(self) -> str:
        """Of all that its memories depend on but the sources; systems that build alike share them."""
        built = self.config.model_dump_json(exclude={"retrieve", "aware", "answer", "backend"})
        models = [self._backend.fingerprint(role) for role in BUILDING if role in self.config.backend.roles]
        return content_hash(built, self.spec.forest, str(BUILD_VERSION), *models).hex()[:12]

    def path(self, environment: str) -> Path:
        """Its memory of an environment."""
        return self.folder / f"{environment}-{self._key}.erag"

    def build(self, environment: Environment) -> None:
        """Build one memory anew in this process, and keep beside it what that took."""
        path, start = self.path(environment.name), time.perf_counter()
        path.parent.mkdir(parents=True, exist_ok=True)
        for left in path.parent.glob(f"{path.name}*"):  # of a build that was killed, which would take less than it does
            left.unlink()
        given = self.spec.forest == "given"
        ingest(self.given if given and self.given is not None else environment.source, path, environment.reader)
        with MemoryFile.writing(path, "erag compare") as memory:
            build(memory, self.config, self.store, given=given)
        with replacing(_told(path)) as file:
            json.dump({"seconds": time.perf_counter() - start, "peak_mb": peak_mb()}, file)

    def missing(self) -> list[Environment]:
        """The environments without a memory built to its end."""
        return [e for e in self.environments.values() if not _told(self.path(e.name)).is_file()]

    def ask(self, items: Sequence[Any]) -> Taken:
        """The hits of each item's question; the seconds are those of whole queries."""
        start, models = time.perf_counter(), metered(self.config, self.store)
        askers = {name: Asker(self.path(name), self.config, self.store, models) for name in self.environments}
        for asker in askers.values():
            asker.warm_up("find")
        before, loading = deepcopy(models.ledger), time.perf_counter() - start
        outputs, seconds = [], 0.0
        for item in items:
            asker = askers[item["environment"]]
            query = parse_query(QueryLine(0, item["asked"]["id"], item["asked"]), TOP, asker.ground)
            result = asker.ask(query)
            outputs.append({"hits": [hit.node for hit in result.hits]})
            seconds += result.seconds
        return Taken.since(before, models.ledger, outputs, seconds, loading)

    def built(self) -> Built:
        """What all its memories took."""
        told = [json.loads(_told(self.path(name)).read_text(encoding="utf-8")) for name in self.environments]
        return Built(sum(one["seconds"] for one in told), max(one["peak_mb"] for one in told))


def _told(path: Path) -> Path:
    return path.with_suffix(".json")
