"""Which questions are asked: sets, modes, samples that are the same for all systems."""

from __future__ import annotations

from pathlib import Path

import pytest
from experiment_worlds import config

from erag.core.errors import ConfigError, InputError
from erag.data.registry import read
from erag.evaluate.datasets.catalogue import load_dataset
from erag.evaluate.scene import Scene
from erag.experiment.config import DataConfig, ExperimentConfig, SystemConfig
from erag.experiment.questions import Posed, chosen, modes_of, posed, record_of
from erag.experiment.reading import read_experiment
from erag.experiment.sources import environments, prepared
from erag.experiment.sweep import resolved
from erag.experiment.systems import pipeline_of
from erag.lm.weights import default_store
from erag.pipeline.config import PipelineConfig, configs_dir
from erag.topomap.build import build_map


@pytest.fixture(scope="module")
def scene() -> Scene:
    (campus,) = load_dataset("sample").environments
    reading = read(campus.source)
    topomap, _ = build_map(reading.frame, reading.observations, reading.edges, PipelineConfig().map)
    return Scene.of(campus, topomap)


def asked(scene: Scene, made: ExperimentConfig) -> list[Posed]:
    return posed("campus", made, scene)


def test_modes_say_what_is_asked(scene: Scene, tmp_path: Path) -> None:
    sets = {"s": {"where": {"kind": "explicit"}, "modes": ["Q", "Q,L", "Q,S", "L"], "sensor": {"ndvi": "low"}}}
    made = config(tmp_path, data={"campus": {"dataset": "sample"}}, sets=sets, tables=[])
    questions = asked(scene, made)
    worded = next(q for q in questions if q.question.text and not q.stated)
    lines = {mode: worded.line(mode) for mode in ("Q", "Q,L", "Q,S", "L")}
    got = {mode: set(line.raw or {}) - {"id", "kind"} for mode, line in lines.items() if line is not None}
    assert got == {"Q": {"query"}, "Q,L": {"query", "at"}, "Q,S": {"query", "sensor"}, "L": {"at"}}
    stated = next(q for q in questions if q.stated)
    assert dict(stated.sensor or {}) == dict((stated.question.line.raw or {})["sensor"])
    wordless = next(q for q in questions if not q.question.text)
    assert modes_of(wordless, made.sets) == ["L"]
    assert not record_of(wordless, scene).worded
    windowed = next(q for q in questions if (q.question.line.raw or {}).get("since"))
    line = windowed.line("Q")
    assert "since" in ((line and line.raw) or {})
    assert record_of(windowed, scene).nearest_m is None


def test_samples_are_nested_seeded_and_spread(scene: Scene, tmp_path: Path) -> None:
    made = config(tmp_path, data={"campus": {"dataset": "sample"}})
    base = asked(scene, made)
    other = [Posed(q.data, "elsewhere", q.question, q.sets, q.at, q.drawn, q.sensor, q.stated) for q in base]
    everything = base + other
    few, more = (chosen(everything, SystemConfig(queries=n), seed=0) for n in (3, 8))
    assert {q.key for q in few} < {q.key for q in more}
    assert [q.key for q in few] == [q.key for q in chosen(everything, SystemConfig(queries=3), seed=0)]
    assert {q.key for q in few} != {q.key for q in chosen(everything, SystemConfig(queries=3), seed=1)}
    explicit = [q for q in more if "explicit" in q.sets]
    assert len(explicit) == 8
    assert sum(q.environment == "elsewhere" for q in explicit) == 4
    assert chosen(everything, SystemConfig(), seed=0) == everything
    assert chosen(everything, SystemConfig(data=("none",)), seed=0) == []
    assert {q.environment for q in chosen(everything, SystemConfig(environments="elsewhere"), seed=0)} == {"elsewhere"}
    assert {s for q in chosen(everything, SystemConfig(sets=("global",)), seed=0) for s in q.sets} == {"global"}


def test_a_place_is_drawn_by_the_seed_where_none_is_stated(scene: Scene, tmp_path: Path) -> None:
    made = config(tmp_path)
    again, elsewhere = asked(scene, made), asked(scene, made.model_copy(update={"seed": 1}))
    places = {q.key: q.at for q in asked(scene, made)}
    assert places == {q.key: q.at for q in again}
    shared = [q for q in elsewhere if q.key in places and q.drawn]
    assert any(q.at != places[q.key] for q in shared)
    on_map = {n.pose.xyz for n in scene.topomap.nodes}
    assert all(q.at in on_map for q in again if q.drawn)


