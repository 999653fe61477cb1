"""From image files to captions in a memory: what is looked at, what is kept, what happens to files that are broken."""

from __future__ import annotations

import json
import shutil
import signal
import sqlite3
import struct
import subprocess
import sys
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from erag.cli.main import run
from erag.core.types import Edges, Frame, Observation, TopoMap
from erag.data.jsonl import JsonlReader
from erag.forest.facts import cluster_facts
from erag.forest.vocabulary import map_vocabulary
from erag.lm.compose import compose
from erag.lm.fake import Fake
from erag.lm.images import load_all
from erag.lm.journal import Journal
from erag.lm.ledger import Ledger
from erag.lm.roles import Caption, RoleName, Roles
from erag.memory.diff import diff
from erag.memory.file import MemoryFile
from erag.pipeline.captions import BAD, CaptionsConfig, look
from erag.pipeline.ingest import ingest
from erag.pipeline.load import load
from erag.pipeline.session import Memory, open_memory

N = 12
FAKE = "backend: {models: {fake: {kind: fake, call_size: 4}}, roles: {embed: fake, caption: fake}}\n"


def _png_header(width: int, height: int) -> bytes:
    """A PNG that says it is large and holds nothing."""
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    parts = [(b"IHDR", header), (b"IDAT", zlib.compress(b"")), (b"IEND", b"")]
    chunks = (struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in parts)
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    """A drive with twelve images, of which node 3 has a caption of its own."""
    folder = tmp_path / "drive"
    (folder / "images").mkdir(parents=True)
    (folder / "meta.json").write_text('{"format": "erag-observations", "version": 1, "frame": "metric"}')
    rows = []
    for i in range(N):
        pixels = np.random.default_rng(i).integers(0, 255, (24, 32, 3)).astype(np.uint8)
        Image.fromarray(pixels).save(folder / "images" / f"{i}.png")
        rows.append({"id": f"n{i}", "pose": {"x": 3.0 * i, "y": 0.0}, "image": f"images/{i}.png"})
    rows[3]["caption"] = "A red bench under a lime tree."
    rows.append({"id": "dark", "pose": {"x": 99.0, "y": 0.0}, "caption": "A dark corner."})
    (folder / "observations.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    return folder


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "fake.yaml"
    path.write_text(FAKE)
    return path


def _built(drive: Path, config: Path, out: Path, *overrides: str) -> Memory:
    memory = open_memory(out, config=config, overrides=overrides)
    memory.ingest(drive)
    memory.build()
    return memory


def _nodes(path: Path) -> dict[str, Observation]:
    return {node.id: node for node in load(path).corpus.topomap.nodes}


def _break_images(drive: Path) -> None:
    """Truncated, an absurd header, text; and four that are odd but sound: CMYK, 16 bits, a wrong ending, a link."""
    images = drive / "images"
    (images / "0.png").write_bytes((images / "0.png").read_bytes()[:60])
    (images / "1.png").write_bytes(_png_header(50_000, 50_000))
    (images / "2.png").write_text("no picture")
    Image.new("CMYK", (20, 10), (0, 90, 90, 0)).save(images / "4.png", "TIFF")
    Image.fromarray(np.full((9, 9), 40_000, np.uint16)).save(images / "5.png")
    Image.new("RGB", (20, 10), (9, 8, 7)).save(images / "6.png", "JPEG")
    (images / "7.png").rename(images / "real.png")
    (images / "7.png").symlink_to("real.png")


def test_broken_images_through_the_command_line(
    drive: Path, config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _break_images(drive)
    path, away = tmp_path / "m.erag", tmp_path / "away"
    assert run(["ingest", str(drive), "--out", str(path)]) == 0
    assert run(["build", str(path), "--config", str(config), "--quarantine", str(away)]) == 0
    said = capsys.readouterr()
    assert "captions: 8 of 11 images captioned" in said.out
    assert "images/1.png: its header says more than 64,000,000 pixels" in said.out
    assert "images/2.png: is no image of the formats" in said.out
    assert f"{BAD}: 3" in said.out
    assert "3 images moved" in said.err
    assert sorted(p.name for p in (away / "images").iterdir()) == ["0.png", "1.png", "2.png"]
    nodes = _nodes(path)
    assert len(nodes) == N + 1
    assert [i for i in range(N) if nodes[f"n{i}"].caption is None] == [0, 1, 2]
    assert nodes["n3"].caption == "A red bench under a lime tree."
    assert run(["query", str(path), "a red bench", "--config", str(config)]) == 0


def test_an_image_that_was_repaired_is_captioned_next_time(drive: Path, config: Path, tmp_path: Path) -> None:
    sound = (drive / "images/0.png").read_bytes()
    _break_images(drive)
    memory = _built(drive, config, tmp_path / "m.erag")
    again = memory.build()
    assert again.current
    assert [image.path.name for bad in again.bad.values() for image in bad] == ["0.png", "1.png", "2.png"]
    (drive / "images/0.png").write_bytes(sound)
    assert not memory.build().current
    assert _nodes(memory.path)["n0"].caption is not None


@pytest.mark.parametrize(
    ("choice", "own", "others", "dark"),
    [("missing", True, True, True), ("all", False, True, False), ("none", True, False, True)],
)
def test_which_images_are_looked_at(
    drive: Path, config: Path, tmp_path: Path, choice: str, own: bool, others: bool, dark: bool
) -> None:
    memory = _built(drive, config, tmp_path / "m.erag", f"captions.look={choice}")
    nodes = _nodes(memory.path)
    assert (nodes["n3"].caption == "A red bench under a lime tree.") == own
    assert all((nodes[f"n{i}"].caption is not None) == others for i in range(N) if i != 3)
    assert (nodes["dark"].caption is not None) == dark


def test_without_eyes_the_report_says_what_was_not_seen(drive: Path, tmp_path: Path, fake_config: Path) -> None:
    memory = open_memory(tmp_path / "m.erag", config=fake_config)
    memory.ingest(drive)
    report = memory.build()
    assert "captions: 11 images have no caption, and no model plays the role caption" in report.lines


def test_captions_are_replayed_when_the_images_are_gone(drive: Path, config: Path, tmp_path: Path) -> None:
    memory = _built(drive, config, tmp_path / "m.erag")
    before = _nodes(memory.path)
    shutil.rmtree(drive)
    other = open_memory(memory.path, config=config, overrides=["forest.alpha=0.4"])
    report = other.build()
    assert report.ledger.calls["caption"] == 0
    assert any("are gone: 11 captions were read from records, 0 nodes stay without one" in s for s in report.lines)
    assert _nodes(memory.path) == before


def test_images_that_are_gone_before_they_were_seen_take_one_line(drive: Path, config: Path, tmp_path: Path) -> None:
    memory = open_memory(tmp_path / "m.erag", config=config)
    memory.ingest(drive)
    shutil.rmtree(drive)
    report = memory.build()
    told = [line for line in report.lines if "drive" in line or ".png" in line]
    assert len(told) == 1
    assert "0 captions were read from records, 11 nodes stay without one" in told[0]
    assert report.ledger.events[BAD] == 11


def test_equal_images_are_captioned_once(drive: Path, config: Path, tmp_path: Path) -> None:
    for i in range(1, N):
        shutil.copyfile(drive / "images/0.png", drive / f"images/{i}.png")
    memory = open_memory(tmp_path / "m.erag", config=config)
    memory.ingest(drive)
    assert memory.build().ledger.calls["caption"] == 1


def test_an_export_holds_what_was_seen(drive: Path, config: Path, tmp_path: Path) -> None:
    memory = _built(drive, config, tmp_path / "m.erag")
    assert run(["export", str(memory.path), "--out", str(tmp_path / "out"), "--format", "jsonl"]) == 0
    back = {o.id: o.caption for o in JsonlReader().read(tmp_path / "out").observations}
    assert back == {id_: node.caption for id_, node in _nodes(memory.path).items()}


DOOMED = """
import os, signal, sys
from erag.memory.calls import Calls
from erag.pipeline.session import open_memory

left, whole = [int(sys.argv[3])], Calls.finish

def finish(self, *args):
    whole(self, *args)
    left[0] -= 1
    if left[0] == 0:
        os.kill(os.getpid(), signal.SIGKILL)

Calls.finish = finish
memory = open_memory(sys.argv[1], config=sys.argv[2])
memory.build()
"""


def test_a_killed_build_goes_on_and_captions_nothing_twice(drive: Path, config: Path, tmp_path: Path) -> None:
    whole = _built(drive, config, tmp_path / "whole.erag")
    broken = open_memory(tmp_path / "broken.erag", config=config)
    broken.ingest(drive)
    command = [sys.executable, "-c", DOOMED, str(broken.path), str(config), "2"]
    assert subprocess.run(command, check=False).returncode == -signal.SIGKILL
    report = broken.build()
    assert (report.ledger.replayed["caption"], report.ledger.calls["caption"]) == (8, 3)
    with MemoryFile.reading(whole.path) as a, MemoryFile.reading(broken.path) as b:
        assert diff(a, b) == []


class Eyes:
    """A captioner that names two objects and says neither, and nothing at all of dark images."""

    roles: frozenset[RoleName] = frozenset({"caption"})

    def identity(self, role: RoleName) -> str:
        return "eyes"

    fingerprint = identity

    def batch_size(self, role: RoleName) -> int:
        return 5

    def caption(self, images: Sequence[Path]) -> list[Caption]:
        load_all(images)
        return [Caption("A view of\x07 somewhere.", ("fire hydrant", "stop sign")) for _ in images]


def test_objects_are_kept_and_counted_as_facts(drive: Path, tmp_path: Path) -> None:
    ingest(drive, tmp_path / "m.erag")
    backend = compose({"eyes": Eyes(), "fake": Fake()}, Roles({"caption": "eyes", "embed": "fake"}))
    seen: list[tuple[str, int, int]] = []
    with MemoryFile.writing(tmp_path / "m.erag", "test") as memory:
        ledger = Ledger()
        looked = look(
            memory, Journal(backend, memory.calls, ledger), CaptionsConfig(), eyes=True,
            progress=lambda *told: seen.append(told),
        )  # fmt: skip
        nodes = looked.nodes(memory.observations.nodes())
    assert seen[0] == ("caption", 0, 11)
    assert seen[-1] == ("caption", 11, 11)
    assert nodes[0].caption == "A view of somewhere."
    assert nodes[0].objects == ("fire hydrant", "stop sign")
    assert nodes[3].objects == ()
    facts = cluster_facts(map_vocabulary(TopoMap(Frame.METRIC, nodes, Edges.empty())), np.arange(N))
    told = {fact.entry.shown: fact.views for fact in facts}
    assert told["fire hydrant"] == 11


def test_a_memory_of_the_version_before_is_read_after_a_build(drive: Path, config: Path, tmp_path: Path) -> None:
    memory = open_memory(tmp_path / "m.erag", config=config)
    memory.ingest(drive)
    connection = sqlite3.connect(memory.path)
    connection.executescript("DROP TABLE seen; DROP TABLE image_hashes; PRAGMA user_version = 1;")
    connection.close()
    assert run(["inspect", str(memory.path)]) == 2
    memory.build()
    assert run(["inspect", str(memory.path)]) == 0
    assert _nodes(memory.path)["n0"].caption is not None
