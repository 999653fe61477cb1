"""Prompts into the cache: ragged rows in chunks of similar length."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from erag.lm.torchlm.cache import Cache
from erag.lm.torchlm.decoder import Decoder
from erag.lm.torchlm.plan import chunks

if TYPE_CHECKING:
    import torch


def extend(
    decoder: Decoder, cache: Cache, rows: Sequence[Sequence[int]], wanted: Sequence[Sequence[int]]
) -> torch.Tensor:
    """Append a row of tokens (at least one) to each row of the cache.

    Returns the hidden states (n, d) of the `wanted` places of each row, one row after the other. Rows of similar length
    should be neighbours: a chunk of them is padded to its longest.
    """
    import torch

    lengths = [len(row) for row in rows]
    width, found = max(lengths), []
    for part, columns in chunks(lengths):
        tokens = torch.tensor([[*row, *[0] * (columns - len(row))] for row in rows[part]])
        hidden = decoder.forward(tokens, cache, part.start)
        cache.clear(part, cache.width + columns, cache.width + width)
        for states, places in zip(hidden, wanted[part], strict=True):
            if places:
                found.append(states[list(places)])
    cache.advance(lengths, width)
    return torch.cat(found) if found else torch.empty(0, decoder.shape.width, dtype=decoder.dtype)
