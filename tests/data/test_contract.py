"""The contract of Q.jsonl and RUN.jsonl."""

import json
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from erag.core.errors import InputError
from erag.core.times import parse_time
from erag.core.types import Answer, Frame, Hit, Pose, Query, Route, Waypoint
from erag.data.contract import QueryLine, Result, parse_query, read_queries, result_line


def parse(raw: dict[str, Any] | None, top: int = 5) -> Query:
    return parse_query(QueryLine(3, str((raw or {}).get("id", "q")), raw), top, lambda x, y: 7.0)


def test_every_key_of_a_query() -> None:
    raw = {
        "id": "q1", "query": "  green grass ", "kind": "implicit", "at": [1, 2.5],
        "sensor": {"ndvi": "low", "t": [1, 2]}, "since": "2024-05-01T00:00:00Z", "until": "2024-06",
        "unknown": {"is": "ignored"},
    }  # fmt: skip
    assert parse(raw) == Query(
        "green grass", Pose(1.0, 2.5, 7.0), {"ndvi": "low", "t": (1.0, 2.0)}, parse_time("2024-05-01").start,
        parse_time("2024-06").start, 5, "find", "q1",
    )  # fmt: skip
    assert parse({"id": "a", "at": [1, 2, 3]}).at == Pose(1, 2, 3)


@pytest.mark.parametrize(
    ("said", "kind"), [("find", "find"), ("explicit", "find"), ("global", "explain"), (None, None)]
)
def test_kinds(said: str | None, kind: str | None) -> None:
    assert parse({"id": "a", "query": "x", "kind": said}).kind == kind


@pytest.mark.parametrize(
    ("raw", "said"),
    [
        (None, "not a JSON object"),
        ({"query": "x"}, "id is None"),
        ({"id": [], "query": "x"}, "id is"),
        ({"id": "a"}, "neither query nor at"),
        ({"id": "a", "query": "  "}, "query is '  '"),
        ({"id": "a", "query": 5}, "query is 5"),
        ({"id": "a", "query": "x" * 5000}, "5000 characters"),
        ({"id": "a", "at": [1]}, r"at is \[1\]"),
        ({"id": "a", "at": [1, math.nan]}, "at is"),
        ({"id": "a", "at": "1,2"}, "at is"),
        ({"id": "a", "at": [True, 2]}, "at is"),
        ({"id": "a", "query": "x", "kind": "delete"}, "kind is 'delete'"),
        ({"id": "a", "query": "x", "since": "yesterday"}, "since is 'yesterday'"),
        ({"id": "a", "query": "x", "since": "2024", "until": "2024"}, "not before"),
        ({"id": "a", "query": "x", "sensor": {"ndvi": "medium"}}, "sensor ndvi"),
        ({"id": "a", "query": "x", "sensor": {"ndvi": [2, 1]}}, "sensor ndvi"),
        ({"id": "a", "query": "x", "sensor": ["ndvi"]}, "sensor is"),
    ],
)
def test_bad_queries_are_refused_in_one_line_with_their_place(raw: dict[str, Any] | None, said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        parse(raw)
    assert caught.value.line().startswith("line 3: ")
    assert "\n" not in caught.value.line()


def test_a_file_is_read_in_order_with_broken_lines_kept(tmp_path: Path) -> None:
    file = tmp_path / "q.jsonl"
    deep = "[" * 100_000
    lines = ['\ufeff{"id": "a", "env": "x"}', "", "{broken\r", "[1]", '{"id": 5, "env": "y"}', deep]
    file.write_text("\n".join([*lines, '{"id": "c", "env": "x"}']), encoding="utf-8")
    assert [(q.number, q.id, q.raw is None) for q in read_queries(file, {})] == [
        (1, "a", False),
        (3, "line 3", True),
        (4, "line 4", True),
        (5, "5", False),
        (6, "line 6", True),
        (7, "c", False),
    ]
    assert [q.id for q in read_queries(file, {"env": "x"})] == ["a", "line 3", "line 4", "line 6", "c"]


def test_unreadable_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        list(read_queries(tmp_path / "no.jsonl", {}))
    (tmp_path / "latin.jsonl").write_bytes(b'{"id": "caf\xe9"}')
    with pytest.raises(InputError, match="UTF-8"):
        list(read_queries(tmp_path / "latin.jsonl", {}))


def test_a_result_is_one_line_of_the_agreed_shape() -> None:
    hit = Hit("n1", (1.0, 2.0, 3.0), 0.5, 0.4, None, None, ("L1-0", "n1"))
    waypoint = Waypoint("n1", Frame.WGS84, (1.0, 2.0, 3.0), None)
    answer = Answer("find", "Go\nthere.", "because", waypoint, Route("ok", ("n0", "n1"), 3.5), ("n1",))
    line = result_line(Result("q", (hit,), answer, 0.25, 12, {"embed": 1}))
    assert "\n" not in line
    record = json.loads(line)
    assert record["hits"] == [
        {"node": "n1", "position": [1.0, 2.0, 3.0], "score": 0.5, "semantic": 0.4, "spatial": None, "sensor": None,
         "path": ["L1-0", "n1"]},
    ]  # fmt: skip
    assert record["answer"] == {
        "kind": "find", "text": "Go\nthere.", "reason": "because", "evidence": ["n1"],
        "waypoint": {"node": "n1", "frame": "wgs84", "position": [1.0, 2.0, 3.0], "yaw": None},
        "route": {"status": "ok", "nodes": ["n0", "n1"], "length_m": 3.5, "bridges": 0},
    }  # fmt: skip
    assert (record["seconds"], record["visited"], record["calls"]) == (0.25, 12, {"embed": 1})
    assert "error" not in record
    assert json.loads(result_line(Result("q", error="bad")))["error"] == "bad"


json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)
keys = st.sampled_from(["id", "query", "at", "kind", "sensor", "since", "until"])


@given(st.dictionaries(keys, json_values, max_size=7))
def test_any_json_object_is_a_query_or_an_input_error(raw: dict[str, Any]) -> None:
    try:
        query: Query | None = parse(raw)
        said = ""
    except InputError as error:
        query, said = None, error.line()
    assert said.startswith("line 3: ") if query is None else (query.text or query.at)
    assert "\n" not in said
