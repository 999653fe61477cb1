"""GML text to records: tolerant of damage, bounded in depth and size, linear in time, evaluating nothing."""

from __future__ import annotations

import html.entities
import re
from dataclasses import dataclass, field
from typing import TypeAlias

from erag.data.files import Lines
from erag.data.reading import Issue
from erag.data.rows import EDGE_OUT, ROW_OUT, IssueLog, show

MAX_DEPTH = 32  # lists within lists
MAX_KEY = 100  # characters
MAX_VALUE = 100_000  # characters of one text; longer ones are cut
MAX_RECORD = 1_000_000  # values in one record
MAX_VALUES = 20_000_000  # values in one file
MAX_DAMAGE = 10_000  # damaged places after which the rest of a file is not read
_MAX_NUMBER = 100  # characters of one number
_LIST_START = "_networkx_list_start"  # what networkx writes before the only element of a list

# Possessive quantifiers: a token is taken or refused without going back, so no input makes this quadratic.
_TOKEN = re.compile(r'\s*+(?:("[^"]*+")|(\[)|(\])|(#[^\n]*+)|([^\s\[\]"]++)|("))')
_SYNC = re.compile(r"(?:^[ \t]*+|\]\s*+)((?:node|edge)\s*+\[)", re.MULTILINE)
_KEY = re.compile(r"[A-Za-z_][\w.\-]*+", re.ASCII)
_LAST_LINE_IS_KEY = re.compile(r"[ \t]*+[A-Za-z_][\w.\-]*+[ \t]++", re.ASCII)
_INTEGER = re.compile(r"[+-]?[0-9]++")
_REAL = re.compile(r"[+-]?(?:[0-9]++\.?[0-9]*+|\.[0-9]++)(?:[eE][+-]?[0-9]++)?")
_SPECIAL = re.compile(r"[+-]?(?:nan|inf|infinity)", re.IGNORECASE)
_ENTITY = re.compile(r"&(?:#([0-9]{1,7})|#[xX]([0-9A-Fa-f]{1,6})|([A-Za-z][A-Za-z0-9]{1,31}));")

GmlValue: TypeAlias = "int | float | str | GmlRecord"


@dataclass(frozen=True, slots=True)
class GmlRecord:
    """A list `key [ ... ]`: its key-value pairs in the order of the file, and the line it begins on."""

    line: int
    items: tuple[tuple[str, GmlValue], ...]

    def get(self, key: str) -> GmlValue | None:
        """The first value of `key`, or None."""
        return next((value for k, value in self.items if k == key), None)

    def all(self, key: str) -> tuple[GmlValue, ...]:
        """Every value of a repeated key in order, without the mark that networkx writes before a single one."""
        found = tuple(value for k, value in self.items if k == key)
        return found[1:] if found[:1] == (_LIST_START,) else found


@dataclass(frozen=True, slots=True)
class GmlGraph:
    """A parsed file: the attributes of the graph, and its node and edge records in the order of the file."""

    attributes: GmlRecord
    nodes: tuple[GmlRecord, ...]
    edges: tuple[GmlRecord, ...]
    issues: tuple[Issue, ...]


@dataclass(slots=True)
class _Open:
    """A list whose closing bracket has not come yet."""

    key: str
    line: int
    items: list[tuple[str, GmlValue]] = field(default_factory=list)


def parse(text: str, file: str) -> GmlGraph:
    """Parse GML text; `file` names it in issues.

    Damage (unclosed quotes and brackets, nesting beyond MAX_DEPTH, stray words, a file cut off) becomes an issue;
    the record it stands in is left out and parsing goes on at the next node or edge.
    """
    return _Parser(text, file).run()


def unescape(text: str) -> str:
    """`text` with HTML entities decoded once; what is no character stays as it is written."""
    return _ENTITY.sub(_character, text) if "&" in text else text


def _character(match: re.Match[str]) -> str:
    decimal, hexadecimal, name = match.groups()
    if name:
        return html.entities.html5.get(f"{name};", match[0])
    code = int(decimal) if decimal else int(hexadecimal, 16)
    return chr(code) if 0 < code <= 0x10FFFF and not 0xD800 <= code <= 0xDFFF else match[0]


