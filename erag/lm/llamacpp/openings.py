"""What chats begin with, read once: the memory of an opening is kept and put back, bit for bit, in later calls."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field

from erag.lm.llamacpp.native import NativeContext, Row
from erag.lm.llamacpp.plan import LEAST, pieces

WORTH_KEEPING = 32  # tokens: below, reading them again costs less than it saves
_KEPT = 8  # openings: each a few MB


@dataclass
class Openings:
    """Memories of openings, the latest used, by their tokens and the number of sequences of the context.

    llama.cpp puts a memory back only into a context of as many sequences as the one it comes from. An opening is always
    read on its own, so that what follows has the same bits whether it was read or put back.
    """

    _states: OrderedDict[tuple[int, tuple[int, ...]], bytes] = field(default_factory=OrderedDict)

    def load(self, context: NativeContext, sequence: int, opening: tuple[int, ...]) -> None:
        """Make an empty sequence know `opening`, from memory or by reading it."""
        key = (context.room.sequences, opening)
        if key in self._states:
            self._states.move_to_end(key)
            context.restore(sequence, self._states[key])
            return
        rows = [Row(token, position, sequence) for position, token in enumerate(opening)]
        for piece in pieces(rows, context.room.batch, LEAST + 1):
            context.decode(piece)
        self._states[key] = context.save(sequence)
        while len(self._states) > _KEPT:
            self._states.popitem(last=False)
