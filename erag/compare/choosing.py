"""Trials of selectors, scorers and embedders: a cloud model's decisions, and labels of what answers a query."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from erag.bench.retrieval import query_file, source_folder
from erag.compare.config import DecisionsTrial, RelevanceTrial, SearchTrial
from erag.compare.trial import Asked, Judgement, Outputs, RoleTrial, drawn, each
from erag.core.errors import InputError
from erag.core.text import node_text
from erag.data.registry import read
from erag.evaluate.labelled import read_labelled
from erag.evaluate.ranking import precision_at
from erag.evaluate.statistics import bootstrap, clustered_bootstrap
from erag.lm.roles import Embedder, SelectTask
from erag.study.compact import kept
from erag.study.decisions import FILES, Decision, chats_of, read_decisions

TOP = 5


class Decisions(RoleTrial):
    """Agreement with a cloud model's choice among cards; cards that read the same are the same."""

    role, measure = "select", "agreement"

    def __init__(self, config: DecisionsTrial) -> None:
        self._config, self.against = config, config.cloud

    @cached_property
    def items(self) -> Sequence[Any]:
        chats = chats_of(self._config.source)
        if chats is None:
            raise InputError("holds no decisions", where=str(self._config.source), allowed=" and ".join(FILES))
        held = [decision for decision in read_decisions([chats]) if self._config.part.holds(decision)]
        asked = drawn(held, self._config.count, self._config.seed, str(self._config.source))
        return [{"query": d.query, "cards": list(d.cards), "chosen": d.chosen} for d in asked]

    def ask(self, asked: Asked, items: Sequence[Any]) -> list[Any]:
        tasks = [SelectTask(item["query"], tuple(item["cards"])) for item in items]
        found = each(lambda some: asked.backend.select(some, 1), tasks, asked.backend.batch_size("select"))
        return [None if picks is None else picks[0] for picks in found]

    def cloud(self) -> Outputs:
        return [item["chosen"] for item in self.items]

    def controls(self) -> Mapping[str, Outputs]:
        rng = np.random.default_rng(self._config.seed)
        chance = [int(rng.integers(len(item["cards"]))) for item in self.items]
        return {"always the first": [0 for _ in self.items], "any, by chance": chance}

    def judge(self, outputs: Outputs, embedder: Embedder) -> Judgement:
        del embedder
        made = [Decision(item["query"], tuple(item["cards"]), item["chosen"]) for item in self.items]
        values = [float(o is not None and d.agrees(o)) for d, o in zip(made, outputs, strict=True)]
        very = [float(o == d.chosen) for d, o in zip(made, outputs, strict=True)]
        whole = clustered_bootstrap(values, [d.group for d in made])
        return Judgement.of(values, {"the same, card sets drawn whole": whole, "the very card": bootstrap(very)})


class _Labels:
    """Texts of a source by node id, and the labelled queries about them."""

    def __init__(self, source: str, queries: str, where: Mapping[str, str]) -> None:
        reading = read(source_folder(source))
        said = {o.id: node_text(o.name, o.caption) for o in reading.observations}
        self.texts = {node: text for node, text in said.items() if text}
        found = read_labelled(query_file(queries), where)
        asked = [(str((q.line.raw or {}).get("query") or ""), q.relevant & self.texts.keys()) for q in found]
        self.queries = [(text, relevant) for text, relevant in asked if text and relevant]
        if not self.queries:
            raise InputError("no query has a relevant text", where=queries, allowed=f"ids of {source}")


