"""Writing a reading and reading it back: the same, all of it or nothing, and never over what is not ours."""

import json
import math
import string
from dataclasses import replace
from pathlib import Path

import networkx as nx
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from erag.core.errors import InputError
from erag.core.text import clean
from erag.core.types import EdgeKind, Frame, Interval, Observation, Pose
from erag.data.reading import GivenCluster, GivenEdge, Reading
from erag.data.registry import read
from erag.data.writer import write_folder, write_gml

SLOW = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])

finite = st.floats(-1e6, 1e6)
ids = st.text(st.characters(exclude_categories=["Cc", "Cs"]), min_size=1, max_size=30).filter(lambda s: bool(s.strip()))
texts = st.text(max_size=60).map(clean).filter(bool)
optional_texts = st.none() | texts
moments = st.floats(-6e10, 2.5e11)
intervals = st.tuples(moments, moments).map(lambda pair: Interval(min(pair), max(pair))) | st.sampled_from(
    [Interval(0.0, 0.0), Interval(1701388800.0, 1704067200.0), Interval(1704067200.0, 1735689600.0)]
)


@st.composite
def readings(draw: st.DrawFn) -> Reading:
    """Any reading that a reader could have made; images are left out here."""
    names = draw(st.lists(ids, min_size=1, max_size=8, unique=True))
    frame = draw(st.sampled_from(Frame))
    plane = st.tuples(st.floats(10, 12), st.floats(40, 42)) if frame is Frame.WGS84 else st.tuples(finite, finite)
    channels = draw(st.lists(ids, max_size=3, unique=True))
    source = draw(texts)

    def node(name: str) -> Observation:
        return Observation(
            id=name,
            kind=draw(st.sampled_from(["place", "object"])),
            pose=Pose(*draw(plane), draw(finite), draw(st.none() | finite)),
            time=draw(st.none() | intervals),
            name=draw(optional_texts),
            caption=draw(optional_texts),
            sensors={c: draw(st.floats(0, 1)) for c in channels if draw(st.booleans())},
            source=draw(st.just(source) | texts),
        )

    nodes = tuple(node(name) for name in names)
    pairs = draw(
        st.lists(st.tuples(st.sampled_from(names), st.sampled_from(names), st.sampled_from(EdgeKind)), max_size=8)
    )
    unique = {(frozenset((a, b)), kind): (a, b, kind) for a, b, kind in pairs if a != b}
    edges = tuple(GivenEdge(*e, draw(st.none() | st.floats(0, 1e6))) for e in unique.values())
    return Reading(
        source=source,
        root=Path(),
        frame=frame,
        observations=nodes,
        edges=edges,
        clusters=draw(clusters(names)),
        sensors={c: (-1.0, 1.5) for c in channels},
        notes=tuple(draw(st.lists(texts, max_size=2))),
    )


@st.composite
def clusters(draw: st.DrawFn, nodes: list[str]) -> tuple[GivenCluster, ...]:
    """A forest of two levels over some of the nodes."""
    taken = draw(st.lists(st.sampled_from(nodes), min_size=1, unique=True))
    cut = draw(st.integers(0, len(taken)))
    below = [part for part in (taken[:cut], taken[cut:]) if part]
    made = [GivenCluster(f"\x7e{i} L1", 1, tuple(m), draw(texts), draw(texts)) for i, m in enumerate(below)]
    made.append(GivenCluster("\x7e L2", 2, tuple(c.id for c in made), "", draw(texts), (draw(texts),)))
    return tuple(c for c in made if not {c.id for c in made} & set(nodes))


def bare(reading: Reading) -> Reading:
    """A reading without what depends on where it was read."""
    return replace(reading, root=Path(), issues=())


@SLOW
@given(readings())
def test_a_folder_reads_back_the_same(tmp_path_factory: pytest.TempPathFactory, reading: Reading) -> None:
    folder = tmp_path_factory.mktemp("w") / "made"
    write_folder(folder, reading)
    assert bare(read(folder)) == bare(reading)


