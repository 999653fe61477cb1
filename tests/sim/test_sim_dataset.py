"""The data set: read back by the readers, resumable to the same bytes, queries that follow from the truth."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("pybullet", reason="the extra `sim` is not installed")

from PIL import Image

from erag.core.errors import InputError
from erag.core.types import EdgeKind
from erag.data.contract import parse_at, read_queries
from erag.data.registry import read
from erag.sim.camera import Size
from erag.sim.captions import caption
from erag.sim.dataset import CHUNK, Plan, build, open_world
from erag.sim.queries import queries
from erag.sim.truth import VISIBLE, View, read_truth
from erag.sim.vocabulary import kin

TINY = Size(48, 36)
PLAN = Plan(("warehouse",), size=TINY)


class Killed(Exception):
    """Stands for a process that ends in the middle."""


def files(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.fixture(scope="module")
def truth(rendered: Path) -> list[View]:
    return read_truth(rendered / "truth" / "house.jsonl")


@pytest.fixture(scope="module")
def lines(rendered: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (rendered / "queries.jsonl").read_text().splitlines()]


def test_our_reader_takes_all_of_it(rendered: Path) -> None:
    reading = read(rendered / "worlds" / "house")
    assert not reading.issues
    kinds = Counter(o.kind for o in reading.observations)
    assert kinds["place"] == sum(len(w.stops) for w in open_world("house", 0))
    assert kinds["object"] > 40
    for o in reading.observations:
        if o.kind == "place":
            assert o.image
            assert o.pose.yaw is not None
            assert "ndvi" in o.sensors
    assert Counter(e.kind for e in reading.edges)[EdgeKind.PATH] == kinds["place"] - 2
    assert reading.sensors == {"ndvi": (-1.0, 1.0)}
    assert all(o.caption is None for o in reading.observations)


def test_gml_says_the_same_as_the_folder(rendered: Path) -> None:
    folder, gml = read(rendered / "worlds" / "house"), read(rendered / "gml" / "house.gml")
    assert [(o.id, o.pose, o.sensors) for o in folder.observations] == [
        (o.id, o.pose, o.sensors) for o in gml.observations
    ]
    assert len(folder.edges) == len(gml.edges)


def test_images_have_the_size_asked_for(rendered: Path) -> None:
    for path in (rendered / "worlds" / "house" / "images").iterdir():
        with Image.open(path) as image:
            assert (image.format, image.size, image.mode) == ("JPEG", (96, 72), "RGB")


def test_truth_stands_beside_every_image(rendered: Path, truth: list[View]) -> None:
    images = {p.stem for p in (rendered / "worlds" / "house" / "images").iterdir()}
    assert {v.node for v in truth} == images
    assert {v.visit for v in truth} == {1, 2}
    for v in truth:
        assert sum(o.share for o in v.objects) + v.sky <= 1.0001
        assert all(o.share > 0 and 0 <= o.box[0] < o.box[2] <= 1 and 0 <= o.box[1] < o.box[3] <= 1 for o in v.objects)
        assert [o.share for o in v.objects] == sorted((o.share for o in v.objects), reverse=True)
        assert all(o.share >= VISIBLE for o in v.visible)


def test_captions_name_what_is_most_visible_and_vary(truth: list[View]) -> None:
    from erag.sim.captions import groups_of
    from erag.sim.vocabulary import plural

    for v in truth:
        assert 1 <= v.caption.count(". ") + 1 <= 5
        assert v.caption == caption(v, "family house")
        for group in groups_of(v.visible)[:3]:
            assert group[0].name in v.caption or plural(group[0].name) in v.caption or "people" in v.caption, v.caption
    assert len({v.caption for v in truth}) > 0.9 * len(truth)


def test_killed_and_run_again_it_ends_with_the_same_bytes(tmp_path: Path) -> None:
    build(tmp_path / "whole", PLAN)
    total = len(open_world("warehouse", 0)[0].stops)

    def kill(stage: str, done: int, of: int) -> None:
        if done < of:
            raise Killed

    for _ in range(total // CHUNK - 1):  # each run gets one chunk further
        with pytest.raises(Killed):
            build(tmp_path / "parts", PLAN, kill)
    build(tmp_path / "parts", PLAN, jobs=2)  # the rest in processes of their own
    assert files(tmp_path / "parts") == files(tmp_path / "whole")
    assert not (tmp_path / "parts" / ".work").exists()


def test_a_world_is_not_rendered_twice(rendered: Path) -> None:
    before = {p: p.stat().st_mtime_ns for p in (rendered / "worlds").rglob("*.jpg")}
    build(rendered, Plan(("house",), size=Size(96, 72)))
    assert {p: p.stat().st_mtime_ns for p in (rendered / "worlds").rglob("*.jpg")} == before


def test_without_sensors_objects_and_with_captions(tmp_path: Path) -> None:
    build(tmp_path / "set", Plan(("warehouse",), "e-image", size=TINY, objects=False, captions="truth"))
    reading = read(tmp_path / "set" / "worlds" / "warehouse")
    assert not reading.sensors
    assert all(o.kind == "place" and not o.sensors and o.caption for o in reading.observations)
    asked = [json.loads(line) for line in (tmp_path / "set" / "queries.jsonl").read_text().splitlines()]
    assert not any("sensor" in q for q in asked)
    ids = {o.id for o in reading.observations}
    assert all(set(q["relevant"]) <= ids for q in asked if "relevant" in q)


def test_another_plan_and_foreign_folders_are_refused(rendered: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="other settings"):
        build(rendered, Plan(("house",), size=Size(64, 48)))
    (tmp_path / "letter.txt").write_text("mine")
    with pytest.raises(InputError, match="other files"):
        build(tmp_path, PLAN)
    assert (tmp_path / "letter.txt").read_text() == "mine"


def test_queries_keep_the_contract(rendered: Path, lines: list[dict[str, Any]]) -> None:
    parsed = list(read_queries(rendered / "queries.jsonl", {}))
    assert len(parsed) == len(lines)
    assert len({q["id"] for q in lines}) == len(lines)
    assert {q["kind"] for q in lines} == {"explicit", "implicit", "global"}
    assert {q["task"] for q in lines} == {"find", "describe", "count", "change", "unanswerable", "last_seen"}
    assert all(q["environment"] == "house" and q["split"] == "train" for q in lines)
    for q in lines:
        if "at" in q:
            parse_at(q["at"], "test", lambda x, y: 0.0)


def test_relevance_follows_from_the_truth(rendered: Path, lines: list[dict[str, Any]], truth: list[View]) -> None:
    ids = {o.id for o in read(rendered / "worlds" / "house").observations}
    for q in lines:
        if q["task"] != "find":
            continue
        assert q["relevant"]
        assert set(q["relevant"]) <= ids
        names = str(q["target"]).split(" or ")
        for v in truth:
            shown = any(o.name in names for o in v.visible)
            assert shown or v.node not in q["relevant"]
            if q["kind"] == "implicit":
                assert shown == (v.node in q["relevant"])


def test_counts_changes_and_the_unanswerable_are_true(lines: list[dict[str, Any]], truth: list[View]) -> None:
    first, second = open_world("house", 0)
    for q in lines:
        if q["task"] == "count":
            seen = {o.instance for v in truth if v.visit == 1 for o in v.visible if o.name == q["target"]}
            assert len(seen) == q["count"]
        if q["task"] == "unanswerable":
            assert q["relevant"] == []
            assert not {t.name for w in (first, second) for t in w.things if t} & set(str(q["target"]).split(" or "))
        if q["task"] == "change" and q["kind"] == "explicit":
            assert q["since"] == second.when.start
            assert all("-b-" in n or n.endswith("@b") for n in q["relevant"])
    assert {q["task"] for q in lines} >= {"count", "change", "unanswerable"}


def test_last_sightings_are_the_last(lines: list[dict[str, Any]], truth: list[View]) -> None:
    asked = [q for q in lines if q["task"] == "last_seen"]
    assert asked
    assert {q["kind"] for q in asked} == {"explicit", "global"}
    gone = 0
    for q in asked:
        shown = [v for v in truth if {o.name for o in v.visible} & set(kin(q["target"]))]
        latest = max(shown, key=lambda v: v.node)  # house-a-0007 before house-b-0001
        assert latest.node in q["relevant"]
        assert all(node in {v.node for v in shown} for node in q["relevant"])
        assert q["seen_at"][:10] in q["golden_answer"]
        gone += latest.visit == 1
    assert gone >= 1


def test_a_wish_for_low_ndvi_asks_for_the_lower_third(truth: list[View]) -> None:
    from erag.sim.asking import Known

    known = Known(open_world("house", 0), truth, objects=False)
    nodes = [v.node for v in truth]
    low, high = known.with_ndvi(nodes, "low"), known.with_ndvi(nodes, "high")
    readings = {v.node: v.ndvi for v in truth}
    assert max(readings[n] for n in low) < min(readings[n] for n in high)
    assert len(low) == pytest.approx(len(nodes) / 3, abs=6)


def test_the_same_seed_asks_the_same(truth: list[View]) -> None:
    visits = open_world("house", 0)
    assert queries(visits, truth, "e-multimodal", 3) == queries(visits, truth, "e-multimodal", 3)
    assert queries(visits, truth, "e-multimodal", 3) != queries(visits, truth, "e-multimodal", 4)
