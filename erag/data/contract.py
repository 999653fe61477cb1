"""The public contract of queries and results: lines of `Q.jsonl` in, lines of `RUN.jsonl` out."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from erag.core.errors import InputError
from erag.core.times import FORMS, parse_time
from erag.core.types import Answer, Hit, Pose, Query, QueryKind, Range, Route, SensorWish, Waypoint

KINDS: Mapping[str, QueryKind] = {
    "find": "find", "explicit": "find", "implicit": "find", "explain": "explain", "global": "explain",
}  # fmt: skip
MAX_QUERY = 2000  # characters
MAX_NUMBER = 1e300  # also keeps out integers no float can hold
Ground = Callable[[float, float], float]  # z of the map at (x, y), for positions given without one


@dataclass(frozen=True, slots=True)
class QueryLine:
    """One line of a `Q.jsonl`: its number, id, and what it says, or None where it is not a JSON object."""

    number: int
    id: str
    raw: Mapping[str, Any] | None


@dataclass(frozen=True, slots=True)
class Result:
    """One line of a `RUN.jsonl`: `seconds` without loading, `visited` rows scored, `calls` computed by role."""

    id: str
    hits: tuple[Hit, ...] = ()
    answer: Answer | None = None
    seconds: float = 0.0
    visited: int = 0
    calls: Mapping[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    error: str | None = None


def read_queries(path: Path, where: Mapping[str, str]) -> Iterator[QueryLine]:
    """The lines of a `Q.jsonl` whose keys have the values `where` asks for; blank lines are skipped.

    A line that is not a JSON object is always returned, with raw None, so that it is answered by an error.
    """
    if path.exists() and not path.is_file():
        raise InputError("is not a regular file", where=str(path), allowed="a file of queries")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise InputError(
            "no such file", where=str(path), allowed="a file of queries, one JSON object a line"
        ) from error
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"cannot be read: {error}", where=str(path), allowed="UTF-8 text, a JSON object a line"
        ) from error
    for number, line in enumerate(text.split("\n"), 1):
        if line.strip():
            parsed = _parse_line(number, line)
            if parsed.raw is None or all(str(parsed.raw.get(k)) == v for k, v in where.items()):
                yield parsed


def parse_query(line: QueryLine, top: int, ground: Ground, where: str | None = None) -> Query:
    """The query of a line. Raises InputError that names the line (or `where`), the key and what is allowed."""
    raw, where = line.raw, where or f"line {line.number}"
    if raw is None:
        raise InputError("not a JSON object", where=where, allowed='{"id": …, "query": …}')
    if not isinstance(raw.get("id"), str | int) or raw["id"] == "" or not _encodable(line.id):
        raise InputError(f"id is {raw.get('id')!r}", where=where, allowed="a text")
    text = parse_text(raw.get("query"), where)
    at = parse_at(raw["at"], where, ground) if raw.get("at") is not None else None
    if text is None and at is None:
        raise InputError("neither query nor at", where=where, allowed="at least one of them")
    kind = raw.get("kind")
    if kind is not None and (not isinstance(kind, str) or kind not in KINDS):
        raise InputError(f"kind is {kind!r}", where=where, allowed=", ".join(KINDS))
    since, until = parse_window(raw.get("since"), raw.get("until"), where)
    sensors = _sensors(raw.get("sensor"), where)
    hours, now = parse_hours(raw.get("hours"), where), _moment("now", raw.get("now"), where)
    return Query(text, at, sensors, since, until, top, KINDS[kind] if kind else None, line.id, hours, now)


def parse_text(value: Any, where: str) -> str | None:
    """The text of a query; None where there is none."""
    if value is None:
        return None
    if not isinstance(value, str) or not value.strip() or len(value) > MAX_QUERY or not _encodable(value):
        shown = value if not isinstance(value, str) or len(value) < 80 else f"{value[:60]}… ({len(value)} characters)"
        raise InputError(f"query is {shown!r}", where=where, allowed=f"a text of 1 to {MAX_QUERY} characters")
    return value.strip()


def parse_at(value: Any, where: str, ground: Ground) -> Pose:
    """A position [x, y] or [x, y, z] in the map's frame."""
    if not isinstance(value, list | tuple) or len(value) not in (2, 3) or not all(map(_is_number, value)):
        raise InputError(f"at is {value!r}", where=where, allowed="[x, y] or [x, y, z], finite, in the map's frame")
    x, y = float(value[0]), float(value[1])
    return Pose(x, y, float(value[2]) if len(value) == 3 else ground(x, y))


