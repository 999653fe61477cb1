"""One function for every source: which reader is taken, and that nothing but InputError comes out."""

import json
import os
import random
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from erag.core.errors import InputError
from erag.data import registry
from erag.data.gml import parse
from erag.data.reading import Reading
from erag.data.registry import READERS, read

MANY = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
GML = 'graph [ frame "metric"\n node [ id 0 label "a" x 1 y 2 caption "c" ]\n node [ id 1 label "b" x 2 y 2 ]\n]\n'
META = '{"format": "erag-observations", "version": 1, "frame": "metric"}'
LINE = '{"id": "a", "pose": {"x": 1, "y": 2}, "caption": "c"}\n'
NODE = {"node_id": 0, "timestamp": 1, "position": [1, 2, 3], "quaternion": [0, 1, 0, 1], "caption": "c"}


def test_each_source_finds_its_reader(tmp_path: Path) -> None:
    (tmp_path / "a.gml").write_text(GML)
    (tmp_path / "graph.txt").write_text(GML)
    (tmp_path / "meta.json").write_text(META)
    (tmp_path / "walk.jsonl").write_text(LINE)
    coex = tmp_path / "coex"
    coex.mkdir()
    (coex / "topological_graph.json").write_text(json.dumps({"nodes": [NODE], "edges": []}))
    for name in ("a.gml", "graph.txt", "walk.jsonl", "coex", "coex/topological_graph.json"):
        assert read(tmp_path / name).observations[0].pose.x == 1
    (tmp_path / "observations.jsonl").write_text(LINE)
    assert read(tmp_path).observations[0].id == "a"
    assert list(READERS) == ["jsonl", "coex", "gml"]


def test_a_reader_can_be_named(tmp_path: Path) -> None:
    (tmp_path / "odd.name").write_text(GML)
    assert len(read(tmp_path / "odd.name", "gml").observations) == 2
    with pytest.raises(InputError, match="there is no reader 'rosbag'; allowed: auto, jsonl, coex, gml"):
        read(tmp_path / "odd.name", "rosbag")
    for wrong in ("jsonl", "coex"):
        with pytest.raises(InputError):
            read(tmp_path / "odd.name", wrong)
    with pytest.raises(InputError):
        read(tmp_path, "gml")


