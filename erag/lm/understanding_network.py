"""The network of the `understanding` backend: a query's vector to the things that would satisfy it.

This module imports torch; it is itself imported only where such a student is trained or loaded.
"""

from __future__ import annotations

import torch
from torch import nn

from erag.lm.adapter_header import AdapterHeader
from erag.lm.adapter_network import AdapterNetwork

NEAR = 8  # taught wishes that have a say, the most similar ones
_SHARPNESS = 20.0  # of their say: a wish whose cosine is 0.05 lower counts e times less


class UnderstandingNetwork(nn.Module):
    """Chances over t known things, half from an adapter, half from what the teacher named for similar wishes.

    `things` (t, d) and `wishes` (w, d) are frozen vectors; `named` (w, t) is what the teacher named, rows of sum 1.
    """

    def __init__(self, header: AdapterHeader, things: int, wishes: int, dropout: float = 0.0) -> None:
        super().__init__()
        self.adapter = AdapterNetwork(header, dropout)
        self.register_buffer("things", torch.zeros(things, header.dim))
        self.register_buffer("wishes", torch.zeros(wishes, header.dim))
        self.named: torch.Tensor = torch.zeros(wishes, things)

    def logits(self, queries: torch.Tensor, shared: torch.Tensor) -> torch.Tensor:
        """(b, t, members) of the adapter, for query vectors (b, d) and shares of their words (b, t) in each thing."""
        things: torch.Tensor = self.get_buffer("things")
        count, total = len(queries), len(things)
        forms = self.adapter.cards(things, things)
        near = queries @ things.T
        features = torch.stack([near, near, near, shared], dim=2).view(count * total, -1)
        owner = torch.arange(count).repeat_interleave(total)
        place = torch.arange(total).repeat(count)
        asked = self.adapter.queries(queries)
        return self.adapter.logits(asked[owner], forms.rows(place), features).view(count, total, -1)

    def recalled(self, queries: torch.Tensor) -> torch.Tensor:
        """(b, t) chances by the wishes most similar to each query."""
        near = queries @ self.get_buffer("wishes").T
        best, rows = near.topk(min(NEAR, near.shape[1]), dim=1)
        weight = (best * _SHARPNESS).softmax(dim=1)
        return (weight[:, :, None] * self.named[rows]).sum(dim=1)

    def chances(self, queries: torch.Tensor, shared: torch.Tensor) -> torch.Tensor:
        """(b, t) the mean of both."""
        own = self.logits(queries, shared).mean(dim=2).softmax(dim=1)
        return (own + self.recalled(queries)) / 2
