"""The questions of an experiment: which are asked, in which modes, from where; and what is known of each for tables."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from pydantic import BaseModel, ConfigDict

from erag.core.text import content_hash
from erag.data.contract import QueryLine
from erag.evaluate.dataset import Question
from erag.evaluate.location import paths, shortest_path
from erag.evaluate.scene import Scene
from erag.experiment.config import PARTS, DataConfig, ExperimentConfig, Mode, SetConfig, SystemConfig
from erag.experiment.predictions import QuestionKey


class QuestionRecord(BaseModel):
    """What tables need of a question besides its answers: no texts, and of its labels only how many there are.

    `at` is the L it is asked from and `drawn` that the seed chose it; `sensor` the wish asked in modes with S and
    `stated` that the data set states it; `radius_m` is R, `shortest_m` the way to the nearest node that answers,
    `nearest_m` to the nearest node of all, unless it asks for a time; `relevant` counts labels, None where there
    are none; `worded` says that it has a text, which a panel needs.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    data: str
    environment: str
    id: str
    kind: str
    sets: tuple[str, ...]
    at: tuple[float, ...] | None = None
    drawn: bool = False
    sensor: dict[str, Any] | None = None
    stated: bool = False
    radius_m: float | None = None
    shortest_m: float | None = None
    nearest_m: float | None = None
    relevant: int | None = None
    golden: bool = False
    worded: bool = True

    @property
    def key(self) -> QuestionKey:
        return (self.data, self.environment, self.id)


@dataclass(frozen=True)
class Posed:
    """A question ready to be asked: what may be asked of it, by the letters of a mode."""

    data: str
    environment: str
    question: Question
    sets: tuple[str, ...]
    at: tuple[float, ...] | None
    drawn: bool
    sensor: Mapping[str, Any] | None
    stated: bool

    @property
    def key(self) -> QuestionKey:
        return (self.data, self.environment, self.question.id)

    def line(self, mode: Mode) -> QueryLine | None:
        """The line that is asked in a mode, None where the question lacks a part of it."""
        raw = dict(self.question.line.raw or {})
        have: dict[str, Any] = {
            "query": raw.get("query"), "at": None if self.at is None else list(self.at), "sensor": self.sensor
        }  # fmt: skip
        wanted = {PARTS[letter] for letter in mode.split(",")}
        if any(have[part] is None for part in wanted):
            return None
        kept = {key: raw[key] for key in ("since", "until") if raw.get(key) is not None}
        kind = {"kind": raw["kind"]} if raw.get("kind") in ("explicit", "implicit", "global", "find", "explain") else {}
        asked = {part: have[part] for part in wanted}
        return replace(self.question.line, raw={"id": self.question.id, **kind, **asked, **kept})


def posed(data: str, config: ExperimentConfig, scene: Scene) -> list[Posed]:
    """The questions about an environment that are in one of the experiment's sets, in the order of the data set."""
    given, made = config.data[data], []
    sets = {q.id: _sets(config, given, q) for q in scene.environment.questions}
    kept = _sampled(data, scene.environment.name, sets, given.questions_per_set, config.seed)
    for question in scene.environment.questions:
        if sets[question.id] and question.id in kept:
            wishes = [config.sets[s].sensor for s in sets[question.id]]
            made.append(_posed(data, scene, question, sets[question.id], wishes, config.seed))
    return made


def _sets(config: ExperimentConfig, given: DataConfig, question: Question) -> tuple[str, ...]:
    raw = question.line.raw or {}
    if not _fits(raw, given.where):
        return ()
    return tuple(name for name, one in config.sets.items() if _fits(raw, one.where))


def _fits(raw: Mapping[str, Any], where: Mapping[str, Sequence[str]]) -> bool:
    return all(str(raw.get(key, "")) in values for key, values in where.items())


def _sampled(data: str, environment: str, sets: Mapping[str, tuple[str, ...]], most: int | None, seed: int) -> set[str]:
    if most is None:
        return set(sets)
    kept = set[str]()
    for name in {s for one in sets.values() for s in one}:
        inside = [i for i, one in sets.items() if name in one]
        kept |= set(sorted(inside, key=lambda i: _draw(seed, data, environment, i))[:most])
    return kept


