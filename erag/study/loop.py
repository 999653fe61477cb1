"""Training with Lightning in a way that a killed run ends with the same weights; shared by all students.

This module imports torch and Lightning; it is itself imported only where a student is trained.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol

import lightning
import torch
from lightning.pytorch.loggers import CSVLogger, Logger, WandbLogger
from torch.utils.data import DataLoader, Dataset, Sampler

from erag.core.errors import InputError
from erag.core.progress import Progress
from erag.core.tracking import offline_settings

LAST = "last.ckpt"


class LoopConfig(Protocol):
    """What the loop needs to know."""

    @property
    def epochs(self) -> int: ...

    @property
    def batch_size(self) -> int: ...

    @property
    def rate(self) -> float: ...

    @property
    def decay(self) -> float: ...

    @property
    def seed(self) -> int: ...

    @property
    def wandb(self) -> bool: ...

    @property
    def threads(self) -> int | None: ...


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


class Saving(lightning.Callback):
    """Keep the state after every epoch: written beside the last one and then put in its place."""

    def __init__(self, folder: Path, progress: Progress) -> None:
        self._folder, self._progress = folder, progress

    def on_train_epoch_end(self, trainer: lightning.Trainer, pl_module: lightning.LightningModule) -> None:
        del pl_module
        fresh = self._folder / "fresh.ckpt"
        trainer.save_checkpoint(fresh, weights_only=False)
        fresh.replace(self._folder / LAST)
        self._progress("epochs", trainer.current_epoch + 1, trainer.max_epochs or 0)


def step_seed(seed: int, epoch: int, step: int) -> None:
    """Let all random choices of a step follow from seed, epoch and step alone."""
    torch.manual_seed((seed * 7919 + epoch) * 1_000_003 + step)


def plan(module: torch.nn.Module, config: LoopConfig, steps: int) -> Any:
    """AdamW without decay of vectors; the rate warms up over a tenth of the steps and falls along a cosine."""
    moving = [p for p in module.parameters() if p.requires_grad]
    decayed, plain = [p for p in moving if p.ndim > 1], [p for p in moving if p.ndim <= 1]
    groups = [{"params": decayed, "weight_decay": config.decay}, {"params": plain, "weight_decay": 0.0}]
    optimiser = torch.optim.AdamW(groups, lr=config.rate)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, config.rate, total_steps=steps, pct_start=0.1)
    return {"optimizer": optimiser, "lr_scheduler": {"scheduler": schedule, "interval": "step"}}


def steps_of(count: int, config: LoopConfig) -> int:
    """Optimiser steps of a whole training. Raises InputError where there are fewer examples than a batch."""
    if count < config.batch_size:
        raise InputError(f"{count} examples to train on", allowed=f"at least a batch of {config.batch_size}")
    return config.epochs * (count // config.batch_size)


def fit(
    module: lightning.LightningModule, count: int, config: LoopConfig, folder: Path, progress: Progress,
    callbacks: Sequence[lightning.Callback] = (),
) -> None:  # fmt: skip
    """Train `module` on batches of numbers below `count`; goes on from `folder`'s last epoch where there is one."""
    logging.getLogger("lightning.pytorch").setLevel(logging.ERROR)  # it advertises
    torch.set_num_threads(config.threads or torch.get_num_threads())
    folder.mkdir(parents=True, exist_ok=True)
    order = _Order(count, config.seed)
    loader = DataLoader(_Rows(count), batch_size=config.batch_size, sampler=order, drop_last=True)
    trainer = lightning.Trainer(
        accelerator="cpu", max_epochs=config.epochs, deterministic=True, gradient_clip_val=1.0, num_sanity_val_steps=0,
        logger=_loggers(config, folder), callbacks=[*callbacks, Saving(folder, progress)], enable_checkpointing=False,
        enable_progress_bar=False, enable_model_summary=False, default_root_dir=folder, log_every_n_steps=1,
    )  # fmt: skip
    last = folder / LAST
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=".*LeafSpec")  # Lightning's own, of PyTorch's next version
            warnings.filterwarnings("ignore", message="Experiment logs directory")  # of what is gone on with
            trainer.fit(module, loader, ckpt_path=str(last) if last.is_file() else None, weights_only=True)
    finally:
        for run in [made.experiment for made in trainer.loggers if isinstance(made, WandbLogger)]:
            run.finish()  # else the next training would be logged as a part of this one


def _loggers(config: LoopConfig, folder: Path) -> list[Logger]:
    loggers: list[Logger] = [CSVLogger(folder, name="csv", version="")]
    if config.wandb:
        import wandb

        run = wandb.init(project="erag-distil", dir=folder, settings=offline_settings())
        loggers.append(WandbLogger(experiment=run, offline=True))
    return loggers
