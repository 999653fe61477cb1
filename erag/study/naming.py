"""Training of a student of query understanding: the things a teacher named, and every known thing asked for by name.

This module imports torch and Lightning; it is itself imported only where such a student is trained.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import lightning
import numpy as np
import torch

from erag.core.progress import Progress
from erag.lm.roles import Vectors
from erag.lm.understanding import UnderstandingHeader, taught_chances
from erag.lm.understanding_network import UnderstandingNetwork
from erag.study import loop
from erag.study.textconfig import UnderstandingDistil
from erag.study.understanding import STUDENT, Lessons


class Naming(lightning.LightningModule):
    """The student and its loss: the cross-entropy of its chances with what was named, earlier names counting more."""

    def __init__(
        self, network: UnderstandingNetwork, config: UnderstandingDistil, wishes: torch.Tensor, shared: torch.Tensor,
        truth: torch.Tensor, steps: int,
    ) -> None:  # fmt: skip
        super().__init__()
        self.network = network
        self._config, self._wishes, self._shared, self._truth, self._steps = config, wishes, shared, truth, steps

    def training_step(self, batch: torch.Tensor, index: int) -> torch.Tensor:
        """The loss of the examples numbered by `batch` (b,): the wishes first, then a request a thing."""
        loop.step_seed(self._config.training.seed, self.current_epoch, index)
        logits = self.network.logits(self._wishes[batch], self._shared[batch])  # (b, t, members)
        loss: torch.Tensor = -(logits.log_softmax(dim=1) * self._truth[batch][:, :, None]).sum(dim=1).mean()
        self.log("loss", loss.detach(), on_step=False, on_epoch=True)
        return loss

    def configure_optimizers(self) -> Any:
        """See `loop.plan`."""
        return loop.plan(self, self._config.training, self._steps)


def train(
    header: UnderstandingHeader, config: UnderstandingDistil, lessons: Lessons, rows: Sequence[int], folder: Path,
    progress: Progress,
) -> UnderstandingNetwork:  # fmt: skip
    """The student of the wishes `rows`; goes on from `folder`'s last epoch where there is one."""
    torch.manual_seed(config.training.seed)
    picked = np.array(list(rows))
    network = UnderstandingNetwork(header, len(header.things), len(picked), config.training.dropout)
    things, wishes = torch.from_numpy(lessons.thing_vectors), torch.from_numpy(lessons.wish_vectors[picked])
    with torch.no_grad():
        network.get_buffer("things").copy_(things)
        network.get_buffer("wishes").copy_(wishes)
    network.named = taught_chances(header)
    asked = torch.cat([wishes, things])  # a thing asked for by its name is meant itself
    shared = torch.cat([torch.from_numpy(lessons.shared[picked]), torch.eye(len(things))])
    truth = torch.cat([network.named, torch.eye(len(things))])
    steps = loop.steps_of(len(asked), config.training)
    module = Naming(network, config, asked, shared, truth, steps)
    loop.fit(module, len(asked), config.training, folder, progress)
    return module.network.eval().requires_grad_(False)


def ways(network: UnderstandingNetwork, lessons: Lessons, rows: Sequence[int]) -> dict[str, Vectors]:
    """Chances (n, t) of the things for the wishes `rows`, by the student, by its parts, and by the plain cosine."""
    queries = torch.from_numpy(lessons.wish_vectors[list(rows)])
    shared = torch.from_numpy(lessons.shared[list(rows)])
    with torch.inference_mode():
        return {
            "nearest things": (queries @ network.get_buffer("things").T).numpy(),
            "similar wishes alone": network.recalled(queries).numpy(),
            "adapter alone": network.logits(queries, shared).mean(dim=2).softmax(dim=1).numpy(),
            STUDENT: network.chances(queries, shared).numpy(),
        }
