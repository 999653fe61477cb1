"""From a teacher's decisions to a cross-encoder: judged as an adapter is and beside one, checkpoint, card."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from erag.core.progress import Progress, quiet
from erag.core.text import content_hash
from erag.core.types import IntArray
from erag.lm.adapter import AnyEmbedder, embedder_of
from erag.lm.checkpoints import save
from erag.lm.cross import CHARS, HEADER, CrossEncoder, CrossEncoderConfig
from erag.lm.cross_header import CrossHeader
from erag.lm.cross_tokens import PairTokens
from erag.lm.offline import go_offline
from erag.lm.probe import choose_dtype
from erag.lm.roles import SelectTask
from erag.lm.weights import ModelStore
from erag.study.calibration import platt
from erag.study.decisions import Decision
from erag.study.pairs import Table, folds, table
from erag.study.selector import Run as AdapterRun
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
from erag.study.textcard import cross_card
from erag.study.textconfig import AdapterDistil, AdapterShape, CrossDistil
from erag.study.vectors import KeptVectors

if TYPE_CHECKING:
    import torch

    from erag.lm.cross_network import CrossNetwork

STUDENT, BESIDE, BOTH = "this cross-encoder", "an adapter", "both together"
_LOGITS = "logits.npy"


def distil(config: CrossDistil, store: ModelStore, progress: Progress = quiet) -> Report:
    """Train and judge a cross-encoder as configured, and write it with its card. Resumable, epoch by epoch.

    Raises InputError for decisions that cannot be read or are fewer than a batch, ModelError for a base that is no
    plain BERT or is too small.
    """
    go_offline()
    clock = [time.perf_counter()]
    decisions = decisions_of(config)
    embedder = embedder_of(config.embedder, store)
    data = table(decisions, KeptVectors(embedder, config.work / "vectors"))
    clock.append(time.perf_counter())
    splits = splits_of(decisions)
    beside: dict[str, Floats] = {}
    if config.beside is not None:
        adapter = _adapter(config, config.beside, embedder, data, progress)
        beside = {name: adapter.left_out(name, groups) for name, groups in splits.items()}
    clock.append(time.perf_counter())
    run = _Run(config, decisions, data, store, progress)
    own = {name: run.left_out(name, groups) for name, groups in splits.items()}
    clock.append(time.perf_counter())
    slope, offset = platt(*pairs_of(own[QUESTIONS], data))
    students = {name: {STUDENT: own[name]} for name in splits}
    if beside:
        for name, groups in splits.items():
            fold = folds(groups, config.folds, config.training.seed)
            both = np.mean([_odds(logits, data, fold) for logits in (beside[name], own[name])], axis=0)
            students[name] = {BESIDE: beside[name], BOTH: both, STUDENT: own[name]}
    _, state = run.trained("all", range(len(data)))
    save(config.out, HEADER, run.header.model_copy(update={"slope": slope, "offset": offset}), state)
    clock.append(time.perf_counter())
    figures = stand(config, students, decisions, data, store)
    speed = _speed(config, store, decisions)
    clock.append(time.perf_counter())
    stages = dict(zip(("embed", "adapter", "folds", "train", "judge"), np.diff(clock).tolist(), strict=True))
    return written(
        config, decisions, data, students[QUESTIONS], figures, speed, stages, lambda report: cross_card(config, report)
    )


def _adapter(
    config: CrossDistil, shape: AdapterShape, embedder: AnyEmbedder, data: Table, progress: Progress
) -> AdapterRun:
    """An adapter on the same decisions; by the same seed the same ones are left out together."""

    def told(stage: str, done: int, total: int) -> None:
        progress(f"adapter, {stage}", done, total)

    alike = AdapterDistil(
        kind="selector", decisions=config.decisions, taught_by=config.taught_by, embedder=config.embedder,
        folds=config.folds, work=config.work / "adapter",
        **{**dict(shape), "training": shape.training.model_copy(update={"seed": config.training.seed})},
    )  # fmt: skip
    return AdapterRun(alike, embedder, data, told)


class _Run:
    """Trainings under folders named by everything the weights depend on, so that no run resumes another one."""

    def __init__(
        self, config: CrossDistil, decisions: Sequence[Decision], data: Table, store: ModelStore, progress: Progress
    ) -> None:
        from erag.study.crossing import Texts

        self.header = CrossHeader(
            base=config.base, weights=store.fingerprint(config.base), layers=config.layers, pooling=config.pooling,
            max_tokens=config.max_tokens, taught_by=config.taught_by,
        )  # fmt: skip
        self._config, self._data, self._progress = config, data, progress
        self._base, self._dtype = store.path(config.base), choose_dtype(config.training.dtype)
        tokens = PairTokens(self._base, config.max_tokens)
        queries = dict.fromkeys(d.query for d in decisions)  # in the order in which `table` numbers them
        cards = dict.fromkeys(card for d in decisions for card in d.cards)
        read = [tokens.encode([text[:CHARS] for text in texts]) for texts in (queries, cards)]
        self._texts, self._frame = Texts(*map(tuple, read)), tokens.frame
        said = config.model_dump_json(include={"relevance", "folds", "call"})
        trained = config.training.model_dump_json(exclude={"wandb", "threads", "dtype"})
        grids = json.dumps([t.tolist() for t in (data.asked, data.shown, data.right)])
        key = content_hash(self.header.model_dump_json(), said, trained, self._dtype, str(self._texts), grids)
        self._folder = config.work / f"run-{key.hex()[:12]}"

    def trained(self, name: str, rows: Sequence[int]) -> tuple[CrossNetwork, dict[str, torch.Tensor]]:
        """The network that was taught the decisions `rows`, and what it was taught."""
        import torch

        from erag.lm.cross_network import build
        from erag.study.crossing import train

        def told(stage: str, done: int, total: int) -> None:
            self._progress(f"{name}: {stage}", done, total)

        torch.manual_seed(self._config.training.seed)
        network = build(self._base, self.header, self._frame, self._dtype, self._config.training.dropout)
        state = train(
            network, self._config, self._data, self._texts, rows, self._folder / _plain(name), self._dtype, told
        )
        return network, state

    def left_out(self, name: str, groups: Sequence[str]) -> Floats:
        """(n, m) logits of every decision by a cross-encoder that has seen nothing of its group."""
        return left_out(
            groups, self._config.folds, self._config.training.seed,
            lambda number, rows, out: self._judged(f"{name} {number}", rows, out),
        )  # fmt: skip

    def _judged(self, name: str, rows: list[int], out: list[int]) -> Floats:
        """Logits of the decisions `out`; they are kept, and what was trained for them is not."""
        from erag.study.crossing import predicted
        from erag.study.loop import LAST

        folder = self._folder / _plain(name)
        if not (folder / _LOGITS).is_file():
            network, _ = self.trained(name, rows)
            found = predicted(network, self._data, self._texts, out, self._config.call, self._dtype)
            fresh = folder / f".{os.getpid()}.npy"
            np.save(fresh, found.double().numpy(), allow_pickle=False)
            fresh.replace(folder / _LOGITS)
        (folder / LAST).unlink(missing_ok=True)
        known: Floats = np.load(folder / _LOGITS, allow_pickle=False)
        return known


def _odds(logits: Floats, data: Table, fold: IntArray) -> Floats:
    """(n, m) log-odds, as a committee's members say them; slope and offset are those of the other folds (n,)."""
    import torch

    odds = np.empty_like(logits)
    for number in np.unique(fold):
        others = np.flatnonzero(fold != number)
        slope, offset = platt(*pairs_of(logits[others], data.rows(torch.from_numpy(others))))
        odds[fold == number] = slope * logits[fold == number] + offset
    return odds


def _plain(name: str) -> Path:
    return Path(name.replace(" ", "-"))


def _speed(config: CrossDistil, store: ModelStore, decisions: Sequence[Decision]) -> dict[str, float]:
    """Milliseconds a decision, asked one at a time; nothing of it is known from before."""
    student = CrossEncoder(CrossEncoderConfig(checkpoint=config.out), store)
    tasks = [SelectTask(d.query, d.cards) for d in timed(decisions)]
    student.select(tasks[:1], 1)
    return {"query and cards read anew": milliseconds(student, tasks)}
