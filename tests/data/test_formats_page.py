"""The examples of docs/formats.md are read as the page says."""

import json
import re
from pathlib import Path

from erag.data.contract import parse_query, read_queries
from erag.data.registry import read

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "formats.md").read_text(encoding="utf-8")


def block(begins: str) -> str:
    """The fenced example that begins with this text."""
    return next(b for b in re.findall(r"```(?:json)?\n(.*?)```", PAGE, re.DOTALL) if b.startswith(begins))


def test_the_observation_folder(tmp_path: Path) -> None:
    (tmp_path / "images").mkdir()
    (tmp_path / "images" / "n01.jpg").write_bytes(b"x")
    for name, begins in (
        ("meta.json", '{"format"'),
        ("observations.jsonl", '{"id": "n01"'),
        ("edges.jsonl", '{"a"'),
        ("clusters.jsonl", '{"id": "c1"'),
    ):
        (tmp_path / name).write_text(block(begins), encoding="utf-8")
    made = read(tmp_path)
    assert (len(made.observations), len(made.edges), len(made.clusters)) == (2, 1, 1)
    assert made.observations[0].image == "images/n01.jpg"
    assert made.issues == ()


def test_the_graph(tmp_path: Path) -> None:
    (tmp_path / "a.gml").write_text(block("graph ["), encoding="utf-8")
    made = read(tmp_path / "a.gml")
    assert (len(made.observations), len(made.edges), len(made.clusters)) == (2, 1, 1)
    assert made.issues == ()


def test_queries_and_results(tmp_path: Path) -> None:
    (tmp_path / "q.jsonl").write_text(block('{"id": "q1", "query"'), encoding="utf-8")
    queries = [parse_query(line, 5, lambda _x, _y: 0.0) for line in read_queries(tmp_path / "q.jsonl", {})]
    assert [q.id for q in queries] == ["q1", "q2", "q3"]
    assert json.loads(block('{"id": "q1",\n'))["hits"][0]["path"][-1] == "n13"