class _Parser:
    """One pass over the text with an explicit stack: [top level, graph, record, nested lists ...]."""

    def __init__(self, text: str, file: str) -> None:
        self._text, self._pos, self._lines, self._log = text, 0, Lines(text), IssueLog(file)
        self._stack = [_Open("", 1)]
        self._key: str | None = None
        self._keys: dict[str, str] = {}
        self._record = 0  # index in the stack of the open node or edge, 0 if there is none
        self._values = self._damages = self._extra = self._bare = 0
        self._extra_at: int | None = None
        self._bare_at: tuple[int, str] | None = None
        self._nodes: list[GmlRecord] = []
        self._edges: list[GmlRecord] = []
        self._graph: list[tuple[str, GmlValue]] = []

    def run(self) -> GmlGraph:
        handlers = (self._text_value, self._begin, self._end, lambda _m: None, self._word, self._unclosed)
        while match := _TOKEN.match(self._text, self._pos):
            self._pos = match.end()
            handlers[(match.lastindex or 0) - 1](match)
        self._finish()
        attributes = GmlRecord(1, tuple(self._graph))
        return GmlGraph(attributes, tuple(self._nodes), tuple(self._edges), tuple(self._log.issues))

    def _text_value(self, match: re.Match[str]) -> None:
        value, start = match[1][1:-1], match.start(1)
        if self._key is None:
            return self._damage(f"text without a key: {show(value, 30)}", start)
        if "\n" in value and _LAST_LINE_IS_KEY.fullmatch(value, value.rfind("\n") + 1):
            return self._damage(f"the quote after {self._key!r} is not closed", start)
        if len(value) > MAX_VALUE:
            what = f"the text of {self._key!r} has {len(value):,} characters"
            self._log.add(self._lines.at(start), what, f"cut to {MAX_VALUE} characters")
            value = value[:MAX_VALUE]
        self._put(unescape(value), start)

    def _word(self, match: re.Match[str]) -> None:
        word, start = match[5], match.start(5)
        if self._key is None:
            if len(word) > MAX_KEY or not _KEY.fullmatch(word):
                return self._damage(f"{show(word, 30)} where a key should stand", start)
            self._key = self._keys.setdefault(word, word)  # one copy of each key
            return None
        if len(word) <= _MAX_NUMBER:
            if _INTEGER.fullmatch(word):
                return self._put(int(word), start)
            if _REAL.fullmatch(word) or _SPECIAL.fullmatch(word):
                return self._put(float(word), start)
        self._bare += 1
        self._bare_at = self._bare_at or (start, self._key)
        self._put(word[:MAX_VALUE], start)

    def _put(self, value: GmlValue, start: int) -> None:
        top = self._stack[-1]
        top.items.append((self._key or "", value))
        self._key = None
        self._values += 1
        if len(top.items) > MAX_RECORD and self._record:
            self._damage(f"more than {MAX_RECORD:,} values in one record", start)
        elif self._values > MAX_VALUES:
            self._damage(f"more than {MAX_VALUES:,} values in the file", start, stop=True)

    def _begin(self, match: re.Match[str]) -> None:
        key, start = self._key, match.start(2)
        if key is None:
            return self._damage("a bracket without a key", start)
        if len(self._stack) > MAX_DEPTH:
            return self._damage(f"lists nested deeper than {MAX_DEPTH}", start)
        if key in ("node", "edge"):
            if self._record:
                self._drop("a bracket is not closed", "")
            self._record = len(self._stack)
        self._stack.append(_Open(key, self._lines.at(start)))
        self._key = None

    def _end(self, match: re.Match[str]) -> None:
        if self._key is not None:
            return self._damage(f"the key {show(self._key, 30)} has no value", match.start(3))
        if len(self._stack) == 1:
            self._extra += 1
            self._extra_at = match.start(3) if self._extra_at is None else self._extra_at
            return
        closed = self._stack.pop()
        record = GmlRecord(closed.line, tuple(closed.items))
        if len(self._stack) == self._record:
            self._record = 0
            (self._nodes if closed.key == "node" else self._edges).append(record)
        elif len(self._stack) == 1 and closed.key == "graph":
            self._graph.extend(record.items)
        else:
            self._stack[-1].items.append((closed.key, record))

    def _unclosed(self, match: re.Match[str]) -> None:
        self._damage("a quote is not closed", match.start(6))

    def _damage(self, what: str, pos: int, stop: bool = False) -> None:
        """Report `what` at `pos`, leave out the record it stands in, go on at the next node or edge."""
        self._damages += 1
        sync = None if stop or self._damages > MAX_DAMAGE else _SYNC.search(self._text, pos)
        self._pos = sync.start(1) if sync else len(self._text)
        line = self._lines.at(pos)
        goes_on = f"reading went on at line {self._lines.at(self._pos)}" if sync else "the rest of the file left out"
        if self._record:
            self._drop(f"{what} (line {line})", f"; {goes_on}")
        else:
            self._log.add(line, what, goes_on)
            del self._stack[2 if len(self._stack) > 1 and self._stack[1].key == "graph" else 1 :]
        self._key = None

    def _drop(self, what: str, then: str) -> None:
        """Leave out the open record."""
        opened = self._stack[self._record]
        self._log.add(opened.line, what, f"{ROW_OUT if opened.key == 'node' else EDGE_OUT}{then}")
        del self._stack[self._record :]
        self._record = 0

    def _finish(self) -> None:
        if self._record:
            self._drop("the file ends inside this record", "")
        if len(self._stack) > 1:
            end = self._lines.at(len(self._text))
            self._log.add(end, f"the list {show(self._stack[1].key, 30)} is not closed", "read to the end of the file")
        if self._bare_at is not None:
            what = f"{self._bare} values without quotes, the first that of {self._bare_at[1]!r}"
            self._log.add(self._lines.at(self._bare_at[0]), what, "read as text")
        if self._extra_at is not None:
            what = f"{self._extra} closing brackets too many"
            self._log.add(self._lines.at(self._extra_at), what, "ignored")
        if len(self._stack) > 1 and self._stack[1].key == "graph":
            self._graph.extend(self._stack[1].items)
        self._graph.extend(item for item in self._stack[0].items)


def repeated(record: GmlRecord, keys: frozenset[str]) -> str | None:
    """The first of `keys` that the record states more than once, or None."""
    seen: set[str] = set()
    for key, _ in record.items:
        if key in seen and key in keys:
            return key
        seen.add(key)
    return None