def _draw(seed: int, *what: str) -> bytes:
    return content_hash(str(seed), *what)


def _posed(
    data: str, scene: Scene, question: Question, sets: tuple[str, ...], wishes: Iterable[Any], seed: int
) -> Posed:
    raw, nodes = question.line.raw or {}, scene.topomap.nodes
    at, sensor = raw.get("at"), raw.get("sensor")
    drawn = at is None and bool(nodes)
    if drawn:
        number = int.from_bytes(_draw(seed, "at", data, scene.environment.name, question.id)[:8], "little")
        at = nodes[number % len(nodes)].pose.xyz
    wish = sensor or next((w for w in wishes if w), None)
    known = {channel for node in nodes for channel in node.sensors}
    usable = wish if wish and set(wish) <= known else None
    place = None if at is None else tuple(float(v) for v in at)
    return Posed(data, scene.environment.name, question, sets, place, drawn, usable, bool(sensor))


def modes_of(one: Posed, sets: Mapping[str, SetConfig]) -> list[Mode]:
    """The modes a question is asked in, each once, in the order its sets name them."""
    return [m for m in dict.fromkeys(m for name in one.sets for m in sets[name].modes) if one.line(m) is not None]


def chosen(questions: Sequence[Posed], system: SystemConfig, seed: int) -> list[Posed]:
    """The questions a system is asked: of each set and data set all, or `queries` spread over environments.

    The same seed chooses the same questions for every system, and a smaller number some of those of a larger one.
    """
    allowed = [q for q in questions if not system.data or q.data in system.data]
    allowed = [q for q in allowed if not system.environments or q.environment in system.environments]
    allowed = [q for q in allowed if not system.sets or set(q.sets) & set(system.sets)]
    if system.queries is None:
        return allowed
    kept = set[QuestionKey]()
    for data, name in sorted({(q.data, s) for q in allowed for s in q.sets}):
        kept |= set(_spread([q for q in allowed if q.data == data and name in q.sets], system.queries, seed))
    return [q for q in allowed if q.key in kept]


def _spread(questions: Sequence[Posed], most: int, seed: int) -> list[QuestionKey]:
    """`most` questions, one environment after the other, each in an order drawn by the seed."""
    by_environment: dict[str, list[QuestionKey]] = {}
    for question in sorted(questions, key=lambda q: _draw(seed, "sample", *q.key)):
        by_environment.setdefault(question.environment, []).append(question.key)
    rounds = [(i, keys[0][1], key) for keys in by_environment.values() for i, key in enumerate(keys)]
    return [key for _, _, key in sorted(rounds, key=lambda r: (r[0], _draw(seed, "order", r[1])))][:most]


def record_of(one: Posed, scene: Scene) -> QuestionRecord:
    """What tables need to know of a question; lengths are those of the environment's own map."""
    at = None if one.at is None else scene.pose(one.at)
    on_map = frozenset(one.question.relevant or ()) & scene.topomap.row.keys()
    relevant = None if one.question.relevant is None else len(on_map)
    shortest = shortest_path(scene.topomap, scene.distances, at, on_map) if at is not None and on_map else None
    everything = list(scene.topomap.row)
    windowed = any((one.question.line.raw or {}).get(key) is not None for key in ("since", "until"))
    near = None if at is None or windowed or not everything else paths(scene.topomap, scene.distances, at, everything)
    nearest = None if near is None else float(near.metres.min())
    return QuestionRecord(
        data=one.data, environment=one.environment, id=one.question.id, kind=one.question.kind, sets=one.sets,
        at=one.at, drawn=one.drawn, sensor=None if one.sensor is None else dict(one.sensor), stated=one.stated,
        radius_m=scene.radius_m, shortest_m=shortest, nearest_m=nearest, relevant=relevant,
        golden=one.question.golden is not None, worded=bool(one.question.text),
    )  # fmt: skip


def digest_of(line: QueryLine) -> str:
    """Of what is asked: another text, place or wish is another question."""
    return content_hash(json.dumps(line.raw, sort_keys=True, ensure_ascii=False)).hex()
