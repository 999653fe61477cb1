"""Systems that can be asked: a preset over a memory, or Naive-RAG over the same map."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

from erag.core.errors import BadModelOutput, InputError, RoleMissing
from erag.core.progress import Progress, quiet
from erag.core.text import content_hash
from erag.core.types import Hit, Pose
from erag.data.contract import QueryLine, Result, parse_query
from erag.evaluate.baselines.naive import NaiveRag
from erag.evaluate.location import paths
from erag.evaluate.scene import Scene
from erag.experiment.config import RELEVANCE, Mode, SystemConfig, model_name
from erag.experiment.memories import Memory
from erag.experiment.predictions import ANSWER, Place, Prediction
from erag.experiment.questions import Posed, digest_of
from erag.generate.answer import NOTHING
from erag.lm.config import BackendConfig
from erag.lm.metered import Metered
from erag.lm.roles import ROLES
from erag.lm.weights import ModelStore
from erag.pipeline.config import PipelineConfig, load_config
from erag.pipeline.load import Built, load
from erag.pipeline.query import Asker, metered
from erag.retrieve.config import RelevanceConfig, TreeConfig

_SCORES = ("node", "score", "semantic", "spatial", "sensor")  # of a hit, as the system gave them
# Of a plain system: no evidence is too little, and places do not matter.
_LEAST = tuple(f"answer.least_{what}=0" for what in ("probability", "named", "evidence", "explained"))
PLAIN = (*_LEAST, "retrieve.places=null")
ANSWERING = 2  # raised when the same configuration and memory give another prediction


def pipeline_of(system: SystemConfig) -> PipelineConfig:
    """The pipeline's configuration of a system. Naive-RAG writes with a model of its own and retrieves by vectors."""
    config = _configured(system.preset, (*system.overrides, *(PLAIN if system.plain else ())))
    if system.naive is None:
        return config
    embeds = config.backend.roles["embed"]
    models = {**config.backend.models, "naive": system.naive.model}
    kept = {key: models[key] for key in (embeds, "naive")}
    return config.model_copy(
        update={"backend": BackendConfig(models=kept, roles={"embed": embeds, "generate": "naive"})}
    )


@lru_cache(maxsize=1024)
def _configured(preset: str, overrides: tuple[str, ...]) -> PipelineConfig:
    """A preset is read once, however many environments a system is asked about."""
    return load_config(preset, overrides=overrides)


def models_of(system: SystemConfig) -> frozenset[str]:
    """The models a system rests on, our model of relevance among them: those that judges may share."""
    config = pipeline_of(system)
    retriever = config.retrieve.retriever
    scores = retriever.scores if isinstance(retriever, TreeConfig) else retriever
    relevance = {RELEVANCE} if isinstance(scores, RelevanceConfig) and system.naive is None else set[str]()
    return frozenset({model_name(config.backend.models[key]) for key in config.backend.roles.values()} | relevance)


@dataclass
class Loaded:
    """What is loaded and shared: models by the configuration of their backend, memories by their file."""

    store: ModelStore
    progress: Progress = quiet
    _known: dict[str, Metered] = field(default_factory=dict)
    _built: dict[Path, Built] = field(default_factory=dict)

    def asker(self, memory: Memory, config: PipelineConfig) -> Asker:
        """Who answers from a memory, which is built where it was not."""
        if memory.path not in self._built:
            memory.make(self.store, self.progress)
            self._built[memory.path] = load(memory.path)
        return Asker(memory.path, config, self.store, self.models(config), self._built[memory.path])

    def models(self, config: PipelineConfig) -> Metered:
        """The models of a configuration, none loaded before it is called."""
        key = config.backend.model_dump_json()
        if key not in self._known:
            self._known[key] = metered(config, self.store)
        return self._known[key]


def identities(models: Metered) -> dict[str, str]:
    """What plays each role that has a model: the identities that judges may not share."""
    found: dict[str, str] = {}
    for role in ROLES:
        try:
            found[role] = models.fingerprint(role)
        except RoleMissing:
            continue
    return found


