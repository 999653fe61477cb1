"""Training of an adapter: independent members at once, each with its own weights and its own dropped components.

This module imports torch and Lightning; it is itself imported only where an adapter is trained.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import lightning
import numpy as np
import torch
import torch.nn.functional as nnf

from erag.core.progress import Progress
from erag.lm.adapter_header import AdapterHeader
from erag.lm.adapter_network import AdapterNetwork
from erag.study import loop
from erag.study.pairs import Table
from erag.study.textconfig import AdapterDistil

_NOWHERE = -1e4  # the logit of a card that is not there


class Adaptation(lightning.LightningModule):
    """An adapter and its loss on the decisions of a table."""

    def __init__(self, header: AdapterHeader, config: AdapterDistil, table: Table, steps: int) -> None:
        super().__init__()
        torch.manual_seed(config.training.seed)
        self.network = AdapterNetwork(header, config.training.dropout)
        self._config, self._table, self._steps = config, table, steps

    def training_step(self, batch: torch.Tensor, index: int) -> torch.Tensor:
        """The loss of the decisions numbered by `batch` (b,)."""
        loop.step_seed(self._config.training.seed, self.current_epoch, index)
        rows = self._table.rows(batch)
        strange = torch.rand(len(rows)) < self._config.strange
        logits = grid_logits(self.network, rows, strange)  # (b, m, members)
        there = rows.shown >= 0
        chances = logits.log_softmax(dim=1).masked_fill(~rows.right[:, :, None], -torch.inf)
        choice = -chances.logsumexp(dim=1).mean()
        pairs = _binary(logits[there], rows.right[there].float())
        relevance = pairs + _binary(self._strangers(rows), torch.zeros(()))
        self.log_dict({"choice": choice.detach(), "relevance": relevance.detach()}, on_step=False, on_epoch=True)
        total: torch.Tensor = (1 - self._config.relevance) * choice + self._config.relevance * relevance
        return total

    def configure_optimizers(self) -> Any:
        """See `loop.plan`."""
        return loop.plan(self, self._config.training, self._steps)

    def _strangers(self, rows: Table) -> torch.Tensor:
        """(b × negatives, members) logits of each query with cards drawn from all."""
        count, total = self._config.negatives, len(self._table.whole)
        drawn = torch.randint(total, (len(rows), count))
        own = (drawn[:, :, None] == rows.shown[:, None, :]).any(dim=2)  # a card of the decision is no stranger
        owner, place = (~own).nonzero(as_tuple=True)
        picked = drawn[owner, place]
        query, whole, heads = rows.queries[rows.asked], rows.whole[picked], rows.heads[picked]
        seen = torch.zeros(len(picked), rows.features.shape[2])
        seen[:, 0], seen[:, 1] = (query[owner] * whole).sum(1), (query[owner] * heads).sum(1)
        seen[:, 2] = torch.maximum(seen[:, 0], seen[:, 1])  # their parts are not at hand: the nearer of both
        some, again = torch.unique(picked, return_inverse=True)
        forms = self.network.cards(rows.whole[some], rows.heads[some])
        return self.network.logits(self.network.queries(query)[owner], forms.rows(again), seen)


def _binary(logits: torch.Tensor, right: torch.Tensor) -> torch.Tensor:
    """The binary cross-entropy of pairs (p, members) whose truth is `right` (p,), or the same for all."""
    truth = right.reshape(-1, 1).expand_as(logits) if right.ndim else right.expand_as(logits)
    return nnf.binary_cross_entropy_with_logits(logits, truth)


def grid_logits(network: AdapterNetwork, rows: Table, strange: torch.Tensor | None = None) -> torch.Tensor:
    """(n, m, members) logits of the cards of n decisions; very low where there is no card.

    The cards of the decisions `strange` (n,) bool are taken as if they had never been seen.
    """
    there = rows.shown >= 0
    some, place = torch.unique(rows.shown[there], return_inverse=True)
    decision = there.nonzero(as_tuple=True)[0]
    forms = network.cards(rows.whole[some], rows.heads[some]).rows(place).together(decision)
    asked, owner = torch.unique(rows.asked, return_inverse=True)
    query = network.queries(rows.queries[asked])
    if strange is not None:
        forms = replace(forms, trust=forms.trust * (~strange[decision]))
    found = network.logits(query[owner[decision]], forms, rows.features[there])
    grid = torch.full((*rows.shown.shape, found.shape[1]), _NOWHERE)
    grid[there] = found
    return grid


def train(
    header: AdapterHeader, config: AdapterDistil, table: Table, some: Sequence[int], folder: Path, progress: Progress
) -> AdapterNetwork:
    """The adapter trained on the decisions `some`; goes on from `folder`'s last epoch where there is one."""
    rows = table.rows(torch.tensor(list(some)))
    seen = torch.from_numpy(np.unique(rows.shown[rows.shown >= 0].numpy()))
    header = header.model_copy(update={"known": len(seen)})
    module = Adaptation(header, config, rows, loop.steps_of(len(rows), config.training))
    module.network.get_buffer("known").copy_(table.whole[seen])
    loop.fit(module, len(rows), config.training, folder, progress)
    return module.network.eval().requires_grad_(False)


def predicted(network: AdapterNetwork, table: Table, some: Sequence[int]) -> torch.Tensor:
    """(n, m) mean logits of the decisions `some`; very low where there is no card."""
    with torch.inference_mode():
        return grid_logits(network, table.rows(torch.tensor(list(some)))).mean(dim=2)
