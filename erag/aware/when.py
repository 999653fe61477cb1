"""Times in words: the window of observations that a question speaks of, relative to the memory's newest one."""

from __future__ import annotations

import calendar
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

from erag.aware.visits import Visit
from erag.core.times import parse_time

Hours = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Window:
    """[since, until) in UTC seconds, and `hours` of the day [from, to) in which something was seen; None: open.

    `words` are the phrases it was read from. `hours` may run over midnight.
    """

    since: float | None = None
    until: float | None = None
    hours: Hours | None = None
    words: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return self.since is not None or self.until is not None or self.hours is not None

    def joined(self, other: Window) -> Window:
        """What lies in both; where the hours of both are stated, those of the other."""
        since = max((s for s in (self.since, other.since) if s is not None), default=None)
        until = min((u for u in (self.until, other.until) if u is not None), default=None)
        return Window(since, until, other.hours or self.hours, (*self.words, *other.words))


@dataclass(frozen=True, slots=True)
class Clock:
    """What times are relative to: `now` in UTC seconds, the `visits`, and how far local time is ahead of UTC."""

    now: float
    visits: tuple[Visit, ...] = ()
    ahead: timedelta = timedelta()

    @property
    def moment(self) -> datetime:
        """Now, in local time."""
        return datetime.fromtimestamp(self.now, UTC) + self.ahead

    def seconds(self, local: datetime) -> float:
        """UTC seconds of a moment in local time."""
        return (local - self.ahead).timestamp()

    def hours(self, start: float, end: float) -> Hours:
        """Hours of the local day as hours of the day in UTC."""
        shift = self.ahead.total_seconds() / 3600
        return ((start - shift) % 24, (end - shift) % 24)


_MONTHS = {
    name.lower(): i for names in (calendar.month_name, calendar.month_abbr) for i, name in enumerate(names) if name
}
_DAYS = {name.lower(): i for i, name in enumerate(calendar.day_name)}
_MONTH = "|".join(sorted(_MONTHS, key=len, reverse=True))
_PARTS: dict[str, Hours] = {
    "early morning": (5, 8), "morning": (5, 12), "forenoon": (8, 12), "midday": (11, 14), "noon": (11, 14),
    "afternoon": (12, 18), "evening": (17, 22), "night": (21, 5), "daytime": (7, 19), "dawn": (4, 8), "dusk": (17, 22),
}  # fmt: skip
_PART = "|".join(sorted(_PARTS, key=len, reverse=True))
_ORDINALS = {"first": 1, "1st": 1, "second": 2, "2nd": 2, "third": 3, "3rd": 3, "fourth": 4, "4th": 4, "fifth": 5}
_VISIT_NOUN = r"(?:visit|tour|drive|run|trip|patrol|round|pass|inspection|survey|session)"
_COUNTS = {"a": 1, "an": 1, "one": 1, "two": 2, "three": 3, "four": 4, "five": 5, "six": 6, "seven": 7, "eight": 8,
           "nine": 9, "ten": 10, "couple of": 2, "a couple of": 2, "few": 3, "a few": 3}  # fmt: skip
_COUNT = r"(\d+|" + "|".join(sorted(_COUNTS, key=len, reverse=True)) + ")"
_UNIT_S = {"second": 1.0, "minute": 60.0, "hour": 3600.0, "day": 86_400.0, "week": 604_800.0, "month": 2_629_800.0,
           "year": 31_557_600.0}  # fmt: skip
_UNIT = "(" + "|".join(_UNIT_S) + ")s?"
_STAMP = r"(\d{4}-\d{2}-\d{2}[tT ]\d{2}:\d{2}(?::\d{2})?(?:[zZ]|[+-]\d{2}:\d{2})?|\d{4}-\d{2}-\d{2}|\d{4}-\d{2})"
_HOUR = r"(\d{1,2})(?::(\d{2}))? ?(am|pm|a\.m\.|p\.m\.|o'clock|h\b|uhr)?"

