"""A table on a page: its title, what has to be said of it, columns and rows of text."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from erag.core.errors import printable


@dataclass(frozen=True)
class Sheet:
    """A table as text; `name` is that of its CSV file."""

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()


def heading(text: str, level: int = 2) -> list[str]:
    """A heading and the empty line after it."""
    return [f"{'#' * level} {text}", ""]


def sheet_lines(sheet: Sheet, level: int = 2) -> list[str]:
    """The sheet in Markdown, under a heading."""
    rule = "|".join("---" if i == 0 else "---:" for i in range(len(sheet.columns)))
    body = [_row(row) for row in sheet.rows]
    notes = [*sheet.notes, ""] if sheet.notes else []
    return [*heading(sheet.title, level), *notes, _row(sheet.columns), f"|{rule}|", *body, ""]


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(printable(cell, 400).replace("|", "\\|") for cell in cells) + " |"
