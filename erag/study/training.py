"""Training of a student with Lightning: every random choice follows from seed, epoch and step, so a killed run resumes.

This module imports torch and Lightning; it is itself imported only where a student is trained.
"""

from __future__ import annotations

import copy
import logging
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any, cast

import lightning
import torch
import torch.nn.functional as nnf
from torch.utils.data import DataLoader, Dataset, Sampler

from erag.core.errors import InputError
from erag.core.progress import Progress
from erag.lm.features import Maps
from erag.lm.probe import choose_dtype
from erag.lm.student_network import Seen, StudentNetwork
from erag.lm.student_words import StudentWords
from erag.study.config import TrainingConfig
from erag.study.targets import UNKNOWN, Targets

LAST = "last.ckpt"
_TEMPERATURE = 0.07
_SAMPLE = 256  # images from which the scale of the features is taken
Losses = dict[str, torch.Tensor]


class _Rows(Dataset[int]):
    """The numbers of the examples; tensors are taken a batch at a time."""

    def __init__(self, count: int) -> None:
        self._count = count

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, index: int) -> int:
        return index


class _Order(Sampler[int]):
    """An order of the examples that depends on seed and epoch alone; Lightning tells the epoch."""

    def __init__(self, count: int, seed: int) -> None:
        self._count, self._seed, self._epoch = count, seed, 0

    def set_epoch(self, epoch: int) -> None:
        self._epoch = epoch

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[int]:
        generator = torch.Generator().manual_seed(self._seed * 100_003 + self._epoch)
        return iter(torch.randperm(self._count, generator=generator).tolist())


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
        torch.manual_seed((self._config.seed * 7919 + self.current_epoch) * 1_000_003 + index)
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
        """AdamW; the rate warms up over a tenth of the steps and falls along a cosine."""
        decayed = [p for p in self.network.parameters() if p.ndim > 1]
        plain = [p for p in self.network.parameters() if p.ndim <= 1]
        groups = [{"params": decayed, "weight_decay": self._config.decay}, {"params": plain, "weight_decay": 0.0}]
        optimiser = torch.optim.AdamW(groups, lr=self._config.rate)
        plan = torch.optim.lr_scheduler.OneCycleLR(optimiser, self._config.rate, total_steps=self._steps, pct_start=0.1)
        return {"optimizer": optimiser, "lr_scheduler": {"scheduler": plan, "interval": "step"}}

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


class _Saving(lightning.Callback):
    """Keep the state after every epoch: written beside the last one and then put in its place."""

    def __init__(self, folder: Path, progress: Progress) -> None:
        self._folder, self._progress = folder, progress

    def on_train_epoch_end(self, trainer: lightning.Trainer, pl_module: lightning.LightningModule) -> None:
        del pl_module
        fresh = self._folder / "fresh.ckpt"
        trainer.save_checkpoint(fresh, weights_only=False)
        fresh.replace(self._folder / LAST)
        self._progress("epochs", trainer.current_epoch + 1, trainer.max_epochs or 0)


def train(
    words: StudentWords, config: TrainingConfig, maps: Maps, truth: Targets, folder: Path, progress: Progress
) -> StudentNetwork:
    """The trained student (averaged weights); goes on from `folder`'s last epoch where there is one.

    Raises InputError where there are fewer examples than a batch.
    """
    count, size = len(maps.fine), config.batch_size
    if count < size:
        raise InputError(f"{count} images to train on", allowed=f"at least a batch of {size}")
    logging.getLogger("lightning.pytorch").setLevel(logging.ERROR)  # it advertises
    torch.set_num_threads(config.threads or torch.get_num_threads())
    folder.mkdir(parents=True, exist_ok=True)
    module = Distillation(words, config, maps, truth, steps=config.epochs * (count // size))
    loader = DataLoader(_Rows(count), batch_size=size, sampler=_Order(count, config.seed), drop_last=True)
    trainer = lightning.Trainer(
        accelerator="cpu", max_epochs=config.epochs, deterministic=True, gradient_clip_val=1.0, num_sanity_val_steps=0,
        logger=_loggers(config, folder), callbacks=[_Saving(folder, progress)], enable_checkpointing=False,
        enable_progress_bar=False, enable_model_summary=False, default_root_dir=folder, log_every_n_steps=1,
    )  # fmt: skip
    last = folder / LAST
    trainer.fit(module, loader, ckpt_path=str(last) if last.is_file() else None, weights_only=True)
    return module.average.eval()


def _loggers(config: TrainingConfig, folder: Path) -> list[Any]:
    from lightning.pytorch.loggers import CSVLogger, WandbLogger

    loggers: list[Any] = [CSVLogger(folder, name="csv", version="")]
    if config.wandb:
        loggers.append(WandbLogger(project="erag-distil", save_dir=folder, offline=True))
    return loggers
