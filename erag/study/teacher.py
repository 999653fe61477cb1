"""What a teacher names for many wishes, kept line by line: a run that is killed goes on where it was."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from erag.core.errors import BadModelOutput, InputError
from erag.core.progress import Progress, quiet
from erag.lm.roles import LMBackend
from erag.retrieve.config import ExpandConfig
from erag.retrieve.expand import Expander

_BLOCK = 8  # wishes asked together and written together
_MAX_LINE = 1 << 16


@dataclass(frozen=True, slots=True)
class Taught:
    """A wish, the number of its need, and what the teacher named for it, most fitting first (none: it failed)."""

    need: int
    wish: str
    things: tuple[str, ...]


def taught(
    teacher: LMBackend, wishes: Sequence[tuple[int, str]], path: Path, things: int, progress: Progress = quiet
) -> list[Taught]:
    """What the teacher names for each wish, asking only for those that `path` does not hold yet.

    A wish for which it names nothing is kept as such and not asked again. Raises InputError for a damaged file, and
    for one that another teacher wrote.
    """
    stamp = json.dumps({"teacher": teacher.identity("generate"), "things": things}, sort_keys=True)
    known = _read(path, stamp)
    missing = [(need, wish) for need, wish in wishes if wish not in known]
    expander = Expander(teacher, ExpandConfig(things=things))
    for start in range(0, len(missing), _BLOCK):
        progress("teacher", start, len(missing))
        block = missing[start : start + _BLOCK]
        named = named_by(expander, [wish for _, wish in block])
        fresh = {wish: Taught(need, wish, found) for (need, wish), found in zip(block, named, strict=True)}
        _append(path, stamp, list(fresh.values()))
        known |= fresh
    progress("teacher", len(missing), len(missing))
    return [Taught(need, wish, known[wish].things) for need, wish in wishes]


def named_by(expander: Expander, wishes: Sequence[str]) -> list[tuple[str, ...]]:
    """The things of each wish; where one of a block fails, each is asked alone."""
    try:
        return expander.things(wishes)
    except BadModelOutput:
        if len(wishes) == 1:
            return [()]
        return [named_by(expander, [wish])[0] for wish in wishes]


def _append(path: Path, stamp: str, rows: Sequence[Taught]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = [] if path.is_file() else [stamp]
    lines += [json.dumps({"need": r.need, "wish": r.wish, "things": r.things}, ensure_ascii=False) for r in rows]
    with path.open("a", encoding="utf-8") as file:
        file.write("".join(f"{line}\n" for line in lines))


def _read(path: Path, stamp: str) -> dict[str, Taught]:
    """The rows of a file; a last line cut short by a kill is dropped from it."""
    if not path.is_file():
        return {}
    text = path.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        path.write_text(whole, encoding="utf-8")
    head, *lines = whole.splitlines() or [stamp]
    if head != stamp:
        raise InputError("was written by another teacher", where=str(path), allowed=stamp, repair=f"remove {path}")
    rows = [_row(line, f"{path}:{number}") for number, line in enumerate(lines, 2)]
    return {row.wish: row for row in rows}


def _row(line: str, where: str) -> Taught:
    try:
        if len(line) > _MAX_LINE:
            raise ValueError("too long")
        raw = json.loads(line)
        return Taught(int(raw["need"]), str(raw["wish"]), tuple(map(str, raw["things"])))
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"no row of a teacher: {error}", where=where, repair="remove this line") from error
