"""Rows of a source before they are checked, and the log of issues met while reading them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from erag.core.errors import printable
from erag.core.types import Interval
from erag.data.reading import Issue

ROW_OUT = "row left out"
EDGE_OUT = "edge left out"
CLUSTER_OUT = "cluster left out"


@dataclass(frozen=True, slots=True)
class RawRow:
    """One observation as the source has it: nothing about the types or values of its fields is known yet."""

    line: int
    id: object
    kind: object = "place"
    x: object = None
    y: object = None
    z: object = 0.0
    yaw: object = None
    time: Interval | str | None = None
    image: object = None
    name: object = None
    caption: object = None
    sensors: object = None
    source: object = None


@dataclass(frozen=True, slots=True)
class RawEdge:
    """One edge as the source has it; `a` and `b` are node ids, `kind` a name of `EdgeKind` in lower case."""

    line: int
    a: object
    b: object
    kind: object
    metres: object = None


@dataclass(frozen=True, slots=True)
class RawCluster:
    """One cluster as the source has it; `members` are ids of nodes or clusters."""

    line: int
    id: object
    level: object
    members: tuple[object, ...] = ()
    name: object = None
    summary: object = None
    relationships: tuple[object, ...] = ()


class IssueLog:
    """Collects issues of one file; `beside` gives the log of another file of the same source."""

    def __init__(self, file: str, issues: list[Issue] | None = None) -> None:
        self.file = file
        self.issues: list[Issue] = [] if issues is None else issues

    def add(self, line: int | None, what: str, action: str) -> None:
        """Report `what` at `line` (None: the file as a whole) and what was done about it."""
        self.issues.append(Issue(self.where(line), printable(what, 300), action))

    def where(self, line: int | None) -> str:
        return printable(self.file if line is None else f"{self.file}:{line}")

    def beside(self, file: str) -> IssueLog:
        return IssueLog(file, self.issues)

    def apart(self) -> IssueLog:
        """A log of the same file whose issues are kept apart until `extend` takes them over."""
        return IssueLog(self.file)

    def extend(self, issues: Iterable[Issue]) -> None:
        self.issues.extend(issues)


def show(value: object, limit: int = 60) -> str:
    """A value of a hostile source in a message: short, on one line, never descending into nested values."""
    if isinstance(value, str):
        return printable(repr(value[: limit + 1]), limit)
    if value is None or isinstance(value, bool | float):
        return str(value)
    if isinstance(value, int):
        return str(value) if abs(value) < 10**20 else f"an integer of {value.bit_length()} bits"
    return {"list": "a list", "tuple": "a list"}.get(type(value).__name__, "an object")


def number(value: object) -> float | None:
    """`value` as a float, infinite if it is too large for one; None if it is no number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf
