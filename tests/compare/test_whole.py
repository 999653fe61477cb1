"""End to end: systems build memories and are asked, what the cloud said is in the memory of a reference."""

import json
from pathlib import Path
from typing import Any

import pytest

from erag.compare.config import CompareConfig, MemoriesTrial, WorldsConfig
from erag.compare.run import compare
from erag.compare.systems import System
from erag.compare.whole import Memories
from erag.evaluate.datasets.catalogue import load_dataset
from erag.lm.fake import Fake
from erag.lm.weights import default_store
from erag.pipeline.config import validate

FAKE = "backend={models: {f: {kind: fake}}, roles: {embed: f, summarise: f}}"
SYSTEMS = {
    "vectors": {"overrides": [FAKE, "retrieve.retriever={kind: node}"]},
    "words": {"overrides": [FAKE, "retrieve.retriever={kind: bm25}"]},
}
TRIAL = {"kind": "memories", "dataset": "sample", "count": 8, "systems": ["words"], "where": {"kind": "explicit"}}


def config(out: Path, **trial: Any) -> CompareConfig:
    raw = {"out": out, "judge": {"kind": "fake"}, "systems": SYSTEMS, "trials": {"whole": {**TRIAL, **trial}}}
    return validate(CompareConfig, raw, "test")


def test_systems_are_held_against_what_the_cloud_said(tmp_path: Path) -> None:
    made = config(tmp_path, reference="vectors", cloud="GPT-4")
    said: list[str] = []
    rows = compare(made, default_store(), said.append)
    assert [(r.backend, r.kind, r.against) for r in rows] == [
        ("vectors", "cloud", "GPT-4"), ("words", "local", "GPT-4"), ("any, by chance", "control", "GPT-4")
    ]  # fmt: skip
    reference, words = rows[0].judgement, rows[1].judgement
    assert reference is not None
    assert words is not None
    assert reference.loss.mean == 0
    assert words.loss.mean == pytest.approx(reference.figure.mean - words.figure.mean)
    assert words.figure.mean > 0.5  # the sample's explicit queries name what they seek
    assert list(words.more) == ["P@5"]
    cell = rows[1].cell
    assert cell is not None
    assert cell.build_seconds > 0
    assert rows[1].seconds == pytest.approx(cell.seconds / 8)
    assert "memories built in" in rows[1].note
    assert len(list((tmp_path / "memories").glob("*.erag"))) == 1  # both build alike
    page = (tmp_path / "report.md").read_text()
    assert "## whole (end to end): P@1, 8 items, against GPT-4" in page
    assert "| ☁ vectors |" in page
    said.clear()
    compare(made, default_store(), said.append)
    assert said == ["whole, vectors: kept", "whole, words: kept"]


def test_without_a_cloud_the_loss_is_against_labels_and_the_truth_is_no_candidate(tmp_path: Path) -> None:
    rows = compare(config(tmp_path, reference="vectors"), default_store(), lambda text: None)
    assert [r.kind for r in rows] == ["cloud", "truth", "local", "control"]
    assert rows[0].note == "no record exists: against labels"
    for row in rows[1:]:
        assert row.against == "labels"
        assert row.judgement is not None
        assert row.judgement.loss.mean == pytest.approx(1 - row.judgement.figure.mean)
    deployed = (tmp_path / "report.md").read_text().split("## What to deploy")[1].split("##")[0]
    assert "| end to end | whole | words |" in deployed
    assert "vectors" not in deployed


def test_a_system_that_cannot_answer_says_why(tmp_path: Path) -> None:
    raw = {**SYSTEMS, "words": {"overrides": [FAKE, "retrieve.rescore={pool: 3}"]}}
    made = config(tmp_path).model_copy(update={"systems": validate(CompareConfig, {
        "systems": raw, "trials": {"whole": TRIAL}}, "test").systems})  # fmt: skip
    rows = compare(made, default_store(), lambda text: None)
    assert rows[1].judgement is None
    assert "'score'" in rows[1].note


def test_a_killed_build_is_begun_anew(tmp_path: Path) -> None:
    trial = Memories(MemoriesTrial.model_validate(TRIAL), WorldsConfig())
    system = System(config(tmp_path).systems["words"], trial.environments, tmp_path / "m", default_store())
    (environment,) = system.missing()
    path = system.path(environment.name)
    path.parent.mkdir()
    path.write_bytes(b"half of a memory")
    path.with_name(f"{path.name}-journal").write_bytes(b"its journal")
    system.build(environment)
    assert system.missing() == []
    assert system.built().seconds > 0
    taken = system.ask(list(trial.items))
    assert len(taken.outputs) == 8
    unanswered = trial.judge([None, *taken.outputs[1:]], Fake())
    assert unanswered.values[0] == 0


@pytest.mark.shared
def test_the_lobby_is_asked_for_what_the_cloud_lists(shared: Path) -> None:
    (environment,) = load_dataset("coex_1f", shared / "data" / "coex_1f").environments
    asked = {q.text: q.relevant for q in environment.questions}
    assert 30 < len(asked) < 60
    assert all(0 < len(relevant or ()) <= 12 for relevant in asked.values())
    assert len(asked["Show me a vending machine."] or ()) >= 4
    assert "Show me a floor." not in asked  # it is everywhere


def test_things_of_a_list_are_told_apart_from_the_text(tmp_path: Path) -> None:
    said = [("A hall with two lamps.", "lamps, wooden door"), ("A door.", "door"), ("A desk.", "desk"), ("Fog.", "")]
    nodes = [
        {"node_id": i, "position": [i, 0, 0], "caption": json.dumps({"Description": text, "Objects": things})}
        for i, (text, things) in enumerate(said)
    ]
    (tmp_path / "nodes_with_captions.json").write_text(json.dumps(nodes))
    (environment,) = load_dataset("coex_1f", tmp_path).environments
    asked = {q.text: q.relevant for q in environment.questions}
    assert asked == {
        "Show me a lamp.": {"0"}, "Show me a wooden door.": {"0"}, "Show me a desk.": {"2"}
    }  # a door is in two of four frames  # fmt: skip
