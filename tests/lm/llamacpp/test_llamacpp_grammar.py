"""Schemas to grammars: every text of the grammar is short and valid, every valid value is a text of the grammar."""

import json
import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.core.errors import BadModelOutput, ConfigError
from erag.lm.llamacpp.grammar import MAX_ITEMS, MAX_STRING, parse, to_grammar

SUMMARY: dict[str, Any] = {
    "type": "object",
    "properties": {
        "name": {"type": "string", "maxLength": 20},
        "text": {"type": "string", "minLength": 1},
        "relationships": {"type": "array", "items": {"type": "string", "maxLength": 8}, "minItems": 1, "maxItems": 3},
        "views": {"type": "integer", "minimum": -2, "maximum": 12},
        "size": {"type": "number"},
        "kind": {"enum": ["find", 'ex"plain', 3, None]},
        "sure": {"type": "boolean"},
        "nothing": {"type": "null"},
        "either": {"anyOf": [{"const": "x\n"}, {"type": "array", "items": {"type": "integer"}, "maxItems": 2}]},
    },
    "required": ["name"],
    "additionalProperties": False,
}
LETTERS = st.characters(exclude_categories=("C", "Zl", "Zp"))
VALUES = st.fixed_dictionaries(
    {
        "name": st.text(LETTERS, max_size=20),
        "text": st.text(LETTERS, min_size=1, max_size=MAX_STRING),
        "relationships": st.lists(st.text(LETTERS, max_size=8), min_size=1, max_size=3),
        "views": st.integers(-2, 12),
        "size": st.integers(-999_999_999, 999_999_999) | st.sampled_from([0.5, -12.25]),
        "kind": st.sampled_from(["find", 'ex"plain', 3, None]),
        "sure": st.booleans(),
        "nothing": st.none(),
        "either": st.just("x\n") | st.lists(st.integers(-9, 99), max_size=2),
    }
)


def as_expression(grammar: str) -> str:
    """Our grammars have no recursion, so they are regular: the same language as a Python expression."""
    rules = dict(line.split(" ::= ", 1) for line in grammar.splitlines())
    known: dict[str, str] = {}
    for name in ("char", "whole", "number", "root"):
        known[name] = f"(?:{_translate(rules[name], known)})"
    return known["root"]


def _translate(rule: str, known: dict[str, str]) -> str:
    token = re.compile(r'"((?:[^"\\]|\\.)*)"|(\[(?:[^\]\\]|\\.)+\])|([a-z]+)|(\{\d+,\d+\}|[()|?])|\s+')
    out, at = "", 0
    while at < len(rule):
        match = token.match(rule, at)
        assert match, rule[at:]
        literal, group, name, mark = match.groups()
        if literal is not None:
            out += "(?:" + re.escape(json.loads('"' + literal + '"')) + ")"
        out += group or known.get(name or "", "") or mark or ""
        at = match.end()
    return out


EXPRESSION = re.compile(as_expression(to_grammar(SUMMARY)))


@given(VALUES)
def test_every_value_of_the_schema_is_a_text_of_its_grammar(value: dict[str, Any]) -> None:
    text = json.dumps({key: value[key] for key in SUMMARY["properties"]}, ensure_ascii=False)
    assert EXPRESSION.fullmatch(text)
    assert parse(SUMMARY, text) == value


@given(st.from_regex(EXPRESSION, fullmatch=True))
def test_every_text_of_the_grammar_is_a_value_of_the_schema(text: str) -> None:
    parse(SUMMARY, text)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "{}",
        '{"name": 3}',
        '{"name": "x", "more": 1}',
        json.dumps({"name": "x" * 21}),
        json.dumps({"name": "", "relationships": []}),
        json.dumps({"name": "", "relationships": ["a"] * 4}),
        json.dumps({"name": "", "views": 13}),
        json.dumps({"name": "", "views": True}),
        json.dumps({"name": "", "kind": "other"}),
        json.dumps({"name": "", "kind": 3.5}),
        json.dumps({"name": "", "sure": 1}),
        json.dumps({"name": "", "either": [1, 2, 3]}),
    ],
)
def test_what_is_not_of_the_schema_is_bad_output(text: str) -> None:
    assert not EXPRESSION.fullmatch(text)
    with pytest.raises(BadModelOutput):
        parse(SUMMARY, text)


def test_strings_and_arrays_without_a_bound_get_one() -> None:
    expression = re.compile(as_expression(to_grammar({"type": "array", "items": {"type": "string"}})))
    assert expression.fullmatch(json.dumps(["x" * MAX_STRING] * MAX_ITEMS))
    assert not expression.fullmatch(json.dumps(["x" * (MAX_STRING + 1)]))
    assert not expression.fullmatch(json.dumps([""] * (MAX_ITEMS + 1)))


def test_long_bounds_are_cut_to_what_the_library_takes() -> None:
    expression = re.compile(as_expression(to_grammar({"type": "string", "minLength": 1500, "maxLength": 2500})))
    lengths = [n for n in (1499, 1500, 2500, 2501) if expression.fullmatch(json.dumps("x" * n))]
    assert lengths == [1500, 2500]


@pytest.mark.parametrize(
    ("schema", "word"),
    [
        ({}, "type"),
        ({"type": "date"}, "date"),
        ({"type": "string", "pattern": "^a$"}, "pattern"),
        ({"type": "integer", "minimum": 1}, "maximum"),
        ({"type": "integer", "minimum": 0, "maximum": 10_000}, "1000"),
        ({"type": "number", "minimum": 0, "maximum": 1}, "m"),
        ({"type": "array", "items": {"type": "null"}, "minItems": 3, "maxItems": 2}, "minItems"),
        ({"type": "object", "properties": {}, "required": ["x"]}, "x"),
        ({"type": "object", "properties": {}, "additionalProperties": True}, "additionalProperties"),
        ({"anyOf": [{"type": "null"}], "type": "null"}, "type"),
        ({"$ref": "#/x", "type": "null"}, r"\$ref"),
    ],
)
def test_what_is_not_supported_is_refused(schema: dict[str, Any], word: str) -> None:
    with pytest.raises(ConfigError, match=word):
        to_grammar(schema)


def test_a_schema_nested_without_end_is_refused() -> None:
    schema: dict[str, Any] = {"type": "null"}
    for _ in range(50):
        schema = {"type": "array", "items": schema}
    with pytest.raises(ConfigError, match="deep"):
        to_grammar(schema)
