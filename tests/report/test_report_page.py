"""The page as a file: complete, escaped, without a request, the same bytes every time."""

import base64
import hashlib
import re
from pathlib import Path

import pytest
from report_worlds import HOSTILE, MakeMemory, MakePage, parse, places

from erag.core.errors import InputError, MemoryFileError
from erag.core.types import Query
from erag.data.contract import QueryLine
from erag.data.sample import sample_dir
from erag.lm.weights import default_store
from erag.pipeline.config import load_config
from erag.pipeline.load import load
from erag.pipeline.query import Asker
from erag.pipeline.session import open_memory
from erag.report.asking import Asked
from erag.report.memory import read_shown, role_models
from erag.report.page import render, write_page

ADDRESSES = ("src", "href", "srcset", "action", "formaction", "poster", "data", "xlink:href", "background", "ping")
QUESTIONS = ("a fire hydrant", "What is the vegetation like here?")
START = (1.122801, 52.410072)


def test_no_address_but_data_and_no_way_to_make_a_request(campus: Path, make_page: MakePage) -> None:
    page = parse(make_page(campus, QUESTIONS, at=START).html)
    for _, attributes in page.elements:
        for name in ADDRESSES:
            assert attributes.get(name, "data:").startswith(("data:", "#")), attributes
        assert not [name for name in attributes if name.startswith("on") or name == "style"], attributes
    style, script = "".join(page.raw["style"]), page.raw["script"][-1]
    assert "url(" not in style
    assert "@import" not in style
    assert not re.search(
        r"https?:|fetch\(|XMLHttp|WebSocket|import\(|sendBeacon|eval\(|innerHTML|document\.write", script
    )


def test_the_policy_allows_our_style_and_script_and_nothing_else(campus: Path, make_page: MakePage) -> None:
    page = parse(make_page(campus).html)
    (policy,) = [a["content"] for a in page.with_attribute("http-equiv", "meta")]
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == rules["base-uri"] == rules["form-action"] == "'none'"
    assert rules["img-src"] == "data:"
    for rule, text in (("style-src", "".join(page.raw["style"])), ("script-src", page.raw["script"][-1])):
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert rules[rule] == f"'sha256-{digest}'"


def test_every_node_edge_and_cluster_is_there(campus: Path, make_page: MakePage) -> None:
    page, built = parse(make_page(campus).html), load(campus).corpus
    rows = [int(a["data-node"]) for a in page.with_attribute("data-node", "circle")]
    assert sorted(rows) == list(range(62))
    leaves = [int(a["data-node"]) for a in page.with_attribute("data-node", "button")]
    assert sorted(leaves) == list(range(62))
    assert [n[0] for n in page.data["nodes"]] == [n.id for n in built.topomap.nodes]
    clusters = [int(a["data-cluster"]) for a in page.with_attribute("data-cluster", "details")]
    assert sorted(clusters) == list(range(len(built.forest.clusters)))
    segments = sum(a["d"].count("M") for a in page.with_attribute("d", "path") if "data-kind" in a)
    assert segments == len(built.topomap.edges) == 74
    for cluster in built.forest.clusters:
        assert cluster.id in page.shown
    for said in ("62 nodes", "74 edges", "74 path", "fake (embed)", "2025-04-24 to 2025-10-16", "nodes per level"):
        assert said in page.shown


def test_the_tree_is_that_of_the_forest(campus: Path, make_page: MakePage) -> None:
    page, forest = parse(make_page(campus).html), load(campus).corpus.forest
    above = [int(p) - forest.n_leaves if p >= 0 else -1 for p in forest.parent]
    assert [node[7] for node in page.data["nodes"]] == above[: forest.n_leaves]
    assert [cluster[3] for cluster in page.data["clusters"]] == above[forest.n_leaves :]
    roots = [c for c in page.data["clusters"] if c[3] == -1]
    loose = above[: forest.n_leaves].count(-1)
    assert sum(c[4] for c in roots) + loose == 62