def parse_window(since: Any, until: Any, where: str) -> tuple[float | None, float | None]:
    """[since, until) in UTC seconds; a coarse stamp stands for its first moment."""
    start, end = (_moment(name, value, where) for name, value in (("since", since), ("until", until)))
    if start is not None and end is not None and start >= end:
        raise InputError(f"since {since!r} is not before until {until!r}", where=where, allowed="since < until")
    return start, end


def parse_hours(value: Any, where: str) -> Range | None:
    """Hours of the day [from, to) in UTC, over midnight where from > to; None where there are none."""
    if value is None:
        return None
    if isinstance(value, list | tuple) and len(value) == 2 and all(_is_number(v) and 0 <= v <= 24 for v in value):
        first, last = float(value[0]), float(value[1])
        if first != last:
            return (first, last)
    raise InputError(f"hours is {value!r}", where=where, allowed="[from, to], two different hours from 0 to 24")


def parse_wish(name: str, value: Any, where: str) -> SensorWish:
    """What is wished of a sensor: `low`, `high` or a range."""
    if value == "low" or value == "high":
        return "low" if value == "low" else "high"
    if isinstance(value, list | tuple) and len(value) == 2:
        low, high = value
        if _is_number(low) and _is_number(high) and low <= high:
            return (float(low), float(high))
    raise InputError(f"sensor {name} is {value!r}", where=where, allowed="low, high or [min, max]")


def result_line(result: Result) -> str:
    """A result as one line of JSON, without the line's end."""
    answer = result.answer
    record = {
        "id": result.id,
        "hits": [_hit(h) for h in result.hits],
        "answer": None if answer is None else _answer(answer),
        "seconds": round(result.seconds, 6),
        "visited": result.visited,
        "calls": dict(result.calls),
        "notes": list(result.notes),
    }
    return json.dumps(record if result.error is None else {**record, "error": result.error}, ensure_ascii=False)


def _parse_line(number: int, line: str) -> QueryLine:
    try:
        raw = json.loads(line)
    except (ValueError, RecursionError):
        raw = None
    if not isinstance(raw, dict):
        return QueryLine(number, f"line {number}", None)
    id_ = raw.get("id")
    return QueryLine(number, str(id_) if isinstance(id_, str | int) and id_ != "" else f"line {number}", raw)


def _encodable(text: str) -> bool:
    """Whether a text from JSON has no half of a surrogate pair, which no file can hold."""
    return text.encode("utf-8", "ignore").decode() == text


def _is_number(value: Any) -> bool:
    """Whether a JSON value is a number that fits a float."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) < MAX_NUMBER


def _moment(name: str, value: Any, where: str) -> float | None:
    if value is None:
        return None
    try:
        return parse_time(value).start
    except (ValueError, TypeError, AttributeError, OverflowError) as error:
        raise InputError(f"{name} is {value!r}", where=where, allowed=FORMS) from error


def _sensors(value: Any, where: str) -> dict[str, SensorWish]:
    if value is None:
        return {}
    if not isinstance(value, dict):
        raise InputError(f"sensor is {value!r}", where=where, allowed='{"ndvi": "low" | "high" | [min, max]}')
    return {str(name): parse_wish(str(name), wish, where) for name, wish in value.items()}


def _hit(h: Hit) -> dict[str, Any]:
    parts = {"semantic": h.semantic, "spatial": h.spatial, "sensor": h.sensor}
    return {"node": h.node, "position": list(h.position), "score": h.score, **parts, "path": list(h.path)}


def _answer(a: Answer) -> dict[str, Any]:
    return {
        "kind": a.kind, "text": a.text, "reason": a.reason, "waypoint": _waypoint(a.waypoint),
        "route": _route(a.route), "evidence": list(a.evidence),
    }  # fmt: skip


def _waypoint(w: Waypoint | None) -> dict[str, Any] | None:
    if w is None:
        return None
    return {"node": w.node, "frame": w.frame.value, "position": list(w.position), "yaw": w.yaw}


def _route(r: Route | None) -> dict[str, Any] | None:
    if r is None:
        return None
    return {"status": r.status, "nodes": list(r.nodes), "length_m": r.length_m, "bridges": r.bridges}
