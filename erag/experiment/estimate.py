"""How long a run will take, by what earlier runs of the same folder took: before it starts."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Any

from erag.experiment.answered import Answered
from erag.experiment.asking import Due
from erag.experiment.memories import Memory
from erag.experiment.predictions import read_predictions


@dataclass(frozen=True)
class Spent:
    """Seconds of a run: memories and answers, and judging and trying the panel; `answers` there were in the end."""

    answering: float
    judging: float
    answers: int

    def record(self, asked: int) -> dict[str, float]:
        """What the facts of a run say of it; `asked` answers were new."""
        return {"answering_s": round(self.answering, 1), "judging_s": round(self.judging, 1),
                "answers": self.answers, "asked": asked}  # fmt: skip


@dataclass(frozen=True)
class Expected:
    """Work ahead: `count` things of a kind, and the seconds all of them take, None where nobody did them before."""

    what: str
    count: int
    seconds: float | None


def expected(due: Sequence[Due], runs: Path, work: Path) -> list[Expected]:
    """A line a system that is still asked, one for memories to be built, one for judging.

    Seconds are means over the runs beside this one: of an answer of the same system in the same environment, else
    anywhere; of a memory by its nodes; of judging by its answers.
    """
    with Answered(work / "answers.jsonl") as answered:
        new = [one for one in due if answered.get(one.fingerprint, one.first) is None]
    facts = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(runs.glob("*/run.json"))]
    memories = {one.asked.memory.key: one.asked.memory for one in new if not one.asked.memory.made}
    lines = [*_systems(new, _seconds(runs)), _memories(memories.values(), new, facts), _judging(len(due), facts)]
    return [line for line in lines if line.count]


def _seconds(runs: Path) -> Mapping[tuple[str, ...], float]:
    """Mean seconds of an answer by system and environment, and by system."""
    found: defaultdict[tuple[str, ...], list[float]] = defaultdict(list)
    for path in sorted(runs.glob("*/predictions.jsonl")):
        for prediction in read_predictions(path):
            for key in ((prediction.system, prediction.environment), (prediction.system,)):
                found[key].append(prediction.seconds)
    return {key: fmean(seconds) for key, seconds in found.items()}


def _systems(due: Iterable[Due], known: Mapping[tuple[str, ...], float]) -> list[Expected]:
    each: defaultdict[str, list[float | None]] = defaultdict(list)
    for one in due:
        name = one.asked.name
        each[name].append(known.get((name, one.question.environment), known.get((name,))))
    return [Expected(name, len(all_), _sum(all_)) for name, all_ in each.items()]


def _memories(memories: Iterable[Memory], due: Sequence[Due], facts: Sequence[Mapping[str, Any]]) -> Expected:
    """Those of one environment take what the slowest of it took before, else what its nodes took elsewhere."""
    took: defaultdict[str, list[float]] = defaultdict(list)
    for run in facts:
        for name, cost in run.get("memories", {}).items():
            took[name.rpartition("-")[0]].append(float(cost.get("seconds", 0.0)))
    nodes = {name: one["nodes"] for run in facts for name, one in run.get("data", {}).items()}
    rates = [max(times) / nodes[name] for name, times in took.items() if nodes.get(name)]
    sizes = {one.asked.memory.key: one.asked.size for one in due}
    names = {m.key: m.source.environment.name for m in memories}
    seconds = [
        max(took[name]) if name in took else sizes[key] * fmean(rates) if rates else None for key, name in names.items()
    ]
    return Expected("memories to build", len(names), _sum(seconds))


def _judging(answers: int, facts: Sequence[Mapping[str, Any]]) -> Expected:
    spent = [run["spent"] for run in facts if run.get("spent", {}).get("answers")]
    rate = fmean(one["judging_s"] / one["answers"] for one in spent) if spent else None
    return Expected("answers to judge", answers, None if rate is None else rate * answers)


def _sum(seconds: Sequence[float | None]) -> float | None:
    """None where any is unknown."""
    known = [s for s in seconds if s is not None]
    return sum(known) if len(known) == len(seconds) else None