def test_an_answer_with_waypoint_route_hits_and_scores(campus: Path, make_page: MakePage) -> None:
    page = parse(make_page(campus, QUESTIONS, at=START).html)
    find, explain = page.data["questions"]
    assert find["goal"] == find["hits"][0]
    assert len(find["way"]) > 1
    assert find["start"] == page.data["nodes"][0][5:7]
    assert page.data["nodes"][find["way"][0]][0] == "n01"
    assert explain["goal"] is None
    assert explain["seen"]
    assert len(list(page.with_attribute("value", "meter"))) == 10
    opened = [a for a in page.with_attribute("data-question", "details") if "open" in a]
    assert [a["data-question"] for a in opened] == ["0"]
    for said in (
        "Go to ",
        " m over ",
        "it was described as",
        "semantic",
        "spatial",
        "calls: 1 embed",
        "from 1.1228, 52.4101",
    ):
        assert said in page.shown


def test_text_from_the_world_is_text(make_memory: MakeMemory, make_page: MakePage) -> None:
    rows = places(12, name=HOSTILE, sensors={HOSTILE[:20]: 0.5})
    for row in rows:
        row["caption"] = f"{HOSTILE} {row['caption']}"
    rows[0]["id"] = f"{HOSTILE[:40]}"
    memory = make_memory(rows)
    page = parse(make_page(memory, [f"{HOSTILE} bench"]).html)
    assert [t for t, _ in page.elements if t == "script"] == ["script", "script"]
    assert {t for t, _ in page.elements if t in ("img", "iframe", "object", "embed", "form", "base")} == {"img"}
    assert [a for a in page.with_attribute("src")] == []
    assert page.data["nodes"][0][0] == HOSTILE[:40]
    assert page.data["nodes"][3][1] == HOSTILE
    assert HOSTILE in page.shown
    assert "</script" not in page.raw["script"][0]
    assert "<!--" not in page.raw["script"][0]


def test_names_without_a_letter_and_marks_that_turn_the_line(make_memory: MakeMemory, make_page: MakePage) -> None:
    rows = places(6, name="\u202egnp.exe\u2069 \x07 𝒳 日本", caption="a bench \u2028 by\u0000 the sea")
    page = make_page(make_memory(rows), ["a bench\u202e"])
    assert not {"\u202e", "\u2069", "\x07", "\u2028", "\x00"} & set(page.html)
    assert parse(page.html).data["nodes"][0][1] == "gnp.exe 𝒳 日本"


def test_the_same_bytes_every_time(campus: Path, make_page: MakePage) -> None:
    assert make_page(campus, QUESTIONS, at=START).html == make_page(campus, QUESTIONS, at=START).html


def test_a_second_memory_of_the_same_source_gives_the_same_page(
    tmp_path: Path, make_page: MakePage, fake_config: Path
) -> None:
    pages = []
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        memory = open_memory(tmp_path / folder / "campus.erag", config=fake_config)
        memory.ingest(sample_dir())
        memory.build()
        pages.append(make_page(memory.path, QUESTIONS).html)
    assert pages[0] == pages[1]


def test_nothing_asked_and_nothing_found(campus: Path, make_memory: MakeMemory, make_page: MakePage) -> None:
    asked_nothing = parse(make_page(campus).html)
    assert "Nothing was asked of this memory." in asked_nothing.shown
    assert asked_nothing.data["questions"] == []
    mute = make_memory([{"id": f"m{i}", "pose": {"x": float(i), "y": 0.0}} for i in range(3)], name="mute")
    page = parse(make_page(mute, ["a tree"]).html)
    assert "Not in this memory." in page.shown
    assert "1 refused" in page.shown
    assert page.data["questions"] == [{"start": None, "goal": None, "way": [], "hits": [], "seen": []}]


