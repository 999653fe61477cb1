"""The Python API in ten lines, and what it shares with the command line."""

import json
import re
import subprocess
import sys
from pathlib import Path

import networkx as nx
import pytest
from pydantic import BaseModel

import erag
from erag.core.errors import ConfigError, InputError
from erag.memory.file import MemoryFile
from erag.pipeline.config import configs_dir, load_config, presets
from erag.pipeline.session import Memory


@pytest.fixture
def memory(tmp_path: Path, fake_config: Path) -> Memory:
    opened = erag.open(tmp_path / "campus.erag", config=fake_config)
    opened.ingest(erag.sample())
    opened.build()
    return opened


def test_open_ingest_build_query(memory: Memory) -> None:
    result = memory.query("a fire hydrant", at=(1.1228, 52.41))
    assert result.answer is not None
    assert result.answer.waypoint is not None
    assert len(result.hits) == 5
    assert result.hits[0].path[-1] == result.hits[0].node
    assert result.answer.waypoint.node == result.hits[0].node


def test_views_for_networkx(memory: Memory) -> None:
    graph, forest = memory.map_to_networkx(), memory.forest_to_networkx()
    assert graph.number_of_nodes() == 62
    assert graph.number_of_edges() == 74
    assert nx.number_connected_components(graph) == 2
    assert nx.is_forest(forest.to_undirected())
    assert forest.number_of_nodes() == 62 + len(memory.forest.clusters)
    assert set(graph.nodes) <= set(forest.nodes)


def test_a_change_is_seen_by_the_next_query(memory: Memory) -> None:
    first = memory.query("a fire hydrant").hits
    memory.remove([first[0].node])
    assert [h.node for h in memory.query("a fire hydrant").hits[:4]] == [h.node for h in first[1:]]


def test_bad_arguments(memory: Memory) -> None:
    with pytest.raises(InputError, match="neither query nor at"):
        memory.query()
    with pytest.raises(InputError, match="at is"):
        memory.query("x", at=(1.0,))
    with pytest.raises(InputError, match="top"):
        memory.query("x", top=0)
    with pytest.raises(AttributeError, match="nonsense"):
        erag.nonsense  # noqa: B018


def test_the_second_build_computes_nothing_and_a_config_change_only_what_is_new(memory: Memory) -> None:
    again = memory.build()
    assert again.current
    changed = Memory(memory.path, memory.config.model_copy(update={"forest": _forest(alpha=0.9)}), memory._store)
    report = changed.build()
    assert not report.current
    assert report.ledger.calls["embed"] == 0
    assert report.ledger.replayed["embed"] > 0


def test_appending_in_two_steps_finds_what_one_step_finds(tmp_path: Path, fake_config: Path, memory: Memory) -> None:
    lines = (erag.sample() / "observations.jsonl").read_text(encoding="utf-8").splitlines()
    part = tmp_path / "campus"
    part.mkdir()
    (part / "meta.json").write_text((erag.sample() / "meta.json").read_text())
    stepwise = erag.open(tmp_path / "steps.erag", config=fake_config)
    for end in (30, len(lines)):
        (part / "observations.jsonl").write_text("\n".join(lines[:end]), encoding="utf-8")
        if end == len(lines):
            (part / "edges.jsonl").write_text((erag.sample() / "edges.jsonl").read_text())
        stepwise.ingest(part)
        stepwise.build()
    queries = ("a fire hydrant", "tennis", "green grass")
    assert [stepwise.query(q).hits for q in queries] == [memory.query(q).hits for q in queries]


def _forest(alpha: float):  # type: ignore[no-untyped-def]
    from erag.forest.config import ForestConfig

    return ForestConfig(alpha=alpha)


def test_every_shipped_configuration_is_valid_and_begins_with_its_command() -> None:
    from erag.bench.config import BenchConfig
    from erag.compare.config import CompareConfig
    from erag.experiment.config import PanelConfig
    from erag.experiment.reading import read_experiment
    from erag.pipeline.config import read_yaml, validate
    from erag.study.kinds import AnyDistil
    from erag.study.quantconfig import AnyQuantise

    assert set(presets()) >= {"tiny"}
    for path in configs_dir().rglob("*.yaml"):
        if path.parent.name == "panels":  # a part of several experiments, without a command of its own
            validate(PanelConfig, read_yaml(path), str(path))
            continue
        assert path.read_text().startswith("# erag "), path
        if path.parent.name == "presets":
            resolved = load_config(path.stem)
            assert type(resolved).model_validate_json(resolved.model_dump_json()) == resolved
        elif path.parent.name == "paper":
            read_experiment(path)
        else:
            models = {"distil": AnyDistil, "quantise": AnyQuantise, "bench": BenchConfig, "compare": CompareConfig}
            validate(models[path.parent.name], read_yaml(path), str(path))


def test_a_value_that_is_missing_is_named() -> None:
    from erag.pipeline.config import validate

    class Pair(BaseModel):
        first: int
        second: int

    with pytest.raises(ConfigError, match=re.escape("first = {}: Field required (and 1 more)")):
        validate(Pair, {}, "pair.yaml")


@pytest.mark.parametrize(
    ("text", "overrides", "said"),
    [
        ("backend: {models: {m: {kind: pickle}}}", (), "kind"),
        ("forest: {alpha: 7}", (), "forest.alpha = 7"),
        ("surprise: 1", (), "surprise"),
        ("[1, 2]", (), "not a mapping"),
        ("a: [", (), "not YAML"),
        ("!!python/object/apply:os.system ['true']", (), "not YAML"),
        ("", ("forest.alpha=much",), "forest.alpha = 'much'"),
        (
            "",
            ("retrieve.pool=0",),
            "retrieve.pool = 0: Input should be greater than or equal to 1, or: Input should be",
        ),
        ("", ("retrieve.pool=0", "retrieve.alpha_rank=2"), " more)"),
        ("", ("forest",), "path=value"),
        ("", ("forest.alpha.x=1", "forest.alpha=1", "forest.alpha.x=2"), "holds a value"),
        ("", ("forest.alpha=[",), "not YAML"),
    ],
)
def test_bad_configurations_are_one_line(tmp_path: Path, text: str, overrides: tuple[str, ...], said: str) -> None:
    path = tmp_path / "c.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=re.escape(said)) as caught:
        load_config(config=path, overrides=overrides)
    assert "\n" not in caught.value.line()


def test_concurrent_readers_while_a_writer_writes(memory: Memory) -> None:
    with MemoryFile.writing(memory.path, "test"):
        code = f"import erag; print(len(erag.open({str(memory.path)!r}).map))"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "another embedder" in done.stderr  # it could read: the default preset has another embedder


def test_import_is_light() -> None:
    code = "import sys, json, erag; print(json.dumps([m for m in ('numpy', 'torch', 'pydantic') if m in sys.modules]))"
    assert json.loads(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout) == []
