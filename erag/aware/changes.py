"""What is gone, new or moved between two visits: places matched by position, things by name, doubt stated."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from erag.aware.sight import Sight
from erag.aware.things import Mention, Name, Things, alike
from erag.core.types import IntArray

ChangeKind = Literal["gone", "new", "moved"]
Alike = Callable[[Name, Name], bool]
SAME_PLACE_M = 1.0  # objects of one name nearer than this are one
_DOUBT = 0.9  # even a fully covered thing is named less often than always
_HALF, _PRIOR = 0.5, 1.0  # how often a view of a thing names it, before anything is known; what that counts, in views
_SAMPLE = 400  # mentions of a visit from which is learnt how often its views name what they look at
_LOOKS = 0.1  # share of the places where a thing may stand from which on a view looks at it
_UNRELATED = 0.02  # share of views that name a thing by chance, at least
LIKELY, PROBABLE = 0.25, 2.0  # evidence in nats: told at all, and told as probable


@dataclass(frozen=True, slots=True)
class Change:
    """A thing that is there on one visit and not on the other.

    `seen` are rows that name it, `looked` rows of the other visit that look at the same spot and do not. `evidence` is
    the log-likelihood ratio, in nats, of its absence from there to its presence.
    """

    kind: ChangeKind
    name: Name
    seen: tuple[int, ...]
    looked: tuple[int, ...]
    evidence: float

    @property
    def probable(self) -> bool:
        """Whether the evidence is strong; else it may only have been overlooked."""
        return self.evidence >= PROBABLE


@dataclass(frozen=True)
class Changes:
    """The changes between two visits, strongest first; `unseen` are things whose place was not looked at again."""

    changes: tuple[Change, ...]
    unseen: tuple[Name, ...]

    def of(self, kind: ChangeKind) -> tuple[Change, ...]:
        """The changes of one kind."""
        return tuple(c for c in self.changes if c.kind == kind)


class Comparison:
    """Compares two visits of a map. `same` says which names may be one thing though they are worded differently."""

    def __init__(self, things: Things, sight: Sight, same: Alike = alike) -> None:
        self._things, self._sight, self._same = things, sight, same
        self._kin: dict[Name, tuple[Name, ...]] = {}
        self._rates: dict[tuple[int, int], float] = {}

    def between(self, before: IntArray, after: IntArray) -> Changes:
        """What changed from the visit with the nodes `before` (a,) to that with the nodes `after` (b,)."""
        lost, unseen = self._lost(before, after)
        come, _ = self._lost(after, before)
        moved = {n: (c, come[n]) for n, c in lost.items() if n in come}
        told = [_change("gone", n, c) for n, c in lost.items() if n not in moved]
        told += [_change("new", n, c) for n, c in come.items() if n not in moved]
        told += [_move(n, gone, there) for n, (gone, there) in moved.items()]
        ordered = sorted(told, key=lambda c: (-c.evidence, c.name))
        return Changes(tuple(ordered), tuple(n for n in unseen if n not in lost))

    def _lost(self, before: IntArray, after: IntArray) -> tuple[dict[Name, list[_Absence]], list[Name]]:
        """Things of `before` that are no longer there on `after`, and those whose place was not looked at again."""
        absences: dict[Name, list[_Absence]] = {}
        unseen = []
        for name, mentions in self._things.by_name.items():
            here = [m for m in mentions if _in(before, m.row)]
            found = [self._absence(m, before, after) for m in here]
            strong = [f for f in found if f.evidence >= LIKELY]
            if strong:
                absences[name] = sorted(strong, key=lambda f: -f.evidence)
            elif here and all(not f.looked and not f.named for f in found):
                unseen.append(name)
        return absences, unseen

    def _absence(self, mention: Mention, before: IntArray, after: IntArray) -> _Absence:
        """How much the views of `after` speak against a thing named in `before` still standing where it stood."""
        rows = self._near(mention.row, after)
        if self._sight.objects[mention.row] and (kept := self._kept(mention, rows)):
            return _Absence(mention.row, (), kept, 0.0)
        named = self._naming(mention.name)
        where = self._where(mention, before, named)
        cover = self._sight.covers(rows, where.points) @ where.weights if len(rows) else np.zeros(0)
        says = np.array([int(r) in named for r in rows], np.bool_)
        chance = self._chance(named, after)
        there = cover * max(where.rate, chance) + (1 - cover) * chance
        nats = np.where(says, np.log(chance / there), np.log((1 - chance) / (1 - there)))
        looking = cover > _LOOKS
        return _Absence(
            mention.row,
            tuple(int(r) for r in rows[looking & ~says]),
            tuple(int(r) for r in rows[looking & says]),
            float(nats[looking].sum()),
        )

    def _where(self, mention: Mention, before: IntArray, named: Mapping[int, object]) -> _Where:
        """Where a thing may stand, in the light of all views of its own visit, and how often views of it name it."""
        points = self._sight.points(mention.row, mention.side)
        rows = self._near(mention.row, before)
        weights = np.full(len(points), 1 / len(points))
        if not len(rows):
            return _Where(points, weights, _DOUBT * self._usual(before))
        covers = self._sight.covers(rows, points)  # (r, k)
        says = np.array([int(r) in named for r in rows], np.bool_)
        chance = self._chance(named, before)
        usual = self._usual(before)
        named_there = np.where(covers, max(usual, chance), chance)
        nats = np.where(says[:, None], np.log(named_there), np.log(1 - named_there)).sum(axis=0)  # (k,)
        weights = np.exp(nats - nats.max())
        weights /= weights.sum()
        cover = covers @ weights
        rate = _DOUBT * (cover[says].sum() + usual * _PRIOR) / (cover.sum() + _PRIOR)
        return _Where(points, weights, float(rate))

    def _kept(self, mention: Mention, rows: IntArray) -> tuple[int, ...]:
        """Object nodes of the same name at the same place."""
        at, same = self._sight.at, self._naming(mention.name)
        return tuple(
            int(r)
            for r in rows
            if self._sight.objects[r] and int(r) in same and np.linalg.norm(at[r] - at[mention.row]) < SAME_PLACE_M
        )

    def _near(self, row: int, among: IntArray) -> IntArray:
        near = self._sight.near(row, 2 * self._sight.reach)
        return np.asarray(near[np.isin(near, among, assume_unique=True) & (near != row)])

    def _usual(self, rows: IntArray) -> float:
        """How often the views of a visit name a thing that another view of it names, where they look at its spot.

        Terse captions of what is in view come to a half; rich ones, in which much is named once, to far less.
        """
        key = (int(rows[0]), len(rows)) if len(rows) else (-1, 0)
        if key not in self._rates:
            inside = [m for m in self._things.mentions if _in(rows, m.row) and not self._sight.objects[m.row]]
            pairs = [self._repeated(m, rows) for m in inside[:: max(1, len(inside) // _SAMPLE)]]
            named, covered = np.sum(pairs, axis=0) if pairs else (0.0, 0.0)
            self._rates[key] = float((named + _HALF * _PRIOR) / (covered + _PRIOR))
        return self._rates[key]

    def _repeated(self, mention: Mention, rows: IntArray) -> tuple[float, float]:
        """The cover of a mention's spot by other views that name the thing too, and by all others."""
        others = self._near(mention.row, rows)
        if not len(others):
            return 0.0, 0.0
        cover = self._sight.covers(others, self._sight.points(mention.row, mention.side)).mean(axis=1)
        named = self._naming(mention.name)
        says = np.array([int(r) in named for r in others], np.bool_)
        return float(cover[says].sum()), float(cover.sum())

    def _chance(self, named: Mapping[int, object], rows: IntArray) -> float:
        """How likely a view of a visit names such a thing wherever it looks."""
        share = sum(_in(rows, r) for r in named) / max(len(rows), 1)
        return float(np.clip(share, _UNRELATED, 0.9))

    def _naming(self, name: Name) -> Mapping[int, object]:
        """The nodes that name a thing, in these words or in others that may mean it."""
        if name not in self._kin:
            self._kin[name] = tuple(other for other in self._things.by_name if self._same(name, other))
        return {m.row: None for other in self._kin[name] for m in self._things.by_name[other]}


@dataclass(frozen=True, eq=False)
class _Where:
    """Points (k, 2) at which a thing may stand with their `weights` (k,), and how likely a view of it names it."""

    points: npt.NDArray[np.float64]
    weights: npt.NDArray[np.float64]
    rate: float


@dataclass(frozen=True, slots=True)
class _Absence:
    """For a mention in `row`: views of the other visit that do not name it, and that do; evidence of its absence."""

    row: int
    looked: tuple[int, ...]
    named: tuple[int, ...]
    evidence: float


def _change(kind: ChangeKind, name: Name, found: Sequence[_Absence]) -> Change:
    best = found[0]
    return Change(kind, name, tuple(f.row for f in found), best.looked, best.evidence)


def _move(name: Name, gone: Sequence[_Absence], there: Sequence[_Absence]) -> Change:
    seen = (*(f.row for f in gone), *(f.row for f in there))
    return Change("moved", name, seen, gone[0].looked, min(gone[0].evidence, there[0].evidence))


def _in(rows: IntArray, row: int) -> bool:
    at = int(np.searchsorted(rows, row))
    return at < len(rows) and int(rows[at]) == row
