"""Sensors, times, changes, numbers and the whole: answers on simulated worlds, right or wrong by stated rules."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from erag.bench.config import AwareBench, MemoryBench
from erag.bench.retrieval import built
from erag.core.errors import InputError
from erag.core.progress import Progress, quiet
from erag.core.types import Answer, Query
from erag.data.contract import QueryLine, Result, parse_query, read_queries
from erag.evaluate.statistics import bootstrap
from erag.evaluate.text import Golden, SemanticSimilarity, fact_coverage, golden_facts
from erag.forest.terms import fold
from erag.lm.weights import ModelStore
from erag.pipeline.query import Asker

ENOUGH = 0.5  # share of the things that changed, and of what is said, from which on an answer is right
_ITEM = re.compile(r"\b(?:a|an) ([^,.;:()]+?) \(seen at")
_NUMBER = re.compile(r"\d+")


@dataclass(frozen=True, slots=True)
class Score:
    """One measure of one answer, with the question and what was said, for the list of what went wrong."""

    id: str
    task: str
    measure: str
    value: float
    asked: str
    said: str


def run(config: AwareBench, store: ModelStore, progress: Progress = quiet) -> Iterator[Score]:
    """The scores of all questions about the worlds. Raises InputError where the root holds none of them."""
    folders = [f for f in sorted((config.root / "worlds").glob("*")) if not config.worlds or f.name in config.worlds]
    if not folders:
        raise InputError("no such worlds", where=str(config.root), repair="erag sim build --captions truth")
    for done, folder in enumerate(folders, 1):
        memory = MemoryBench(source=str(folder), memory=config.folder / f"{folder.name}.erag", pipeline=config.pipeline)
        asker = Asker(built(memory, store), config.pipeline, store)
        for line in read_queries(config.root / "queries.jsonl", {"environment": folder.name}):
            yield from scores(asker, line)
        progress("worlds", done, len(folders))


def scores(asker: Asker, line: QueryLine) -> Iterator[Score]:
    """The scores of one labelled question; none for the tasks that other benchmarks measure."""
    raw = line.raw or {}
    task, query = str(raw.get("task")), parse_query(line, 5, asker.ground)
    if task == "find" and query.sensors:
        yield from _sensed(asker, raw, query)
    if task not in ("last_seen", "change", "count", "describe"):
        return
    result = asker.ask(query)
    said = result.answer.text.split("\n")[0] if result.answer else ""
    for measure, value in _measures(task, raw, result, asker).items():
        yield Score(line.id, task, measure, value, str(raw["query"]), said)


def _sensed(asker: Asker, raw: Mapping[str, Any], query: Query) -> Iterator[Score]:
    """P@1 and P@5 with and without the wish for a sensor's reading."""
    for name, asked in (("with S", query), ("without S", replace(query, sensors={}))):
        hits = [hit.node in raw["relevant"] for hit in asker.ask(asked).hits]
        yield Score(query.id, "sensor", f"P@1 {name}", float(any(hits[:1])), str(raw["query"]), name)
        yield Score(query.id, "sensor", f"P@5 {name}", sum(hits) / 5, str(raw["query"]), name)


def _measures(task: str, raw: Mapping[str, Any], result: Result, asker: Asker) -> Mapping[str, float]:
    answer = result.answer or Answer("explain", "")
    if task == "last_seen":
        return {"right": float(last_seen_right(raw, result))}
    if task == "change":
        return {"right": float(change_right(raw, result))}
    if task == "count":
        return _count(raw, answer)
    judge = SemanticSimilarity("minilm-l6", asker.embedder, retrieves=True)
    (score,) = judge.scores([str(raw["query"])], [answer.text], [Golden(str(raw["golden_answer"]))])
    wanted = ("ss", "ss_generic", "fact_coverage", "fact_coverage_generic")
    return {name: score.values()[name] for name in wanted}


def last_seen_right(raw: Mapping[str, Any], result: Result) -> bool:
    """The first hit shows the thing within the last minute it was seen; a text also has to state the day."""
    right = bool(result.hits) and result.hits[0].node in raw["relevant"]
    stated = result.answer is not None and str(raw["seen_at"])[:10] in result.answer.text
    return right and (stated or raw["kind"] == "explicit")


def change_right(raw: Mapping[str, Any], result: Result) -> bool:
    """A place: the first hit is relevant. Things: half of those that changed are named, and half of those named did.

    Of what is neither, season and weather: the answer states half of the golden facts.
    """
    answer = result.answer.text if result.answer else ""
    if "relevant" in raw:
        return bool(result.hits) and result.hits[0].node in raw["relevant"]
    if not raw.get("target"):
        return fact_coverage(answer, golden_facts(Golden(str(raw["golden_answer"]))))[0] >= ENOUGH
    golden = [_words(name) for name in str(raw["target"]).split(", ")]
    named = [_words(name) for name in _ITEM.findall(answer.split("Moved", 1)[0].split("moved,", 1)[0])]
    found = sum(any(_one(g, n) for n in named) for g in golden)
    true = sum(any(_one(g, n) for g in golden) for n in named)
    return found >= ENOUGH * len(golden) and true >= ENOUGH * len(named)


def _count(raw: Mapping[str, Any], answer: Answer) -> Mapping[str, float]:
    """The error of the first number an answer states, which is that of the first visit where there were several."""
    match = _NUMBER.search(answer.text)
    said = int(match[0]) if match else 0
    error = abs(said - int(raw["count"]))
    return {"error": float(error), "relative error": error / int(raw["count"]), "within one": float(error <= 1)}


def _words(name: str) -> tuple[str, ...]:
    return tuple(fold(word) for word in name.split())


def _one(golden: tuple[str, ...], named: tuple[str, ...]) -> bool:
    """Whether a name may mean a golden one: the same head, and one has all the words of the other."""
    return golden[-1] == named[-1] and (set(golden) <= set(named) or set(named) <= set(golden))


def table(scores_: Sequence[Score]) -> list[tuple[object, ...]]:
    """Rows of task, measure, number, mean and 95 % interval of the mean."""
    rows: list[tuple[object, ...]] = []
    for task, measure in dict.fromkeys((s.task, s.measure) for s in sorted(scores_, key=lambda s: s.task)):
        values = [s.value for s in scores_ if (s.task, s.measure) == (task, measure)]
        found = bootstrap(values)
        rows.append((task, measure, len(values), f"{found.mean:.2f}", f"{found.low:.2f}–{found.high:.2f}"))
    return rows


def missed(scores_: Sequence[Score]) -> list[str]:
    """What was answered wrongly, a line each."""
    return [f"{s.id} {s.asked} → {s.said[:160]}" for s in scores_ if s.measure == "right" and not s.value]
