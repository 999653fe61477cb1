"""What a source says about itself: format, version, name, frame, sensor ranges; and the meta.json that holds it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from erag.core.errors import InputError
from erag.core.text import MAX_CAPTION
from erag.core.times import FORMS, format_time, parse_interval
from erag.core.types import Frame, Interval, Range
from erag.data import jsontext
from erag.data.files import place, read_text
from erag.data.rows import IssueLog, number, show
from erag.data.validation import MAX_NAME, problem_of_id, text_of

FORMAT, VERSION = "erag-observations", 1
META = "meta.json"
_EXAMPLE = '{"format": "erag-observations", "version": 1, "frame": "metric"}'
_KEYS = frozenset({"format", "version", "name", "frame", "sensors", "notes"})


@dataclass(frozen=True)
class Meta:
    """The head of an observation folder."""

    frame: Frame
    name: str | None = None
    sensors: Mapping[str, Range] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def read_meta(folder: Path, log: IssueLog) -> Meta:
    """Read `meta.json`. Raises InputError if it is missing, damaged, of another format or version, or has no frame."""
    path = folder / META
    where = place(path)
    if not path.is_file():
        raise InputError("it is missing, so the frame is unknown", where=where, repair=f"write {_EXAMPLE} there")
    try:
        said = jsontext.loads(read_text(path, log, root=folder))
    except ValueError as error:
        raise InputError(f"not JSON: {error}", where=where, allowed=_EXAMPLE) from None
    if not isinstance(said, dict) or said.get("format") != FORMAT or said.get("version") != VERSION:
        raise InputError(f"not version {VERSION} of {FORMAT}", where=where, allowed=_EXAMPLE)
    if key := jsontext.repeated(said):
        raise InputError(f"it states {show(key)} twice", where=where)
    for key in sorted(set(said) - _KEYS):
        log.add(None, f"unknown key {show(key)}", "ignored")
    name = text_of(said.get("name"), "name", MAX_NAME, 1, log)
    notes = said.get("notes", [])
    if not isinstance(notes, list):
        raise InputError(f"the notes are {show(notes)}", where=where, allowed="a list of texts")
    said_notes = notes_of(notes, log)
    return Meta(frame_of(said.get("frame"), where), name, _ranges(said.get("sensors", {}), where), said_notes)


def frame_of(value: object, where: str) -> Frame:
    """The frame that `value` names. Raises InputError for any other value."""
    if isinstance(value, str) and value in [f.value for f in Frame]:
        return Frame(value)
    allowed = '"wgs84" (x = longitude, y = latitude in degrees) or "metric" (metres)'
    raise InputError(f"the frame is {show(value)}", where=where, allowed=allowed)


def range_of(channel: object, low: object, high: object, where: str) -> Range:
    """The declared range of a sensor channel. Raises InputError unless it is finite and min < max."""
    a, b = number(low), number(high)
    if (problem := problem_of_id(channel)) or a is None or b is None or not -math.inf < a < b < math.inf:
        what = problem or f"the range of the sensor {show(channel)} is {show(low)} to {show(high)}"
        raise InputError(what, where=where, allowed='finite numbers, min < max, as {"min": -1, "max": 1}')
    return (a, b)


def interval_of(start: object, end: object, line: int, log: IssueLog) -> Interval | None:
    """The interval from `start` to `end`, each UTC seconds or a time stamp; None, reported, if it is none."""
    try:
        return Interval(_seconds(start), _seconds(end))
    except ValueError:
        what = f"the time from {show(start)} to {show(end)} is no interval"
        log.add(line, f"{what}; allowed: start <= end in UTC seconds or {FORMS}", "kept without time")
        return None


def _seconds(value: object) -> float:
    if isinstance(value, str):
        return parse_interval(value).start
    seconds = number(value)
    if seconds is None:
        raise ValueError(show(value))
    return seconds


def _ranges(said: object, where: str) -> dict[str, Range]:
    if not isinstance(said, dict):
        raise InputError(f"the sensors are {show(said)}", where=where, allowed='{"ndvi": {"min": -1, "max": 1}}')
    ranges = {}
    for channel, bounds in said.items():
        low, high = (bounds.get("min"), bounds.get("max")) if isinstance(bounds, dict) else (None, None)
        ranges[channel] = range_of(channel, low, high, where)
    return ranges


def notes_of(notes: Iterable[object], log: IssueLog) -> tuple[str, ...]:
    """Notes as tidy text; what is none is reported and left out."""
    texts = (text_of(note, "note", MAX_CAPTION, 1, log) for note in notes)
    return tuple(text for text in texts if text)


def stamp_of(time: Interval) -> str | None:
    """The stamp that reads back as exactly this interval, or None if there is none."""
    try:
        stamp = format_time(time)
        return stamp if parse_interval(stamp) == time else None
    except (ValueError, OverflowError):  # a moment that no calendar shows
        return None
