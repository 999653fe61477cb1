"""Our observation folder as others write it: what is read, what is told."""

import json
import os
from pathlib import Path
from typing import Any

import pytest

from erag.core.errors import InputError
from erag.core.types import EdgeKind, Frame, Interval
from erag.data.jsonl import JsonlReader
from erag.data.reading import Reading

META = {"format": "erag-observations", "version": 1, "frame": "metric"}


def place(i: object, **fields: object) -> dict[str, Any]:
    return {"id": i, "pose": {"x": 1, "y": 2}} | fields


def write(folder: Path, *lines: object, meta: object = META, name: str = "observations.jsonl") -> Path:
    text = "\n".join(line if isinstance(line, str) else json.dumps(line) for line in lines)
    (folder / name).write_text(text, encoding="utf-8")
    (folder / "meta.json").write_text(meta if isinstance(meta, str) else json.dumps(meta), encoding="utf-8")
    return folder


def read(folder: Path, *lines: object, meta: object = META) -> Reading:
    return JsonlReader().read(write(folder, *lines, meta=meta))


def test_a_sound_folder(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(b"x")
    full = place(
        "a",
        kind="object",
        time={"start": "2024-05-17T09:30:00Z", "end": 1715938260.5},
        pose={"x": 1.5, "y": -2, "z": 3, "yaw": 0.25},
        image="a.jpg",
        name="Lamp",
        caption="A lamp.\u2028It shines.",
        sensors={"ndvi": -0.5},
        source="robot 1",
    )
    meta = META | {"name": "lab", "sensors": {"ndvi": {"min": -1, "max": 1}}, "notes": ["z points up"]}
    (tmp_path / "edges.jsonl").write_text('{"a": "a", "b": "b", "kind": "path", "metres": 2.5}\n')
    (tmp_path / "clusters.jsonl").write_text('{"id": "c", "level": 1, "members": ["a", "b"], "summary": "s"}\n')
    made = read(tmp_path, full, "", place("b", time="2024-05"), meta=meta)
    a, b = made.observations
    assert (made.source, made.frame, made.root, made.sensors) == ("lab", Frame.METRIC, tmp_path, {"ndvi": (-1.0, 1.0)})
    assert made.notes == ("z points up",)
    assert (a.id, a.kind, a.pose.xyz, a.pose.yaw, a.image) == ("a", "object", (1.5, -2.0, 3.0), 0.25, "a.jpg")
    assert (a.name, a.caption, a.sensors, a.source) == ("Lamp", "A lamp. It shines.", {"ndvi": -0.5}, "robot 1")
    assert a.time == Interval(1715938200.0, 1715938260.5)
    assert (b.kind, b.pose.z, b.time, b.source) == ("place", 0.0, Interval(1714521600.0, 1717200000.0), "lab")
    assert [(e.a, e.b, e.kind, e.metres) for e in made.edges] == [("a", "b", EdgeKind.PATH, 2.5)]
    assert [(c.id, c.members, c.summary) for c in made.clusters] == [("c", ("a", "b"), "s")]
    assert made.issues == ()


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("{", "not JSON"),
        ("[1]", "no JSON object"),
        ("[" * 200_000, "nested too deep"),
        ('{"id": ' + "9" * 5000 + "}", "too many digits"),
        ('{"id": "x", "id": "y", "pose": {"x": 1, "y": 2}}', "'id' twice"),
        ('{"id": "x", "pose": {"x": 1, "x": 9, "y": 2}}', "'x' twice"),
        ('{"id": "x", "pose": {"x": NaN, "y": 2}}', "x is nan"),
        ('{"id": "x", "pose": {"x": 1e400, "y": 2}}', "x is inf"),
        ('{"id": "x", "pose": [1, 2]}', "no position"),
        ('{"id": "x"}', "no position"),
        ('{"pose": {"x": 1, "y": 2}}', "id is not text"),
        ('{"id": "\\ud800", "pose": {"x": 1, "y": 2}}', "control characters"),
    ],
)
def test_lines_that_cannot_be_used_are_left_out(line: str, told: str, tmp_path: Path) -> None:
    made = read(tmp_path, place("a"), line, place("b"))
    assert [o.id for o in made.observations] == ["a", "b"]
    (issue,) = made.issues
    assert issue.where == "observations.jsonl:2"
    assert told in issue.what
    assert issue.action == "row left out"


