"""One experiment from start to end: memories, answers, judgements, tables; killed at any moment, it goes on."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

from erag.core.errors import ConfigError, InputError
from erag.core.lockfile import exclusive
from erag.core.output import replacing
from erag.core.progress import Progress, quiet
from erag.data.registry import read
from erag.evaluate.judges.stack import Stack, fit_stack, read_stack
from erag.evaluate.scene import Scene
from erag.evaluate.text import SemanticSimilarity
from erag.experiment.agreement import AgreementRow, Tried, TriedPair, agreement_rows, joined, stackable, triable, tried
from erag.experiment.answered import Answered
from erag.experiment.asking import Ground, everything, parted
from erag.experiment.config import ExperimentConfig, SystemConfig, model_name
from erag.experiment.driving import Driven, driven
from erag.experiment.estimate import Expected, Spent, expected
from erag.experiment.judging import Voted, texts, voted
from erag.experiment.machine import machine
from erag.experiment.memories import Memory
from erag.experiment.panel import Bench, bench
from erag.experiment.predictions import Appender, Prediction, read_predictions, write_records
from erag.experiment.questions import chosen, posed, record_of
from erag.experiment.report import Folder, write_report
from erag.experiment.sources import environments, prepared
from erag.experiment.sweep import resolved
from erag.experiment.systems import Loaded, models_of, pipeline_of
from erag.lm.config import BackendConfig, build_backend
from erag.lm.sentence import SentenceConfig
from erag.lm.weights import ModelStore
from erag.pipeline.config import PipelineConfig
from erag.retrieve.config import RetrieveConfig
from erag.topomap.build import build_map

EMBEDDED = SystemConfig(overrides=("backend.roles={embed: minilm}", "answer.explain=quotes"))  # no summaries


class Experiment:
    """A configuration, its run folder `out`, and what is loaded on the way."""

    def __init__(self, config: ExperimentConfig, out: Path, store: ModelStore, progress: Progress = quiet) -> None:
        self.config = resolved(config)
        self.folder, self._store, self._progress = Folder(out), store, progress
        self._loaded, self._memories = Loaded(store, progress), dict[str, Memory]()
        self.asked_now = self.taken_over = 0

    def run(self, again: Sequence[str] = ()) -> None:
        """Everything. `again` names systems whose answers are asked anew.

        Raises InputError while another process runs in the same folder, and for data or configurations that are wrong.
        """
        self.folder.path.mkdir(parents=True, exist_ok=True)
        with exclusive(self.folder.path / ".lock", "erag run", _taken):
            self._write_config()
            started = time.perf_counter()
            predictions = self._answers(again)
            answered = time.perf_counter()
            self._judge(predictions)
            self._write_facts(Spent(answered - started, time.perf_counter() - answered, len(predictions)))
            write_report(self.config, self.folder)

    def estimate(self) -> list[Expected]:
        """What is still to be done and how long it takes by what earlier runs took; nothing is asked or built."""
        known = {p.key: p for p in read_predictions(self.folder.predictions)}
        due, _ = parted(everything(self.config, self.grounds, self._memory, self._loaded), known)
        return expected(due, self.folder.path.parent, self.config.work)

    def tables(self) -> None:
        """The tables anew, from what lies in the run's folder. Raises InputError where nothing was asked yet."""
        if not self.folder.predictions.is_file():
            raise InputError("nothing was asked yet", where=str(self.folder.path), repair="run without --tables-only")
        write_report(self.config, self.folder)

    def _write_config(self) -> None:
        with replacing(self.folder.config) as file:
            yaml.safe_dump(self.config.model_dump(mode="json"), file, sort_keys=False, allow_unicode=True, width=120)

    @cached_property
    def grounds(self) -> tuple[Ground, ...]:
        """The environments of all data sets, prepared once."""
        return tuple(ground for data in self.config.data for ground in self._prepared(data))

    def _prepared(self, data: str) -> Iterator[Ground]:
        given = self.config.data[data]
        found = environments(data, given).environments
        for i, environment in enumerate(found):
            self._progress(f"{data}: maps", i, len(found))
            source = prepared(data, given, environment, self.config.work, self._store, self._progress)
            reading = read(source.folder)
            topomap, _ = build_map(reading.frame, reading.observations, reading.edges, PipelineConfig().map)
            truths = environment.truths.over(topomap.row, listed=self.config.panel.reads == "lists")
            scene = Scene.of(replace(environment, truths=truths), topomap)
            yield Ground(source, scene, tuple(posed(data, self.config, scene)))
        self._progress(f"{data}: maps", len(found), len(found))

    def _memory(self, ground: Ground, config: PipelineConfig) -> Memory:
        given = self.config.data[ground.source.data].forest == "given"
        memory = Memory.of(ground.source, config, given, self.config.work, self._store)
        return self._memories.setdefault(memory.key, memory)

    def _answers(self, again: Sequence[str]) -> list[Prediction]:
        """Ask what was not asked yet; answers of another configuration go to the work folder."""
        unknown = sorted(set(again) - set(self.config.systems))
        if unknown:
            raise ConfigError(f"no system {unknown[0]!r}", where="--again", allowed=", ".join(self.config.systems))
        write_records(self.folder.questions, [record_of(q, g.scene) for g in self.grounds for q in g.questions])
        known = {p.key: p for p in read_predictions(self.folder.predictions) if p.system not in again}
        due, kept = parted(everything(self.config, self.grounds, self._memory, self._loaded), known)
        self._set_aside(known.values(), kept)
        totals, done = Counter(one.asked.name for one in due), Counter[str]()
        with Appender(self.folder.predictions) as file, Answered(self.config.work / "answers.jsonl") as answered:
            for i, one in enumerate(due):
                name = one.asked.name
                prediction, new = one.answer(answered, anew=name in again)
                file.add(prediction)
                done[name] += 1
                self.asked_now += new
                self._progress(name, done[name], totals[name])
                if i + 1 == len(due) or due[i + 1].asked is not one.asked:
                    one.asked.release()
        self.taken_over = len(due) - self.asked_now
        return read_predictions(self.folder.predictions)

    def _set_aside(self, known: Iterable[Prediction], kept: Sequence[Prediction]) -> None:
        """Keep in the file what answers this configuration; the rest is kept beside the memories, not thrown away."""
        stays = {p.key for p in kept}
        stale = [p for p in known if p.key not in stays]
        if stale:
            with Appender(self.config.work / "stale" / f"{self.folder.path.name}.jsonl") as file:
                for prediction in stale:
                    file.add(prediction)
        write_records(self.folder.predictions, kept)

    def _judge(self, predictions: Sequence[Prediction]) -> None:
        stack = None if self.config.panel.stack is None else read_stack(self.config.panel.stack)
        embedder = build_backend(self._similarity(), self._store)
        work, similarity = self.config.work, self.config.similarity
        with bench(self.config.panel, embedder, similarity, work, self._store, self._progress) as seated:
            rows = self._agree(seated, stack)
            write_records(self.folder.agreement, rows)
            votes = list(self._votes(predictions, seated, stack))
        write_records(self.folder.votes, votes)
        write_records(self.folder.trips, self._trips(predictions))
        measure = SemanticSimilarity(similarity, embedder, retrieves=similarity in self._used())
        every = {q.key: q for g in self.grounds for q in g.questions}
        write_records(self.folder.texts, texts(predictions, every, measure))

    def _similarity(self) -> BackendConfig:
        if self.config.similarity == "fake":
            return BackendConfig.model_validate({"models": {"ss": {"kind": "fake"}}, "roles": {"embed": "ss"}})
        return BackendConfig(models={"ss": SentenceConfig(model=self.config.similarity)}, roles={"embed": "ss"})

    def _votes(self, predictions: Sequence[Prediction], seated: Bench, stack: Stack | None) -> Iterator[Voted]:
        for i, ground in enumerate(self.grounds):
            self._progress("judge", i, len(self.grounds))
            yield from voted(predictions, ground.questions, ground.scene, seated, stack)
        self._progress("judge", len(self.grounds), len(self.grounds))

    def _trips(self, predictions: Sequence[Prediction]) -> list[Driven]:
        config, seed = self.config.trips, self.config.seed
        return [] if config is None else [d for g in self.grounds for d in driven(predictions, g, config, seed)]

    def _agree(self, seated: Bench, stack: Stack | None) -> list[AgreementRow]:
        config = self.config.panel.agreement
        if config is None:
            return []
        rows, fitting, pairs_tried = list[AgreementRow](), list[Tried](), list[TriedPair]()
        rules = [name for name, judge in self.config.panel.judges.items() if judge.kind == "labels"]
        for data in self.config.data:
            pairs = [found for g in self.grounds if g.source.data == data and (found := self._tried(g, seated))]
            if pairs:
                whole = joined(pairs)
                pairs_tried += whole.records(data)
                names = stackable(whole.votes, rules)
                rows += agreement_rows(data, whole, config.top, stack, names if len(names) > 1 else ())
                fitting.append(whole)
        write_records(self.folder.tried, pairs_tried)
        if self.config.panel.fit and fitting:
            whole = joined(fitting)
            where = ", ".join(f"{d} ({c.split or 'all splits'})" for d, c in self.config.data.items())
            stackable_names = stackable(whole.votes, rules)
            fit_stack(whole.votes, whole.labels, stackable_names, whole.queries, where).save(self.folder.stack)
        return rows

    def _tried(self, ground: Ground, seated: Bench) -> Tried | None:
        """The labelled pairs of an environment: its share of the questions the panel is tried on."""
        config = self.config.panel.agreement
        if config is None:
            return None
        every = [q for g in self.grounds for q in g.questions if triable(q)]
        sample = chosen(every, SystemConfig(queries=config.questions), self.config.seed)
        wanted = {q.key for q in sample}
        questions = [q for q in ground.questions if q.key in wanted]
        if not questions:
            return None
        systems = sorted(self.config.systems.values(), key=lambda system: not system.ours)  # else in their order
        pipeline = pipeline_of(systems[0] if systems else EMBEDDED)
        ranking = RetrieveConfig.model_validate({"retriever": {"kind": config.ranking}})
        pipeline = pipeline.model_copy(update={"retrieve": ranking})
        asker = self._loaded.asker(self._memory(ground, pipeline), pipeline)
        return tried(asker, ground.scene, questions, seated, config, self.config.seed)

    def _used(self) -> set[str]:
        """The names of the models the systems use."""
        return {name for system in self.config.systems.values() for name in models_of(system)}

    def _write_facts(self, spent: Spent) -> None:
        judges = [j.model for j in self.config.panel.judges.values() if j.model is not None]
        models = self._used() | {self.config.similarity} | {model_name(m) for m in judges}
        used = {n: sorted(models_of(s)) for n, s in self.config.systems.items()}
        facts: dict[str, Any] = {
            **machine(models, self._store), "seed": self.config.seed, "systems": used,
            "retrieving": sorted(self._used()),
            "data": {g.source.environment.name: {"data": g.source.data, "digest": g.source.digest,
                                                 "nodes": len(g.scene.topomap), "questions": len(g.questions),
                                                 "radius_m": round(g.scene.radius_m, 2)} for g in self.grounds},
            "spent": spent.record(self.asked_now),
            "memories": {m.path.name: {k: round(v, 3) for k, v in m.cost.items()} for m in self._memories.values()},
        }  # fmt: skip
        with replacing(self.folder.facts) as file:
            json.dump(facts, file, indent=1, ensure_ascii=False)
            file.write("\n")


def _taken(holder: str) -> InputError:
    return InputError(f"another run is at work in it ({holder})", where="erag run", repair="wait for it, or --out NEW")
