"""Decisions as tensors: vectors of a frozen embedder, features of pairs, and splits that do not leak."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from erag.core.types import IntArray
from erag.lm.adapter import Embed, cards, features, queries
from erag.lm.adapter_header import FEATURES
from erag.study.decisions import Decision

if TYPE_CHECKING:
    import torch


@dataclass(frozen=True, eq=False)
class Table:
    """n decisions over q queries and c cards.

    `queries` (q, d), `whole` and `heads` (c, d) float32; `asked` (n,) the query of each decision, `shown` (n, m) its
    cards, -1 where it has fewer, `features` (n, m, f), `right` (n, m) bool: the chosen one, and cards of the same
    text, which nobody can tell from it.
    """

    queries: torch.Tensor
    whole: torch.Tensor
    heads: torch.Tensor
    asked: torch.Tensor
    shown: torch.Tensor
    features: torch.Tensor
    right: torch.Tensor

    def __len__(self) -> int:
        return len(self.asked)

    def rows(self, some: torch.Tensor) -> Table:
        """The decisions numbered by `some`, over the same queries and cards."""
        own = (self.asked[some], self.shown[some], self.features[some], self.right[some])
        return Table(self.queries, self.whole, self.heads, *own)


def table(decisions: Sequence[Decision], embed: Embed) -> Table:
    """The decisions as tensors; every distinct text is embedded once."""
    import torch

    asked = queries([d.query for d in decisions], embed)
    shown = cards([card for d in decisions for card in d.cards], embed)
    query_row = {text: row for row, text in enumerate(asked)}
    card_row = {text: row for row, text in enumerate(shown)}
    most = max(len(d.cards) for d in decisions)
    grid = torch.full((len(decisions), most), -1)
    seen, right = torch.zeros(len(decisions), most, len(FEATURES)), torch.zeros_like(grid, dtype=torch.bool)
    for row, d in enumerate(decisions):
        grid[row, : len(d.cards)] = torch.tensor([card_row[card] for card in d.cards])
        right[row, : len(d.cards)] = torch.tensor([card == d.cards[d.chosen] for card in d.cards])
        seen[row, : len(d.cards)] = torch.tensor([features(asked[d.query], shown[card]) for card in d.cards])
    return Table(
        _stacked([t.whole for t in asked.values()]), _stacked([t.whole for t in shown.values()]),
        _stacked([t.head for t in shown.values()]), torch.tensor([query_row[d.query] for d in decisions]), grid, seen,
        right,
    )  # fmt: skip


def _stacked(rows: Sequence[np.ndarray]) -> torch.Tensor:
    import torch

    return torch.from_numpy(np.stack(rows).astype(np.float32))


def folds(groups: Sequence[str], count: int, seed: int) -> IntArray:
    """(n,) the fold of each item: items of one group share a fold, and folds are of about equal size.

    The largest groups are dealt first, each to the fold that has least so far; groups of one size in an order that
    depends on the seed alone. Fewer groups than folds leave folds empty.
    """
    names, sizes = np.unique(np.array(groups), return_counts=True)
    shuffled = np.random.default_rng(seed).permutation(len(names))
    order = shuffled[np.argsort(-sizes[shuffled], kind="stable")]
    filled, fold = np.zeros(count, np.int64), np.empty(len(names), np.int64)
    for group in order:
        fold[group] = int(filled.argmin())
        filled[fold[group]] += sizes[group]
    return fold[np.searchsorted(names, np.array(groups))]
