"""JSON of a hostile source: bounded, with line numbers, and with repeated keys told instead of overwritten."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from erag.data.files import Lines
from erag.data.rows import IssueLog

_SPACE = re.compile(r"[ \t\n\r]*+")


class JsonObject(dict[str, Any]):
    """A JSON object that remembers which of its keys were stated more than once."""

    repeated: tuple[str, ...] = ()


def _object(pairs: list[tuple[str, Any]]) -> JsonObject:
    made = JsonObject(pairs)
    if len(made) < len(pairs):
        made.repeated = tuple(key for key, n in Counter(key for key, _ in pairs).items() if n > 1)
    return made


_DECODER = json.JSONDecoder(object_pairs_hook=_object)


def loads(text: str) -> object:
    """The value of a JSON text. Raises ValueError, in one line, for all that is none, however deep or long."""
    try:
        return _DECODER.decode(text)
    except RecursionError:
        raise ValueError("nested too deep") from None
    except json.JSONDecodeError as error:
        raise ValueError(f"{error.msg} at character {error.pos + 1}") from None
    except ValueError:
        raise ValueError("a whole number with too many digits") from None


def repeated(value: object) -> str | None:
    """A key that the object, or an object directly in it, states more than once; None if there is none."""
    if not isinstance(value, JsonObject):
        return None
    inner = (v.repeated for v in value.values() if isinstance(v, JsonObject))
    return next((key for keys in (value.repeated, *inner) for key in keys), None)


@dataclass(frozen=True, slots=True)
class Item:
    """An element of a section of a JSON document: the line it begins on, its key if it has one, its value."""

    line: int
    key: str | None
    value: object


def sections(text: str, log: IssueLog) -> dict[str, list[Item]]:
    """The elements of the arrays and objects that a document's object holds, by its keys; "" for a document's array.

    A damaged document gives what stands before the damage, which is reported.
    """
    walk = _Walk(text)
    found: dict[str, list[Item]] = {}
    try:
        walk.document(found)
    except RecursionError:
        _report(walk, "nested too deep", log)
    except json.JSONDecodeError as error:
        walk.pos = min(error.pos, len(text))
        _report(walk, error.msg, log)
    except ValueError:
        _report(walk, "a whole number with too many digits", log)
    return found


def _report(walk: _Walk, what: str, log: IssueLog) -> None:
    line = walk.lines.at(walk.pos)
    log.add(line, f"damaged JSON: {what}", f"the rest of the file left out, from line {line}")


class _Walk:
    """A position in a JSON text that is read element by element, so that every element has a line."""

    def __init__(self, text: str) -> None:
        self.text, self.pos, self.lines = text, 0, Lines(text)

    def document(self, found: dict[str, list[Item]]) -> None:
        if self._peek() == "[":
            self._elements(found.setdefault("", []))
        elif self._peek() == "{":
            for key in self._members():
                begin = self._peek()
                target = found.setdefault(key, [])
                if begin in ("[", "{"):
                    self._elements(target)
                else:
                    target.append(self._item(None))
        else:
            raise json.JSONDecodeError("neither an object nor an array", self.text, self.pos)

    def _elements(self, items: list[Item]) -> None:
        if self._peek() == "{":
            for key in self._members():
                items.append(self._item(key))
        else:
            for _ in self._until("]"):
                items.append(self._item(None))

    def _members(self) -> Iterator[str]:
        """The keys of the object at the position; the caller takes each value before it asks for the next key."""
        for _ in self._until("}"):
            if self._peek() != '"':
                raise json.JSONDecodeError("a key in quotes should stand here", self.text, self.pos)
            key, self.pos = _DECODER.raw_decode(self.text, self.pos)
            self._take(":")
            yield key

    def _until(self, close: str) -> Iterator[None]:
        """Once for each element of the array or object at the position."""
        self._take(self._peek())
        if self._peek() != close:
            yield
            while self._peek() == ",":
                self._take(",")
                yield
        self._take(close)

    def _item(self, key: str | None) -> Item:
        self._peek()
        line = self.lines.at(self.pos)
        value, self.pos = _DECODER.raw_decode(self.text, self.pos)
        return Item(line, key, value)

    def _peek(self) -> str:
        match = _SPACE.match(self.text, self.pos)
        self.pos = match.end() if match else self.pos
        return self.text[self.pos : self.pos + 1]

    def _take(self, char: str) -> None:
        if self._peek() != char:
            raise json.JSONDecodeError(f"{char!r} should stand here", self.text, self.pos)
        self.pos += 1
