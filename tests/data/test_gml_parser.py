"""The GML parser: what it keeps of sound and of damaged files."""

import math

import pytest

from erag.data import gml
from erag.data.gml import GmlGraph, GmlRecord, parse, unescape


def nodes(graph: GmlGraph) -> list[object]:
    return [record.get("id") for record in graph.nodes]


def node(i: int, inner: str = "") -> str:
    return f'  node [\n    id {i}\n    label "n{i}"\n{inner}  ]\n'


def graph(*parts: str) -> str:
    return "graph [\n" + "".join(parts) + "]\n"


def test_values_lines_and_nesting() -> None:
    inner = '    position [\n      x -1.5\n      y +2e3\n    ]\n    note "two\nlines"\n'
    made = parse(graph('  name "a b"\n', node(7, inner)), "m.gml")
    assert made.issues == ()
    assert made.attributes.get("name") == "a b"
    (record,) = made.nodes
    assert record.line == 3
    position = record.get("position")
    assert isinstance(position, GmlRecord)
    assert (position.line, position.get("x"), position.get("y"), position.get("z")) == (6, -1.5, 2000.0, None)
    assert record.get("note") == "two\nlines"


def test_numbers_that_are_none_are_still_read() -> None:
    made = parse(graph(node(1, "x NaN y -inf z 1e400 w +INF v .5 u 5.\n")), "m.gml")
    get = made.nodes[0].get
    assert math.isnan(float(str(get("x"))))
    assert (get("y"), get("z"), get("w"), get("v"), get("u")) == (-math.inf, math.inf, math.inf, 0.5, 5.0)


def test_repeated_keys_keep_their_order_and_lose_the_marker() -> None:
    made = parse(graph(node(1, 'm "_networkx_list_start"\nm "b"\n'), node(2, 'm "b"\nm "a"\nm "b"\n')), "m.gml")
    assert made.nodes[0].all("m") == ("b",)
    assert made.nodes[1].all("m") == ("b", "a", "b")
    assert gml.repeated(made.nodes[1], frozenset({"m"})) == "m"
    assert gml.repeated(made.nodes[1], frozenset({"id"})) is None


@pytest.mark.parametrize(
    ("written", "means"),
    [
        ("&#34;Trail&#34;", '"Trail"'),
        ("&quot;&amp;&lt;&#x41;&eacute;", '"&<Aé'),
        ("&amp;#34;", "&#34;"),  # decoded once
        ("&#55296;&#0;&#99999999999;&nosuch;&", "&#55296;&#0;&#99999999999;&nosuch;&"),
        ("&copy 2020", "&copy 2020"),
    ],
)
def test_entities(written: str, means: str) -> None:
    assert unescape(written) == means


def test_code_in_attributes_is_text() -> None:
    code = "__import__('os').system('touch /tmp/x')"
    assert parse(graph(node(1, f'name "{code}"\n')), "m.gml").nodes[0].get("name") == code


@pytest.mark.parametrize(
    "broken",
    [
        '    name "never closed\n',
        '    label "n2" name "never closed\n    type "object"\n    note "x"\n',
        "    position [\n      x 1\n",
        "    %%% what\n",
        "    name\n",
        '    "text without a key"\n',
        "    [\n",
        "    a [ " * 40 + "\n",
    ],
)
def test_one_damaged_record_is_left_out_and_the_rest_kept(broken: str) -> None:
    text = graph(node(1), f"  node [\n    id 2\n{broken}  ]\n", node(3), node(4), "  edge [\n source 1 target 3\n ]\n")
    made = parse(text, "m.gml")
    assert nodes(made) == [1, 3, 4]
    assert len(made.edges) == 1
    out = [i for i in made.issues if i.action.startswith("row left out")]
    assert [i.where for i in out] == ["m.gml:6"]


def test_quotes_that_pair_up_wrongly_are_found_at_once() -> None:
    """All values are single words, so a strict parser reads on to the end with text and structure exchanged."""
    body = [node(i, '    type "object"\n    name "chair"\n') for i in range(50)]
    body[5] = body[5].replace('"object"', '"object')
    made = parse(graph(*body), "m.gml")
    assert nodes(made) == [i for i in range(50) if i != 5]


