"""JSON that is of its schema whatever a model chooses: here one that chooses at random."""

import json
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torchlm_worlds import meets

from erag.core.errors import ConfigError
from erag.lm.torchlm.lexicon import Lexicon
from erag.lm.torchlm.schema import compile_schema
from erag.lm.torchlm.vocabulary import Vocabulary
from erag.lm.torchlm.writer import FreeWriter, JsonWriter


@pytest.fixture(scope="module")
def lexicon(vocabulary: Vocabulary) -> Lexicon:
    return Lexicon(vocabulary)


def write(schema: dict[str, Any], lexicon: Lexicon, seed: int = 0, most: int = 1000, favour: str = "") -> JsonWriter:
    """Let random logits write, those of tokens in `favour` a little higher."""
    draw = np.random.default_rng(seed)
    size = len(lexicon.vocabulary.tokens)
    liked = torch.tensor([bool(t) and t in favour for t in lexicon.texts])
    writer = JsonWriter(compile_schema(schema), lexicon, most)
    while not writer.finished:
        logits = torch.from_numpy(draw.normal(size=size)).float() + 2 * liked
        writer.queue.clear()
        writer.choose(int(logits.argmax()), logits)
    return writer


def value(writer: JsonWriter, lexicon: Lexicon) -> Any:
    return json.loads(lexicon.vocabulary.decode(writer.tokens))


def bounded(least: str, most: str) -> st.SearchStrategy[dict[str, int]]:
    pairs = st.tuples(st.integers(0, 5), st.integers(0, 30)).map(lambda p: {least: p[0], most: p[0] + p[1]})
    return st.one_of(st.just({}), pairs)


integers = st.tuples(st.integers(-300, 300), st.integers(0, 5000)).map(
    lambda p: {"type": "integer", "minimum": p[0], "maximum": p[0] + p[1]}
)
plain = st.one_of(
    bounded("minLength", "maxLength").map(lambda b: {"type": "string", **b}),
    integers,
    st.sampled_from([{"type": kind} for kind in ("boolean", "null", "number", "integer")]),
    st.lists(st.one_of(st.text(max_size=4), st.integers(-9, 99), st.booleans()), min_size=1, max_size=4).map(
        lambda values: {"enum": values}
    ),
    st.just({"anyOf": [{"type": "string", "maxLength": 5}, {"type": "null"}, {"type": "integer"}]}),
)
schemas = st.recursive(
    plain,
    lambda inner: st.one_of(
        st.tuples(inner, bounded("minItems", "maxItems")).map(lambda p: {"type": "array", "items": p[0], **p[1]}),
        st.dictionaries(st.text(max_size=6), inner, max_size=4).map(lambda d: {"type": "object", "properties": d}),
    ),
    max_leaves=5,
)


@settings(max_examples=300)
@given(schemas, st.integers(0, 1000), st.sampled_from([0, 1, 7, 60, 400]))
def test_whatever_is_chosen_the_text_is_of_the_schema(
    lexicon: Lexicon, schema: dict[str, Any], seed: int, most: int
) -> None:
    writer = write(schema, lexicon, seed, most)
    assert meets(schema, value(writer, lexicon))
    assert writer.truncated or len(writer.tokens) <= max(most, 1) + 100


def test_strings_hold_escapes_and_characters_of_several_tokens(lexicon: Lexicon) -> None:
    texts = [value(write({"type": "string", "maxLength": 40}, lexicon, seed), lexicon) for seed in range(300)]
    assert any(ord(c) > 0x7FF for text in texts for c in text)  # three bytes, so three tokens
    assert all(c.isprintable() or ord(c) > 0x9F for text in texts for c in text)
    assert all(len(text) <= 40 for text in texts)


def test_a_cap_closes_what_is_open(lexicon: Lexicon) -> None:
    schema = {"type": "object", "properties": {"a": {"type": "string"}, "b": {"type": "string", "minLength": 2}}}
    writer = write(schema, lexicon, most=12, favour="abcdefghij")
    found = value(writer, lexicon)
    assert writer.truncated
    assert writer.cut == 2
    assert 0 < len(found["a"]) <= 12
    assert len(found["b"]) == 2
    roomy = write(schema, lexicon, most=90, favour='"')
    assert not roomy.truncated
    assert roomy.cut == 0


def test_an_array_ends_when_the_model_says_so(lexicon: Lexicon) -> None:
    schema = {"type": "array", "items": {"type": "string", "maxLength": 3}, "maxItems": 9}
    assert value(write(schema, lexicon, favour="]"), lexicon) == []
    assert len(value(write(schema, lexicon, favour='",'), lexicon)) == 9


