"""The shipped sample keeps its promises: valid, consistent with itself, completely labelled."""

import json
import math
import re
from collections import Counter
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import networkx as nx
import pytest

import erag.data.sample as sample
from erag.core.errors import InputError
from erag.core.geometry import distance
from erag.core.text import sentences, words
from erag.core.types import Frame
from erag.data.sample import sample_conditions, sample_dir, sample_queries

MIXED_KEYS = {"at", "sensor", "since", "until"}
FUNCTION_WORDS = {"a", "an", "the", "in", "on", "of", "with", "and"}


def lines(name: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (sample_dir() / name).read_text(encoding="utf-8").splitlines()]


OBSERVATIONS = lines("observations.jsonl")
EDGES = lines("edges.jsonl")
QUERIES = lines("queries.jsonl")
BY_ID = {o["id"]: o for o in OBSERVATIONS}
FINDS = [q for q in QUERIES if q["kind"] != "global"]
VISITS = {v: [o for o in OBSERVATIONS if o["id"][0] == v] for v in "nspa"}


def metres(a: str, b: str) -> float:
    p, q = ([BY_ID[i]["pose"][axis] for axis in "xyz"] for i in (a, b))
    return float(distance(Frame.WGS84, p, q))


def metres_from(at: list[float], node: str) -> float:
    pose = BY_ID[node]["pose"]
    return float(distance(Frame.WGS84, [*at, 0.0], [pose["x"], pose["y"], 0.0]))


def by_rule(rule: str) -> set[str]:
    return {o["id"] for o in OBSERVATIONS if re.search(rule, o["caption"], re.IGNORECASE)}


def graph() -> nx.Graph:
    g = nx.Graph((e["a"], e["b"]) for e in EDGES)
    g.add_nodes_from(BY_ID)
    return g


def test_the_folder_is_complete_and_an_absent_one_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert {"meta.json", "observations.jsonl", "edges.jsonl"} <= {p.name for p in sample_dir().iterdir()}
    assert sample_queries().parent == sample_dir()
    monkeypatch.setattr(sample.resources, "files", lambda _: tmp_path)
    with pytest.raises(InputError, match=re.escape(str(tmp_path))):
        sample_dir()


def test_meta_declares_format_frame_and_sensor() -> None:
    meta = json.loads((sample_dir() / "meta.json").read_text(encoding="utf-8"))
    assert meta == {
        "format": "erag-observations",
        "version": 1,
        "name": "campus",
        "frame": "wgs84",
        "sensors": {"ndvi": {"min": -1, "max": 1}},
    }


def test_observations_have_the_format() -> None:
    assert 60 <= len(OBSERVATIONS) <= 64
    assert len(BY_ID) == len(OBSERVATIONS)
    for o in OBSERVATIONS:
        assert set(o) == {"id", "kind", "time", "pose", "name", "caption", "sensors"}, o["id"]
        assert o["kind"] == "place"
        assert set(o["pose"]) == {"x", "y", "z", "yaw"}
        assert set(o["sensors"]) == {"ndvi"}
        assert -1 <= o["sensors"]["ndvi"] <= 1
        assert -math.pi <= o["pose"]["yaw"] <= math.pi


def test_captions_are_short_distinct_texts() -> None:
    assert len({o["caption"] for o in OBSERVATIONS}) == len(OBSERVATIONS)
    for o in OBSERVATIONS:
        assert 2 <= len(sentences(o["caption"])) <= 4, o["id"]
        assert 30 <= len(words(o["caption"])) <= 90, o["id"]


def test_times_increase_along_each_visit_by_at_most_a_minute() -> None:
    assert sum(len(v) for v in VISITS.values()) == len(OBSERVATIONS)
    for visit in VISITS.values():
        times = [datetime.fromisoformat(o["time"]) for o in visit]
        steps = [(b - a).total_seconds() for a, b in pairwise(times)]
        assert all(5 <= s <= 60 for s in steps), steps
    starts = [v[0]["time"] for v in VISITS.values()]
    assert starts == sorted(starts)
    assert {o["time"][:7] for o in VISITS["n"] + VISITS["s"] + VISITS["p"]} == {"2025-04"}
    assert {o["time"][:7] for o in VISITS["a"]} == {"2025-10"}


def test_the_robot_looks_where_it_drives() -> None:
    for visit in VISITS.values():
        for a, b in pairwise(visit):
            p, q = a["pose"], b["pose"]
            east = (q["x"] - p["x"]) * math.cos(math.radians(p["y"]))
            turn = math.remainder(math.atan2(q["y"] - p["y"], east) - p["yaw"], math.tau)
            assert abs(turn) < 0.05, a["id"]


def test_edges_join_places_a_drive_apart() -> None:
    pairs = [frozenset((e["a"], e["b"])) for e in EDGES]
    assert len(set(pairs)) == len(pairs)
    for e in EDGES:
        assert set(e) == {"a", "b", "kind"}
        assert e["kind"] == "path"
        again = "a" in (e["a"][0], e["b"][0]) and e["a"][0] != e["b"][0]  # the same place in autumn
        assert (0 < metres(e["a"], e["b"]) < 5) if again else (15 <= metres(e["a"], e["b"]) <= 40), e
    for visit in VISITS.values():
        assert all(frozenset((a["id"], b["id"])) in pairs for a, b in pairwise(visit))


