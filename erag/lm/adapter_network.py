"""The network of the `adapter` backend: a query and its cards, as vectors of a frozen embedder, to one number a card.

This module imports torch; it is itself imported only where an adapter is trained or loaded.
"""

from __future__ import annotations

from typing import cast

import torch
import torch.nn.functional as nnf
from torch import nn

from erag.lm.adapter_header import FEATURES, AdapterHeader

_COSINE = 10.0  # what a cosine counts at the start: without training the network is the embedder itself


class AdapterNetwork(nn.Module):
    """`members` independent low-rank forms over the same frozen vectors; what counts is the mean of their logits.

    A member's logit of card c for query q: A q · B [c, h] / rank + b · [c, h] + w · x, where h is the vector of the
    card's head and x are `FEATURES`: cosines and words in common. The forms start near zero, x's cosine at 10.
    """

    def __init__(self, header: AdapterHeader, dropout: float = 0.0) -> None:
        super().__init__()
        self._members, self._rank, self._dropout = header.members, header.rank, dropout
        wide = header.members * header.rank
        self._scale = header.dim**0.5  # vectors of length 1 to components of about 1
        self.query = nn.Linear(header.dim, wide)
        self.card = nn.Linear(2 * header.dim, wide)
        self.bias = nn.Linear(2 * header.dim, header.members)
        self.weights = nn.Parameter(torch.zeros(header.members, len(FEATURES)))
        nn.init.zeros_(self.bias.weight)
        nn.init.zeros_(self.bias.bias)
        with torch.no_grad():
            self.weights[:, 0] = _COSINE

    def queries(self, vectors: torch.Tensor) -> torch.Tensor:
        """(b, members, rank) for query vectors (b, d)."""
        dropped = nnf.dropout(vectors * self._scale, self._dropout, self.training)
        return cast(torch.Tensor, self.query(dropped)).view(-1, self._members, self._rank)

    def cards(self, vectors: torch.Tensor, heads: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """(m, members, rank) and (m, members) for the vectors (m, d) of cards and of their heads."""
        both = torch.cat([vectors, heads], dim=1) * self._scale
        dropped = nnf.dropout(both, self._dropout, self.training)
        return self.card(dropped).view(-1, self._members, self._rank), self.bias(dropped)

    def logits(
        self, asked: torch.Tensor, cards: torch.Tensor, bias: torch.Tensor, features: torch.Tensor
    ) -> torch.Tensor:
        """(p, members) for p pairs: `asked`, `cards` (p, members, rank), `bias` (p, members), `features` (p, f)."""
        near = (asked * cards).sum(dim=2) / self._rank
        return near + bias + features @ self.weights.T
