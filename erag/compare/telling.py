"""Trials of summarisers, on a cloud model's own clusters, and of generators, on questions with golden answers."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from erag.bench.config import MemoryBench
from erag.bench.retrieval import built, query_file
from erag.compare.config import AnswersTrial, SummariesTrial
from erag.compare.trial import Asked, Judgement, Outputs, RoleTrial, drawn, each, shifted
from erag.core.errors import BadModelOutput
from erag.core.types import Cluster, Edges, Forest, IntArray, TopoMap
from erag.data.contract import read_queries
from erag.data.registry import read
from erag.evaluate.statistics import bootstrap
from erag.evaluate.text import GENERIC, Golden, SemanticSimilarity
from erag.forest.facts import cluster_facts
from erag.forest.given import given_forest
from erag.forest.quality import base_nodes
from erag.forest.summaries import Summaries
from erag.forest.support import Evidence, check, coverage, supported
from erag.forest.vocabulary import Vocabulary, map_vocabulary
from erag.generate.asking import explain_prompt
from erag.generate.asking import read as answer_of
from erag.generate.focus import Focus, counts
from erag.generate.views import Views
from erag.lm.config import BackendConfig, ModelConfig
from erag.lm.roles import Embedder, Group, Prompt, Summary
from erag.lm.weights import ModelStore
from erag.pipeline.config import PipelineConfig
from erag.pipeline.query import Asker


class _Silent:
    """A summariser that has nothing to say: everything is then composed from facts by code."""

    def summarise(self, groups: Sequence[Group]) -> list[Summary]:
        raise BadModelOutput(f"nothing to say of {len(groups)} groups")


class ClusterSummaries(RoleTrial):
    """SS to the cloud model's summary of the same cluster, facts mentioned, and statements no member bears out."""

    role, measure = "summarise", "SS to the cloud's summary"

    def __init__(self, config: SummariesTrial) -> None:
        self._config, self.against = config, config.cloud

    @cached_property
    def _world(self) -> tuple[TopoMap, Forest]:
        reading = read(self._config.source)
        topomap = TopoMap(reading.frame, reading.observations, Edges.empty())
        forest, _ = given_forest(topomap, reading.clusters, np.zeros((len(topomap), 2), np.float32))
        return topomap, forest

    @cached_property
    def items(self) -> Sequence[Any]:
        """Clusters of nodes (level 1) that the cloud model described."""
        told = [c for c in self._world[1].clusters if c.level == 1 and c.summary]
        kept = drawn(told, self._config.count, self._config.seed, str(self._config.source))
        return [{"cluster": c.id, **_written(c)} for c in kept]

    def ask(self, asked: Asked, items: Sequence[Any]) -> list[Any]:
        """As a build would: facts or members in, checked summaries out."""
        summaries = Summaries(self._world[0], asked.backend, self._config.summaries, asked.ledger)
        return [_written(c) for c in summaries.level(self._clusters(items))]

    def _clusters(self, items: Sequence[Any]) -> list[Cluster]:
        wanted = {item["cluster"] for item in items}
        return [c for c in self._world[1].clusters if c.id in wanted]

    def cloud(self) -> Outputs:
        return [{key: item[key] for key in ("name", "text", "relationships")} for item in self.items]

    def controls(self) -> Mapping[str, Outputs]:
        summaries = Summaries(self._world[0], _Silent(), self._config.summaries.model_copy(update={"again": None}))
        return {
            "composed by code": [_written(c) for c in summaries.level(self._clusters(self.items))],
            "of another cluster": shifted(self.cloud()),
        }

    def judge(self, outputs: Outputs, embedder: Embedder) -> Judgement:
        told, golden = [_spoken(o) for o in outputs], [Golden(_spoken(o)) for o in self.cloud()]
        scores = SemanticSimilarity("judge", embedder).scores([""] * len(told), told, golden)
        covered, unsupported = zip(*map(self._checked, self.items, outputs), strict=True)
        more = {"facts mentioned": bootstrap(covered), "statements unsupported": bootstrap(unsupported)}
        return Judgement.of([s.ss for s in scores], more)

    @cached_property
    def _words(self) -> Vocabulary:
        return map_vocabulary(self._world[0])

    @cached_property
    def _below(self) -> Mapping[str, IntArray]:
        """The rows of the nodes below each cluster."""
        forest = self._world[1]
        return {c.id: rows for c, rows in zip(forest.clusters, base_nodes(forest), strict=True)}

    def _checked(self, item: Any, output: Any) -> tuple[float, float]:
        """Of one summary, the share of facts mentioned and the share of statements that no member bears out."""
        rows = self._below[item["cluster"]]
        known = tuple(cluster_facts(self._words, rows))
        summary = Summary(output["name"], output["text"], tuple(output["relationships"]))
        found = check(summary, Evidence(self._words, rows, known, measured=True))
        facts = [fact for fact in known if fact.entry.kind != "sign"]
        return coverage(summary, facts) if summary.text else 0.0, len(found.removed) / max(found.statements, 1)