def test_where_takes_several_values_and_an_absent_key(scene: Scene, tmp_path: Path) -> None:
    sets = {
        "both": {"where": {"kind": ["explicit", "implicit"], "task": ["", "find"]}},
        "none": {"where": {"task": "x"}},
    }
    made = config(tmp_path, data={"campus": {"dataset": "sample"}}, sets=sets, tables=[])
    kinds = {q.question.kind for q in asked(scene, made)}
    assert kinds == {"explicit", "implicit"}
    assert all(q.sets == ("both",) for q in asked(scene, made))


def test_sources_are_made_once_for_each_content(tmp_path: Path) -> None:
    (campus,) = load_dataset("sample").environments
    made = [
        prepared("campus", DataConfig(dataset="sample", readings=readings), campus, tmp_path, default_store(), _quiet)
        for readings in (True, False, True)
    ]
    assert made[0].digest == made[2].digest != made[1].digest
    assert len(list((tmp_path / "sources").iterdir())) == 2
    assert not any(o.sensors for o in read(made[1].folder).observations)
    assert all(o.image is None for o in read(made[0].folder).observations)


def _quiet(stage: str, done: int, total: int) -> None:
    del stage, done, total


def test_environments_that_are_not_there_are_named() -> None:
    with pytest.raises(InputError, match=r"no environment 'moon'.*campus"):
        environments("d", DataConfig(dataset="sample", environments=("moon",)))
    with pytest.raises(InputError, match="no environment of split 'train'"):
        environments("d", DataConfig(dataset="sample", split="train"))


@pytest.mark.parametrize("path", sorted((configs_dir() / "paper").glob("*.yaml")), ids=lambda p: p.stem)
def test_every_shipped_experiment_can_be_read(path: Path) -> None:
    made = resolved(read_experiment(path))
    assert path.read_text().startswith(f"# erag run --config configs/paper/{path.name}\n")
    for system in made.systems.values():
        pipeline_of(system)
    assert made.data


def test_a_shared_panel_is_a_file_and_can_be_overridden(tmp_path: Path) -> None:
    (tmp_path / "panel.yaml").write_text("{judges: {words: {kind: words}}, reads: lists, fit: true}")
    panel = "{from: panel.yaml, fit: false}"
    rest = "data: {d: {dataset: sample}}, sets: {s: {}}"
    (tmp_path / "run.yaml").write_text(f"{{title: T, panel: {panel}, {rest}}}")
    made = read_experiment(tmp_path / "run.yaml", ["panel.reads=all"])
    assert (list(made.panel.judges), made.panel.reads, made.panel.fit) == (["words"], "all", False)


def test_what_holds_for_every_system_is_written_into_each(tmp_path: Path) -> None:
    sweep = {"axes": {"k": {"path": "retrieve.retriever.branches", "values": [1]}}}
    made = resolved(config(tmp_path, overrides=["answer.facts=1"], sweep=sweep))
    assert all("answer.facts=1" in system.overrides for system in made.systems.values())
    assert "k = 1" in made.systems
    assert resolved(made) == made
    ours, plain = (pipeline_of(SystemConfig(plain=plain)) for plain in (False, True))
    assert (ours.answer.least_probability, plain.answer.least_probability) == (0.2, 0)
    assert (ours.retrieve.places is None, plain.retrieve.places is None) == (False, True)


def test_configurations_that_cannot_be_are_refused(tmp_path: Path) -> None:
    bad = [
        {"tables": [{"title": "T", "columns": [{"title": "c", "set": "none", "metric": "ss"}]}]},
        {"tables": [{"title": "T", "columns": [{"title": "c", "set": "global", "metric": "ss", "mode": "Q,L"}]}]},
        {"systems": {"a": {"sets": "none"}}, "tables": []},
        {"panel": {"judges": {}}},
        {"panel": {"judges": {"m": {"kind": "model"}}}},
        {"panel": {"judges": {"w": {"kind": "words", "expanded": "model"}}}},
        {"panel": {"probability": "stack"}},
        {"tables": [{"title": "T", "columns": [], "against": "none"}]},
    ]
    for changes in bad:
        with pytest.raises(ValueError):
            config(tmp_path, **changes)
    sweep = {"axes": {"k": {"path": "retrieve.retriever.branches", "values": [1]}}, "grid": [["k", "x"]]}
    with pytest.raises(ConfigError, match="no axis 'x'"):
        resolved(config(tmp_path, sweep=sweep))
