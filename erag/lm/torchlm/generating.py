"""Many answers side by side: prompts of similar length, a shared beginning computed once, finished rows leave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from erag.lm.torchlm.cache import Buffers, Cache
from erag.lm.torchlm.decoder import Decoder
from erag.lm.torchlm.plan import Limits, Tokens, batches, common
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

    def __init__(self, decoder: Decoder, limits: Limits) -> None:
        self._decoder, self._limits = decoder, limits
        self._root, self._rows = (Buffers(decoder.shape, decoder.dtype) for _ in range(2))

    def run(self, requests: Sequence[Request]) -> None:
        """Let all writers finish. What is computed together is a function of prompts, beginnings and caps."""
        import torch

        open_ = sorted(
            (r for r in requests if not r.writer.finished), key=lambda r: (len(_start(r)), _start(r), r.most)
        )
        with torch.inference_mode():
            for part in batches([len(_start(r)) + r.most for r in open_], self._limits):
                self._batch(open_[part.start : part.stop])

    def _batch(self, requests: Sequence[Request]) -> None:
        writers = [request.writer for request in requests]
        cache, hidden = self._prefill([_start(request) for request in requests], max(r.most for r in requests))
        for writer in writers:
            writer.queue.clear()  # it was read with the prompt
        while self._choose(writers, hidden, cache):
            hidden = self._step(writers, cache)

    def _prefill(self, prompts: Sequence[Tokens], most: int) -> tuple[Cache, torch.Tensor]:
        """The cache that holds the prompts, and the last hidden state (n, d) of each."""
        shared = min(common(prompts), min(map(len, prompts)) - 1)
        rest = [prompt[shared:] for prompt in prompts]
        width = shared + max(map(len, rest))
        cache = self._rows.cache(len(prompts), width, room=width + most + _STEP)
        if shared:
            root = self._root.cache(1, shared)
            extend(self._decoder, root, [prompts[0][:shared]], [[]])
            cache.copy_rows(root, [0] * len(prompts))
        return cache, extend(self._decoder, cache, rest, [[len(row) - 1] for row in rest])

    def _choose(self, writers: list[Writer], hidden: torch.Tensor, cache: Cache) -> bool:
        """Let the writers whose turn it is choose, and take out those that finished. Whether any is left."""
        asking = [i for i, writer in enumerate(writers) if not writer.queue]
        if asking:
            best, logits = self._decoder.best(hidden[asking])
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
        hidden = self._decoder.forward(tokens, cache)[:, 0]
        cache.advance([1] * len(writers), 1)
        return hidden


def _start(request: Request) -> Tokens:
    """What is read before the model first chooses: the prompt, and how the writer begins."""
    return (*request.prompt, *request.writer.queue)