# Seeing in the past, or an order to find: without either, `in the morning` may well be a part of a wish.
_OBSERVED = re.compile(
    r"\b(?:saw|seen|see|observed|noticed|spotted|recorded|photographed|captured|filmed|sighted|visited|passed|looked|"
    r"was|were|did (?:you|the robot)|have you)\b"
)
_ORDERED = re.compile(
    r"^(?:please )?(?:find|show|list|describe|count|explain|what (?:is|are) (?:there|seen|visible|to be seen)|"
    r"which|how many|summari[sz]e)\b"
)
_WISHING = re.compile(
    r"\b(?:i|we|my|our|us|want|need|would|can|could|should|must|shall|let's|i'd|we'd|will|going to|have to|tomorrow|"
    r"they|he|she|opens?|serves?|does|do)\b"
)


def window(text: str, clock: Clock) -> Window:
    """The window of observations that a text speaks of; an open one where it speaks of none.

    Visits, dates and `yesterday` are always read; parts of the day, hours and `last week` only in sentences about what
    was seen, since `somewhere for breakfast in the morning` is a wish.
    """
    spoken = " ".join(text.lower().replace("’", "'").split())
    found = Window()
    rules = (*_PLAIN, *(_OF_SEEING if _about_seeing(spoken) else ()))
    for pattern, read in rules:
        match = re.search(pattern, spoken)
        part = read(match, clock) if match else None
        if match and part:
            found = found.joined(replace(part, words=(match[0].strip(),)))
            spoken = f"{spoken[: match.start()]} {spoken[match.end() :]}"
    return found


def without(text: str, phrases: Sequence[str]) -> str:
    """A text without phrases that were understood otherwise; the text itself where nothing would be left."""
    left = text
    for phrase in phrases:
        pattern = r"\s+".join(re.escape(word) for word in phrase.split())
        left = re.sub(rf"\s*,?\s*{pattern}", "", left.replace("’", "'"), count=1, flags=re.IGNORECASE)
    return " ".join(left.split()) if re.search(r"\w", left) else text


def _about_seeing(spoken: str) -> bool:
    if _OBSERVED.search(spoken) and not re.search(r"\b(?:to see|let us see|want to|would like)\b", spoken):
        return True
    return bool(_ORDERED.search(spoken)) and not _WISHING.search(spoken)


Reader = Callable[[re.Match[str], Clock], Window | None]


def _day(moment: datetime) -> datetime:
    return moment.replace(hour=0, minute=0, second=0, microsecond=0)


def _days(clock: Clock, first: datetime, count: int = 1) -> Window:
    return Window(clock.seconds(first), clock.seconds(first + timedelta(days=count)))


def _within_day(clock: Clock, day: datetime, part: str | None) -> Window:
    if not part:
        return _days(clock, day)
    start, end = _PARTS[part]
    return Window(
        clock.seconds(day + timedelta(hours=start)),
        clock.seconds(day + timedelta(hours=end if end > start else end + 24)),
    )


def _relative_day(match: re.Match[str], clock: Clock) -> Window:
    since, back, part = match[1], {"yesterday": 1, "the day before yesterday": 2, "today": 0}[match[2]], match[3]
    found = _within_day(clock, _day(clock.moment) - timedelta(days=back), part)
    return _bounded(found, since)


def _bounded(span: Window, word: str | None) -> Window:
    """A span as what `since`, `until`, `before` or `after` it make of it."""
    if word in ("since", "from"):
        return Window(since=span.since)
    if word in ("after",):
        return Window(since=span.until if span.until != span.since else span.since)
    if word in ("before", "until", "till", "prior to", "by", "up to"):
        return Window(until=span.since)
    return span


def _stamp(text: str) -> Window:
    found = parse_time(text)
    return Window(found.start, found.end if found.end > found.start else found.start + 60)


def _one_stamp(match: re.Match[str], clock: Clock) -> Window | None:
    del clock
    try:
        return _bounded(_stamp(match[2]), match[1])
    except ValueError:
        return None


def _two_stamps(match: re.Match[str], clock: Clock) -> Window | None:
    del clock
    try:
        return Window(_stamp(match[1]).since, _stamp(match[2]).until)
    except ValueError:
        return None


