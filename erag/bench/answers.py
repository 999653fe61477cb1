"""Whole answers: are they valid, do waypoints lie on the map, how long do they take; presets side by side."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from erag.bench.config import AnswersBench
from erag.bench.retrieval import built, query_file
from erag.core.progress import Progress, quiet
from erag.data.contract import QueryLine, Result, read_queries
from erag.generate.answer import NOTHING
from erag.lm.weights import ModelStore
from erag.pipeline.config import load_config
from erag.pipeline.query import Asker


@dataclass(frozen=True, slots=True)
class AnswerScore:
    """Of `queries` asked: shares of valid answers and of waypoints on the map, refusals, seconds, calls a query."""

    preset: str
    queries: int
    valid: float
    on_map: float
    refused: int
    median: float
    p95: float
    calls: Mapping[str, float]
    events: Mapping[str, int]


def run(config: AnswersBench, store: ModelStore, progress: Progress = quiet) -> Iterator[AnswerScore]:
    """The same random queries, each asked from a random place of the map, of every preset."""
    path = built(config, store, progress)
    for preset in config.presets:
        asker = Asker(path, load_config(preset), store)
        asker.warm_up("find", "explain")
        lines = _lines(config, asker)
        results: list[Result] = []
        for result in asker.ask_lines(lines, top=5):
            results.append(result)
            progress(preset, len(results), len(lines))
        yield _score(preset, asker, results)


def _lines(config: AnswersBench, asker: Asker) -> list[QueryLine]:
    rng, nodes = np.random.default_rng(config.seed), asker.corpus.topomap.nodes
    known = [
        line.raw for source in config.queries for line in read_queries(query_file(source), config.where) if line.raw
    ]
    asked = [raw for raw in known if raw.get("query")]
    return [_line(i, asked[int(rng.integers(len(asked)))], nodes[int(rng.integers(len(nodes)))].pose.xyz)
            for i in range(config.count)]  # fmt: skip


def _line(number: int, raw: Mapping[str, Any], at: Sequence[float]) -> QueryLine:
    kept = {key: value for key, value in raw.items() if key in ("query", "kind")}
    return QueryLine(number + 1, f"q{number:03d}", {**kept, "id": f"q{number:03d}", "at": list(at)})


def _score(preset: str, asker: Asker, results: Sequence[Result]) -> AnswerScore:
    seconds = [r.seconds for r in results]
    found = [r for r in results if r.answer and r.answer.kind == "find" and r.answer.text != NOTHING]
    on_map = [r for r in found if r.answer and r.answer.waypoint and r.answer.waypoint.node in asker.corpus.topomap.row]
    roles = sorted({role for r in results for role in r.calls})
    return AnswerScore(
        preset,
        len(results),
        sum(_valid(asker, r) for r in results) / len(results),
        len(on_map) / max(len(found), 1),
        sum(r.answer is not None and r.answer.text == NOTHING for r in results),
        float(np.median(seconds)),
        float(np.quantile(seconds, 0.95)),
        {role: sum(r.calls.get(role, 0) for r in results) / len(results) for role in roles},
        dict(asker.ledger.events),
    )


def _valid(asker: Asker, result: Result) -> bool:
    """No error, a text, and nothing named that is not in the memory."""
    answer = result.answer
    if result.error is not None or answer is None or not answer.text.strip():
        return False
    known = asker.corpus.topomap.row
    named = [hit.node for hit in result.hits] + list(answer.evidence)
    waypoint = answer.waypoint is not None or answer.kind == "explain" or answer.text == NOTHING
    return waypoint and all(node in known for node in named)
