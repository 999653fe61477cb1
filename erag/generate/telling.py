"""What every answer says besides: what the sensors read there, and how old what it rests on is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from erag.aware.reading import Read
from erag.aware.readings import Readings, extremes, readings, standing, trend_words
from erag.aware.visits import Visit
from erag.core.times import plain_date, plain_span
from erag.core.types import Answer, IntArray, SensorWish
from erag.retrieve.corpus import Corpus

Part = tuple[str, IntArray]


@dataclass(frozen=True, slots=True)
class Told:
    """Of what an answer speaks: the base nodes of its scope, and their named parts, for the readings over it."""

    rows: IntArray
    parts: tuple[Part, ...] = ()


class Telling:
    """Adds readings and age to answers over one corpus. `stale_after` is in seconds."""

    def __init__(self, corpus: Corpus, visits: Sequence[Visit], names: Mapping[str, str], stale_after: float) -> None:
        self._corpus, self._visits, self._names, self._stale = corpus, tuple(visits), names, stale_after

    def told(self, answer: Answer, read: Read, scope: Told | None = None) -> Answer:
        """The answer with its readings, where the query speaks of any, and its age, where that is old."""
        return self._aged(self._sensed(answer, read, scope), read)

    def _sensed(self, answer: Answer, read: Read, scope: Told | None) -> Answer:
        if not read.channels and not read.unread:
            return answer
        if answer.kind == "find" and answer.waypoint is not None:
            row = self._corpus.topomap.row[answer.waypoint.node]
            said = [self._reading(row, c, read.query.sensors.get(c)) for c in read.channels]
            said += [f"there are no readings of {c} in this memory" for c in read.unread]
            return replace(answer, reason="; ".join(filter(None, (answer.reason, *said))))
        if answer.kind == "explain" and answer.evidence and scope is not None:
            lines = [line for c in read.channels if (line := self.over(scope, c))]
            lines += [f"There are no readings of {c} in this memory." for c in read.unread]
            first, *rest = answer.text.split("\n")
            return replace(answer, text="\n".join((" ".join(filter(None, (first, *lines))), *rest)))
        return answer

    def _reading(self, row: int, channel: str, wish: SensorWish | None) -> str:
        value = self._corpus.topomap.nodes[row].sensors.get(channel)
        if value is None:
            return f"it has no reading of {channel}, so that was not weighed"
        known = np.array([node.sensors.get(channel, np.nan) for node in self._corpus.topomap.nodes], np.float64)
        share = standing(known, value)
        rank = f"higher than {share:.0%}" if share >= 0.5 else f"lower than {1 - share:.0%}"
        wished = f" ({wish} was asked for)" if isinstance(wish, str) else ""
        return f"{channel} reads {value:.2f} there, {rank} of the map's readings{wished}"

    def over(self, scope: Told, channel: str) -> str:
        """The readings of a channel over a scope in a sentence or two; empty where there are none."""
        found = readings(self._corpus.topomap, scope.rows, channel, [v.rows for v in self._visits])
        if found is None:
            return f"None of these views has a reading of {channel}."
        return " ".join(filter(None, (self._level(found), self._where(scope, channel), self._trend(found))))

    def _level(self, found: Readings) -> str:
        about = self._names.get(found.channel, found.channel)
        spread = f"80 % of {found.read:,} readings lie between {found.low:.2f} and {found.high:.2f}"
        return f"{about[:1].upper()}{about[1:]} is {found.mean:.2f} on average; {spread}."

    def _where(self, scope: Told, channel: str) -> str:
        ranked = extremes(self._corpus.topomap, scope.parts, channel)
        if len(ranked) < 2 or ranked[0][0] == ranked[-1][0]:
            return ""
        (top, high), (bottom, low) = ranked[0], ranked[-1]
        return f"It is highest in {top} ({high:.2f}) and lowest in {bottom} ({low:.2f})."

    @staticmethod
    def _trend(found: Readings) -> str:
        return f"Over the visits it is {trend_words(found.trend)}." if found.trend else ""

    def _aged(self, answer: Answer, read: Read) -> Answer:
        """Says how old the newest view is that an answer rests on, where that is old and not said yet."""
        rows = [self._corpus.topomap.row[node] for node in answer.evidence]
        seen = max((t.start for r in rows if (t := self._corpus.topomap.nodes[r].time)), default=None)
        if seen is None or read.now is None or read.now - seen < self._stale or plain_date(seen) in answer.text:
            return answer
        than = "the newest observation of this memory" if read.query.now is None else "now"
        age = f"seen on {plain_date(seen)}, {plain_span(read.now - seen)} before {than}"
        if answer.kind == "find":
            return replace(answer, text=f"{answer.text} It was last {age}.")
        return replace(answer, reason="; ".join(filter(None, (answer.reason, f"what it rests on was {age}"))))