def _date(match: re.Match[str], clock: Clock) -> Window | None:
    """`on 12 April 2025`, `since April 12`; without a year the last one there was."""
    word, day, month, year = (
        match["word"],
        match["day"] or match["day2"],
        match["month"] or match["month2"],
        match["year"],
    )
    number, now = _MONTHS[month], clock.moment
    try:
        when = _day(now).replace(year=int(year) if year else now.year, month=number, day=int(day))
    except ValueError:
        return None
    return _bounded(_days(clock, when if year or when <= now else when.replace(year=now.year - 1)), word)


def _month(match: re.Match[str], clock: Clock) -> Window | None:
    word, month, year, now = match[1], _MONTHS[match[2]], match[3], clock.moment
    start = _day(now).replace(year=int(year) if year else now.year, month=month, day=1)
    if not year and start > now:
        start = start.replace(year=now.year - 1)
    return _bounded(_days(clock, start, calendar.monthrange(start.year, start.month)[1]), word)


def _weekday(match: re.Match[str], clock: Clock) -> Window:
    back = (clock.moment.weekday() - _DAYS[match[2]]) % 7
    return _bounded(_days(clock, _day(clock.moment) - timedelta(days=back)), match[1])


def _ago(match: re.Match[str], clock: Clock) -> Window:
    """`two days ago` is that day, `three hours ago` the half hour before and after; `since … ago` from then on."""
    unit, count = match[3], _number(match[2])
    at = clock.now - count * _UNIT_S[unit]
    slack = {"second": 30.0, "minute": 60.0, "hour": 1800.0}.get(unit)
    if slack is not None:
        return _bounded(Window(at - slack, at + slack), match[1])
    day = _day(datetime.fromtimestamp(at, UTC) + clock.ahead)
    around = {"day": 0, "week": 3, "month": 15, "year": 180}[unit]
    return _bounded(_days(clock, day - timedelta(days=around), 2 * around + 1), match[1])


def _in_the_last(match: re.Match[str], clock: Clock) -> Window:
    return Window(since=clock.now - _number(match[1] or "one") * _UNIT_S[match[2]])


def _calendar(match: re.Match[str], clock: Clock) -> Window:
    """`this week`, `last month`: by the calendar."""
    last, unit, today = match[2] == "last", match[3], _day(clock.moment)
    if unit == "week":
        start = today - timedelta(days=today.weekday() + 7 * last)
        return _bounded(_days(clock, start, 7), match[1])
    first = today.replace(day=1) if unit == "month" else today.replace(month=1, day=1)
    before = (first - timedelta(days=1)).replace(day=1) if unit == "month" else first.replace(year=first.year - 1)
    after = (first + timedelta(days=32)).replace(day=1) if unit == "month" else first.replace(year=first.year + 1)
    span = (before, first) if last else (first, after)
    return _bounded(Window(clock.seconds(span[0]), clock.seconds(span[1])), match[1])


def _number(word: str) -> float:
    return float(word) if word.isdigit() else float(_COUNTS[word])


def _this_part(match: re.Match[str], clock: Clock) -> Window:
    day = _day(clock.moment)
    if match[1] == "last":  # last night: from the evening before
        day -= timedelta(days=1)
    return _within_day(clock, day, match[2])


def _part(match: re.Match[str], clock: Clock) -> Window:
    return Window(hours=clock.hours(*_PARTS[match[1]]))


def _hour(hour: str, minute: str | None, half: str | None) -> float | None:
    value = int(hour) + int(minute or 0) / 60
    if half and half[0] == "p" and value < 12:
        value += 12
    if half and half[0] == "a" and 12 <= value < 13:
        value -= 12
    return value if 0 <= value <= 24 and (half or minute) else None


def _clock_hour(match: re.Match[str], clock: Clock) -> Window | None:
    at = _hour(match[2], match[3], match[4])
    if at is None:
        return None
    if match[1] in ("before", "until", "till", "by"):
        return Window(hours=clock.hours(0, at))
    if match[1] in ("after", "since", "from"):
        return Window(hours=clock.hours(at, 24))
    slack = 0.5 if match[1] == "at" else 1.0
    return Window(hours=clock.hours(max(at - slack, 0), min(at + slack, 24)))


def _two_hours(match: re.Match[str], clock: Clock) -> Window | None:
    late = _hour(match[4], match[5], match[6])
    early = _hour(match[1], match[2], match[3] or match[6])
    if late is None or early is None:
        return None
    if early > late and match[6] and not match[3]:  # between 11 and 2 pm
        early = _hour(match[1], match[2], "am") or early
    return Window(hours=clock.hours(early, late))


