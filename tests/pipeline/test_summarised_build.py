"""Builds with a summariser: every cluster described, resumed and replayed without a model."""

from collections.abc import Sequence
from pathlib import Path

import pytest

import erag
from erag.core.errors import EragError, ModelError
from erag.lm.fake import Fake
from erag.lm.roles import Group, Summary
from erag.lm.weights import ModelStore
from erag.memory.diff import diff
from erag.memory.file import MemoryFile
from erag.pipeline.build import build
from erag.pipeline.config import load_config
from erag.pipeline.session import Memory

CONFIG = """
backend:
  models: {fake: {kind: fake, call_size: 3}}
  roles: {embed: fake, summarise: fake, select: fake, score: fake, generate: fake}
forest: {cuts: {kind: shrink, first: 5, upper: 3}}
"""


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "config.yaml"
    path.write_text(CONFIG)
    return path


@pytest.fixture
def memory(tmp_path: Path, config: Path) -> Memory:
    opened = erag.open(tmp_path / "campus.erag", config=config)
    opened.ingest(erag.sample())
    return opened


def forget_the_forest(file: MemoryFile) -> None:
    """Take the forest out of a memory; its observations and call records stay."""
    with file.db.transaction() as connection:
        for table in ("generation_arrays", "clusters", "generations"):
            connection.execute(f"DELETE FROM {table}")


def test_every_cluster_is_described_and_the_report_says_how_well(memory: Memory) -> None:
    report = memory.build()
    clusters = memory.forest.clusters
    assert all(c.name and c.summary and c.relationships for c in clusters)
    assert max(c.level for c in clusters) >= 2
    assert any("clusters described" in line for line in report.lines)
    assert {"summarise", "check"} <= set(report.seconds)
    assert report.ledger.calls["summarise"] >= len(clusters)
    summaries = memory.asker.corpus.summary_vectors
    assert (summaries.any(axis=1)).all()


def test_summaries_can_stand_for_clusters_while_the_forest_grows(tmp_path: Path, config: Path) -> None:
    overrides = ["forest.cluster_embedding=summary", "summaries.source=members", "summaries.check=false"]
    opened = erag.open(tmp_path / "paper.erag", config=config, overrides=overrides)
    opened.ingest(erag.sample())
    opened.build()
    assert all(c.summary for c in opened.forest.clusters)
    n = opened.forest.n_leaves
    assert abs(opened.forest.embeddings[n:] - opened.asker.corpus.summary_vectors).max() < 1e-3


def test_a_build_killed_among_its_summaries_ends_the_same_and_repeats_nothing(
    tmp_path: Path, config: Path, memory: Memory, monkeypatch: pytest.MonkeyPatch
) -> None:
    memory.build()
    broken = erag.open(tmp_path / "broken.erag", config=config)
    broken.ingest(erag.sample())
    whole, left = Fake.summarise, 2

    def dies(self: Fake, groups: Sequence[Group]) -> list[Summary]:
        nonlocal left
        left -= 1
        if left < 0:
            raise ModelError("killed")
        return whole(self, groups)

    monkeypatch.setattr(Fake, "summarise", dies)
    with pytest.raises(ModelError):
        broken.build()
    monkeypatch.setattr(Fake, "summarise", whole)
    report = broken.build()
    assert report.ledger.replayed["summarise"] >= 6
    with MemoryFile.reading(memory.path) as a, MemoryFile.reading(broken.path) as b:
        assert diff(a, b) == []
        again = b.db.rows(
            "SELECT key FROM call_attempts JOIN call_batches USING (batch) WHERE status = 'done' GROUP BY key "
            "HAVING count(*) > 1"
        )
    assert again == []


def test_recorded_calls_rebuild_the_forest_with_no_model_at_hand(
    memory: Memory, monkeypatch: pytest.MonkeyPatch
) -> None:
    memory.build()
    before = memory.forest.clusters

    def absent(self: Fake, *_: object) -> None:
        raise ModelError("no such model")

    for role in ("embed", "summarise"):
        monkeypatch.setattr(Fake, role, absent)
    with MemoryFile.writing(memory.path, "test") as file:
        forget_the_forest(file)
        report = build(file, memory.config, memory._store)
        generation = file.generations.load()
    assert generation is not None
    assert generation.clusters == before
    assert not report.ledger.calls


@pytest.mark.weights
def test_the_tiny_preset_rebuilds_from_records_where_no_weights_are(
    tmp_path: Path, weights: ModelStore, smollm2: ModelStore
) -> None:
    opened = erag.open(tmp_path / "campus.erag")
    opened.ingest(erag.sample())
    opened.build()
    before = opened.forest.clusters
    empty = ModelStore(weights.manifests, tmp_path / "nothing")
    with MemoryFile.writing(opened.path, "test") as file:
        forget_the_forest(file)
        report = build(file, load_config("tiny"), empty)
        generation = file.generations.load()
    assert generation is not None
    assert generation.clusters == before
    assert not report.ledger.calls
    new = tmp_path / "campus" / "observations.jsonl"
    new.parent.mkdir()
    new.write_text('{"id": "new", "pose": {"x": 1.1228, "y": 52.41}, "caption": "A helicopter on a roof."}\n')
    (new.parent / "meta.json").write_text((erag.sample() / "meta.json").read_text())
    opened.ingest(new.parent, id_prefix="new/")
    with MemoryFile.writing(opened.path, "test") as file, pytest.raises(EragError, match="models pull minilm-l6"):
        build(file, load_config("tiny"), empty)
