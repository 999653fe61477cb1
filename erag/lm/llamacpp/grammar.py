"""JSON schemas as grammars (GBNF) under which every text is short and valid, and the check of what came out.

llama.cpp's own converter is not used: it lets `minimum` and `maximum` pass unseen, knows no limit for white space, and
admits escapes that are no text (\\ud800). Here a keyword is obeyed or refused.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from erag.core.errors import BadModelOutput, ConfigError

MAX_STRING = 400  # characters where the schema says nothing
MAX_ITEMS = 16
MAX_DIGITS = 9
MAX_RANGE = 1000  # integers between two bounds
_REPEATS = 1000  # llama.cpp refuses more than 2000 in one
_MAX_DEPTH = 16

Schema = Mapping[str, Any]
_NOTES = frozenset({"title", "description", "$schema", "default", "examples"})
_KEYWORDS = {
    "object": {"properties", "required", "additionalProperties"},
    "array": {"items", "minItems", "maxItems"},
    "string": {"minLength", "maxLength"},
    "integer": {"minimum", "maximum"},
    "number": set(),
    "boolean": set(),
    "null": set(),
}
_PRIMITIVES = {"boolean": '("true" | "false")', "null": '"null"', "number": "number"}
_SHARED = (
    r'char ::= [^"\\\x00-\x1F\x7F\u0080-\u009F\u2028\u2029] | "\\" ["\\]',
    f'whole ::= "0" | [1-9] [0-9]{{0,{MAX_DIGITS - 1}}}',
    'number ::= "-"? whole ("." [0-9]{1,6})?',
)


def to_grammar(schema: Schema) -> str:
    """The grammar of a schema; every property is written, in the schema's order.

    Objects, arrays (minItems, maxItems), strings (minLength, maxLength), integers (both bounds or none), numbers,
    booleans, null, enum, const and anyOf. Strings and arrays without an upper bound get MAX_STRING and MAX_ITEMS.
    Raises ConfigError for any other keyword.
    """
    return "\n".join((f"root ::= {_rule(schema, 'schema', 0)}", *_SHARED))


def parse(schema: Schema, text: str) -> Any:
    """The value of a text. Raises BadModelOutput when it is not JSON of this schema."""
    try:
        value = json.loads(text)
    except ValueError as error:
        raise BadModelOutput(f"{text[:80]!r} is not JSON ({error})", allowed="JSON of the schema") from error
    where = mismatch(schema, value)
    if where:
        raise BadModelOutput(f"{text[:80]!r} does not meet the schema at {where}", allowed="JSON of the schema")
    return value


def mismatch(schema: Schema, value: Any, where: str = "$") -> str | None:
    """Where a value departs from a schema of the kind `to_grammar` takes; None when it does not."""
    if "anyOf" in schema:
        return None if any(mismatch(option, value) is None for option in schema["anyOf"]) else where
    if "const" in schema or "enum" in schema:
        return None if _literal(value) in map(_literal, _choices(schema)) else where
    kind = schema.get("type")
    if kind == "object":
        return _object_mismatch(schema, value, where)
    if kind == "array":
        if not isinstance(value, list) or not schema.get("minItems", 0) <= len(value) <= _most(schema, "maxItems"):
            return where
        parts = (mismatch(schema["items"], item, f"{where}[{i}]") for i, item in enumerate(value))
        return next((part for part in parts if part), None)
    if kind == "string":
        good = isinstance(value, str) and schema.get("minLength", 0) <= len(value) <= _most(schema, "maxLength")
    elif kind == "integer":
        low, high = schema.get("minimum", value), schema.get("maximum", value)
        good = isinstance(value, int) and not isinstance(value, bool) and low <= value <= high
    else:
        types: dict[str, tuple[type, ...]] = {"number": (int, float), "boolean": (bool,), "null": (type(None),)}
        good = isinstance(value, types[str(kind)]) and (kind == "boolean" or not isinstance(value, bool))
    return None if good else where


def _object_mismatch(schema: Schema, value: Any, where: str) -> str | None:
    if not isinstance(value, dict) or set(value) - set(schema["properties"]):
        return where
    if missing := [key for key in schema.get("required", ()) if key not in value]:
        return f"{where}.{missing[0]}"
    parts = (mismatch(schema["properties"][key], item, f"{where}.{key}") for key, item in value.items())
    return next((part for part in parts if part), None)


def _most(schema: Schema, keyword: str) -> int:
    return int(schema.get(keyword, MAX_STRING if keyword == "maxLength" else MAX_ITEMS))


def _rule(schema: Schema, where: str, depth: int) -> str:
    if depth > _MAX_DEPTH:
        raise ConfigError("nested too deeply", where=where, allowed=f"{_MAX_DEPTH} levels")
    if "anyOf" in schema:
        _refuse_others(schema, {"anyOf"}, where)
        return f"({' | '.join(_rule(option, f'{where}.anyOf', depth + 1) for option in schema['anyOf'])})"
    if "const" in schema or "enum" in schema:
        _refuse_others(schema, {"const", "enum", "type"}, where)
        return f"({' | '.join(_quoted(_literal(choice)) for choice in _choices(schema))})"
    kind = schema.get("type")
    if kind not in _KEYWORDS:
        raise ConfigError(f"unknown type {kind!r}", where=where, allowed=", ".join(_KEYWORDS))
    _refuse_others(schema, {"type"} | _KEYWORDS[kind], where)
    if kind == "object":
        return _object_rule(schema, where, depth)
    if kind == "array":
        item = _rule(schema.get("items", {}), f"{where}[]", depth + 1)
        return f'"[" {_list(item, *_bounds(schema, "minItems", "maxItems", where))} "]"'
    if kind == "string":
        low, high = _bounds(schema, "minLength", "maxLength", where)
        return rf'"\"" {_repeat("char", low, high)} "\""'
    return _integer(schema, where) if kind == "integer" else _PRIMITIVES[kind]


def _object_rule(schema: Schema, where: str, depth: int) -> str:
    if schema.get("additionalProperties", False) is not False:
        raise ConfigError("additionalProperties", where=where, allowed="false or absent")
    properties = schema.get("properties", {})
    if unknown := sorted(set(schema.get("required", ())) - set(properties)):
        raise ConfigError(f"required property {unknown[0]!r} is not described", where=where)
    parts = [f"{_quoted(_literal(k) + ': ')} {_rule(v, f'{where}.{k}', depth + 1)}" for k, v in properties.items()]
    return f'"{{" {_joined(parts)} "}}"' if parts else '"{}"'


def _joined(parts: Sequence[str]) -> str:
    return ' ", " '.join(parts)


def _list(item: str, low: int, high: int) -> str:
    """`low` to `high` items with commas between them."""
    if high == 0:
        return ""
    tail = _repeat(f'(", " {item})', max(low - 1, 0), high - 1)
    return f"{item} {tail}" if low else f"({item} {tail})?"


def _repeat(rule: str, low: int, high: int) -> str:
    parts = []
    while high > 0:
        step = min(high, _REPEATS)
        parts.append(f"{rule}{{{min(low, step)},{step}}}")
        low, high = max(low - step, 0), high - step
    return " ".join(parts)


def _bounds(schema: Schema, least: str, most: str, where: str) -> tuple[int, int]:
    low, high = int(schema.get(least, 0)), _most(schema, most)
    if not 0 <= low <= high:
        raise ConfigError(f"{least} {low} and {most} {high}", where=where, allowed=f"0 <= {least} <= {most}")
    return low, high


def _integer(schema: Schema, where: str) -> str:
    low, high = schema.get("minimum"), schema.get("maximum")
    if low is None and high is None:
        return '"-"? whole'
    if not isinstance(low, int) or not isinstance(high, int) or not 0 <= high - low < MAX_RANGE:
        allowed = f"both or none, fewer than {MAX_RANGE} integers between them"
        raise ConfigError(f"minimum {low} and maximum {high}", where=where, allowed=allowed)
    return f"({' | '.join(_quoted(str(n)) for n in range(low, high + 1))})"


def _choices(schema: Schema) -> Sequence[Any]:
    return [schema["const"]] if "const" in schema else schema["enum"]


def _literal(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)


def _quoted(text: str) -> str:
    """A GBNF literal."""
    escapes = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\r": "\\r", "\t": "\\t"}
    return '"' + "".join(escapes.get(c, c) for c in text) + '"'


def _refuse_others(schema: Schema, known: set[str], where: str) -> None:
    if unknown := sorted(set(schema) - known - _NOTES):
        raise ConfigError(f"schema keyword {unknown[0]!r}", where=where, allowed=", ".join(sorted(known)))
