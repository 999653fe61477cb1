"""JSON of a schema from a server that may not keep to it: what is sent, and what is wrong with an answer."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Literal

from erag.lm.torchlm.schema import AnyOf, Fields, Items, Node, Number, Options, Text, compile_schema, literal

VALUE = "value"  # the key under which a schema that is no object's is wrapped
_LENGTHS = frozenset({"minLength", "maxLength", "minItems", "maxItems", "minimum", "maximum"})
Schema = Mapping[str, Any]
NAME = "answer"


class Form:
    """A schema as it is sent, and answers as they are read back."""

    def __init__(self, schema: Schema, structured: Literal["strict", "full"]) -> None:
        self._node, self._structured = compile_schema(schema), structured
        self.wrapped = structured == "strict" and schema.get("type") != "object"
        self._whole = _wrapped(schema) if self.wrapped else schema

    @property
    def response_format(self) -> dict[str, Any]:
        """The field of the request."""
        strict = self._structured == "strict"
        schema = _strict(self._whole) if strict else self._whole
        return {"type": "json_schema", "json_schema": {"name": NAME, "schema": schema, "strict": strict}}

    @property
    def instruction(self) -> str:
        """What the model is told where its server may leave bounds unread; nothing where it keeps to them."""
        if self._structured == "full":
            return ""
        return f"Answer with JSON of this schema and nothing else: {json.dumps(self._whole, ensure_ascii=False)}"

    def read(self, text: str) -> tuple[str, str]:
        """The JSON of the schema in an answer, and what is wrong with it: one of the two is empty."""
        try:
            value = json.loads(text)
        except (ValueError, RecursionError):
            return "", "it is not JSON"
        if self.wrapped:
            if not isinstance(value, dict) or VALUE not in value:
                return "", f"it has no key {VALUE!r}"
            value = value[VALUE]
        wrong = fault(value, self._node)
        return ("", wrong) if wrong else (literal(value), "")


def fault(value: Any, node: Node, where: str = "it") -> str:
    """What keeps a value from being one of a schema, in words; nothing where it is one."""
    match node:
        case Options():
            return "" if literal(value) in node.values else f"{where} is none of {', '.join(node.values[:12])}"
        case Text():
            return _text_fault(value, node, where)
        case Number():
            return _number_fault(value, node, where)
        case Items():
            return _items_fault(value, node, where)
        case Fields():
            return _fields_fault(value, node, where)
        case AnyOf():
            return "" if any(not fault(value, option) for option in node.options) else f"{where} is of no kind allowed"


def _text_fault(value: Any, node: Text, where: str) -> str:
    if not isinstance(value, str):
        return f"{where} is no text"
    fits = node.low <= len(value) <= node.high
    return "" if fits else f"{where} has {len(value)} characters, not {node.low} to {node.high}"


def _number_fault(value: Any, node: Number, where: str) -> str:
    kinds = (int, float) if node.fraction else (int,)
    if type(value) not in kinds:
        return f"{where} is no {'number' if node.fraction else 'whole number'}"
    low, high = node.low, node.high
    fits = (low is None or value >= low) and (high is None or value <= high)
    return "" if fits else f"{where} is {value}, not {low} to {high}"


def _items_fault(value: Any, node: Items, where: str) -> str:
    if not isinstance(value, list):
        return f"{where} is no list"
    if not node.low <= len(value) <= node.high:
        return f"{where} has {len(value)} items, not {node.low} to {node.high}"
    found = (fault(item, node.item, f"item {i} of {where}") for i, item in enumerate(value, 1))
    return next(filter(None, found), "")


def _fields_fault(value: Any, node: Fields, where: str) -> str:
    if not isinstance(value, dict):
        return f"{where} is no object"
    known = {json.loads(key): child for key, child in node.fields}
    if missing := [key for key in known if key not in value]:
        return f"{where} has no {missing[0]!r}"
    if unknown := [key for key in value if key not in known]:
        return f"{where} has {unknown[0][:40]!r}, which is not asked for"
    found = (fault(value[key], child, f"{key!r}") for key, child in known.items())
    return next(filter(None, found), "")


def _wrapped(schema: Schema) -> Schema:
    return {"type": "object", "properties": {VALUE: schema}, "required": [VALUE]}


def _strict(schema: Schema) -> dict[str, Any]:
    """As strict servers take it: every property required, no others, no bounds, a type for every enum."""
    kept: dict[str, Any] = {key: value for key, value in schema.items() if key not in _LENGTHS}
    if "properties" in kept:
        kept["properties"] = {key: _strict(child) for key, child in kept["properties"].items()}
        kept |= {"required": list(kept["properties"]), "additionalProperties": False}
    if "items" in kept:
        kept["items"] = _strict(kept["items"])
    if "anyOf" in kept:
        kept["anyOf"] = [_strict(option) for option in kept["anyOf"]]
    if "enum" in kept and "type" not in kept:
        kinds = {_kind(value) for value in kept["enum"]}
        kept |= {"type": kinds.pop()} if len(kinds) == 1 else {}
    return kept


def _kind(value: Any) -> str:
    names = {str: "string", bool: "boolean", int: "integer", float: "number", type(None): "null"}
    return names.get(type(value), "string")
