"""What a trial is: the same items for every backend, outputs as JSON, and a judgement of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np

from erag.core.errors import BadModelOutput, InputError
from erag.evaluate.statistics import Interval, bootstrap
from erag.lm.ledger import Ledger
from erag.lm.roles import Embedder, LMBackend, RoleName

In = TypeVar("In")
Out = TypeVar("Out")
Outputs = Sequence[Any]  # one JSON value an item, None where the model gave nothing that its role allows


@dataclass(frozen=True, slots=True)
class Figure:
    """A measured value with its 95 % interval over items."""

    name: str
    value: float
    low: float
    high: float

    @classmethod
    def of(cls, name: str, values: Sequence[float]) -> Figure:
        """The mean of one value an item."""
        return cls.within(name, bootstrap(list(values)))

    @classmethod
    def within(cls, name: str, interval: Interval) -> Figure:
        return cls(name, interval.mean, interval.low, interval.high)

    @property
    def short(self) -> str:
        """The value and its interval, for a table."""
        return f"{self.value:.2f} [{self.low:.2f}, {self.high:.2f}]"


@dataclass(frozen=True, slots=True)
class Judgement:
    """The figure a trial is about, what is lost against the cloud (or else the labels), and further figures."""

    figure: Figure
    loss: Figure
    more: tuple[Figure, ...] = ()


class Trial(Protocol):
    """A trial over its items. It is made in the process that judges, and again in each that is measured."""

    measure: str  # what `Judgement.figure` is
    against: str  # what the loss is against: the cloud model, or "labels"

    @property
    def role(self) -> RoleName: ...

    @property
    def items(self) -> Sequence[Any]:
        """The items as JSON values; they and the configuration determine what is asked."""
        ...

    def ask(self, backend: LMBackend, items: Sequence[Any], ledger: Ledger) -> list[Any]:
        """One output an item, same order."""
        ...

    def cloud(self) -> Outputs | None:
        """What the cloud model said of the items; None where no record exists."""
        ...

    def controls(self) -> Mapping[str, Outputs]:
        """Outputs that need no model, by name: what any model has to beat."""
        ...

    def judge(self, outputs: Outputs, embedder: Embedder) -> Judgement: ...


def drawn(items: Sequence[In], count: int, seed: int, where: str) -> list[In]:
    """`count` of the items, or all, in their order. Raises InputError for none."""
    if not items:
        raise InputError("holds nothing that can be asked", where=where)
    if len(items) <= count:
        return list(items)
    chosen = np.random.default_rng(seed).choice(len(items), count, replace=False)
    return [items[int(i)] for i in np.sort(chosen)]


def each(call: Callable[[Sequence[In]], Sequence[Out]], items: Sequence[In], size: int) -> list[Out | None]:
    """A result an item, in batches of `size`; a batch the model fails at is asked again in halves, None is left."""
    found: list[Out | None] = []
    for start in range(0, len(items), size):
        found += _tried(call, items[start : start + size])
    return found


def _tried(call: Callable[[Sequence[In]], Sequence[Out]], items: Sequence[In]) -> list[Out | None]:
    try:
        return list(call(items))
    except BadModelOutput:
        if len(items) == 1:
            return [None]
    half = len(items) // 2
    return [*_tried(call, items[:half]), *_tried(call, items[half:])]


def shifted(values: Sequence[Out]) -> list[Out]:
    """Each item's output given to its neighbour: a control of the right kind that says the wrong thing."""
    return [*values[1:], *values[:1]]


def judged(name: str, values: Sequence[float], best: float | Sequence[float] = 1.0) -> tuple[Figure, Figure]:
    """The figure of one value an item, and the loss against the `best` there is, item by item."""
    against = np.broadcast_to(np.asarray(best, np.float64), len(values))
    losses = [float(b - v) for b, v in zip(against, values, strict=True)]
    return Figure.of(name, values), Figure.of("loss", losses)
