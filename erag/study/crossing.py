"""Training of a cross-encoder: its upper layers on the decisions of a table, each a softmax over its cards.

This module imports torch and Lightning; it is itself imported only where a cross-encoder is trained.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lightning
import torch
import torch.nn.functional as nnf

from erag.core.progress import Progress
from erag.lm.checkpoints import quantised, restored
from erag.lm.cross_network import CrossNetwork
from erag.lm.cross_tokens import Ids
from erag.lm.probe import Dtype
from erag.study import loop
from erag.study.pairs import Table
from erag.study.textconfig import CrossDistil

_NOWHERE = -1e4  # the logit of a card that is not there


@dataclass(frozen=True, slots=True)
class Texts:
    """The tokens of the queries and cards that a table numbers."""

    queries: tuple[Ids, ...]
    cards: tuple[Ids, ...]


class Crossing(lightning.LightningModule):
    """What is taught of a cross-encoder, and its loss on the decisions of a table.

    The base is not a part of the module: it does not change, so it is not kept with every epoch.
    """

    def __init__(
        self, network: CrossNetwork, config: CrossDistil, table: Table, texts: Texts, steps: int, dtype: Dtype
    ) -> None:
        super().__init__()
        self.upper = network.upper
        self._network, self._config, self._table, self._texts = network, config, table, texts
        self._steps, self._half = steps, dtype == "bfloat16"

    def training_step(self, batch: torch.Tensor, index: int) -> torch.Tensor:
        """The loss of the decisions numbered by `batch` (b,)."""
        loop.step_seed(self._config.training.seed, self.current_epoch, index)
        rows = self._table.rows(batch)
        with torch.autocast("cpu", torch.bfloat16, enabled=self._half):
            logits = grid_logits(self._network, rows, self._texts, self._config.call)  # (b, m)
        there = rows.shown >= 0
        chances = logits.log_softmax(dim=1).masked_fill(~rows.right, -torch.inf)
        choice = -chances.logsumexp(dim=1).mean()
        relevance = nnf.binary_cross_entropy_with_logits(logits[there], rows.right[there].float())
        self.log_dict({"choice": choice.detach(), "relevance": relevance.detach()}, on_step=False, on_epoch=True)
        total: torch.Tensor = (1 - self._config.relevance) * choice + self._config.relevance * relevance
        return total

    def configure_optimizers(self) -> Any:
        """See `loop.plan`."""
        return loop.plan(self, self._config.training, self._steps)


def grid_logits(network: CrossNetwork, rows: Table, texts: Texts, call: int) -> torch.Tensor:
    """(n, m) float32 logits of the cards of n decisions; very low where there is no card."""
    decision, place = (rows.shown >= 0).nonzero(as_tuple=True)
    asked, shown = rows.asked[decision].tolist(), rows.shown[decision, place].tolist()
    pairs = [(texts.queries[query], texts.cards[card]) for query, card in zip(asked, shown, strict=True)]
    grid = torch.full(rows.shown.shape, _NOWHERE)
    grid[decision, place] = network.logits(pairs, call)
    return grid


def train(
    network: CrossNetwork, config: CrossDistil, table: Table, texts: Texts, some: Sequence[int], folder: Path,
    dtype: Dtype, progress: Progress,
) -> dict[str, torch.Tensor]:  # fmt: skip
    """What was taught by the decisions `some`, float32; goes on from `folder`'s last epoch where there is one.

    Raises InputError where there are fewer decisions than a batch.
    """
    rows = table.rows(torch.tensor(list(some)))
    module = Crossing(network, config, rows, texts, loop.steps_of(len(rows), config.training), dtype)
    loop.fit(module, len(rows), config.training, folder, progress)
    return {name: tensor.detach() for name, tensor in network.upper.state_dict().items()}


def predicted(
    network: CrossNetwork, table: Table, texts: Texts, some: Sequence[int], call: int, dtype: Dtype
) -> torch.Tensor:
    """(n, m) logits of the decisions `some` by the weights as a checkpoint keeps them; very low where there is no card.

    The network is set to work and learns no more.
    """
    network.upper.load_state_dict(restored(quantised(network.upper.state_dict())))
    with torch.inference_mode():
        return grid_logits(network.at_work(dtype), table.rows(torch.tensor(list(some))), texts, call)
