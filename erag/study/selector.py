"""From a teacher's decisions to an adapter: figures on questions and on sets of cards never seen, checkpoint, card."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from erag.core.progress import Progress, quiet
from erag.core.text import content_hash
from erag.lm.adapter import HEADER, Adapter, AdapterConfig, AnyEmbedder, embedder_of
from erag.lm.adapter_header import RULES, AdapterHeader
from erag.lm.checkpoints import save
from erag.lm.offline import go_offline
from erag.lm.roles import SelectTask
from erag.lm.weights import ModelStore
from erag.study.calibration import platt
from erag.study.ceiling import Lot, learning_curve, lots
from erag.study.decisions import Decision
from erag.study.pairs import Table, folds, table
from erag.study.standing import (
    QUESTIONS,
    Floats,
    Report,
    decisions_of,
    left_out,
    milliseconds,
    pairs_of,
    splits_of,
    stand,
    timed,
    written,
)
from erag.study.textcard import selector_card
from erag.study.textconfig import AdapterDistil
from erag.study.vectors import KeptVectors

if TYPE_CHECKING:
    import torch

STUDENT = "this adapter"


def distil(config: AdapterDistil, store: ModelStore, progress: Progress = quiet) -> Report:
    """Train and judge an adapter as configured, and write it with its card. Resumable, epoch by epoch.

    Raises InputError for decisions that cannot be read or are fewer than a batch.
    """
    go_offline()
    clock = [time.perf_counter()]
    decisions = decisions_of(config)
    embedder = embedder_of(config.embedder, store)
    data = table(decisions, KeptVectors(embedder, config.work / "vectors"))
    clock.append(time.perf_counter())
    run = Run(config, embedder, data, progress)
    fewer = run.lots(decisions)
    unseen = {name: run.left_out(name, groups) for name, groups in splits_of(decisions).items()}
    clock.append(time.perf_counter())
    slope, offset = platt(*pairs_of(unseen[QUESTIONS], data))
    network = run.trained("all", range(len(data)))
    known = len(network.get_buffer("known"))
    header = run.header.model_copy(update={"slope": slope, "offset": offset, "known": known})
    save(config.out, HEADER, header, network.state_dict())
    clock.append(time.perf_counter())
    figures = stand(config, {name: {STUDENT: own} for name, own in unseen.items()}, decisions, data, store)
    speed = _speed(config, store, decisions)
    clock.append(time.perf_counter())
    curve = learning_curve(fewer, decisions, config.resamples, run.taught_less)
    clock.append(time.perf_counter())
    stages = dict(zip(("embed", "folds", "train", "judge", "curve"), np.diff(clock).tolist(), strict=True))
    judged = {STUDENT: unseen[QUESTIONS]}
    return written(
        config, decisions, data, judged, figures, speed, stages, lambda report: selector_card(config, report), curve
    )


class Run:
    """Trainings under folders named by everything the weights depend on, so that no run resumes another one."""

    def __init__(self, config: AdapterDistil, embedder: AnyEmbedder, data: Table, progress: Progress) -> None:
        self.header = AdapterHeader(
            dim=data.queries.shape[1], rank=config.rank, members=config.members, trusted_from=config.trusted_from,
            embedder=embedder.identity("embed"), taught_by=config.taught_by,
        )  # fmt: skip
        said = config.model_dump_json(include={"rank", "members", "relevance", "negatives", "folds", "strange"})
        trained = config.training.model_dump_json(exclude={"wandb", "threads"})
        key = content_hash(str(RULES), said, trained, self.header.model_dump_json(), *_digests(data)).hex()[:12]
        self._config, self._data, self._progress = config, data, progress
        self._folder = config.work / f"run-{key}"

    def trained(self, name: str, rows: Sequence[int], epochs: int | None = None) -> torch.nn.Module:
        """The adapter that was taught the decisions `rows`, for other than the configured number of epochs if said."""
        from erag.study.adapting import train

        def told(stage: str, done: int, total: int) -> None:
            self._progress(f"{name}: {stage}", done, total)

        config = self._config
        if epochs is not None:
            config = config.model_copy(update={"training": config.training.model_copy(update={"epochs": epochs})})
        folder = self._folder / name.replace(",", "").replace(" ", "-")
        return train(self.header, config, self._data, rows, folder, told)

    def left_out(self, name: str, groups: Sequence[str]) -> Floats:
        """(n, m) logits of every decision by an adapter that has seen nothing of its group."""
        return left_out(
            groups, self._config.folds, self._config.training.seed,
            lambda number, rows, out: self._judged(f"{name} {number}", rows, out),
        )  # fmt: skip

    def lots(self, decisions: Sequence[Decision]) -> list[Lot]:
        """What is taught for the points of the learning curve."""
        config = self._config
        fold = folds([d.query for d in decisions], config.folds, config.training.seed)
        return lots(config.curve, decisions, fold, config.training.batch_size, config.training.seed)

    def taught_less(self, lot: Lot) -> Floats:
        """Logits of what a lot asks by an adapter that was taught the lot in as many steps as there are for all."""
        epochs = round(self._config.training.epochs * lot.repeats)
        return self._judged(f"{lot.name}, {epochs} epochs", lot.taught, lot.asked, epochs)

    def _judged(self, name: str, rows: list[int], out: list[int], epochs: int | None = None) -> Floats:
        """Logits of the decisions `out` by an adapter that was taught the decisions `rows`."""
        from erag.study.adapting import predicted

        network = self.trained(name, rows, epochs)
        found: Floats = predicted(network, self._data, out).double().numpy()  # type: ignore[arg-type]
        return found


def _digests(data: Table) -> list[str]:
    tensors = [t.double() for t in vars(data).values()]
    return [f"{tuple(t.shape)} {t.sum().item()!r} {t.square().sum().item()!r}" for t in tensors]


def _speed(config: AdapterDistil, store: ModelStore, decisions: Sequence[Decision]) -> dict[str, float]:
    """Milliseconds a decision, asked one at a time: the cards known and the query new, and both known."""
    some = timed(decisions)
    adapter = Adapter(AdapterConfig(checkpoint=config.out, embedder=config.embedder), store)
    adapter.select([SelectTask("warm up", d.cards) for d in some], 1)
    fresh = milliseconds(adapter, [SelectTask(f"{d.query} {number}", d.cards) for number, d in enumerate(some)])
    tasks = [SelectTask(d.query, d.cards) for d in some]
    adapter.select(tasks, 1)
    return {"a new query over known cards": fresh, "known texts": milliseconds(adapter, tasks)}