def test_one_island_cannot_be_reached() -> None:
    main, island = sorted(nx.connected_components(graph()), key=len, reverse=True)
    assert island == {"p01", "p02", "p03"}
    assert min(metres(i, j) for i in island for j in main) > 50


def test_forty_queries_of_the_stated_kinds() -> None:
    assert len({q["id"] for q in QUERIES}) == 40 == len(QUERIES)
    kinds = Counter("mixed" if MIXED_KEYS & set(q) else q["kind"] for q in QUERIES)
    assert kinds == {"explicit": 16, "implicit": 12, "global": 6, "mixed": 6}
    used = Counter(key for q in QUERIES for key in MIXED_KEYS & set(q))
    assert all(used[key] for key in MIXED_KEYS)
    assert all("query" in q or "at" in q for q in QUERIES)


def test_global_queries_have_golden_answers_and_others_relevant_places() -> None:
    for q in QUERIES:
        if q["kind"] == "global":
            assert len(words(q["golden_answer"])) >= 20
            assert "relevant" not in q
        else:
            assert q["relevant"], q["id"]
            assert len(set(q["relevant"])) == len(q["relevant"])
            assert set(q["relevant"]) <= set(BY_ID)


def test_labels_follow_the_captions() -> None:
    for q in FINDS:
        if not MIXED_KEYS & set(q):
            assert set(q["relevant"]) == by_rule(q["relevance_rule"]), q["id"]
        elif "query" in q:
            assert set(q["relevant"]) <= by_rule(q["relevance_rule"]), q["id"]


def test_implicit_queries_do_not_name_their_target() -> None:
    implicit = [q for q in QUERIES if q["kind"] == "implicit"]
    for q in implicit:
        target = {w.rstrip("s") for w in words(q["target"])} - FUNCTION_WORDS
        assert target, q["id"]
        assert not target & {w.rstrip("s") for w in words(q["query"])}, q["id"]


def test_location_queries_mean_the_nearest() -> None:
    only_at = [q for q in QUERIES if "query" not in q]
    nearest_rack = next(q for q in QUERIES if "nearest" in q.get("query", ""))
    assert len(only_at) == 1
    for q, among in [(only_at[0], set(BY_ID)), (nearest_rack, by_rule(nearest_rack["relevance_rule"]))]:
        best, second = sorted(among, key=lambda i, at=q["at"]: metres_from(at, i))[:2]
        assert q["relevant"] == [best]
        assert metres_from(q["at"], best) * 2 < metres_from(q["at"], second)


def test_time_queries_mean_what_was_seen_then() -> None:
    timed = [q for q in QUERIES if "since" in q]
    assert timed
    for q in timed:
        since, until = (datetime.fromisoformat(q[key]) for key in ("since", "until"))
        seen = {i for i in by_rule(q["relevance_rule"]) if since <= datetime.fromisoformat(BY_ID[i]["time"]) < until}
        assert set(q["relevant"]) == seen != by_rule(q["relevance_rule"])


def test_sensor_queries_agree_with_the_readings() -> None:
    ndvi = {i: o["sensors"]["ndvi"] for i, o in BY_ID.items()}
    for q in (q for q in QUERIES if "sensor" in q):
        wish = q["sensor"]["ndvi"]
        readings = [ndvi[i] for i in q["relevant"]]
        assert max(readings) < 0.2 if wish == "low" else min(readings) > 0.6, q["id"]


def test_unanswerable_queries_have_no_answer_here() -> None:
    unanswerable = lines("unanswerable.jsonl")
    assert len(unanswerable) == 4
    assert all(q["relevant"] == [] for q in unanswerable)
    autumn = " ".join(o["caption"] for o in VISITS["a"]).lower()
    everything = " ".join(o["caption"] for o in OBSERVATIONS).lower()
    assert not re.search(r"swimming|pharmac|chemist's|cinema|\bfilm\b", everything)
    assert "scaffolding" not in autumn
    assert "scaffolding" in everything


def test_labels_of_conditions_follow_from_their_rules() -> None:
    asked = [json.loads(line) for line in sample_conditions().read_text("utf-8").splitlines()]
    assert Counter(q["half"] for q in asked) == {"look": 24, "measure": 24}
    assert len({q["query"] for q in asked} | {q["id"] for q in asked}) == 96
    for q in asked:
        right = by_rule(q["relevance_rule"])
        if "not_rule" in q:
            right -= by_rule(q["not_rule"])
        if "near_rule" in q:
            right = {i for i in right if min(metres(i, j) for j in by_rule(q["near_rule"])) <= 40}
        if "far_rule" in q:
            right = {i for i in right if min(metres(i, j) for j in by_rule(q["far_rule"])) >= 60}
        assert right, q["id"]
        assert set(q["relevant"]) == right, q["id"]
