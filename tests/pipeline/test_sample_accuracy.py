"""Accuracy on the sample with real embeddings, offline; guards against regressions where no outside data is."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from erag.data.sample import sample_dir, sample_queries
from erag.evaluate.labelled import evaluate, read_labelled
from erag.lm.weights import ModelStore
from erag.pipeline.session import Memory, open_memory

pytestmark = pytest.mark.weights
FLOORS = {  # explicit, implicit; one query is 0.05 and 0.08
    "node": (0.65, 0.4),
    "sentence": (0.8, 0.4),
    "bm25": (0.75, 0.15),
    "fusion": (0.8, 0.5),
    "tree": (0.8, 0.5),
}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory, weights: ModelStore) -> Memory:
    assert weights.state("minilm-l6") != "wrong"
    memory = open_memory(tmp_path_factory.mktemp("sample") / "campus.erag")
    memory.ingest(sample_dir())
    memory.build()
    return memory


@pytest.mark.parametrize("kind", FLOORS)
def test_precision_of_each_retriever(built: Memory, kind: str) -> None:
    asked = open_memory(built.path, overrides=[f"retrieve.retriever.kind={kind}"])
    scores = {s.kind: s.p1.mean for s in evaluate(asked.asker, sample_queries(), parts=())}
    explicit, implicit = FLOORS[kind]
    assert scores["explicit"] >= explicit
    assert scores["implicit"] >= implicit


def test_the_tree_never_loses_the_flat_winner(built: Memory) -> None:
    flat = open_memory(built.path, overrides=["retrieve.retriever.kind=fusion"])
    tree = open_memory(built.path, overrides=["retrieve.retriever={kind: tree, evidence: 1.0}"])
    for query in read_labelled(sample_queries(), {}):
        text = (query.line.raw or {}).get("query")
        if text:
            assert tree.query(text).hits[0].node == flat.query(text).hits[0].node


def test_conditions_improve_the_queries_that_state_them(built: Memory) -> None:
    with_all = {s.kind: s.p1.mean for s in evaluate(built.asker, sample_queries())}
    text_only = {s.kind: s.p1.mean for s in evaluate(built.asker, sample_queries(), parts=())}
    assert with_all["explicit"] >= text_only["explicit"]


@pytest.mark.offline
def test_a_query_needs_no_network(built: Memory) -> None:
    if shutil.which("unshare") is None or subprocess.run(["unshare", "-rn", "true"], check=False).returncode:
        pytest.skip("no network namespaces here (unshare -rn)")
    ask = [sys.executable, "-m", "erag", "query", str(built.path), "Where can I charge an electric car?", "--json"]
    inside, outside = (
        json.loads(subprocess.run([*prefix, *ask], capture_output=True, check=True).stdout)
        for prefix in (["unshare", "-rn"], [])
    )
    assert inside["hits"] == outside["hits"]
    assert inside["hits"][0]["node"] == "n11"


def test_hits_do_not_depend_on_what_was_asked_before(built: Memory) -> None:
    first = built.query("a bench").hits
    built.query("something else entirely, and much longer than the question before it was")
    assert built.query("a bench").hits == first


def test_the_demo_on_the_sample_writes_its_exports(tmp_path: Path, weights: ModelStore) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "erag", "demo", "--sample", "--out", str(tmp_path / "out")],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    assert "P@1" in done.stdout
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "campus.erag",
        "campus.gml",
        "campus.geojson",
        "report.html",
    }
