"""Questions with what a memory answered: what a page shows of queries."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from erag.core.errors import BadModelOutput, InputError
from erag.core.types import Query
from erag.data.contract import QueryLine, Result, parse_query
from erag.pipeline.query import Asker


@dataclass(frozen=True, slots=True)
class Asked:
    """A question and its result. `query` is None for a line that could not be asked; `text` is what it said."""

    text: str
    query: Query | None
    result: Result


def text_lines(texts: Sequence[str]) -> list[QueryLine]:
    """Texts as lines of a `Q.jsonl`."""
    return [QueryLine(i, f"ask {i}", {"id": f"ask {i}", "query": text}) for i, text in enumerate(texts, 1)]


def ask(asker: Asker, lines: Iterable[QueryLine], top: int = 5, at: Sequence[float] | None = None) -> Iterator[Asked]:
    """Ask a memory the lines in order; `at` is the robot's position where a line states none.

    A line that cannot be asked or answered has a result with `error`. Raises ModelError when the models cannot be
    loaded, whatever the lines.
    """
    for line in lines:
        yield _asked(asker, _placed(line, at), top)


def _asked(asker: Asker, line: QueryLine, top: int) -> Asked:
    query = None
    try:
        query = parse_query(line, top, asker.ground)
        return Asked(query.text or "", query, asker.ask(query))
    except (InputError, BadModelOutput) as error:
        return Asked(_said(line), query, Result(line.id, error=error.line()))


def _placed(line: QueryLine, at: Sequence[float] | None) -> QueryLine:
    if line.raw is None or at is None or line.raw.get("at") is not None:
        return line
    raw: dict[str, Any] = {**line.raw, "at": list(at)}
    return QueryLine(line.number, line.id, raw)


def _said(line: QueryLine) -> str:
    """What a line that cannot be asked asks, as far as it can be told."""
    said = None if line.raw is None else line.raw.get("query")
    return said if isinstance(said, str) else ""