def test_a_closed_text_may_look_like_structure() -> None:
    made = parse(graph(node(1, '    caption "a sign says:\n  node [\n    id 99\n  ]\nno more"\n'), node(2)), "m.gml")
    assert nodes(made) == [1, 2]
    assert made.issues == ()


@pytest.mark.parametrize("cut", range(1, 60, 7))
def test_a_file_cut_off_keeps_what_stands_before(cut: int) -> None:
    text = graph(*(node(i) for i in range(5)))
    made = parse(text[: -cut - 2], "m.gml")
    complete = text[: -cut - 2].count("\n  ]")
    assert nodes(made) == list(range(complete))
    assert made.issues


def test_brackets_too_many_and_no_graph_around() -> None:
    made = parse("node [ id 1 ] ] ] edge [ source 1 target 1 ]", "m.gml")
    assert nodes(made) == [1]
    assert len(made.edges) == 1
    assert [(i.where, i.what) for i in made.issues] == [("m.gml:1", "2 closing brackets too many")]


def test_attributes_of_an_unclosed_graph_are_kept() -> None:
    assert parse('graph [ frame "metric" node [ id 1 ]', "m.gml").attributes.get("frame") == "metric"


def test_long_values_are_cut_and_bare_words_are_told() -> None:
    made = parse(graph(node(1, f'note "{"x" * (gml.MAX_VALUE + 5)}"\nother True\n')), "m.gml")
    assert made.nodes[0].get("note") == "x" * gml.MAX_VALUE
    assert made.nodes[0].get("other") == "True"
    assert [i.action for i in made.issues] == [f"cut to {gml.MAX_VALUE} characters", "read as text"]


BOMBS = {
    "brackets": "graph [" + "[" * 2_000_000,
    "lists": "graph [" + "a [" * 700_000,
    "nodes in nodes": "graph [\n" + "node [\n" * 200_000,
    "graphs in graphs": "graph [ " * 250_000,
    "closing brackets": "graph [" + "]" * 1_000_000,
    "quotes": "graph [ node [ a " + '"' * 2_000_001,
    "quotes on lines": "graph [ node [ a " + '"\n' * 1_000_000,
    "keys and quotes": "graph [\n" + 'node [ a "\n' * 200_000,
    "one word": "graph [ node [ a " + "x" * 10_000_000,
    "one number": "graph [ node [ id " + "9" * 10_000_000 + " ] ]",
    "one text": 'graph [ node [ id 0 a "' + "x" * 10_000_000,
    "white space": "graph [ node [ id 1 ] ]" + " " * 10_000_000,
    "empty lines": "graph [ node [ id 1 " + "\n" * 10_000_000,
    "entities": 'graph [ node [ id 1 a "' + "&#" * 1_000_000 + '" ] ]',
    "stray signs": "graph [\n" + "node [ %\n" * 200_000,
    "comment": "#" * 5_000_000,
    "values": "graph [ node [ " + "a 1 " * 500_000,
}


@pytest.mark.parametrize("bomb", BOMBS)
def test_bombs_end_in_issues(bomb: str) -> None:
    """Each of these would take hours if parsing were quadratic, and would crash it if it were recursive."""
    made = parse(BOMBS[bomb], "bomb.gml")
    assert len(made.nodes) <= 1
    assert made.issues or bomb in ("white space", "comment")


def test_after_too_many_damaged_places_the_rest_is_not_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gml, "MAX_DAMAGE", 3)
    made = parse(graph(*("  node [\n %\n ]\n" for _ in range(10)), node(1)), "m.gml")
    assert nodes(made) == []
    assert "the rest of the file left out" in made.issues[-2].action


def test_too_many_values_end_the_reading(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gml, "MAX_VALUES", 5)
    made = parse(graph(node(1), node(2), node(3)), "m.gml")
    assert nodes(made) == [1, 2]
    monkeypatch.setattr(gml, "MAX_VALUES", 100)
    monkeypatch.setattr(gml, "MAX_RECORD", 5)
    made = parse(graph(node(1, "a 1\n" * 10), node(2)), "m.gml")
    assert nodes(made) == [2]