def _visit(match: re.Match[str], clock: Clock) -> Window | None:
    """`on the first visit`; `since the first visit`: what was seen after it."""
    visit = _numbered(match[2], clock.visits)
    if visit is None or len(clock.visits) < 2:
        return None
    number, word = visit.number, match[1]
    after = clock.visits[number].start if number < len(clock.visits) else None
    if word in ("since", "after"):
        return Window(since=after if after is not None else visit.start)
    if word in ("before", "until", "prior to"):
        return Window(until=visit.start)
    return Window(visit.start, after)


def _numbered(word: str, visits: Sequence[Visit]) -> Visit | None:
    if not visits:
        return None
    if word in ("last", "latest", "newest", "most recent", "current", "this"):
        return visits[-1]
    if word in ("previous", "earlier", "penultimate"):
        return visits[-2] if len(visits) > 1 else None
    number = _ORDINALS.get(word, 0)
    return visits[number - 1] if 0 < number <= len(visits) else None


def _now(match: re.Match[str], clock: Clock) -> Window | None:
    del match
    return Window(since=clock.visits[-1].start) if len(clock.visits) > 1 else None


_BOUND = r"(since|after|before|until|till|prior to|by|up to|from)"
_WHICH = (
    r"(first|1st|second|2nd|third|3rd|fourth|4th|fifth|last|latest|newest|most recent|current|this|previous|earlier)"
)
# Rules in the order in which they are tried; what one has read is not read again.
_PLAIN: tuple[tuple[str, Reader], ...] = (
    (rf"\b(?:between|from) {_STAMP} (?:and|to|until) {_STAMP}", _two_stamps),
    (rf"\b(?:{_BOUND}|on|in|during|at) {_STAMP}", _one_stamp),
    (rf"\b(?:(since|after|before|until|prior to)|on|in|during|at|of|from)"
     rf"(?: the| our| your)? {_WHICH} {_VISIT_NOUN}\b", _visit),
    (rf"\b(?:(?P<word>since|after|before|until|till|from)|on)(?: the)? (?:(?P<day>\d{{1,2}})(?:st|nd|rd|th)?(?: of)? "
     rf"(?P<month>{_MONTH})|(?P<month2>{_MONTH}) (?P<day2>\d{{1,2}})"
     rf"(?:st|nd|rd|th)?)\b\.?(?:,? (?P<year>\d{{4}}))?", _date),
    (rf"\b(?:(since|after|before|until|till|from)|in) ({_MONTH}) (\d{{4}})\b", _month),
    (rf"\b(?:{_BOUND} )?(the day before yesterday|yesterday)(?: ({_PART}))?\b", _relative_day),
    (rf"\b(?:{_BOUND} )?{_COUNT} {_UNIT} ago\b", _ago),
    (r"\b(?:that (?:is|are) |which (?:is|are) )?(?:there now|here now|currently|at present|"
     r"at the moment|nowadays)\b", _now),
)  # fmt: skip
_OF_SEEING: tuple[tuple[str, Reader], ...] = (
    (rf"\b(?:(since|after|before|until|till|from)|in) ({_MONTH})()\b(?! \d)", _month),
    (rf"\b(?:in|within|during|over) the (?:last|past) (?:{_COUNT} )?{_UNIT}\b", _in_the_last),
    (rf"\b(?:{_BOUND} )?(this|last) (week|month|year)\b", _calendar),
    (rf"\b(?:{_BOUND} )?(today)(?: ({_PART}))?\b", _relative_day),
    (rf"\b(this|last) ({_PART})\b", _this_part),
    (rf"\b(?:{_BOUND} |on |last )(?:last )?({'|'.join(_DAYS)})\b", _weekday),
    (rf"\b(?:between|from) {_HOUR} (?:and|to|until) {_HOUR}", _two_hours),
    (rf"\b(before|after|since|until|till|by|at|around|about) {_HOUR}", _clock_hour),
    (rf"\b(?:in the|at|around|during the) ({_PART})\b", _part),
)  # fmt: skip
