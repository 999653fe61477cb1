"""Stamps to intervals and back."""

import math
from datetime import UTC, datetime

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from erag.core.times import format_time, parse_interval, parse_time
from erag.core.types import Interval

FIRST, END = -62_135_596_800, 253_402_300_800  # years 1 to 9999
MICROSECONDS = st.integers(FIRST * 10**6, (END - 1) * 10**6)


def utc(*parts: int) -> float:
    return datetime(*parts, tzinfo=UTC).timestamp()


@pytest.mark.parametrize(
    ("stamp", "start", "end"),
    [
        ("2024", utc(2024, 1, 1), utc(2025, 1, 1)),
        ("2023-12", utc(2023, 12, 1), utc(2024, 1, 1)),
        ("2024-02", utc(2024, 2, 1), utc(2024, 3, 1)),
        ("2023-02", utc(2023, 2, 1), utc(2023, 3, 1)),
        ("2024-02-29", utc(2024, 2, 29), utc(2024, 3, 1)),
        ("1969-12-31", -86_400.0, 0.0),
        ("0001", FIRST, utc(2, 1, 1)),
        ("9999", utc(9999, 1, 1), END),
        ("9999-12", utc(9999, 12, 1), END),
        ("9999-12-31", utc(9999, 12, 31), END),
        ("2024-05-17T09:30:00Z", utc(2024, 5, 17, 9, 30), None),
        ("2024-05-17t09:30:00z", utc(2024, 5, 17, 9, 30), None),
        ("2024-05-17 09:30", utc(2024, 5, 17, 9, 30), None),
        ("2024-05-17T09:30:00", utc(2024, 5, 17, 9, 30), None),
        ("2024-05-17T09:30:00+02:00", utc(2024, 5, 17, 7, 30), None),
        ("2024-05-17T00:30:00+05:45", utc(2024, 5, 16, 18, 45), None),
        ("2024-05-17T09:30:00.25-01:00", utc(2024, 5, 17, 10, 30) + 0.25, None),
        (" 2024-05 \n", utc(2024, 5, 1), utc(2024, 6, 1)),
    ],
)
def test_stamps_mean_intervals(stamp: str, start: float, end: float | None) -> None:
    assert parse_time(stamp) == Interval(start, start if end is None else end)


@pytest.mark.parametrize(
    "stamp",
    [
        "", " ", "now", "20", "999", "10000", "0000", "0000-01", "2024-00", "2024-13", "2024-1", "2024-02-30",
        "2023-02-29", "2024-05-00", "2024-05-17T", "2024-05-17T24:00:00Z", "2024-05-17T09:60:00Z",
        "2016-12-31T23:59:60Z", "1e20", "100000000000000000000", "-2024", "+2024", "nan", "inf", "20240517",
        "2024-W01", "2024-W01-5", "2024-138", "2024-05-17x09:30", "2024-05-17T09:30:00+25:00",
        "2024-05-17T09:30:00 UTC", "0001-01-01T00:00:00+14:00", "9999-12-31T23:59:59-12:00", "２０２４",
        "2024-05-17T09:30:00." + "9" * 10**5, "2024\x00", "20241120_182831", "2024-05-17T09:30:00Z; drop",
        "2024/05", "17.5.2024",
    ],
)  # fmt: skip
def test_malformed_stamps_are_refused(stamp: str) -> None:
    with pytest.raises(ValueError, match="is no time") as raised:
        parse_time(stamp)
    assert "2024-05-17T09:30:00Z" in str(raised.value)
    assert len(str(raised.value)) < 400
    assert str(raised.value).isprintable()


@given(st.text(max_size=30))
def test_any_text_is_a_time_or_a_value_error(text: str) -> None:
    try:
        interval = parse_time(text)
    except ValueError:
        return
    assert FIRST <= interval.start <= interval.end <= END


@given(MICROSECONDS)
@example(1_571_636_004_579_869)
@example(-1)
def test_instants_survive_the_round_trip(microseconds: int) -> None:
    instant = Interval(microseconds / 1e6, microseconds / 1e6)
    assert parse_time(format_time(instant)) == instant
    assert parse_interval(format_time(instant)) == instant


@given(MICROSECONDS, MICROSECONDS)
@example(0, 86_400 * 10**6)
@example(FIRST * 10**6, 0)
def test_intervals_survive_the_round_trip(a: int, b: int) -> None:
    interval = Interval(min(a, b) / 1e6, max(a, b) / 1e6)
    assert parse_interval(format_time(interval)) == interval


@given(st.dates(), st.sampled_from([4, 7, 10]))
def test_the_shortest_stamp_is_written(day: object, length: int) -> None:
    stamp = str(day)[:length]
    assert format_time(parse_time(stamp)) == stamp
    assert parse_interval(stamp) == parse_time(stamp)


def test_what_is_no_day_month_or_year_is_written_with_both_ends() -> None:
    assert format_time(Interval(0, 2 * 86_400)) == "1970-01-01T00:00:00Z/1970-01-03T00:00:00Z"
    assert format_time(Interval(0.5, 0.5)) == "1970-01-01T00:00:00.500000Z"
    assert parse_interval("2024-05/2024-07") == Interval(utc(2024, 5, 1), utc(2024, 7, 1))


@pytest.mark.parametrize("seconds", [1e20, -1e20, 1e300, float(END) + 1, FIRST - 1.0, 4e11])
def test_moments_beyond_the_calendar_have_no_stamp(seconds: float) -> None:
    with pytest.raises(ValueError):
        format_time(Interval(seconds, seconds))
    with pytest.raises(ValueError):
        format_time(Interval(min(seconds, 0.5), max(seconds, 0.5)))


def test_the_end_of_the_last_year_can_end_an_interval() -> None:
    whole = Interval(0.5, float(END))
    assert format_time(whole).endswith("/9999-12-31T23:59:59Z")
    assert parse_interval(format_time(whole)).end == pytest.approx(END)


@pytest.mark.parametrize("stamp", ["/", "2024/", "/2024", "2024-01/2023-01", "2024/2025/2026", "a/b"])
def test_malformed_intervals_are_refused(stamp: str) -> None:
    with pytest.raises(ValueError):
        parse_interval(stamp)


def test_microseconds_of_a_recorder_are_kept() -> None:
    at = 1_571_636_004_579_869 / 1e6
    assert format_time(Interval(at, at)) == "2019-10-21T05:33:24.579869Z"
    assert math.isclose(parse_time("2019-10-21T05:33:24.579869Z").start, at, abs_tol=5e-7)
