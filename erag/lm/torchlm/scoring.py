"""Log-probabilities of continuations: prefixes that several share are computed once, logits only where needed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from erag.lm.torchlm.cache import Cache, Pool
from erag.lm.torchlm.decoder import Decoder
from erag.lm.torchlm.plan import Branch, Limits, Tokens, batches, common, tree
from erag.lm.torchlm.prefill import extend

if TYPE_CHECKING:
    import torch


@dataclass(frozen=True, slots=True)
class Due:
    """Tokens of a prompt (not empty), and those whose probability after it is asked (not empty)."""

    prompt: Tokens
    continuation: Tokens

    @property
    def path(self) -> Tokens:
        """What the network reads: all but the last token."""
        return (*self.prompt, *self.continuation[:-1])


@dataclass(frozen=True, slots=True)
class _Place:
    """A branch of the tree, and the row of the level above that it continues (None for the first level)."""

    branch: Branch
    parent: int | None


class Scorer:
    """Scores dues batch by batch; `limits` are those of a batch."""

    def __init__(self, decoder: Decoder, limits: Limits, pool: Pool) -> None:
        self._decoder, self._limits, self._pool = decoder, limits, pool

    def run(self, dues: Sequence[Due]) -> dict[Due, float]:
        """The natural log-probability of each distinct due, summed over its tokens."""
        import torch

        paths = sorted({due.path for due in dues})
        place = {path: i for i, path in enumerate(paths)}
        owners: list[list[Due]] = [[] for _ in paths]
        for due in sorted(set(dues), key=lambda d: (d.path, d.continuation)):
            owners[place[due.path]].append(due)
        found: dict[Due, float] = {}
        with torch.inference_mode():
            shared = common(paths) if len(paths) > 1 else 0
            for part in batches([len(path) - shared for path in paths], self._limits):
                found |= self._batch(paths[part.start : part.stop], owners[part.start : part.stop])
        return found

    def _batch(self, paths: Sequence[Tokens], owners: Sequence[Sequence[Due]]) -> dict[Due, float]:
        wanted = [sorted({i for due in dues for i in _positions(due)}) for dues in owners]
        states, at = self._read(paths, wanted)
        keys = [(due, at[row, i]) for row, dues in enumerate(owners) for due in dues for i in _positions(due)]
        targets = [token for dues in owners for due in dues for token in due.continuation]
        logs = self._decoder.log_probabilities(states, [state for _, state in keys], targets)
        totals: dict[Due, float] = {}
        for (due, _), value in zip(keys, logs.tolist(), strict=True):
            totals[due] = totals.get(due, 0.0) + value
        return totals

    def _read(
        self, paths: Sequence[Tokens], wanted: Sequence[Sequence[int]]
    ) -> tuple[torch.Tensor, dict[tuple[int, int], int]]:
        """Hidden states (n, d) at the wanted positions, and the number of the state of each (path, position)."""
        import torch

        root = tree(paths, range(len(paths)))
        level = [_Place(branch, None) for branch in ([root] if root.tokens else root.children)]
        cache: Cache | None = None
        states: list[torch.Tensor] = []
        at: dict[tuple[int, int], int] = {}
        depth = total = 0
        while level:
            level.sort(key=lambda p: (len(p.branch.tokens), p.branch.members))
            places = [_needed(p.branch, wanted) for p in level]
            cache = self._cache(depth, cache, level)
            states.append(extend(self._decoder, cache, [p.branch.tokens for p in level], places))
            for place, row in zip(level, places, strict=True):
                for i in row:
                    at |= {(member, place.branch.start + i): total for member in place.branch.members}
                    total += 1
            level = [_Place(child, row) for row, place in enumerate(level) for child in place.branch.children]
            depth += 1
        return torch.cat(states), at

    def _cache(self, depth: int, above: Cache | None, level: Sequence[_Place]) -> Cache:
        width = max(len(place.branch.tokens) for place in level)
        cache = self._pool.level(depth).cache(len(level), width + (above.copied if above else 0))
        if above is not None:
            cache.follow(above, [place.parent or 0 for place in level])
        return cache


def _positions(due: Due) -> range:
    """The positions of the path after which a token of the continuation follows."""
    return range(len(due.prompt) - 1, len(due.prompt) + len(due.continuation) - 1)


def _needed(branch: Branch, wanted: Sequence[Sequence[int]]) -> list[int]:
    """The wanted positions that lie in a branch, counted from its start."""
    span = range(branch.start, branch.start + len(branch.tokens))
    return sorted({i - branch.start for member in branch.members for i in wanted[member] if i in span})