@SLOW
@given(readings())
def test_gml_reads_back_the_same(tmp_path_factory: pytest.TempPathFactory, reading: Reading) -> None:
    path = tmp_path_factory.mktemp("w") / "made.gml"
    write_gml(path, reading)
    assert bare(read(path)) == bare(reading)


@SLOW
@given(readings())
def test_networkx_reads_our_gml(tmp_path_factory: pytest.TempPathFactory, reading: Reading) -> None:
    path = tmp_path_factory.mktemp("w") / "made.gml"
    write_gml(path, reading)
    graph = nx.read_gml(path)
    assert set(graph) == {o.id for o in reading.observations} | {c.id for c in reading.clusters}
    members = sum(len(c.members) for c in reading.clusters)
    assert graph.number_of_edges() == len(reading.edges) + members
    for o in reading.observations:
        assert tuple(graph.nodes[o.id]["position"].values()) == o.pose.xyz
        assert graph.nodes[o.id].get("caption") == o.caption


def small(root: Path = Path(), **fields: object) -> Reading:
    node = Observation("a", "place", Pose(1.0, 2.0), source="s")
    return Reading("s", root, Frame.METRIC, (replace(node, **fields),))  # type: ignore[arg-type]


def test_hostile_texts_survive_gml(tmp_path: Path) -> None:
    text = 'node [ id 9 ] " ] &#34; &amp; \\ é 🚗 __import__("os")'
    write_gml(tmp_path / "a.gml", small(caption=text, name=text, id='x" ] node [ label "y'))
    made = read(tmp_path / "a.gml")
    (o,) = made.observations
    assert (o.id, o.caption, o.name) == ('x" ] node [ label "y', text, text)
    assert made.issues == ()
    assert nx.read_gml(tmp_path / "a.gml").nodes[o.id]["caption"] == text


def test_images_are_copied_and_found(tmp_path: Path) -> None:
    root = tmp_path / "source"
    (root / "frames").mkdir(parents=True)
    (root / "frames" / "a.jpg").write_bytes(b"picture")
    reading = small(root, image="frames/a.jpg")
    write_folder(tmp_path / "made", reading)
    assert read(tmp_path / "made").observations == reading.observations
    assert (tmp_path / "made" / "frames" / "a.jpg").read_bytes() == b"picture"
    write_folder(tmp_path / "made", read(tmp_path / "made"))  # over itself
    assert (tmp_path / "made" / "frames" / "a.jpg").read_bytes() == b"picture"
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith(".")] == []


@pytest.mark.parametrize("image", ["gone.jpg", "../secret.jpg", "link.jpg", "meta.json"])
def test_images_that_cannot_be_copied(image: str, tmp_path: Path) -> None:
    root = tmp_path / "source"
    root.mkdir()
    (tmp_path / "secret.jpg").write_bytes(b"x")
    (root / "meta.json").write_bytes(b"x")
    (root / "link.jpg").symlink_to(tmp_path / "secret.jpg")
    with pytest.raises(InputError):
        write_folder(tmp_path / "made", small(root, image=image))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["secret.jpg", "source"]


def test_one_of_ours_is_replaced_whole(tmp_path: Path) -> None:
    first = replace(small(), edges=(), clusters=(GivenCluster("c", 1, ("a",), "", "s"),))
    write_folder(tmp_path / "made", first)
    assert (tmp_path / "made" / "clusters.jsonl").is_file()
    write_folder(tmp_path / "made", small(caption="New."))
    assert sorted(p.name for p in (tmp_path / "made").iterdir()) == ["meta.json", "observations.jsonl"]
    assert read(tmp_path / "made").observations[0].caption == "New."


