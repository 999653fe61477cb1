"""What a trial is: the same items for everyone who is asked, outputs as JSON, and a judgement of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self, TypeVar

import numpy as np

from erag.compare.config import Role
from erag.core.errors import BadModelOutput, InputError
from erag.evaluate.statistics import Interval, bootstrap
from erag.lm.ledger import Ledger
from erag.lm.roles import Embedder, LMBackend, RoleName
from erag.study.compact import VectorForm

In = TypeVar("In")
Out = TypeVar("Out")
Outputs = Sequence[Any]  # one JSON value an item, None where the model gave nothing that its role allows
LABELS = "labels"


@dataclass(frozen=True)
class Judgement:
    """The figure a trial is about, what is lost against the cloud (or else the labels), and further figures by name.

    `values` are the figure's item by item, where it is a mean over items.
    """

    figure: Interval
    loss: Interval
    more: Mapping[str, Interval] = field(default_factory=dict)
    values: tuple[float, ...] = ()

    @classmethod
    def of(cls, values: Sequence[float], more: Mapping[str, Interval] | None = None) -> Self:
        """Of one value an item, of which 1 is the best."""
        return cls(bootstrap(values), bootstrap([1 - v for v in values]), more or {}, tuple(values))

    def against(self, best: Judgement) -> Judgement:
        """The same with the loss against another one's values, item by item."""
        return replace(self, loss=bootstrap([b - v for b, v in zip(best.values, self.values, strict=True)]))


@dataclass(frozen=True)
class Taken:
    """What was said of the items of a trial, and what that took: seconds, those of loading apart, and counts."""

    outputs: list[Any]
    seconds: float
    load_seconds: float
    tokens_in: int
    tokens_out: int
    cost: float
    events: dict[str, int]

    @classmethod
    def since(cls, before: Ledger, after: Ledger, outputs: list[Any], seconds: float, load_seconds: float) -> Self:
        """With the difference of two states of a ledger."""
        return cls(
            outputs, seconds, load_seconds, after.tokens_in.total() - before.tokens_in.total(),
            after.tokens_out.total() - before.tokens_out.total(), sum(after.cost.values()) - sum(before.cost.values()),
            dict(after.events - before.events),
        )  # fmt: skip


@dataclass(frozen=True)
class Asked:
    """A backend that plays the role of a trial, what it counts, and how vectors of its texts are kept."""

    backend: LMBackend
    ledger: Ledger = field(default_factory=Ledger)
    vectors: VectorForm = "float32"


class Trial(ABC):
    """A trial over its items. It is made in the process that judges, and again in each that is measured.

    `measure` is what `Judgement.figure` is; `against` the cloud model that the loss is against, or the labels.
    """

    measure: str
    against: str = LABELS
    role: Role

    @property
    @abstractmethod
    def items(self) -> Sequence[Any]:
        """The items as JSON values; they and the configuration determine what is asked."""

    @property
    def units(self) -> int:
        """What seconds and tokens are told of: the items."""
        return len(self.items)

    def cloud(self) -> Outputs | None:
        """What the cloud model said of the items; None where no record exists."""
        return None

    @abstractmethod
    def controls(self) -> Mapping[str, Outputs]:
        """Outputs that need no model, by name: what any model has to beat."""

    @abstractmethod
    def judge(self, outputs: Outputs, embedder: Embedder) -> Judgement:
        """`embedder` holds texts against each other."""


class RoleTrial(Trial):
    """A trial of one role."""

    role: RoleName

    @abstractmethod
    def ask(self, asked: Asked, items: Sequence[Any]) -> list[Any]:
        """One output an item, same order."""


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
