"""Times: RFC 3339 instants, and coarse stamps such as a month, as intervals in UTC seconds."""

from __future__ import annotations

import calendar
import re
from datetime import UTC, datetime

from erag.core.types import Interval

_YEAR = re.compile(r"(\d{4})$")
_MONTH = re.compile(r"(\d{4})-(\d{2})$")
_DAY = re.compile(r"(\d{4})-(\d{2})-(\d{2})$")
FORMS = "RFC 3339 (2024-05-17T09:30:00Z), a day (2024-05-17), a month (2024-05) or a year (2024)"


def parse_time(stamp: str) -> Interval:
    """The interval a stamp means: an instant has length 0, a day, month or year its whole length.

    A date-time without an offset is read as UTC. Raises ValueError for anything else than `FORMS`.
    """
    text = stamp.strip()
    if m := _YEAR.match(text):
        return Interval(_utc(int(m[1]), 1, 1), _utc(int(m[1]) + 1, 1, 1))
    if m := _MONTH.match(text):
        year, month = int(m[1]), int(m[2])
        return Interval(_utc(year, month, 1), _utc(year + month // 12, month % 12 + 1, 1))
    if m := _DAY.match(text):
        start = _utc(int(m[1]), int(m[2]), int(m[3]))
        return Interval(start, start + 86_400)
    moment = datetime.fromisoformat(text)
    at = moment.replace(tzinfo=moment.tzinfo or UTC).timestamp()
    return Interval(at, at)


def format_time(interval: Interval) -> str:
    """The shortest stamp that means this interval exactly, else `start/end` in RFC 3339."""
    if interval.start == interval.end:
        return _rfc3339(interval.start)
    begin = datetime.fromtimestamp(interval.start, UTC)
    for stamp in (f"{begin:%Y}", f"{begin:%Y-%m}", f"{begin:%Y-%m-%d}"):
        if parse_time(stamp) == interval:
            return stamp
    return f"{_rfc3339(interval.start)}/{_rfc3339(interval.end)}"


def parse_interval(stamp: str) -> Interval:
    """What `format_time` writes, read back: a stamp, or `start/end`."""
    if "/" not in stamp:
        return parse_time(stamp)
    start, end = stamp.split("/", 1)
    return Interval(parse_time(start).start, parse_time(end).start)


def _rfc3339(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).isoformat().replace("+00:00", "Z")


def _utc(year: int, month: int, day: int) -> float:
    return float(calendar.timegm(datetime(year, month, day, tzinfo=UTC).timetuple()))
