"""What a question says besides what it asks for, made conditions of the query: sensors, times, visits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import timedelta

from erag.aware.asked import Asked, asked
from erag.aware.channels import Wished, lexicon, named, unread, wishes
from erag.aware.config import AwareConfig
from erag.aware.visits import newest, visits
from erag.aware.when import Clock, Window, window, without
from erag.core.times import plain_moment
from erag.core.types import Query, Range, SensorWish, TopoMap


@dataclass(frozen=True)
class Read:
    """A query with the conditions that its words state, what it asks about time and number, and notes for the user.

    `query.text` is without the words that became a time window; `channels` are those the text speaks of, `unread` those
    it names though the map has no readings of them.
    """

    query: Query
    asked: Asked = field(default_factory=Asked)
    window: Window = field(default_factory=Window)
    now: float | None = None
    channels: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


class Reader:
    """Reads the questions asked of one map. `declared` are the sensor ranges its sources state."""

    def __init__(self, topomap: TopoMap, declared: Mapping[str, Range], config: AwareConfig) -> None:
        self._config = config
        self._words = lexicon(config.channels)
        self.visits = visits(topomap, config.visit_gap)
        self._newest = newest(topomap)
        self.channels = tuple(sorted({c for node in topomap.nodes for c in node.sensors} | set(declared)))

    def about(self, channel: str) -> str:
        """What a channel measures, for people."""
        return self._words.about(channel)

    def read(self, query: Query) -> Read:
        """What the words of a query say of sensors and times; conditions it states apart from them win."""
        now = query.now if query.now is not None else self._newest
        if query.text is None:
            return Read(query, now=now)
        what = asked(query.text) if self._config.read_times else Asked()
        when = self._window(query, now)
        wished = self._wishes(query)
        sensors: Mapping[str, SensorWish] = query.sensors or {w.channel: w.wish for w in wished}
        text = without(query.text, when.words) if when and not what.changes else query.text
        plain = replace(query, text=text, sensors=sensors)
        if when and not what.changes and what.aspect != "still" and not _states_window(query):
            plain = replace(plain, since=when.since, until=when.until, hours=when.hours)
        spoken = named(query.text, self.channels, self._words) if self._config.read_sensors else ()
        missing = unread(query.text, self.channels, self._words) if self._config.read_sensors else ()
        told = _told_window(when) if not _states_window(query) and not what.changes else []
        notes = (*self._told(wished), *told, *self._missing(missing))
        return Read(plain, what, when, now, tuple(dict.fromkeys((*sensors, *spoken))), missing, notes)

    def _window(self, query: Query, now: float | None) -> Window:
        if query.text is None or now is None or not self._config.read_times:
            return Window()
        return window(query.text, Clock(now, self.visits, timedelta(hours=self._config.hours_ahead)))

    def _wishes(self, query: Query) -> tuple[Wished, ...]:
        if query.text is None or query.sensors or not self._config.read_sensors:
            return ()
        return wishes(query.text, self.channels, self._words)

    @staticmethod
    def _told(wished: tuple[Wished, ...]) -> list[str]:
        return [f'"{w.words}" was read as {w.channel}={_wish(w.wish)}' for w in wished]

    def _missing(self, channels: tuple[str, ...]) -> list[str]:
        return [f"this memory has no readings of {c}: places are judged by what was seen alone" for c in channels]


def _states_window(query: Query) -> bool:
    return query.since is not None or query.until is not None or query.hours is not None


def _wish(wish: SensorWish) -> str:
    return wish if isinstance(wish, str) else f"{wish[0]:g}:{wish[1]:g}"


def _told_window(when: Window) -> list[str]:
    return [f'"{", ".join(when.words)}" was read as {window_words(when.since, when.until, when.hours)}'] if when else []


def window_words(since: float | None, until: float | None, hours: Range | None) -> str:
    """A time window in words and stamps."""
    parts = [
        f"from {plain_moment(since)}" if since is not None else "",
        f"before {plain_moment(until)}" if until is not None else "",
    ]
    parts += [f"between {_clock(hours[0])} and {_clock(hours[1])} UTC"] if hours is not None else []
    return " ".join(filter(None, parts)) or "at any time"


def _clock(hour: float) -> str:
    return f"{int(hour):02d}:{round((hour % 1) * 60) % 60:02d}"
