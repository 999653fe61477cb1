"""Training of a student with Lightning: every random choice follows from seed, epoch and step, so a killed run resumes.

This module imports torch and Lightning; it is itself imported only where a student is trained.
"""

from __future__ import annotations

import copy
from dataclasses import fields
from pathlib import Path
from typing import Any, cast

import lightning
import torch
import torch.nn.functional as nnf

from erag.core.progress import Progress
from erag.lm.features import Maps
from erag.lm.probe import choose_dtype
from erag.lm.student_network import Seen, StudentNetwork
from erag.lm.student_words import StudentWords
from erag.study import loop
from erag.study.config import TrainingConfig
from erag.study.targets import UNKNOWN, Targets

_TEMPERATURE = 0.07
_SAMPLE = 256  # images from which the scale of the features is taken
Losses = dict[str, torch.Tensor]


class Distillation(lightning.LightningModule):
    """The student, its averaged weights, and its losses on a set of examples held in memory."""

    def __init__(self, words: StudentWords, config: TrainingConfig, maps: Maps, truth: Targets, steps: int) -> None:
        super().__init__()
        torch.manual_seed(config.seed)
        self.network = StudentNetwork(words)
        cast(Any, self.network).to(memory_format=torch.channels_last)  # half the time of a step
        some = slice(None, None, max(1, len(maps.fine) // _SAMPLE))
        self.network.normalise(maps.fine[some], maps.coarse[some])
        self.average = copy.deepcopy(self.network).requires_grad_(False)
        self._config, self._maps, self._truth, self._steps = config, maps, truth, steps
        self._half = choose_dtype(config.dtype) == "bfloat16"

    def training_step(self, batch: torch.Tensor, index: int) -> torch.Tensor:
        """The loss of the examples numbered by `batch` (b,)."""
        loop.step_seed(self._config.seed, self.current_epoch, index)
        fine, coarse, truth = self._augmented(batch)
        with torch.autocast("cpu", torch.bfloat16, enabled=self._half):
            seen = self.network(fine, coarse)
        parts = losses(Seen(*(getattr(seen, field.name).float() for field in fields(seen))), truth)
        total = torch.stack(list(parts.values())).sum()
        self.log_dict({name: value.detach() for name, value in parts.items()}, on_step=False, on_epoch=True)
        return total

    def on_train_batch_end(self, outputs: Any, batch: Any, batch_idx: int) -> None:
        del outputs, batch, batch_idx
        follow = min(self._config.average, (1 + self.global_step) / (10 + self.global_step))
        with torch.no_grad():
            for slow, fast in zip(self.average.parameters(), self.network.parameters(), strict=True):
                slow.lerp_(fast, 1 - follow)

    def configure_optimizers(self) -> Any:
        """See `loop.plan`."""
        return loop.plan(self.network, self._config, self._steps)

    def _augmented(self, batch: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, Targets]:
        """Features and targets of a batch, the whole batch mirrored or not, and some channels put out."""
        fine, coarse = self._maps.fine[batch].float(), self._maps.coarse[batch].float()
        truth = self._truth.rows(batch)
        if torch.rand(()) < 0.5:
            fine, coarse, truth = fine.flip(3), coarse.flip(3), _mirrored(truth)
        rate = self._config.channel_dropout
        if rate:
            fine = _put_out(fine, self.network.fine_scale, rate)
            coarse = _put_out(coarse, self.network.coarse_scale, rate)
        return fine, coarse, truth


def _put_out(maps: torch.Tensor, scale: torch.Tensor, rate: float) -> torch.Tensor:
    """Some channels (b, c, ., .) of each example held at their mean."""
    return torch.where(torch.rand(*maps.shape[:2], 1, 1) < rate, scale[0][:, None, None], maps)


def _mirrored(truth: Targets) -> Targets:
    centre = truth.centre.clone()
    centre[:, :, 0] = 1 - centre[:, :, 0]
    parts = {**vars(truth), "centre": centre, "cells": truth.cells.flip(3)}
    return Targets(**parts)


def losses(seen: Seen, truth: Targets) -> Losses:
    """The parts of the loss, weighted: presence, cells, centre, looks, many, far, place, light, text."""
    there = truth.presence == 1
    classes = truth.presence.shape[1]
    parts = {
        "presence": classes * _binary(seen.presence, truth.presence),
        "looks": 2 * _binary(seen.looks, truth.looks),
        "many": 0.3 * _binary(seen.many, truth.many),
        "far": 0.3 * _binary(seen.far, truth.far),
        "centre": 3 * (seen.centre - truth.centre).abs()[there].mean() if there.any() else seen.centre.sum() * 0,
        "place": 0.5 * _choice(seen.places, truth.places),
        "light": 0.2 * _choice(seen.lights, truth.lights),
        "text": _text(seen.vector, truth.vector),
    }
    parts["cells"] = classes * nnf.binary_cross_entropy_with_logits(seen.cells, truth.cells.float() / 255)
    return parts


def _binary(logits: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    known = truth != UNKNOWN
    if not known.any():
        return logits.sum() * 0
    return nnf.binary_cross_entropy_with_logits(logits[known], truth[known].float())


def _choice(logits: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    known = truth != UNKNOWN
    return nnf.cross_entropy(logits[known], truth[known]) if known.any() else logits.sum() * 0


def _text(vector: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """Close to the caption's vector, and closer to it than to the captions of the other images of the batch."""
    near = 1 - (vector * truth).sum(dim=1).mean()
    scores = vector @ truth.T / _TEMPERATURE
    same = (truth @ truth.T).gt(0.999)  # equal captions are no wrong answers
    scores = scores.masked_fill(same & ~torch.eye(len(truth), dtype=torch.bool), -torch.inf)
    return near + 0.2 * nnf.cross_entropy(scores, torch.arange(len(truth)))


def train(
    words: StudentWords, config: TrainingConfig, maps: Maps, truth: Targets, folder: Path, progress: Progress
) -> StudentNetwork:
    """The trained student (averaged weights); goes on from `folder`'s last epoch where there is one.

    Raises InputError where there are fewer examples than a batch.
    """
    steps = loop.steps_of(len(maps.fine), config)
    module = Distillation(words, config, maps, truth, steps)
    loop.fit(module, len(maps.fine), config, folder, progress)
    return module.average.eval()
