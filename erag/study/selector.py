"""From a teacher's decisions to an adapter: figures on questions and on sets of cards never seen, checkpoint, card."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from erag.core.progress import Progress, quiet
from erag.core.text import content_hash
from erag.evaluate.statistics import Interval, clustered_bootstrap
from erag.lm.adapter import HEADER, Adapter, AdapterConfig, embedder_of
from erag.lm.adapter_header import RULES, AdapterHeader
from erag.lm.checkpoints import save
from erag.lm.config import BackendConfig, build_backend
from erag.lm.offline import go_offline
from erag.lm.roles import Selector, SelectTask
from erag.lm.weights import ModelStore
from erag.study.calibration import areas, platt
from erag.study.decisions import Decision, read_decisions
from erag.study.pairs import Table, folds, table
from erag.study.shown import Shown
from erag.study.textcard import selector_card
from erag.study.textconfig import AdapterDistil
from erag.study.vectors import KeptVectors

if TYPE_CHECKING:
    import torch

Floats = npt.NDArray[np.float64]
QUESTIONS, SETS = "unseen questions", "unseen sets of cards"
STUDENT, STRICT = "this adapter", "the same, copies told apart"
_TIMED = 200  # decisions asked one by one


@dataclass(frozen=True)
class Report:
    """What came of it: agreement with the teacher by split and selector, area under the ROC curve by split and scorer,
    milliseconds a decision with and without the embedding of new texts, seconds by stage."""

    out: Path
    bytes: int
    decisions: int
    questions: int
    sets: int
    cards: int
    chance: float
    agreement: Mapping[str, Mapping[str, Interval]]
    area: Mapping[str, Mapping[str, Interval]]
    milliseconds: Mapping[str, float]
    seconds: Mapping[str, float]

    def table(self) -> Shown:
        """The figures for the terminal."""
        rows = [
            (name, *(str(self.agreement[split][name]) for split in self.agreement)) for name in self.agreement[SETS]
        ]
        return Shown(("selector", *self.agreement), rows)


def distil(config: AdapterDistil, store: ModelStore, progress: Progress = quiet) -> Report:
    """Train and judge an adapter as configured, and write it with its card. Resumable, epoch by epoch.

    Raises InputError for decisions that cannot be read or are fewer than a batch.
    """
    go_offline()
    clock = [time.perf_counter()]
    decisions = [d for d in read_decisions(config.decisions) if config.without is None or not config.without.holds(d)]
    embedder = embedder_of(config.embedder, store)
    data = table(decisions, KeptVectors(embedder, config.work / "vectors"))
    header = AdapterHeader(
        dim=data.queries.shape[1], rank=config.rank, members=config.members, trusted_from=config.trusted_from,
        embedder=embedder.identity("embed"), taught_by=config.taught_by,
    )  # fmt: skip
    clock.append(time.perf_counter())
    splits = {QUESTIONS: [d.query for d in decisions], SETS: [d.group for d in decisions]}
    run = _Run(config, header, data, progress)
    unseen = {name: run.left_out(name, groups) for name, groups in splits.items()}
    clock.append(time.perf_counter())
    slope, offset = platt(*_pairs(unseen[QUESTIONS], data))
    network = run.trained("all", range(len(data)))
    known = len(network.get_buffer("known"))
    header = header.model_copy(update={"slope": slope, "offset": offset, "known": known})
    save(config.out, HEADER, header, network.state_dict())
    clock.append(time.perf_counter())
    agreement, area = {}, {}
    compared = {name: _picks(_backend(model, store), decisions) for name, model in config.compare.items()}
    for name, groups in splits.items():
        agreement[name], area[name] = _figures(config, unseen[name], decisions, data, groups, compared)
    speed = _speed(config, store, decisions)
    clock.append(time.perf_counter())
    stages = dict(zip(("embed", "folds", "train", "judge"), np.diff(clock).tolist(), strict=True))
    report = Report(
        config.out, config.out.stat().st_size, len(decisions), len(set(splits[QUESTIONS])), len(set(splits[SETS])),
        len(data.whole), float(np.mean([1 / len(d.cards) for d in decisions])), agreement, area, speed, stages,
    )  # fmt: skip
    config.out.with_suffix(".md").write_text(selector_card(config, report), encoding="utf-8")
    (config.work / "figures.json").write_text(json.dumps(asdict(report), indent=1, default=str), encoding="utf-8")
    return report


class _Run:
    """Trainings under folders named by everything the weights depend on, so that no run resumes another one."""

    def __init__(self, config: AdapterDistil, header: AdapterHeader, data: Table, progress: Progress) -> None:
        said = config.model_dump_json(include={"rank", "members", "relevance", "negatives", "folds", "strange"})
        trained = config.training.model_dump_json(exclude={"wandb", "threads"})
        key = content_hash(str(RULES), said, trained, header.model_dump_json(), *_digests(data)).hex()[:12]
        self._config, self._header, self._data, self._progress = config, header, data, progress
        self._folder = config.work / f"run-{key}"

    def trained(self, name: str, rows: Sequence[int]) -> torch.nn.Module:
        from erag.study.adapting import train

        def told(stage: str, done: int, total: int) -> None:
            self._progress(f"{name}: {stage}", done, total)

        return train(self._header, self._config, self._data, rows, self._folder / name.replace(" ", "-"), told)

    def left_out(self, name: str, groups: Sequence[str]) -> Floats:
        """(n, m) logits of every decision by an adapter that has seen nothing of its group."""
        from erag.study.adapting import predicted

        fold = folds(groups, self._config.folds, self._config.training.seed)
        found = np.zeros(self._data.shown.shape)
        for number in range(self._config.folds):
            out = np.flatnonzero(fold == number)
            if len(out):
                network = self.trained(f"{name} {number}", np.flatnonzero(fold != number).tolist())
                found[out] = predicted(network, self._data, out.tolist()).numpy()  # type: ignore[arg-type]
        return found


def _digests(data: Table) -> list[str]:
    tensors = [t.double() for t in vars(data).values()]
    return [f"{tuple(t.shape)} {t.sum().item()!r} {t.square().sum().item()!r}" for t in tensors]


def _pairs(logits: Floats, data: Table) -> tuple[Floats, Floats]:
    """Logits (p,) of all pairs of decision and card, and whether the card was chosen (p,)."""
    there = (data.shown >= 0).numpy()
    return logits[there], data.right.numpy()[there].astype(np.float64)


def _figures(
    config: AdapterDistil, logits: Floats, decisions: Sequence[Decision], data: Table, groups: Sequence[str],
    compared: Mapping[str, Sequence[int]],
) -> tuple[dict[str, Interval], dict[str, Interval]]:  # fmt: skip
    """Agreement by selector, and area under the ROC curve by scorer."""
    cosine = np.where((data.shown >= 0).numpy(), data.features[:, :, 0].numpy(), -np.inf)
    picks = {"always first": [0] * len(decisions), "cosine": cosine.argmax(axis=1).tolist(), **compared}
    picks[STUDENT] = logits.argmax(axis=1).tolist()
    right = {name: [float(d.agrees(p)) for p, d in zip(own, decisions, strict=True)] for name, own in picks.items()}
    right[STRICT] = [float(p == d.chosen) for p, d in zip(picks[STUDENT], decisions, strict=True)]
    agreement = {name: clustered_bootstrap(own, groups, samples=config.resamples) for name, own in right.items()}
    owners = np.repeat(np.array(groups), (data.shown >= 0).sum(dim=1).numpy())
    scored = {"cosine": _pairs(cosine, data), STUDENT: _pairs(logits, data)}
    return agreement, {name: areas(*own, owners.tolist(), config.resamples) for name, own in scored.items()}


def _backend(model: object, store: ModelStore) -> Selector:
    return build_backend(BackendConfig.model_validate({"models": {"one": model}, "roles": {"select": "one"}}), store)


def _picks(selector: Selector, decisions: Sequence[Decision]) -> list[int]:
    return [picks[0] for picks in selector.select([SelectTask(d.query, d.cards) for d in decisions], 1)]


def _speed(config: AdapterDistil, store: ModelStore, decisions: Sequence[Decision]) -> dict[str, float]:
    """Milliseconds a decision, asked one at a time: the cards known and the query new, and both known."""
    some = decisions[:: max(1, len(decisions) // _TIMED)]
    adapter = Adapter(AdapterConfig(checkpoint=config.out, embedder=config.embedder), store)
    adapter.select([SelectTask("warm up", d.cards) for d in some], 1)
    fresh = _milliseconds(adapter, [SelectTask(f"{d.query} {number}", d.cards) for number, d in enumerate(some)])
    tasks = [SelectTask(d.query, d.cards) for d in some]
    adapter.select(tasks, 1)
    return {"a new query over known cards": fresh, "known texts": _milliseconds(adapter, tasks)}


def _milliseconds(selector: Selector, tasks: Sequence[SelectTask]) -> float:
    taken = []
    for task in tasks:
        start = time.perf_counter()
        selector.select([task], 1)
        taken.append(time.perf_counter() - start)
    return float(np.median(taken)) * 1000