class Relevance(RoleTrial):
    """The area under the ROC of each query's texts, relevant ones against others."""

    role, measure = "score", "AUC"

    def __init__(self, config: RelevanceTrial) -> None:
        self._config = config

    @cached_property
    def items(self) -> Sequence[Any]:
        config, rng = self._config, np.random.default_rng(self._config.seed)
        labels = _Labels(config.source, config.queries, config.where)
        asked = drawn(labels.queries, config.count, config.seed, config.queries)
        return [self._item(text, relevant, labels.texts, rng) for text, relevant in asked]

    def _item(
        self, query: str, relevant: frozenset[str], texts: Mapping[str, str], rng: np.random.Generator
    ) -> dict[str, Any]:
        good, bad = sorted(relevant), sorted(texts.keys() - relevant)
        some = [str(n) for n in rng.permutation(good)[: self._config.relevant]]
        others = [str(n) for n in rng.permutation(bad)[: self._config.others]]
        return {"query": query, "relevant": [texts[n] for n in some], "others": [texts[n] for n in others]}

    def ask(self, asked: Asked, items: Sequence[Any]) -> list[Any]:
        backend = asked.backend
        pairs = [(item["query"], text) for item in items for text in (*item["relevant"], *item["others"])]
        scores = each(lambda some: [float(s) for s in backend.score(some)], pairs, backend.batch_size("score"))
        ends = np.cumsum([len(item["relevant"]) + len(item["others"]) for item in items])
        return [scores[start:end] for start, end in zip((0, *ends[:-1]), ends, strict=True)]

    def controls(self) -> Mapping[str, Outputs]:
        """The length of a text as its score."""
        return {"longer texts first": [[float(len(t)) for t in (*i["relevant"], *i["others"])] for i in self.items]}

    def judge(self, outputs: Outputs, embedder: Embedder) -> Judgement:
        del embedder
        areas = [_area(scores, len(item["relevant"])) for item, scores in zip(self.items, outputs, strict=True)]
        return Judgement.of(areas)


def _area(scores: Sequence[float | None], relevant: int) -> float:
    """How often a relevant text scores above another, ties half; a text without a score counts as last."""
    known = np.array([-np.inf if s is None else s for s in scores])
    good, bad = known[:relevant, None], known[None, relevant:]
    return float(((good > bad) + 0.5 * (good == bad)).mean())


class Search(RoleTrial):
    """Precision of the first text, and of the first five, when all texts are ranked by cosine."""

    role, measure = "embed", "P@1"

    def __init__(self, config: SearchTrial) -> None:
        self._config = config

    @property
    def units(self) -> int:
        """The embedded texts, since a pool costs more than its queries."""
        return len(self._pool) + len(self.items)

    @cached_property
    def _pool(self) -> dict[str, str]:
        """The texts that are searched, by node: all that answer an asked query, and others."""
        return {node: text for node, text in self._labels.texts.items() if node in self._kept}

    @cached_property
    def _labels(self) -> _Labels:
        return _Labels(self._config.source, self._config.queries, self._config.where)

    @cached_property
    def _asked(self) -> list[tuple[str, frozenset[str]]]:
        return drawn(self._labels.queries, self._config.count, self._config.seed, self._config.queries)

    @cached_property
    def _kept(self) -> frozenset[str]:
        nodes, pool = sorted(self._labels.texts), self._config.pool
        if pool is None or pool >= len(nodes):
            return frozenset(nodes)
        rng, wanted = np.random.default_rng(self._config.seed), sorted(frozenset().union(*(r for _, r in self._asked)))
        some = [str(n) for n in rng.permutation(wanted)[: pool // 2]]
        rest = [str(n) for n in rng.permutation(sorted(set(nodes) - set(wanted)))]
        return frozenset((some + rest)[:pool])

    @cached_property
    def items(self) -> Sequence[Any]:
        asked = [(text, sorted(relevant & self._kept)) for text, relevant in self._asked]
        return [{"query": text, "relevant": relevant} for text, relevant in asked if relevant]

    def ask(self, asked: Asked, items: Sequence[Any]) -> list[Any]:
        nodes = sorted(self._pool)
        documents = kept(asked.backend.embed([self._pool[node] for node in nodes], "document"), asked.vectors)
        queries = asked.backend.embed([item["query"] for item in items], "query")
        return [[nodes[int(row)] for row in documents.nearest(query, TOP)] for query in queries]

    def controls(self) -> Mapping[str, Outputs]:
        rng, nodes = np.random.default_rng(self._config.seed), sorted(self._pool)
        return {"any, by chance": [[str(n) for n in rng.permutation(nodes)[:TOP]] for _ in self.items]}

    def judge(self, outputs: Outputs, embedder: Embedder) -> Judgement:
        del embedder
        pairs = [(output, frozenset(item["relevant"])) for item, output in zip(self.items, outputs, strict=True)]
        first, five = ([precision_at(o, r, k) for o, r in pairs] for k in (1, TOP))
        return Judgement.of(first, {"P@5": bootstrap(five)})
