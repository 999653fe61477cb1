"""The region a question names: around something, in a named area, within metres, along a way."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from erag.aware.sight import Sight
from erag.aware.things import Name, Things
from erag.core.geometry import distance
from erag.core.types import IntArray, Pose, Route
from erag.forest.terms import mentions
from erag.retrieve.corpus import Corpus

_METRES = r"(\d+(?:\.\d+)?) ?(?:m|metres?|meters?)"
_END = r"(?:\?|\.|,|;|$| like\b| look\b| look like\b| changed?\b)"
_WITHIN = re.compile(rf"\bwithin {_METRES}(?: (?:of|around|from) (?P<what>.+?))?{_END}")
_WAY = re.compile(
    rf"\b(?:along|on) (?:the |my |our )?(?:way|route|path|walk|road|drive)?\s*(?:from (?P<start>.+?) )?"
    rf"to (?P<goal>.+?){_END}"
    rf"|\bfrom (?P<start2>.+?) to (?P<goal2>.+?){_END}|\bbetween (?P<start3>.+?) and (?P<goal3>.+?){_END}"
)
_AROUND = re.compile(
    rf"\b(?:around|near|nearby|close to|next to|beside|by|surrounding|surroundings of|vicinity of) (?P<what>.+?){_END}"
)
_IN = re.compile(rf"\b(?:in|inside|at|on|of) (?P<what>(?:the|this|that|our|my) .+?){_END}")
_DESCRIBE = re.compile(
    rf"^(?:please )?(?:describe|explain|summari[sz]e|tell me about)(?: to me| me)? "
    rf"(?P<what>(?:the|this|that|our|my) .+?){_END}"
)
_HERE = frozenset({"here", "me", "us", "the robot", "this place", "this spot", "where i am", "my position"})
_MOST = 0.6  # a place named by more of the views than this is the whole map
_ENDS = 8  # places of one name that are tried as ends of a way
LEAST = 3  # views a named area has at least


class Routes(Protocol):
    """What a way needs of a router."""

    def route(self, start: Pose | str | None, goal: str) -> Route:
        """The shortest way from a pose or a node to a node."""
        ...


@dataclass(frozen=True)
class Region:
    """The base nodes `rows` (r,) of a region, and what to call it."""

    rows: IntArray
    name: str


class Regions:
    """Finds the regions that questions name on one map. `radius` in metres is what `around` and `near` mean."""

    def __init__(self, corpus: Corpus, routes: Routes, things: Things, sight: Sight) -> None:
        self._corpus, self._routes, self._things, self._sight = corpus, routes, things, sight

    @property
    def radius(self) -> float:
        """Metres that `around` means: what one can see from a place."""
        return self._sight.reach

    def of(self, text: str, at: Pose | None) -> Region | None:
        """The region that a text names, asked at a pose; None where it names none that the map knows."""
        spoken = " ".join(text.lower().replace("’", "'").split())
        found = (self._within(spoken, at), self._along(spoken, at), self._around(spoken, at), self._inside(spoken))
        return next((region for region in found if region is not None), None)

    def _within(self, spoken: str, at: Pose | None) -> Region | None:
        match = _WITHIN.search(spoken)
        if match is None:
            return None
        metres, what = float(match[1]), match["what"] or "here"
        centres = self._anchors(what, at)
        return self._close(centres, metres, f"the region within {metres:g} m of {_called(what)}")

    def _around(self, spoken: str, at: Pose | None) -> Region | None:
        match = _AROUND.search(spoken)
        if match is None or match["what"] in _HERE:
            return None
        return self._close(self._anchors(match["what"], at), self.radius, f"the surroundings of {match['what']}")

    def _inside(self, spoken: str) -> Region | None:
        """Views that name an area themselves."""
        for match in (*_DESCRIBE.finditer(spoken), *_IN.finditer(spoken)):
            rows = self._naming(match["what"])
            if LEAST <= len(rows) <= _MOST * max(int(self._corpus.searchable.sum()), 1):
                return Region(rows, match["what"])
        return None

    def _along(self, spoken: str, at: Pose | None) -> Region | None:
        match = _WAY.search(spoken)
        if match is None:
            return None
        start, goal = (next((g for k in keys if (g := match[k])), None) for keys in (_STARTS, _GOALS))
        ends = self._anchors(goal or "", at)
        starts: list[Pose | str | None] = [at] if start is None else [self._id(row) for row in self._anchors(start, at)]
        ways = [self._routes.route(begin, self._id(row)) for begin in starts[:_ENDS] if begin for row in ends[:_ENDS]]
        driven = [way for way in ways if way.status == "ok" and way.length_m is not None and len(way.nodes) > 1]
        if not driven:
            return None
        best = min(driven, key=lambda way: (way.length_m or 0.0, way.nodes))
        rows = np.array([self._corpus.topomap.row[node] for node in best.nodes], np.int64)
        return self._close(rows, self.radius / 2, f"the way from {start or 'here'} to {goal} ({best.length_m:.0f} m)")

    def _anchors(self, what: str, at: Pose | None) -> IntArray:
        """Rows of the nodes that stand for what is named: a node's id, where the robot is, or what names the thing."""
        plain = re.sub(r"^(?:node|the node) ", "", what.strip())
        ids = {node.lower(): row for node, row in self._corpus.topomap.row.items()}
        if plain in ids:
            return np.array([ids[plain]], np.int64)
        if plain in _HERE:
            return self._nearest(at)
        return self._naming(what)

    def _nearest(self, at: Pose | None) -> IntArray:
        if at is None:
            return np.empty(0, np.int64)
        topomap = self._corpus.topomap
        return np.array([distance(topomap.frame, np.array(at.xyz), topomap.positions).argmin()], np.int64)

    def _naming(self, what: str) -> IntArray:
        """Nodes that name a thing or a place with all its words, ascending; else clusters of that name."""
        name = _name(what)
        if not name:
            return np.empty(0, np.int64)
        found = self._things.of(name)
        full = [m.row for m in found if self._corpus.searchable[m.row]]
        return np.array(sorted(full), np.int64)

    def _close(self, centres: IntArray, metres: float, name: str) -> Region | None:
        """All nodes within `metres` of one of the centres; None without any."""
        if not len(centres):
            return None
        rows = np.unique(np.concatenate([self._sight.near(int(row), metres) for row in centres]))
        return Region(rows, name)

    def _id(self, row: int) -> str:
        return self._corpus.topomap.nodes[row].id


_STARTS: Sequence[str] = ("start", "start2", "start3")
_GOALS: Sequence[str] = ("goal", "goal2", "goal3")


def _name(what: str) -> Name:
    phrases = mentions(what).phrases
    return phrases[0].words if phrases else ()


def _called(what: str) -> str:
    return "where it is asked" if what in _HERE else what