@pytest.mark.parametrize("stranger", ["notes.txt", "frames/other.jpg", "edges.jsonl.bak"])
def test_a_folder_with_other_files_is_not_touched(stranger: str, tmp_path: Path) -> None:
    made = tmp_path / "made"
    write_folder(made, small())
    (made / stranger).parent.mkdir(exist_ok=True)
    (made / stranger).write_text("mine")
    before = {p: p.read_bytes() for p in made.rglob("*") if p.is_file()}
    with pytest.raises(InputError, match="holds other files"):
        write_folder(made, small(caption="New."))
    assert {p: p.read_bytes() for p in made.rglob("*") if p.is_file()} == before


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "dir").mkdir()
    for name in ("file", "link", "file/below"):
        with pytest.raises(InputError):
            write_folder(tmp_path / name, small())
    for name in ("dir", "file/below.gml"):
        with pytest.raises(InputError):
            write_gml(tmp_path / name, small())
    write_folder(tmp_path / "dir", small())  # empty folders may be filled
    assert (tmp_path / "file").read_text() == "x"


@pytest.mark.parametrize(
    "fields",
    [
        {"id": ""},
        {"id": "a\x00"},
        {"id": "\ud800"},
        {"caption": ""},
        {"caption": " two  spaces "},
        {"name": "\x1b[31m"},
        {"sensors": {"t": math.nan}},
        {"time": Interval(1e15, 1e16)},
        {"pose": Pose(1e12, 0.0)},
        {"kind": "tree"},
    ],
)
def test_what_would_not_read_back_is_refused(fields: dict[str, object], tmp_path: Path) -> None:
    with pytest.raises(InputError):
        write_folder(tmp_path / "made", small(**fields))  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


def test_what_is_refused_is_named(tmp_path: Path) -> None:
    reading = replace(small(), observations=(small().observations[0], small(id="b", caption=" x").observations[0]))
    with pytest.raises(InputError, match="the observation 2 cannot be written as it is"):
        write_folder(tmp_path / "made", reading)
    with pytest.raises(InputError, match="the name, sensors or notes"):
        write_folder(tmp_path / "made", replace(small(), notes=("\x07",)))
    with pytest.raises(InputError, match="the edge 1 cannot be written"):
        write_folder(tmp_path / "made", replace(small(), edges=(GivenEdge("a", "b", EdgeKind.PATH),)))


def test_gml_refuses_ids_that_clash_or_lead_nowhere(tmp_path: Path) -> None:
    twice = replace(small(), clusters=(GivenCluster("a", 1, ("a",)),))
    with pytest.raises(InputError, match="the id 'a' is used twice"):
        write_gml(tmp_path / "a.gml", twice)
    with pytest.raises(InputError, match="names 'b', which is no node"):
        write_gml(tmp_path / "a.gml", replace(small(), edges=(GivenEdge("a", "b", EdgeKind.PATH),)))
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_folder(tmp_path / "made", small())
    write_gml(tmp_path / "a.gml", small())
    before = (tmp_path / "a.gml").read_bytes()

    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(InputError, match="No space left"):
        write_folder(tmp_path / "made", small(caption="New."))
    with pytest.raises(InputError, match="No space left"):
        write_gml(tmp_path / "a.gml", small(caption="New."))
    assert read(tmp_path / "made").observations == small().observations
    assert (tmp_path / "a.gml").read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.gml", "made"]


def test_the_folder_is_plain_to_read(tmp_path: Path) -> None:
    reading = replace(small(name="Café", time=Interval(1701388800.0, 1704067200.0)), edges=())
    write_folder(tmp_path / "made", reading)
    line = (tmp_path / "made" / "observations.jsonl").read_text(encoding="utf-8")
    assert set(line) - set(string.printable) == {"é"}
    assert json.loads(line) == {
        "id": "a",
        "kind": "place",
        "pose": {"x": 1.0, "y": 2.0, "z": 0.0},
        "time": "2023-12",
        "name": "Café",
    }
