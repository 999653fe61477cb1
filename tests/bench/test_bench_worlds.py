"""Benchmarks on simulated worlds: captions of the truth, decisions by scores and models, the weight of location."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from erag.bench import location, selection
from erag.bench.config import LocationBench, SelectionBench, WorldsConfig
from erag.bench.worlds import labelled_worlds
from erag.core.errors import InputError
from erag.data.meta import FORMAT, META, VERSION
from erag.lm.weights import default_store
from erag.pipeline.config import PipelineConfig
from erag.pipeline.load import load

FAKE = {"backend": {"models": {"m": {"kind": "fake"}}, "roles": {"embed": "m"}}}
PIPELINE = PipelineConfig.model_validate(FAKE)
THINGS = ("bench", "fountain", "kiosk", "statue", "tent", "swing", "bollard", "hydrant")


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A world as the simulator writes it, without captions: eight things along a street, each twice."""
    made = tmp_path_factory.mktemp("data")
    nodes = [f"street-a-{i}" for i in range(16)]
    places = [{"id": node, "pose": {"x": 10.0 * i, "y": 0}} for i, node in enumerate(nodes)]
    thing = {"id": "bench-1@a", "kind": "object", "pose": {"x": 0, "y": 1}, "name": "bench"}
    edges = [{"a": a, "b": b, "kind": "path"} for a, b in pairwise(nodes)]
    edges.append({"a": "bench-1@a", "b": nodes[0], "kind": "observed_from"})
    folder = made / "worlds" / "street"
    lines(folder / "observations.jsonl", [*places, thing])
    lines(folder / "edges.jsonl", edges)
    (folder / META).write_text(json.dumps({"format": FORMAT, "version": VERSION, "frame": "metric"}))
    seen = [{"node": n, "split": "train", "caption": f"A {THINGS[i % 8]}."} for i, n in enumerate(nodes)]
    lines(made / "truth" / "street.jsonl", seen)
    finds = [_find(i, f"Find a {name}.", [nodes[i], nodes[i + 8], f"{name}-1@a"]) for i, name in enumerate(THINGS)]
    wished = _find(8, "Find a bench.", [nodes[0]]) | {"sensor": {"ndvi": "low"}}
    lines(made / "queries.jsonl", [*finds, wished, _find(9, "Find a zeppelin.", []) | {"task": "unanswerable"}])
    return made


def _find(number: int, text: str, relevant: Sequence[str]) -> dict[str, Any]:
    asked = {"id": f"q{number}", "query": text, "kind": "explicit", "task": "find", "at": [0, 0, 0]}
    return asked | {"relevant": list(relevant), "environment": "street", "split": "train"}


def lines(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))


def test_a_world_is_told_by_its_truth(root: Path, tmp_path: Path) -> None:
    config = WorldsConfig(root=root, folder=tmp_path)
    (world,) = labelled_worlds(config, PIPELINE, default_store())
    corpus = load(world.memory).corpus
    assert corpus.texts[:2] == ("A bench.", "A fountain.")
    assert len(corpus.texts) == 16  # no object nodes
    assert [q.id for q in world.finds] == [f"q{i}" for i in range(8)]
    assert [q.id for q in world.of("unanswerable")] == ["q9"]
    (again,) = labelled_worlds(config, PIPELINE, default_store())
    assert load(again.memory).corpus.texts == corpus.texts
    with pytest.raises(InputError, match="split 'dev'"):
        list(labelled_worlds(WorldsConfig(root=root, split="dev", folder=tmp_path), PIPELINE, default_store()))


def test_selectors_decide_on_worlds_by_scores_and_by_models(root: Path, tmp_path: Path) -> None:
    config = SelectionBench.model_validate(
        {
            "kind": "selection",
            "worlds": {"root": root, "folder": tmp_path},
            "pipeline": FAKE,
            "cards": 4,
            "rounds": 2,
            "scores": {"cosine": {"kind": "node"}, "relevance": {"kind": "relevance", "uses": False}},
            "selectors": {"fake": {"kind": "fake"}},
        }
    )
    cosine, relevance, fake = selection.run(config, default_store())
    assert [s.selector for s in (cosine, relevance, fake)] == ["cosine", "relevance", "fake"]
    assert {s.decisions for s in (cosine, relevance, fake)} == {16}
    assert relevance.right.mean == 1
    assert cosine.right.mean > 0.5  # chance is a quarter
    assert (relevance.prompts, relevance.tokens) == (0, 0)


def test_the_weight_of_location_trades_right_hits_for_short_ways(root: Path, tmp_path: Path) -> None:
    retrieve = {"retriever": {"kind": "relevance", "uses": False}}
    config = LocationBench.model_validate(
        {
            "kind": "location",
            "worlds": {"root": root, "folder": tmp_path},
            "weights": [0, 0.2, 1],
            "forms": {"sum": {"location": "sum"}, "product": {"location": "product"}},
            "plot": tmp_path / "plot" / "location.png",
            "pipeline": {**FAKE, "retrieve": retrieve},
        }
    )
    scores = list(location.run(config, default_store()))
    assert [s.weight for s in scores] == ["0", "0.2", "1", "0", "0.2", "1", location.NEAREST]
    assert [s.form for s in scores] == 3 * ["sum"] + 3 * ["product"] + [""]
    anywhere, balanced, nearest, *scaled, ideal = scores
    assert {s.questions for s in scores} == {8}
    assert anywhere.right.mean == balanced.right.mean == ideal.right.mean == 1
    assert nearest.right.mean == 1 / 8
    assert nearest.path.mean == 0
    assert balanced.path.mean == pytest.approx(ideal.path.mean)  # of two that answer the nearer one
    assert balanced.path.mean == pytest.approx(np.mean([10.0 * i / 75 for i in range(8)]))
    assert [s.right.mean for s in scaled] == [1, 1, 1]  # what answers hardly at all is worth no way
    assert scaled[2].path.mean == pytest.approx(ideal.path.mean)
    with pytest.raises(ValidationError, match="location"):
        LocationBench.model_validate({**config.model_dump(), "forms": {"x": {"location": "far"}}})
    pytest.importorskip("matplotlib")
    assert location.plotted(scores, config.plot)
    assert config.plot.stat().st_size > 1000