def test_what_is_no_source(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.gml")  # opening it would wait for ever
    (tmp_path / "empty.gml").touch()
    (tmp_path / "folder").mkdir()
    (tmp_path / "photo.png").write_bytes(random.Random(0).randbytes(5000))
    (tmp_path / "loop.gml").symlink_to(tmp_path / "loop.gml")
    (tmp_path / "dead.gml").symlink_to(tmp_path / "nothing")
    for name, told in (
        ("missing.gml", "no such file"),
        ("dead.gml", "no such file"),
        ("pipe.gml", "pipe, socket or device"),
        ("empty.gml", "the file is empty"),
        ("folder", "no reader recognises it; allowed: a .gml file"),
        ("photo.png", "no reader recognises it"),
        ("loop.gml", "cannot be opened"),
        ("x" * 5000, "cannot be opened"),
        ("a\0b", "cannot be opened"),
    ):
        with pytest.raises(InputError, match=told):
            read(tmp_path / name)
    with pytest.raises(InputError, match="pipe, socket or device"):
        read(Path(os.devnull))
    with pytest.raises(InputError, match="not UTF-8 text: byte"):
        read(tmp_path / "photo.png", "gml")


def test_a_file_too_large_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("erag.data.files.MAX_FILE", 50)
    (tmp_path / "a.gml").write_text(GML)
    with pytest.raises(InputError, match=r"has \d+ bytes; allowed: at most 50"):
        read(tmp_path / "a.gml")


def attempt(path: Path, reader: str) -> Reading | None:
    """The reading, or None if it was refused in one printable line; any other exception fails the test."""
    refused, made = None, None
    try:
        made = registry.read(path, reader)
    except InputError as error:
        refused = error.line()
    if made is None:
        assert refused
        assert refused.isprintable()
        return None
    assert made.observations
    assert all(i.where.isprintable() and i.what.isprintable() and i.action.isprintable() for i in made.issues)
    return made


def scramble(text: str, seed: int) -> bytes:
    """A sound file with a few bytes changed, removed or repeated."""
    chance = random.Random(seed)
    raw = bytearray(text.encode())
    for _ in range(chance.randint(1, 8)):
        at = chance.randrange(len(raw))
        cut = slice(at, at + chance.randint(0, 12))
        raw[cut] = chance.choice([b"", b'"', b"[", b"]", b"\\", b"\xff", b"\n", b"1e400", bytes(raw[cut]) * 2, b"\x00"])
    return bytes(raw)


@MANY
@given(st.binary(max_size=300), st.sampled_from(["auto", *READERS]))
@example(b"graph [ node [ id 1", "gml")
@example(b"\xff\xfe", "gml")
@example(b'[{"node_id": 1, "quaternion": []}]', "auto")
def test_any_bytes_are_read_or_refused(tmp_path_factory: pytest.TempPathFactory, raw: bytes, reader: str) -> None:
    folder = tmp_path_factory.mktemp("fuzz")
    for name in ("a.gml", "a.jsonl", "observations.jsonl", "meta.json", "topological_graph.json"):
        (folder / name).write_bytes(raw)
        attempt(folder / name, reader)
    attempt(folder, reader)


@MANY
@given(st.text(st.sampled_from('node edge[]"\n 1.x_&#;gk\\'), max_size=200))
def test_any_gml_like_text_is_parsed(text: str) -> None:
    made = parse(f"graph [\n{text}", "f.gml")
    assert len(made.nodes) <= text.count("node")


@pytest.mark.parametrize("seed", range(300))
def test_scrambled_files_are_read_or_refused(seed: int, tmp_path: Path) -> None:
    (tmp_path / "meta.json").write_text(META)
    (tmp_path / "a.gml").write_bytes(scramble(GML, seed))
    (tmp_path / "a.jsonl").write_bytes(scramble(LINE * 5, seed))
    (tmp_path / "topological_graph.json").write_bytes(scramble(json.dumps({"nodes": [NODE], "edges": []}), seed))
    for name in ("a.gml", "a.jsonl", "topological_graph.json"):
        attempt(tmp_path / name, "auto")
    (tmp_path / "meta.json").write_bytes(scramble(META, seed))
    attempt(tmp_path / "a.jsonl", "jsonl")


@MANY
@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
        max_leaves=8,
    ),
    st.sampled_from(["id", "kind", "time", "pose", "image", "name", "caption", "sensors", "source"]),
    st.sampled_from(["node_id", "timestamp", "position", "quaternion", "image", "caption"]),
)
def test_any_json_in_any_field_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, value: object, ours: str, theirs: str
) -> None:
    folder = tmp_path_factory.mktemp("fuzz")
    (folder / "meta.json").write_text(META)
    rows = [json.loads(LINE), json.loads(LINE) | {"id": "b", ours: value}]
    (folder / "a.jsonl").write_text("\n".join(json.dumps(row) for row in rows))
    made = attempt(folder / "a.jsonl", "auto")
    assert made is not None
    out = sum(i.action.startswith("row left out") for i in made.issues)
    assert len(made.observations) + out == 2
    nodes = [NODE, NODE | {"node_id": 1, theirs: value}]
    edges = [{"src": 0, "dst": value, "type": "sequence"}, {"src": 0, "dst": 1, "type": value}]
    (folder / "topological_graph.json").write_text(json.dumps({"nodes": nodes, "edges": edges}))
    made = attempt(folder, "coex")
    assert made is not None
    out = sum(i.action.startswith("row left out") for i in made.issues)
    assert len(made.observations) + out == 2
    assert len(made.edges) + sum(i.action.startswith("edge left out") for i in made.issues) == 2