def test_a_line_too_long_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("erag.data.jsonl.MAX_LINE", 100)
    made = read(tmp_path, place("a"), place("b", caption="x" * 100))
    assert [o.id for o in made.observations] == ["a"]
    assert "a line of" in made.issues[0].what


@pytest.mark.parametrize(
    "time", [1715938200, "", "soon", ["2024"], {"start": 5}, {"start": 6, "end": 5}, {"start": 0, "end": "x"}]
)
def test_times_that_are_none(time: object, tmp_path: Path) -> None:
    made = read(tmp_path, place("a", time=time))
    assert made.observations[0].time is None
    assert [i.action for i in made.issues] == ["kept without time"]


def test_unknown_keys_are_told_once(tmp_path: Path) -> None:
    made = read(tmp_path, place("a"), *(place(f"b{i}", captoin="x") for i in range(5)), meta=META | {"nmae": "x"})
    assert [(i.where, i.what) for i in made.issues] == [
        ("meta.json", "unknown key 'nmae'"),
        ("observations.jsonl:2", "unknown key 'captoin', in 5 lines"),
    ]


def test_one_file_beside_its_meta(tmp_path: Path) -> None:
    write(tmp_path, place("a"), name="walk.jsonl")
    (tmp_path / "edges.jsonl").write_text("of something else")
    made = JsonlReader().read(tmp_path / "walk.jsonl")
    assert made.source == f"{tmp_path.name}/walk.jsonl"
    assert made.issues == ()


@pytest.mark.parametrize(
    ("meta", "told"),
    [
        ({}, "not version 1 of erag-observations"),
        ([], "not version 1"),
        (META | {"version": 2}, "not version 1"),
        (META | {"frame": "utm"}, "the frame is 'utm'"),
        ({"format": "erag-observations", "version": 1}, "the frame is None"),
        (META | {"sensors": {"t": {"min": 1, "max": 0}}}, "range of the sensor 't' is 1 to 0"),
        (META | {"sensors": {"t": 5}}, "range of the sensor 't' is None to None"),
        (META | {"sensors": [1]}, "the sensors are a list"),
        (META | {"notes": "x"}, "the notes are 'x'"),
        ("{", "not JSON"),
        ("[" * 100_000, "nested too deep"),
        ('{"format": "erag-observations", "version": 1, "frame": "metric", "frame": "wgs84"}', "'frame' twice"),
    ],
)
def test_a_meta_that_is_none(meta: object, told: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=told) as caught:
        read(tmp_path, place("a"), meta=meta)
    assert "meta.json" in caught.value.where


def test_no_meta_and_no_observations(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no observations\.jsonl"):
        JsonlReader().read(tmp_path)
    (tmp_path / "observations.jsonl").write_text(json.dumps(place("a")))
    with pytest.raises(InputError, match=r"the frame is unknown; try: write"):
        JsonlReader().read(tmp_path)


def test_links_out_of_the_folder_are_not_followed(tmp_path: Path) -> None:
    inner, secret = tmp_path / "inner", tmp_path / "secret.jsonl"
    inner.mkdir()
    secret.write_text(json.dumps(place("secret")))
    write(inner, place("a"), place("b"))
    (inner / "edges.jsonl").symlink_to(secret)
    os.mkfifo(inner / "clusters.jsonl")  # opening it would wait for ever
    made = JsonlReader().read(inner)
    assert [(i.where, i.what, i.action) for i in made.issues] == [
        ("edges.jsonl", "a symbolic link leads out of the folder", "not read"),
        ("clusters.jsonl", "is a pipe, socket or device", "not read"),
    ]
    (inner / "observations.jsonl").unlink()
    (inner / "observations.jsonl").symlink_to(secret)
    with pytest.raises(InputError, match="leads out of the folder"):
        JsonlReader().read(inner)


def test_windows_line_ends_and_a_byte_order_mark(tmp_path: Path) -> None:
    write(tmp_path, place("a"), place("b"))
    path = tmp_path / "observations.jsonl"
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert [o.id for o in JsonlReader().read(tmp_path).observations] == ["a", "b"]


def test_clusters_whose_lists_are_none(tmp_path: Path) -> None:
    (tmp_path / "clusters.jsonl").write_text('{"id": "c", "level": 1, "members": "a"}\n{"id": "d", "level": 1}\n[]\n')
    made = read(tmp_path, place("a"))
    assert [(i.where, i.action) for i in made.issues] == [
        (f"clusters.jsonl:{n}", "cluster left out") for n in (1, 3, 2)
    ]
