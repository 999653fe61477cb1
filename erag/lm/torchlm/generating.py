"""Many answers side by side: prompts of similar length, a shared beginning computed once, finished rows leave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from erag.lm.torchlm.cache import Cache, Pool
from erag.lm.torchlm.decoder import Decoder
from erag.lm.torchlm.plan import MIN_SHARED, Limits, Tokens, batches, common
from erag.lm.torchlm.prefill import extend
from erag.lm.torchlm.writer import Writer

if TYPE_CHECKING:
    import torch

_STEP = 64  # columns by which a cache grows while answers are written


@dataclass(frozen=True)
class Request:
    """A prompt (not empty), the tokens its answer may have, and a writer for it that nobody else uses."""

    prompt: Tokens
    most: int
    writer: Writer


class Generator:
    """Answers requests batch by batch; `limits` are those of a batch."""

    def __init__(self, decoder: Decoder, limits: Limits, pool: Pool) -> None:
        self.decoder, self._limits, self._pool = decoder, limits, pool

    def run(self, requests: Sequence[Request]) -> None:
        """Let all writers finish. What is computed together is a function of prompts, beginnings and caps."""
        import torch

        waiting = [request for request in requests if not request.writer.finished]
        waiting.sort(key=lambda r: (len(_start(r)), _start(r), r.most))
        with torch.inference_mode():
            shared, trunk = self._trunk([_start(request) for request in waiting])
            for part in batches([len(_start(r)) - shared + r.most for r in waiting], self._limits):
                self._batch(waiting[part.start : part.stop], shared, trunk)

    def _trunk(self, prompts: Sequence[Tokens]) -> tuple[int, Cache | None]:
        """What all prompts begin with: its length (0 where it is not worth it), and the cache that holds it."""
        shared = min(common(prompts), min(map(len, prompts)) - 1) if len(prompts) > 1 else 0
        if shared < MIN_SHARED:
            return 0, None
        trunk = self._pool.level(0).cache(1, shared)
        extend(self.decoder, trunk, [prompts[0][:shared]], [[]])
        return shared, trunk

    def _batch(self, requests: Sequence[Request], shared: int, trunk: Cache | None) -> None:
        writers = [request.writer for request in requests]
        rows = [_start(request)[shared:] for request in requests]
        width, most = max(map(len, rows)), max(request.most for request in requests)
        cache = self._pool.level(1).cache(len(rows), width, room=width + most + _STEP)
        if trunk is not None:
            cache.follow(trunk, [0] * len(rows))
        hidden = extend(self.decoder, cache, rows, [[len(row) - 1] for row in rows])
        for writer in writers:
            writer.queue.clear()  # it was read with the prompt
        while self._choose(writers, hidden, cache):
            hidden = self._step(writers, cache)

    def _choose(self, writers: list[Writer], hidden: torch.Tensor, cache: Cache) -> bool:
        """Let the writers whose turn it is choose, and take out those that finished. Whether any is left."""
        asking = [i for i, writer in enumerate(writers) if not writer.queue]
        if asking:
            best, logits = self.decoder.best(hidden[asking])
            for place, row in enumerate(asking):
                writer = writers[row]
                while not writer.queue and not writer.finished:
                    writer.choose(int(best[place]), logits[place])
        for row in reversed(range(len(writers))):
            if writers[row].finished:
                cache.drop(row)
                writers[row] = writers[-1]
                writers.pop()
        return bool(writers)

    def _step(self, writers: Sequence[Writer], cache: Cache) -> torch.Tensor:
        """Feed one token a row: hidden states (n, d)."""
        import torch

        if cache.width == cache.columns:
            cache.resize(cache.columns + _STEP)
        tokens = torch.tensor([[writer.queue.popleft()] for writer in writers])
        hidden = self.decoder.forward(tokens, cache)[:, 0]
        cache.advance([1] * len(writers), 1)
        return hidden


def _start(request: Request) -> Tokens:
    """What is read before the model first chooses: the prompt, and how the writer begins."""
    return (*request.prompt, *request.writer.queue)