class Asked:
    """A system over one environment, loaded at its first question."""

    def __init__(self, name: str, system: SystemConfig, memory: Memory, scene: Scene, loaded: Loaded, top: int) -> None:
        self.name, self._system, self.memory, self._scene, self._top = name, system, memory, scene, top
        self._config, self._loaded = pipeline_of(system), loaded
        self._models = loaded.models(self._config)
        self._asker: Asker | None = None
        self._naive: NaiveRag | None = None

    @property
    def size(self) -> int:
        """Nodes of the environment."""
        return len(self._scene.topomap)

    def fingerprint(self, line: QueryLine) -> str:
        """Of all that determines the prediction for a line."""
        return content_hash(self._answering, digest_of(line)).hex()[:16]

    @cached_property
    def _answering(self) -> str:
        """Everything but the question."""
        used = self._config.model_dump_json(include={"retrieve", "answer", "backend"})
        naive = "" if self._system.naive is None else self._system.naive.model_dump_json()
        models = json.dumps(identities(self._models), sort_keys=True)
        return content_hash(str(ANSWERING), self.memory.key, used, naive, models, str(self._top)).hex()

    def predict(self, posed: Posed, mode: Mode, line: QueryLine, first: bool) -> Prediction:
        """The prediction; one that cannot be made has `error` and no answers."""
        self._load()
        ledger = self._models.ledger
        read, wrote = ledger.tokens_in.total(), ledger.tokens_out.total()
        start = time.perf_counter()
        try:
            found = self._ask(line) if self._naive is None else self._ask_naive(self._naive, line)
        except (InputError, BadModelOutput) as error:
            found = {"error": error.line()}
        found["seconds"] = time.perf_counter() - start
        found["tokens_in"], found["tokens_out"] = ledger.tokens_in.total() - read, ledger.tokens_out.total() - wrote
        return self._prediction(found, posed, mode, line, first)

    def adopted(self, known: Prediction, posed: Posed, mode: Mode, line: QueryLine, first: bool) -> Prediction:
        """The same answer from another experiment; what its places are held against is this experiment's."""
        found = known.model_dump(include={*ANSWER})
        found["nodes"] = [hit.model_dump(include={*_SCORES}) for hit in known.hits]
        return self._prediction(found, posed, mode, line, first)

    def _prediction(self, found: dict[str, Any], posed: Posed, mode: Mode, line: QueryLine, first: bool) -> Prediction:
        base = {
            "system": self.name, "data": posed.data, "environment": posed.environment, "id": posed.question.id,
            "mode": mode, "first": first, "fingerprint": self.fingerprint(line),
        }  # fmt: skip
        hits = self._measured(found.pop("nodes", []), posed)
        return Prediction.model_validate({**base, **found, "hits": hits})

    def release(self) -> None:
        """Let go of what was made for this system; models and memories stay loaded for the next one."""
        self._asker = self._naive = None

    def _load(self) -> None:
        if self._asker is None:
            self._asker = self._loaded.asker(self.memory, self._config)
            if self._system.naive is None:
                self._asker.warm_up("find", "explain")
            else:
                self._naive = NaiveRag(self._asker.corpus.topomap, self._system.naive, self._models)

    def _ask(self, line: QueryLine) -> dict[str, Any]:
        asker = self._asker
        if asker is None:
            raise ValueError("asked before it was loaded")
        return _told(asker.ask(parse_query(line, self._top, self._ground)))

    def _ask_naive(self, naive: NaiveRag, line: QueryLine) -> dict[str, Any]:
        before = self._models.ledger.calls.copy()
        named = naive.ask(parse_query(line, self._top, self._ground))
        notes = [] if named.shrunk is None else [f"context cut to {named.shrunk} tokens"]
        if not named.explained and named.node is None:
            notes.append("names no node")
        return {
            "kind": "explain" if named.explained else "find", "text": named.text, "notes": notes,
            "nodes": [{"node": named.node}] if named.node else [], "waypoint": named.node, "visited": named.visited,
            "calls": dict(self._models.ledger.calls - before),
        }  # fmt: skip

    def _ground(self, x: float, y: float) -> float:
        return self._scene.pose((x, y)).z

    def _measured(self, nodes: list[dict[str, Any]], posed: Posed) -> list[Place]:
        """The hits with the way to each from L, on the environment's own map, and its reading."""
        ids = [one["node"] for one in nodes]
        reading = _readings(self._scene, posed, ids)
        if posed.at is None or not ids:
            return [Place(**one, reading=r) for one, r in zip(nodes, reading, strict=True)]
        at: Pose = self._scene.pose(posed.at)
        found = paths(self._scene.topomap, self._scene.distances, at, ids)
        lengths = zip(found.metres.tolist(), found.on_edges.tolist(), strict=True)
        return [
            Place(**one, metres=m, on_edges=along, reading=r)
            for one, (m, along), r in zip(nodes, lengths, reading, strict=True)
        ]


def _readings(scene: Scene, posed: Posed, ids: list[str]) -> list[float | None]:
    channel = next(iter(sorted(posed.sensor or {})), "")
    nodes = scene.topomap.nodes
    return [nodes[scene.topomap.row[node]].sensors.get(channel) for node in ids]


def _told(result: Result) -> dict[str, Any]:
    answer = result.answer
    told: dict[str, Any] = {
        "nodes": [_hit(h) for h in result.hits], "visited": result.visited, "calls": _positive(result.calls),
        "notes": result.notes,
    }  # fmt: skip
    if answer is None:
        return told
    refused = answer.text == NOTHING
    if answer.route is not None:
        told |= {"route": answer.route.status, "route_m": answer.route.length_m}
    waypoint = None if answer.waypoint is None else answer.waypoint.node
    return told | {
        "kind": answer.kind, "text": answer.text, "reason": answer.reason, "refused": refused, "waypoint": waypoint
    }  # fmt: skip


def _hit(hit: Hit) -> dict[str, Any]:
    return {name: getattr(hit, name) for name in _SCORES}


def _positive(calls: Mapping[str, int]) -> dict[str, int]:
    return {role: n for role, n in calls.items() if n}