def _written(cluster: Cluster) -> dict[str, Any]:
    return {"name": cluster.name, "text": cluster.summary, "relationships": list(cluster.relationships)}


def _spoken(output: Any) -> str:
    return ". ".join(filter(None, (output["name"], output["text"])))


class Answers(RoleTrial):
    """SS to golden answers, from the same prompt for all; an answer that is not of its schema counts as none."""

    role, measure = "generate", "SS to the golden answer"

    def __init__(self, config: AnswersTrial, store: ModelStore, embedder: ModelConfig, folder: Path) -> None:
        self._config, self._store, self._embedder, self._folder = config, store, embedder, folder

    @cached_property
    def items(self) -> Sequence[Any]:
        asked = [line.raw for line in read_queries(query_file(self._config.queries), self._config.where) if line.raw]
        golden = [raw for raw in asked if raw.get("golden_answer") and raw.get("query")]
        kept = drawn(golden, self._config.count, self._config.seed, self._config.queries)
        return [self._item(str(raw["query"]), str(raw["golden_answer"])) for raw in kept]

    @cached_property
    def _asker(self) -> Asker:
        """A memory of the source, for its views and counts."""
        backend = BackendConfig(models={"judge": self._embedder}, roles={"embed": "judge"})
        pipeline = PipelineConfig(backend=backend)
        name = "-".join(Path(self._config.source).resolve().parts[-2:])
        self._folder.mkdir(parents=True, exist_ok=True)
        bench = MemoryBench(source=self._config.source, memory=self._folder / f"{name}.erag", pipeline=pipeline)
        return Asker(built(bench, self._store), pipeline, self._store)

    @cached_property
    def _tools(self) -> tuple[Focus, Views]:
        corpus = self._asker.corpus
        return Focus(corpus, lambda texts: self._asker.embed(texts, "document")), Views(corpus)

    def _item(self, question: str, golden: str) -> dict[str, Any]:
        (focus, views), limits = self._tools, self._config.answer
        rows = np.flatnonzero(self._asker.corpus.searchable)
        vector = self._asker.embed([question], "query")[0]
        told = [view.text for view in views.of(vector, rows, limits.views)]
        counted = counts(focus.facts(vector, rows, limits.facts, limits.least_share))
        prompt = explain_prompt(question, told, counted.rstrip("."), limits.explain_chars)
        return {
            "question": question, "golden": golden, "counted": counted, "views": told,
            "messages": [list(turn) for turn in prompt.messages], "schema": prompt.schema, "most": prompt.max_tokens,
        }  # fmt: skip

    def ask(self, asked: Asked, items: Sequence[Any]) -> list[Any]:
        prompts = [Prompt(tuple((r, t) for r, t in i["messages"]), i["schema"], i["most"]) for i in items]
        found = each(asked.backend.generate, prompts, asked.backend.batch_size("generate"))
        return [None if said is None else said.text for said in found]

    def controls(self) -> Mapping[str, Outputs]:
        def said(texts: Sequence[str]) -> Outputs:
            return [json.dumps({"answer": text}) for text in texts]

        return {
            "the counts alone, by code": said([item["counted"] for item in self.items]),
            "a generic sentence": said([GENERIC for _ in self.items]),
        }

    def judge(self, outputs: Outputs, embedder: Embedder) -> Judgement:
        told = [_answered(output) for output in outputs]
        questions, golden = [i["question"] for i in self.items], [Golden(i["golden"]) for i in self.items]
        scores = SemanticSimilarity("judge", embedder).scores(questions, told, golden)
        more = {
            "valid": [float(bool(text)) for text in told], "grounded": list(map(self._grounded, self.items, told)),
            "golden facts stated": [s.coverage for s in scores],
        }  # fmt: skip
        return Judgement.of([s.ss for s in scores], {name: bootstrap(values) for name, values in more.items()})

    @cached_property
    def _texts(self) -> tuple[str, ...]:
        corpus = self._asker.corpus
        return tuple(text for text, able in zip(corpus.texts, corpus.searchable, strict=True) if able)

    def _grounded(self, item: Any, text: str) -> float:
        """The share of an answer's sentences that the views of the map, or the counts, bear out; 0 for no answer."""
        kept, removed = supported(text, Evidence.of_texts([*self._texts, item["counted"]]))
        return len(kept) / max(len(kept) + len(removed), 1)


def _answered(output: Any) -> str:
    try:
        return "" if output is None else answer_of(output, "answer")
    except BadModelOutput:
        return ""
