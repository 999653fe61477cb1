"""Times: RFC 3339 instants, and coarse stamps such as a month, as intervals in UTC seconds."""

from __future__ import annotations

import calendar
import re
from datetime import UTC, datetime, timedelta

from erag.core.errors import printable
from erag.core.types import Interval

FORMS = "RFC 3339 (2024-05-17T09:30:00Z), a day (2024-05-17), a month (2024-05) or a year (2024); years 0001 to 9999"

_COARSE = re.compile(r"([0-9]{4})(?:-([0-9]{2})(?:-([0-9]{2}))?)?")
_INSTANT = re.compile(
    r"[0-9]{4}-[0-9]{2}-[0-9]{2}[Tt ][0-9]{2}:[0-9]{2}(?::[0-9]{2}(?:[.,][0-9]{1,12})?)?(?:[Zz]|[+-][0-9]{2}:[0-9]{2})?"
)
_DAY_S = 86_400
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_FIRST_S, _LAST_S = -62_135_596_800.0, 253_402_300_800.0  # from year 1 up to, without, year 10000


def parse_time(stamp: str) -> Interval:
    """The interval a stamp means: an instant has length 0, a day, month or year its whole length.

    A date-time without an offset is read as UTC, one without seconds as the full minute; digits beyond microseconds
    are cut. Raises ValueError for anything else than `FORMS`, leap seconds included.
    """
    text = stamp.strip()
    try:
        if m := _COARSE.fullmatch(text):
            return _coarse(int(m[1]), *(int(v) for v in m.groups()[1:] if v))
        if _INSTANT.fullmatch(text):
            return _instant(text.upper())
    except ValueError as error:
        raise ValueError(f"{printable(stamp, 80)!r} is no time ({error}); allowed: {FORMS}") from error
    raise ValueError(f"{printable(stamp, 80)!r} is no time; allowed: {FORMS}")


_LAST_STAMP = "9999-12-31T23:59:59Z"  # stands for the end of the year 9999, which no date-time can name


def format_time(interval: Interval) -> str:
    """The shortest stamp that means this interval to the microsecond, else `start/end` in RFC 3339.

    Raises ValueError for moments outside the years 1 to 9999, which no stamp can name.
    """
    if interval.start == interval.end:
        return _rfc3339(interval.start)
    day = _moment(interval.start).date().isoformat()
    for stamp in (day[:4], day[:7], day):
        if parse_time(stamp) == interval:
            return stamp
    end = _LAST_STAMP if interval.end == _LAST_S else _rfc3339(interval.end)
    return f"{_rfc3339(interval.start)}/{end}"


def parse_interval(stamp: str) -> Interval:
    """What `format_time` writes, read back: a stamp, or `start/end` (from the start of the one to that of the other).

    Raises ValueError for a malformed stamp, or for an end before the start.
    """
    if "/" not in stamp:
        return parse_time(stamp)
    start, end = stamp.split("/", 1)
    return Interval(parse_time(start).start, parse_time(end).start)


def _coarse(year: int, month: int | None = None, day: int | None = None) -> Interval:
    start = datetime(year, 1 if month is None else month, 1 if day is None else day, tzinfo=UTC).timestamp()
    days = 366 if calendar.isleap(year) else 365
    if month is not None:
        days = calendar.monthrange(year, month)[1] if day is None else 1
    return Interval(start, start + days * _DAY_S)


def _instant(text: str) -> Interval:
    moment = datetime.fromisoformat(text)
    at = moment.replace(tzinfo=moment.tzinfo or UTC).timestamp()
    if not _FIRST_S <= at < _LAST_S:
        raise ValueError("its offset leads out of the years 1 to 9999")
    return Interval(at, at)


def _moment(seconds: float) -> datetime:
    try:
        return _EPOCH + timedelta(seconds=seconds)
    except OverflowError as error:
        raise ValueError(f"{seconds} s since 1970 lies outside the years 1 to 9999") from error


def _rfc3339(seconds: float) -> str:
    return _moment(seconds).isoformat().replace("+00:00", "Z")


def plain_date(seconds: float) -> str:
    """The day of a moment, in UTC: `2025-04-12`."""
    return _moment(seconds).date().isoformat()


def plain_moment(seconds: float) -> str:
    """A moment to the minute, in UTC: `2025-04-12 09:04`."""
    return _moment(seconds).strftime("%Y-%m-%d %H:%M")


_UNITS = (("year", 365.25 * _DAY_S), ("month", 30.44 * _DAY_S), ("day", _DAY_S), ("hour", 3600.0), ("minute", 60.0))


def plain_span(seconds: float) -> str:
    """A length of time in words, in the largest unit of which it has two or more: `196 days` is `6 months`."""
    for unit, length in _UNITS:
        if (count := round(seconds / length)) >= 2:
            return f"{count} {unit}s"
    return "1 minute" if seconds >= 30 else f"{seconds:.0f} seconds"
