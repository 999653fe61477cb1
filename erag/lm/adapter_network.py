"""The network of the `adapter` backend: a query and its cards, as vectors of a frozen embedder, to one number a card.

This module imports torch; it is itself imported only where an adapter is trained or loaded.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import torch
import torch.nn.functional as nnf
from torch import nn

from erag.lm.adapter_header import FEATURES, AdapterHeader

_COSINE = 10.0  # what a cosine counts at the start: without training the network is the embedder itself


@dataclass(frozen=True, slots=True, eq=False)
class Forms:
    """What a network makes of m cards: `form` (m, members, rank), `bias` (m, members), `trust` (m,) in [0, 1]."""

    form: torch.Tensor
    bias: torch.Tensor
    trust: torch.Tensor

    def together(self, owner: torch.Tensor) -> Forms:
        """The cards of choices, `owner` (m,) numbering the choice of each: trusted as far as the least known of them.

        What was learnt of one card against its rivals says little where the rivals are others.
        """
        least = torch.ones(int(owner.max()) + 1 if len(owner) else 0)
        least = least.scatter_reduce(0, owner, self.trust, "amin")
        return Forms(self.form, self.bias, least[owner])

    def rows(self, some: torch.Tensor) -> Forms:
        """The cards numbered by `some`."""
        return Forms(self.form[some], self.bias[some], self.trust[some])


class AdapterNetwork(nn.Module):
    """`members` independent low-rank forms over the same frozen vectors; what counts is the mean of their logits.

    A member's logit of card c for query q: t × (A q · B [c, h] / rank + b · [c, h]) + w · x + a, where h is the vector
    of the card's head, x are `FEATURES` (cosines and words in common), and t says how far the card is like one that
    was seen in training (in a choice the least known of its cards decides): what was learnt of the cards of one place
    is not said of those of another, which are left to w and a. The forms start near zero, x's cosine at 10.
    """

    def __init__(self, header: AdapterHeader, dropout: float = 0.0) -> None:
        super().__init__()
        self._members, self._rank, self._dropout = header.members, header.rank, dropout
        self._trusted_from = header.trusted_from
        wide = header.members * header.rank
        self._scale = header.dim**0.5  # vectors of length 1 to components of about 1
        self.query = nn.Linear(header.dim, wide)
        self.card = nn.Linear(2 * header.dim, wide)
        self.bias = nn.Linear(2 * header.dim, header.members)
        self.weights = nn.Parameter(torch.zeros(header.members, len(FEATURES)))
        self.base = nn.Parameter(torch.zeros(header.members))
        self.register_buffer("known", torch.zeros(header.known, header.dim))
        nn.init.zeros_(self.bias.weight)
        nn.init.zeros_(self.bias.bias)
        with torch.no_grad():
            self.weights[:, 0] = _COSINE

    def queries(self, vectors: torch.Tensor) -> torch.Tensor:
        """(b, members, rank) for query vectors (b, d)."""
        dropped = nnf.dropout(vectors * self._scale, self._dropout, self.training)
        return cast(torch.Tensor, self.query(dropped)).view(-1, self._members, self._rank)

    def cards(self, vectors: torch.Tensor, heads: torch.Tensor) -> Forms:
        """The forms of cards, for the vectors (m, d) of the whole of each and of its head."""
        both = torch.cat([vectors, heads], dim=1) * self._scale
        dropped = nnf.dropout(both, self._dropout, self.training)
        form = self.card(dropped).view(-1, self._members, self._rank)
        return Forms(form, self.bias(dropped), self._trust(vectors))

    def logits(self, asked: torch.Tensor, cards: Forms, features: torch.Tensor) -> torch.Tensor:
        """(p, members) for p pairs: `asked` (p, members, rank), their `cards`, `features` (p, f)."""
        near = (asked * cards.form).sum(dim=2) / self._rank
        return cards.trust[:, None] * (near + cards.bias) + features @ self.weights.T + self.base

    def _trust(self, vectors: torch.Tensor) -> torch.Tensor:
        """(m,) 1 for a card that was trained on, 0 from the cosine `trusted_from` to the nearest of them downwards."""
        known: torch.Tensor = self.get_buffer("known")
        if not len(known):
            return torch.ones(len(vectors))
        nearest = (vectors @ known.T).amax(dim=1)
        # an 8-bit vector is not quite the one it stands for
        return ((nearest + 0.01 - self._trusted_from) / (1 - self._trusted_from)).clamp(0, 1)
