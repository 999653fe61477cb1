"""Answers for many prompts side by side: finished ones leave, waiting ones take their place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from erag.lm.llamacpp.native import Logits, NativeContext, Row
from erag.lm.llamacpp.openings import WORTH_KEEPING, Openings
from erag.lm.llamacpp.plan import LEAST, pieces, shared

WORTH_COPYING = 32  # tokens: below, computing them is as fast as copying a sequence


class Chooser(Protocol):
    """Picks the next token."""

    def choose(self, logits: Logits) -> int: ...


@dataclass(frozen=True, slots=True)
class Request:
    """Tokens of a prompt (not empty), how many may follow, and the grammar (GBNF) they have to obey or None.

    The first `opening` tokens are those of every prompt of its kind, and worth keeping for later calls.
    """

    prompt: tuple[int, ...]
    max_tokens: int
    grammar: str | None = None
    opening: int = 0


@dataclass(frozen=True, slots=True)
class Completion:
    """The tokens of an answer without the one that ended it. `truncated`: the cap ended it."""

    tokens: tuple[int, ...]
    truncated: bool


@dataclass(slots=True)
class _Slot:
    """A sequence at work: what its memory holds, and the token that was chosen but not yet computed."""

    request: Request
    chooser: Chooser
    seen: list[int]
    answer: list[int] = field(default_factory=list)


class Generator:
    """The loop over one clean context. `ends` are the tokens before which an answer stops."""

    def __init__(
        self,
        context: NativeContext,
        ends: frozenset[int],
        chooser: Callable[[Request], Chooser],
        openings: Openings | None = None,
    ) -> None:
        self._context, self._ends, self._chooser = context, ends, chooser
        self._openings = openings or Openings()
        self._slots: list[_Slot] = []
        self._done: dict[Request, Completion] = {}

    def run(self, requests: Sequence[Request]) -> list[Completion]:
        """One completion a request, same order. Equal requests are answered once; order makes no difference."""
        self._context.clear()
        waiting = sorted(set(requests), key=lambda r: (r.prompt, r.max_tokens, r.grammar or ""), reverse=True)
        for request in [r for r in waiting if r.max_tokens < 1]:
            self._done[request] = Completion((), truncated=True)
            waiting.remove(request)
        while waiting or self._slots:
            while waiting and len(self._slots) < self._context.room.sequences:
                self._start(len(self._slots), waiting.pop())
            self._sweep(waiting)
            self._step()
        return [self._done[request] for request in requests]

    def _start(self, place: int, request: Request) -> None:
        """Read a prompt into a sequence, beginning with what a sequence there is has in common with it."""
        slot = _Slot(request, self._chooser(request), [])
        slot.seen = list(request.prompt[: self._begin(place, request)])
        if place == len(self._slots):
            self._slots.append(slot)
        else:
            self._slots[place] = slot
        first, last = len(slot.seen), len(request.prompt) - 1
        rows = [Row(request.prompt[p], p, place, p == last) for p in range(first, last + 1)]
        for piece in pieces(rows, self._context.room.batch, LEAST + 1):
            logits = self._context.decode(piece)
        slot.seen = list(request.prompt)
        slot.answer.append(slot.chooser.choose(logits[0]))

    def _begin(self, place: int, request: Request) -> int:
        """Bring what is known of a prompt into a sequence: another's beginning, else the opening; its length."""
        known = self._reuse(place, request.prompt)
        opening = min(request.opening, len(request.prompt) - LEAST)
        if opening < WORTH_KEEPING or known >= opening:
            return known
        self._context.keep(place, 0)
        self._openings.load(self._context, place, request.prompt[:opening])
        return opening

    def _reuse(self, place: int, prompt: tuple[int, ...]) -> int:
        """Bring the longest known beginning of `prompt`, never its last two tokens, into a sequence; its length."""
        common = [max(0, min(shared(slot.seen, prompt), len(prompt) - LEAST)) for slot in self._slots]
        own = common[place] if place < len(common) else 0
        best = max(common, default=0)
        if best >= own + WORTH_COPYING:
            self._context.copy(common.index(best), place, best)
            return best
        self._context.keep(place, own)
        return own

    def _step(self) -> None:
        """Compute the token that was chosen last in every sequence, and choose the next."""
        if not self._slots:
            return
        rows = [Row(slot.answer[-1], len(slot.seen), i, True) for i, slot in enumerate(self._slots)]
        for slot, logits in zip(self._slots, self._context.decode(rows), strict=True):
            slot.seen.append(slot.answer[-1])
            slot.answer.append(slot.chooser.choose(logits))

    def _sweep(self, waiting: list[Request]) -> None:
        """Take out finished answers; a waiting prompt takes their place, else the last sequence does."""
        place = 0
        while place < len(self._slots):
            slot = self._slots[place]
            if not self._finished(slot):
                place += 1
                continue
            tokens = tuple(slot.answer)
            ended = tokens[-1] in self._ends
            self._done[slot.request] = Completion(tokens[:-1] if ended else tokens, truncated=not ended)
            if waiting:
                self._start(place, waiting.pop())
            else:
                self._remove(place)

    def _remove(self, place: int) -> None:
        """Close the gap: sequences that are not neighbours would be computed one after the other."""
        last = self._slots.pop()
        if place < len(self._slots):
            self._context.copy(len(self._slots), place, len(last.seen))
            self._slots[place] = last
        self._context.keep(len(self._slots), 0)

    def _finished(self, slot: _Slot) -> bool:
        return slot.answer[-1] in self._ends or len(slot.answer) >= slot.request.max_tokens
