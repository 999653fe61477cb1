"""JSON schemas as trees of values to be written; a keyword is obeyed or refused."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from erag.core.errors import ConfigError

MAX_STRING, MAX_ITEMS, MAX_DIGITS = 400, 16, 9  # where the schema says nothing
MAX_DEPTH = 16
_NOTES = frozenset({"title", "description", "$schema", "default", "examples"})
_KEYWORDS: Mapping[str, frozenset[str]] = {
    "object": frozenset({"properties", "required", "additionalProperties"}),
    "array": frozenset({"items", "minItems", "maxItems"}),
    "string": frozenset({"minLength", "maxLength"}),
    "integer": frozenset({"minimum", "maximum"}),
    "number": frozenset(),
    "boolean": frozenset(),
    "null": frozenset(),
}


@dataclass(frozen=True, slots=True)
class Text:
    """A string of `low` to `high` characters."""

    low: int
    high: int


@dataclass(frozen=True, slots=True)
class Options:
    """One of some values, each as JSON."""

    values: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Number:
    """A number of at most MAX_DIGITS digits: an integer between bounds (None: no bounds), or with a `fraction`."""

    low: int | None
    high: int | None
    fraction: bool


@dataclass(frozen=True, slots=True)
class Items:
    """An array of `low` to `high` equal items."""

    item: Node
    low: int
    high: int


@dataclass(frozen=True, slots=True)
class Fields:
    """An object: each key as JSON, and its value. All are written, in this order."""

    fields: tuple[tuple[str, Node], ...]


@dataclass(frozen=True, slots=True)
class AnyOf:
    """One of some kinds of values that begin with different characters."""

    options: tuple[Node, ...]


Node = Text | Options | Number | Items | Fields | AnyOf


def compile_schema(schema: Mapping[str, Any]) -> Node:
    """The tree of a schema.

    Objects, arrays (minItems, maxItems), strings (minLength, maxLength), integers (minimum, maximum), numbers,
    booleans, null, enum, const, and anyOf of kinds that differ in their first character. Raises ConfigError for any
    other keyword, and for bounds that no value meets.
    """
    return _node(schema, "schema", 0)


def openers(node: Node) -> frozenset[str]:
    """The characters a value can begin with."""
    if isinstance(node, Options):
        return frozenset(value[0] for value in node.values)
    if isinstance(node, AnyOf):
        return frozenset().union(*map(openers, node.options))
    if isinstance(node, Number):
        return frozenset("-0123456789")
    return frozenset({Text: '"', Items: "[", Fields: "{"}[type(node)])


def literal(value: Any) -> str:
    """A value as JSON, written as the code writes it everywhere."""
    return json.dumps(value, ensure_ascii=False)


def _node(schema: Any, where: str, depth: int) -> Node:
    if not isinstance(schema, Mapping) or depth > MAX_DEPTH:
        allowed = f"an object, at most {MAX_DEPTH} in each other"
        raise ConfigError("not a schema, or nested too deeply", where=where, allowed=allowed)
    if "anyOf" in schema:
        return _any_of(schema, where, depth)
    if "const" in schema or "enum" in schema:
        return _options(schema, where)
    kind = schema.get("type")
    if not isinstance(kind, str) or kind not in _KEYWORDS:
        raise ConfigError(f"unknown type {kind!r}", where=where, allowed=", ".join(_KEYWORDS))
    _refuse_others(schema, _KEYWORDS[kind] | {"type"}, where)
    return _typed(kind, schema, where, depth)


def _typed(kind: str, schema: Mapping[str, Any], where: str, depth: int) -> Node:
    if kind == "object":
        return _fields(schema, where, depth)
    if kind == "array":
        low, high = _bounds(schema, "minItems", "maxItems", MAX_ITEMS, where)
        return Items(_node(schema.get("items", {}), f"{where}[]", depth + 1), low, high)
    if kind == "string":
        return Text(*_bounds(schema, "minLength", "maxLength", MAX_STRING, where))
    if kind == "integer":
        return _integer(schema, where)
    if kind == "number":
        return Number(None, None, fraction=True)
    return Options(("null",) if kind == "null" else ("true", "false"))


def _options(schema: Mapping[str, Any], where: str) -> Options:
    _refuse_others(schema, frozenset({"const", "enum", "type"}), where)
    values = [schema["const"]] if "const" in schema else list(schema["enum"])
    if not values:
        raise ConfigError("an enum without values", where=where)
    return Options(tuple(dict.fromkeys(map(literal, values))))


def _any_of(schema: Mapping[str, Any], where: str, depth: int) -> AnyOf:
    _refuse_others(schema, frozenset({"anyOf"}), where)
    options = tuple(_node(option, f"{where}.anyOf", depth + 1) for option in schema["anyOf"])
    begun = [c for option in options for c in openers(option)]
    if not options or len(set(begun)) < len(begun):
        raise ConfigError("kinds that begin alike in anyOf", where=where, allowed="kinds that begin differently")
    return AnyOf(options)


def _fields(schema: Mapping[str, Any], where: str, depth: int) -> Fields:
    if schema.get("additionalProperties", False) is not False:
        raise ConfigError("additionalProperties", where=where, allowed="false or absent")
    properties = schema.get("properties", {})
    if unknown := sorted(set(schema.get("required", ())) - set(properties)):
        raise ConfigError(f"required property {unknown[0]!r} is not described", where=where)
    return Fields(tuple((literal(key), _node(value, f"{where}.{key}", depth + 1)) for key, value in properties.items()))


def _integer(schema: Mapping[str, Any], where: str) -> Number:
    low, high, most = schema.get("minimum"), schema.get("maximum"), 10**MAX_DIGITS - 1
    for bound in (low, high):
        if bound is not None and (not isinstance(bound, int) or abs(bound) > most):
            raise ConfigError(f"bound {bound!r}", where=where, allowed=f"integers of at most {MAX_DIGITS} digits")
    if low is not None and high is not None and low > high:
        raise ConfigError(f"minimum {low} is above maximum {high}", where=where)
    return Number(-most if low is None else low, most if high is None else high, fraction=False)


def _bounds(schema: Mapping[str, Any], least: str, most: str, usual: int, where: str) -> tuple[int, int]:
    low = schema.get(least, 0)
    high = schema.get(most, max(usual, low) if isinstance(low, int) else usual)
    if not isinstance(low, int) or not isinstance(high, int) or not 0 <= low <= high:
        raise ConfigError(f"{least} {low!r}, {most} {high!r}", where=where, allowed="integers, 0 or more, in order")
    return low, high


def _refuse_others(schema: Mapping[str, Any], known: frozenset[str], where: str) -> None:
    if unknown := sorted(set(schema) - known - _NOTES):
        raise ConfigError(f"schema keyword {unknown[0]!r}", where=where, allowed=", ".join(sorted(known)))