def test_one_node_has_a_page(make_memory: MakeMemory, make_page: MakePage) -> None:
    page = parse(make_page(make_memory(places(1)), ["bench"]).html)
    assert page.data["size"] == [800, 800]
    assert page.data["nodes"][0][5:7] == [400, 400]


def test_a_line_that_cannot_be_asked_is_shown_as_failed(campus: Path, make_page: MakePage) -> None:
    lines = [
        QueryLine(1, "line 1", None),
        QueryLine(2, "q2", {"id": "q2", "query": "grass", "sensor": {"noise": "low"}}),
        QueryLine(3, "q3", {"id": "q3", "query": ["<b>"], "kind": "x"}),
        QueryLine(4, "q4", {"id": "q4", "query": "grass", "sensor": {"ndvi": [0.1, 0.9]}, "since": "2025-10"}),
    ]
    page = parse(make_page(campus, lines=lines).html)
    statuses = [a["class"] for a in page.with_attribute("data-question", "details")]
    assert statuses[:3] == ["question error"] * 3
    assert statuses[3] != "question error"
    assert "3 failed" in page.shown
    assert "ndvi 0.1 to 0.9; since 2025-10-01T00:00:00Z" in page.shown
    assert "noise" in page.shown


def test_metric_and_wgs84_maps_say_which_they_are(campus: Path, make_memory: MakeMemory, make_page: MakePage) -> None:
    metric = parse(make_page(make_memory(places(6))).html)
    assert "x right, y up" in metric.shown
    assert metric.data["nodes"][1][9] == "3.00, 1.00, 0.00 m"
    assert metric.data["unit"] == pytest.approx(15 / 10_000)
    wgs84 = parse(make_page(campus).html)
    assert "north is up" in wgs84.shown
    assert wgs84.data["nodes"][0][9] == "52.410072°, 1.122801°"


def test_an_out_of_date_memory_says_so(campus: Path, tmp_path: Path, fake_config: Path) -> None:
    (tmp_path / "m.erag").write_bytes(campus.read_bytes())
    memory = open_memory(tmp_path / "m.erag", config=fake_config)
    memory.remove(["n14"])
    html = render(read_shown(memory.path)).html
    assert "older than the observations (1 removed)" in html
    assert "fire hydrant" not in parse(html).data["nodes"][13][2]


def test_a_memory_that_was_not_built_has_no_page(tmp_path: Path, fake_config: Path) -> None:
    memory = open_memory(tmp_path / "m.erag", config=fake_config)
    memory.ingest(sample_dir())
    with pytest.raises(MemoryFileError, match="has no forest yet"):
        read_shown(memory.path)


def test_a_page_never_replaces_a_memory_or_an_input(campus: Path, tmp_path: Path) -> None:
    page, queries = render(read_shown(campus)), tmp_path / "q.jsonl"
    queries.write_text("{}")
    for out in (campus, queries):
        with pytest.raises(InputError, match="would be overwritten"):
            write_page(page, out, campus, queries)
    said = write_page(page, tmp_path / "deep" / "page.html", campus)
    assert said.startswith(f"{tmp_path}/deep/page.html: 62 nodes, ")
    assert (tmp_path / "deep" / "page.html").read_text() == page.html


def test_models_by_role() -> None:
    backend = {
        "models": {"a": {"kind": "sentence", "model": "minilm"}, "b": {"kind": "fake"}},
        "roles": {"embed": "a", "score": "b"},
    }
    assert role_models(backend) == {"embed": "minilm", "score": "fake"}
    assert role_models({}) == {}


def test_results_of_other_runs_can_be_shown(campus: Path, fake_config: Path) -> None:
    asker = Asker(campus, load_config(config=fake_config), default_store())
    query = Query(text="a bench")
    page = parse(render(read_shown(campus), [Asked("a bench", query, asker.ask(query))]).html)
    assert re.search(r"\d\.\d{3} s · ", page.shown)