def test_the_model_writes_what_it_prefers(lexicon: Lexicon) -> None:
    """A model that knows what it wants gets it, through single tokens and merged ones alike."""
    schema = {
        "type": "object",
        "properties": {
            "name": {"type": "string"},
            "parts": {"type": "array", "items": {"type": "string"}, "minItems": 1},
            "kind": {"enum": ["find", "explain", "finds"]},
            "n": {"type": "integer", "minimum": 0, "maximum": 500},
            "x": {"type": "number"},
            "none": {"anyOf": [{"type": "string"}, {"type": "null"}]},
        },
    }
    wanted = {"name": 'the "cat", ö日', "parts": ["in", "a."], "kind": "finds", "n": 42, "x": -0.25, "none": None}
    assert follow(schema, json.dumps(wanted, ensure_ascii=False), lexicon) == wanted
    assert follow(schema, json.dumps(wanted | {"kind": "find"}, ensure_ascii=False), lexicon)["kind"] == "find"


def follow(schema: dict[str, Any], text: str, lexicon: Lexicon) -> Any:
    """What comes out when the model's favourite is always the next token of `text`."""
    writer = JsonWriter(compile_schema(schema), lexicon, 500)
    data = text.encode()
    while not writer.finished:
        done = b"".join(lexicon.vocabulary.bytes_of(t) for t in writer.tokens)
        assert data.startswith(done), (done, data)
        rest = data[len(done) :].decode("utf-8", "ignore") or None
        best = lexicon.vocabulary.encode(rest)[0] if rest else _byte(data[len(done)], lexicon)
        if not data[len(done) :].startswith(lexicon.vocabulary.bytes_of(best)):
            best = _byte(data[len(done)], lexicon)
        logits = torch.zeros(len(lexicon.texts))
        logits[best] = 9
        writer.queue.clear()
        writer.choose(best, logits)
    return json.loads(lexicon.vocabulary.decode(writer.tokens))


def _byte(byte: int, lexicon: Lexicon) -> int:
    found = (t for t in range(len(lexicon.texts)) if lexicon.vocabulary.bytes_of(t) == bytes([byte]))
    return next(found)


def test_free_text_stops_at_its_end_or_its_cap() -> None:
    writer = FreeWriter(frozenset({2}), 3)
    for token in (5, 6, 2):
        writer.choose(token, torch.zeros(1))
    assert (writer.tokens, writer.finished, writer.truncated) == ([5, 6], True, False)
    capped = FreeWriter(frozenset({2}), 2)
    for token in (5, 6):
        capped.choose(token, torch.zeros(1))
    assert (capped.tokens, capped.finished, capped.truncated) == ([5, 6], True, True)
    assert FreeWriter(frozenset(), 0).finished


@pytest.mark.parametrize(
    ("schema", "reason"),
    [
        ({"type": "string", "pattern": "a+"}, "pattern"),
        ({"type": "strings"}, "strings"),
        ({}, "unknown type None"),
        ({"type": ["string", "null"]}, "unknown type"),
        ({"type": "object", "properties": {"a": {"$ref": "#/x"}}}, r"schema\.a"),
        ({"type": "object", "required": ["b"]}, "'b'"),
        ({"type": "object", "additionalProperties": True}, "additionalProperties"),
        ({"type": "array", "items": {"type": "null"}, "minItems": 3, "maxItems": 2}, "minItems 3"),
        ({"type": "array"}, "unknown type None"),
        ({"type": "integer", "minimum": 5, "maximum": 4}, "minimum 5"),
        ({"type": "integer", "maximum": 10**12}, "digits"),
        ({"enum": []}, "without values"),
        ({"anyOf": [{"type": "string"}, {"enum": ["a"]}]}, "begin alike"),
    ],
)
def test_schemas_that_are_not_understood_are_refused(schema: dict[str, Any], reason: str) -> None:
    with pytest.raises(ConfigError, match=reason):
        compile_schema(schema)


def test_endless_nesting_is_refused() -> None:
    schema: dict[str, Any] = {"type": "null"}
    for _ in range(40):
        schema = {"type": "array", "items": schema}
    with pytest.raises(ConfigError, match="nested"):
        compile_schema(schema)


@pytest.mark.parametrize("values", [["\x80", "\x81"], ["é", "è", "e"], ["日本", "日曜"], ["🌳", "🌲", ""]])
def test_options_may_differ_within_a_character(lexicon: Lexicon, values: list[str]) -> None:
    chosen = {value(write({"enum": values}, lexicon, seed), lexicon) for seed in range(40)}
    assert chosen <= set(values)
    assert len(chosen) > 1
