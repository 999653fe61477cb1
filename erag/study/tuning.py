"""Training of a low-rank adapter on lessons: the loss is of the answers' tokens alone.

This module imports torch and Lightning; it is itself imported only where an adapter is trained.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import lightning
import torch
import torch.nn.functional as nnf

from erag.core.progress import Progress
from erag.study import loop
from erag.study.lessons import Drill
from erag.study.loraconfig import LoraTraining
from erag.study.lowrank import LowRank

_NOTHING = -100  # the goal of a token after which nothing is learnt


class Tuning(lightning.LightningModule):
    """A network with low-rank terms, and its loss on a drill."""

    def __init__(self, network: LowRank, drill: Drill, config: LoraTraining, steps: int) -> None:
        super().__init__()
        self.network = network
        self._drill, self._config, self._steps = drill, config, steps
        self._prefix = torch.tensor(drill.prefix, dtype=torch.long)

    def training_step(self, batch: torch.Tensor, index: int) -> torch.Tensor:
        """The mean loss, in nats a token of an answer, of the lessons numbered by `batch` (b,)."""
        loop.step_seed(self._config.seed, self.current_epoch, index)
        rows, goals = padded(self._drill, batch.tolist())
        taught = goals != _NOTHING
        logits = self.network.logits(self.network(self._prefix, rows)[taught]).float()
        loss = nnf.cross_entropy(logits, goals[taught])
        self.log("nats", loss.detach(), on_step=False, on_epoch=True)
        return loss

    def configure_optimizers(self) -> Any:
        """See `loop.plan`."""
        return loop.plan(self, self._config, self._steps)


def padded(drill: Drill, some: list[int]) -> tuple[torch.Tensor, torch.Tensor]:
    """What is read after the prefix, and what should follow each token of it: both (b, s), padded on the right."""
    rows = [(*drill.asked[i], *drill.answers[i][:-1]) for i in some]
    width = max(map(len, rows))
    tokens = torch.zeros(len(rows), width, dtype=torch.long)
    goals = torch.full((len(rows), width), _NOTHING)
    for place, (i, row) in enumerate(zip(some, rows, strict=True)):
        tokens[place, : len(row)] = torch.tensor(row)
        goals[place, len(drill.asked[i]) - 1 : len(row)] = torch.tensor(drill.answers[i])
    return tokens, goals


def train(
    network: LowRank, drill: Drill, config: LoraTraining, folder: Path, progress: Progress
) -> dict[str, torch.Tensor]:
    """The factors trained on a drill; goes on from `folder`'s last epoch where there is one.

    Raises InputError where there are fewer lessons than a batch.
    """
    module = Tuning(network, drill, config, loop.steps_of(len(drill), config))
    loop.fit(module, len(drill), config, folder, progress)
    return {name: factor.detach() for name, factor in network.factors.items()}
