"""A judge that reads object lists: is something that satisfies the question in view, and how large?"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from erag.evaluate.judges.protocol import Floats
from erag.evaluate.truth import VISIBLE, Asked, Pair, SeenObject
from erag.forest.terms import fold

_WORD = re.compile(r"[^\W_]+")
Name = tuple[str, ...]  # folded words: `Fire Hydrants` and `fire hydrant` are one


def folded(text: str) -> Name:
    """The words of a class or a text, singular and in lower case."""
    return tuple(fold(word) for word in _WORD.findall(text.lower()))


@dataclass(frozen=True)
class LabelJudge:
    """P = min(1, area of the largest object that satisfies the question / `visible`).

    What satisfies it: the question's `targets`; where nobody stated them, those of the environment's `classes` that its
    text names (`a fire hydrant`). It abstains where there are neither, or where nobody listed the node's objects.
    """

    classes: frozenset[str] = frozenset()
    visible: float = VISIBLE
    name: str = "labels"
    models: frozenset[str] = field(default=frozenset(), init=False)

    @classmethod
    def over(cls, objects: Iterable[SeenObject]) -> LabelJudge:
        """A judge that knows the classes of `objects`, all those listed in an environment."""
        return cls(frozenset(o.name for o in objects))

    def probabilities(self, pairs: Sequence[Pair]) -> Floats:
        """See `Judge`."""
        wanted = {asked: self._wanted(asked) for asked in {p.asked for p in pairs}}
        return np.array([self._vote(wanted[p.asked], p.truth.objects) for p in pairs], np.float64)

    def _vote(self, wanted: frozenset[Name], objects: tuple[SeenObject, ...] | None) -> float:
        if objects is None or not wanted:
            return float("nan")
        largest = max((o.area for o in objects if folded(o.name) in wanted), default=0.0)
        return min(1.0, largest / self.visible)

    def _wanted(self, asked: Asked) -> frozenset[Name]:
        if asked.targets is not None:
            return frozenset(folded(t) for t in asked.targets)
        spoken = folded(asked.text)
        named = {name for name in self._names if _within(name, spoken)}
        inside = {a for a in named for b in named if len(a) < len(b) and _within(a, b)}  # `rack` of `bicycle rack`
        return frozenset(named - inside)

    @cached_property
    def _names(self) -> frozenset[Name]:
        return frozenset(name for name in map(folded, self.classes) if name)


def _within(name: Name, spoken: Name) -> bool:
    return any(spoken[i : i + len(name)] == name for i in range(len(spoken) - len(name) + 1))
