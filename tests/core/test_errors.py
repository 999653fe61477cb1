"""Errors are one printable line."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.core import errors
from erag.core.errors import EragError, InputError, MemoryFileError, MemoryLocked, printable


def test_the_line_says_what_where_allowed_and_repair() -> None:
    error = InputError("latitude 95", where="map.gml:12", allowed="-90 to 90", repair="erag ingest --swap")
    assert str(error) == "map.gml:12: latitude 95; allowed: -90 to 90; try: erag ingest --swap"
    assert str(InputError("no nodes")) == "no nodes"


def test_every_error_can_be_caught_as_one() -> None:
    found = [e for e in vars(errors).values() if isinstance(e, type) and issubclass(e, Exception)]
    assert len(found) > 5
    assert all(issubclass(e, EragError) for e in found)
    assert issubclass(MemoryLocked, MemoryFileError)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("two\nlines\r\n", "two\\nlines\\r\\n"),
        ("\x1b[31mred\x1b[0m", "\\x1b[31mred\\x1b[0m"),
        ("\x07\x00", "\\x07\\x00"),
        ("evil\u202etxt.exe", "evil\\u202etxt.exe"),
        ("\u2028\ufeff", "\\u2028\\ufeff"),
        ("\ud83d", "\\ud83d"),
        ("Käse 長椅 'q' \"d\" \\", "Käse 長椅 'q' \"d\" \\"),
    ],
)
def test_hostile_text_is_made_visible(text: str, shown: str) -> None:
    assert printable(text) == shown


@given(st.text(), st.integers(1, 40))
def test_printable_text_is_one_short_line(text: str, limit: int) -> None:
    shown = printable(text, limit)
    assert shown.isprintable()
    assert len(shown) <= limit
    assert shown == text or not text.isprintable() or (len(text) > limit and shown.endswith("…"))


def test_a_hostile_value_cannot_break_the_line() -> None:
    line = str(InputError("bad id 'a\nb\x1b[2J'", where="x\ny", allowed="\t", repair="z" * 10_000))
    assert line.isprintable()
    assert len(line) == 600
