"""The command line end to end, without weights: what it prints, where, and with which exit code."""

import json
import os
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from erag.cli.main import run
from erag.data.sample import sample_dir, sample_queries
from erag.memory.file import MemoryFile

Outcome = tuple[int, str, str]
Run = Callable[..., Outcome]


@pytest.fixture
def erag(capfd: pytest.CaptureFixture[str]) -> Run:
    """Runs a command line in this process: exit code, stdout, stderr."""

    def call(*arguments: object) -> Outcome:
        code = run([str(a) for a in arguments])
        captured = capfd.readouterr()
        return code, captured.out, captured.err

    return call


def one_line(err: str) -> str:
    assert err.startswith("erag: ")
    assert err.count("\n") == 1, err
    return err


def test_ingest_build_query_from_nothing(erag: Run, tmp_path: Path, fake_config: Path) -> None:
    memory = tmp_path / "m.erag"
    code, out, _ = erag("ingest", sample_dir(), "--out", memory)
    assert code == 0
    assert "62 added, 0 replaced, 0 unchanged; 62 observations" in out
    assert "62 unchanged" in erag("ingest", sample_dir(), "--out", memory)[1]
    code, out, err = erag("build", memory, "--config", fake_config)
    assert code == 0
    assert "level" in out
    assert "embed " in err
    assert "up to date" in erag("build", memory, "--config", fake_config)[1]
    code, out, err = erag("query", memory, "a fire hydrant", "--config", fake_config, "--at-node", "n01")
    assert code == 0
    assert out.startswith("Go to ")
    assert "m along the map" in out
    assert "rows scored" in err


def test_query_json_is_one_line_of_the_contract_and_quiet(erag: Run, campus: Path, fake_config: Path) -> None:
    code, out, err = erag(
        "query", campus, "bench", "--config", fake_config, "--json", "--top", 3, "--at", "1.1228,52.41"
    )
    assert (code, err) == (0, "")
    record = json.loads(out)
    assert len(record["hits"]) == 3
    assert {h["node"] for h in record["hits"]} <= set(record["hits"][0]["path"]) | {h["node"] for h in record["hits"]}
    assert record["answer"]["route"]["status"] == "ok"
    assert all(0 <= h["score"] <= 1 and 0 <= h["spatial"] <= 1 for h in record["hits"])


def test_location_alone_is_a_query(erag: Run, campus: Path, fake_config: Path) -> None:
    record = json.loads(erag("query", campus, "--at-node", "n05", "--config", fake_config, "--json")[1])
    assert record["hits"][0]["node"] == "n05"
    assert record["hits"][0]["semantic"] is None
    assert record["calls"] == {"embed": 0}


def test_a_user_prefers_what_is_near_or_what_is_best(erag: Run, campus: Path, fake_config: Path) -> None:
    def scores(*prefer: str) -> list[tuple[float, float, float]]:
        asked = ("query", campus, "bench", "--at-node", "n05", "--json", "--config", fake_config, *prefer)
        return [(h["score"], h["semantic"], h["spatial"]) for h in json.loads(erag(*asked)[1])["hits"]]

    assert all(score == semantic for score, semantic, _ in scores("--prefer", "best"))
    assert all(score == spatial for score, _, spatial in scores("--prefer", "1"))
    assert all(score == pytest.approx((s + d) / 2) for score, s, d in scores("--prefer", "near"))
    assert scores("--prefer", "balanced") == scores()
    assert scores("--prefer", "best", "--set", "retrieve.alpha_rank=1") == scores("--prefer", "1")


def test_sensor_and_time_conditions(erag: Run, campus: Path, fake_config: Path) -> None:
    asked = ("query", campus, "grass", "--config", fake_config, "--json", "--sensor", "ndvi=high", "--since", "2025-10")
    record = json.loads(erag(*asked)[1])
    assert all(h["node"].startswith("a") for h in record["hits"])
    assert all(h["sensor"] is not None for h in record["hits"])


def test_a_file_of_queries(erag: Run, campus: Path, fake_config: Path, tmp_path: Path) -> None:
    run_file = tmp_path / "run.jsonl"
    code, _, err = erag("query", campus, "--queries", sample_queries(), "--out", run_file, "--config", fake_config)
    assert (code, err) == (0, "")
    records = [json.loads(line) for line in run_file.read_text().splitlines()]
    asked = [json.loads(line) for line in sample_queries().read_text().splitlines()]
    assert [r["id"] for r in records] == [q["id"] for q in asked]
    for record in records:
        nodes = [h["node"] for h in record["hits"]]
        assert len(set(nodes)) == len(nodes) <= 5
        scores = [h["score"] for h in record["hits"]]
        assert scores == sorted(scores, reverse=True)
        assert record["visited"] > 0
    chosen = erag("query", campus, "--queries", sample_queries(), "--where", "kind=global", "--config", fake_config)[1]
    assert len(chosen.splitlines()) == 6


def test_bad_lines_are_answered_by_errors_in_their_place(
    erag: Run, campus: Path, fake_config: Path, tmp_path: Path
) -> None:
    queries = tmp_path / "q.jsonl"
    queries.write_text(
        '{"id": "a", "query": "bench"}\nnot json\n{"id": "c", "query": "x", "sensor": {"noise": "low"}}\n'
    )
    code, out, err = erag("query", campus, "--queries", queries, "--config", fake_config)
    records = [json.loads(line) for line in out.splitlines()]
    assert code == 0
    assert [(r["id"], "error" in r) for r in records] == [("a", False), ("line 2", True), ("c", True)]
    assert "noise" in records[2]["error"]
    assert "ndvi" in records[2]["error"]
    assert "2 of 3 queries could not be asked" in err
    surrogate, huge = json.dumps({"id": "\ud800", "query": "x"}), '{"id": "h", "at": [1%s, 0]}' % ("0" * 400)
    kind = '{"id": "k", "query": "x", "kind": []}'
    queries.write_text("\n".join([surrogate, huge, kind, '{"id": "last", "query": "bench"}']))
    records = [
        json.loads(line)
        for line in erag("query", campus, "--queries", queries, "--config", fake_config)[1].splitlines()
    ]
    assert ["error" in r for r in records] == [True, True, True, False]
    queries.write_text("not json\n")
    assert erag("query", campus, "--queries", queries, "--config", fake_config)[0] == 2


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("query", "no.erag", "x"), "no such memory file"),
        (("ingest", "no-such-source", "--out", "m.erag"), "no-such-source"),
        (("ingest", "no-such-source", "--out", "m.erag", "--reader", "pickle"), "pickle"),
        (("query", "M", "x", "--preset", "huge"), "allowed: paper, standard, tiny"),
        (("query", "M", "x", "--set", "retrieve.pool=0"), "retrieve.pool"),
        (("query", "M", "x", "--set", "nonsense"), "path=value"),
        (("query", "M"), "neither query nor at"),
        (("query", "M", "x", "--at", "here"), "X,Y or X,Y,Z"),
        (("query", "M", "x", "--at", "1,95"), "95"),
        (("query", "M", "x", "--at-node", "zz"), "no node 'zz'"),
        (("query", "M", "x", "--prefer", "near"), "--prefer without a position"),
        (("query", "M", "x", "--at", "1,2", "--prefer", "far"), "near, balanced, best, or a number from 0"),
        (("query", "M", "x", "--at", "1,2", "--prefer", "nan"), "'nan'"),
        (("query", "M", "x", "--sensor", "ndvi"), "KEY=VALUE"),
        (("query", "M", "x", "--sensor", "noise=low"), "ndvi"),
        (("query", "M", "x", "--since", "soon"), "since is 'soon'"),
        (("query", "M", "x", "--kind", "guess"), "kind is 'guess'"),
        (("query", "M", "x", "--top", "0"), "--top"),
        (("query", "M", "--queries", "no.jsonl"), "no such file"),
        (("query", "M", "--queries", "Q", "--out", "M"), "would be overwritten"),
        (("query", "M", "--queries", "Q", "--out", "Q"), "would be overwritten"),
        (("query", "M", "--queries", "Q", "--at", "1,2"), "--at with --queries"),
        (("query", "M", "x", "--out", "r.jsonl"), "--out without --queries"),
        (("query", "M", "x", "--sensor", "ndvi=low", "--sensor", "ndvi=high"), "same key twice"),
        (("query", "M", "x", "--set", "forest.alpha=2024-13-45"), "not YAML"),
        (("query", "M", "x", "--set", "forest=[&a [x], *a]"), "alias"),
        (("query", "M", "x", "--set", "forest=" + "[" * 3000), "deep"),
        (("query", "M", "x", "--at", "200,10"), "±180"),
        (("query", "M", "--queries", "."), "not a regular file"),
        (("export", "M", "--out", "M", "--format", "gml"), "memory itself"),
        (("remove", ".", "n01"), "is a folder"),
        (("inspect", "x" * 300), "no file can be there"),
        (("build", "."), "is a folder"),
        (("build", "M", "--forest", "best"), "cluster, given"),
        (("build", "M", "--forest", "given"), "state no clusters"),
        (("remove", "M", "zz"), "no node 'zz'"),
        (("export", "M", "--out", "x", "--format", "pickle"), "gml, geojson, jsonl"),
        (("inspect",), "M.erag"),
        (("fly",), "fly"),
    ],
)  # fmt: skip
def test_wrong_input_is_one_line_and_exit_code_2(
    erag: Run, campus: Path, fake_config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...], said: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    copy = tmp_path / "copy.erag"
    copy.write_bytes(campus.read_bytes())
    (tmp_path / "q.jsonl").write_text('{"id": "a", "query": "x"}')
    filled = [{"M": str(copy), "Q": "q.jsonl"}.get(a, a) for a in arguments]
    if arguments[0] in ("query", "build") and "--preset" not in arguments:
        filled += ["--config", str(fake_config)]
    code, out, err = erag(*filled)
    assert (code, out) == (2, "")
    assert said in one_line(err)


def test_a_query_before_the_build_names_the_command(erag: Run, tmp_path: Path, fake_config: Path) -> None:
    erag("ingest", sample_dir(), "--out", tmp_path / "m.erag")
    code, _, err = erag("query", tmp_path / "m.erag", "x", "--config", fake_config)
    assert code == 2
    assert f"erag build {tmp_path / 'm.erag'}" in one_line(err)


def test_another_embedder_is_refused(erag: Run, campus: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.yaml"
    other.write_text("backend: {models: {fake: {kind: fake, seed: 5}}, roles: {embed: fake}}\n")
    code, _, err = erag("query", campus, "x", "--config", other)
    assert code == 2
    assert "another embedder" in one_line(err)


def test_removal_append_and_staleness(erag: Run, campus: Path, fake_config: Path, tmp_path: Path) -> None:
    memory = tmp_path / "m.erag"
    memory.write_bytes(campus.read_bytes())
    ask = ("query", memory, "a fire hydrant", "--config", fake_config, "--json")
    assert json.loads(erag(*ask)[1])["hits"][0]["node"] == "n14"
    assert erag("remove", memory, "n14")[0] == 0
    record = json.loads(erag(*ask)[1])
    assert "n14" not in [h["node"] for h in record["hits"]]
    assert "1 removed" in record["notes"][0]
    assert erag("build", memory, "--config", fake_config)[0] == 0
    assert json.loads(erag(*ask)[1])["notes"] == []
    assert "61 place" in erag("inspect", memory)[1]
    erag("ingest", sample_dir(), "--out", memory)
    assert "1 added" in json.loads(erag(*ask)[1])["notes"][0]
    erag("build", memory, "--config", fake_config)
    assert json.loads(erag(*ask)[1])["hits"][0]["node"] == "n14"


def test_a_map_without_any_text_answers_nothing(erag: Run, tmp_path: Path, fake_config: Path) -> None:
    (tmp_path / "meta.json").write_text(
        '{"format": "erag-observations", "version": 1, "name": "bare", "frame": "metric"}'
    )
    rows = [json.dumps({"id": f"p{i}", "pose": {"x": i, "y": 0}}) for i in range(3)]
    (tmp_path / "observations.jsonl").write_text("\n".join(rows))
    erag("ingest", tmp_path, "--out", tmp_path / "m.erag")
    assert erag("build", tmp_path / "m.erag", "--config", fake_config)[0] == 0
    code, out, _ = erag("query", tmp_path / "m.erag", "a tree", "--config", fake_config, "--json")
    assert (code, json.loads(out)["hits"]) == (0, [])


def test_a_damaged_memory_is_one_line(erag: Run, campus: Path, tmp_path: Path, fake_config: Path) -> None:
    for statement in (
        "UPDATE nodes SET x = 1e999",
        "UPDATE clusters SET members = '{'",
        "DELETE FROM generation_arrays",
    ):
        memory = tmp_path / "m.erag"
        memory.write_bytes(campus.read_bytes())
        connection = sqlite3.connect(memory)
        connection.execute(statement)
        connection.commit()
        connection.close()
        code, _, err = erag("query", memory, "x", "--config", fake_config)
        assert code == 2
        assert "damaged" in one_line(err)


def test_a_symbolic_link_is_the_same_memory(campus: Path, tmp_path: Path, erag: Run) -> None:
    (tmp_path / "m.erag").write_bytes(campus.read_bytes())
    (tmp_path / "link.erag").symlink_to(tmp_path / "m.erag")
    with MemoryFile.writing(tmp_path / "m.erag", "test"):
        code, _, err = erag("remove", tmp_path / "link.erag", "n01")
    assert code == 2
    assert "being written by test" in one_line(err)


def test_the_journal_of_a_deleted_memory_is_not_replayed(erag: Run, tmp_path: Path, campus: Path) -> None:
    (tmp_path / "m.erag-journal").write_bytes(campus.read_bytes()[:8192])
    assert erag("ingest", sample_dir(), "--out", tmp_path / "m.erag")[0] == 0
    assert "62 place" in erag("inspect", tmp_path / "m.erag")[1]
    assert not (tmp_path / "m.erag-journal").exists()


def test_two_sources_with_equal_ids_need_a_prefix(erag: Run, tmp_path: Path) -> None:
    memory, other = tmp_path / "m.erag", tmp_path / "other"
    other.mkdir()
    for file in sample_dir().iterdir():
        if file.suffix in (".json", ".jsonl"):
            (other / file.name).write_text(file.read_text().replace('"name": "campus"', '"name": "elsewhere"'))
    erag("ingest", sample_dir(), "--out", memory)
    code, _, err = erag("ingest", other, "--out", memory)
    assert code == 2
    assert "--id-prefix" in one_line(err)
    code, out, _ = erag("ingest", other, "--out", memory, "--id-prefix", "b/")
    assert code == 0
    assert "124 observations" in out


@pytest.mark.parametrize("format_", ["gml", "geojson", "jsonl"])
def test_export_writes_map_and_forest(erag: Run, campus: Path, tmp_path: Path, format_: str) -> None:
    out = tmp_path / f"campus.{format_}"
    code, said, _ = erag("export", campus, "--out", out, "--format", format_)
    assert code == 0
    assert "62 nodes" in said
    if format_ == "geojson":
        features = json.loads(out.read_text())["features"]
        assert sum(f["properties"]["type"] == "place" for f in features) == 62
        return
    again = tmp_path / "again.erag"
    assert "62 added" in erag("ingest", out, "--out", again)[1]
    assert json.loads(erag("inspect", again, "--json")[1])["given_clusters"] > 3


def test_inspect_and_diff(erag: Run, campus: Path, tmp_path: Path) -> None:
    code, out, _ = erag("inspect", campus)
    assert code == 0
    assert "62 place" in out
    assert "ndvi [-1, 1]" in out
    assert erag("diff", campus, campus)[:2] == (0, "no difference\n")
    erag("ingest", sample_dir(), "--out", tmp_path / "m.erag")
    code, out, _ = erag("diff", campus, tmp_path / "m.erag", "--exit-code")
    assert code == 1
    assert "vectors: " in out


def test_interrupt_leaves_a_message_and_code_130(erag: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("erag.pipeline.ingest.read", interrupted)
    code, _, err = erag("ingest", sample_dir(), "--out", tmp_path / "m.erag")
    assert code == 130
    assert "goes on from there" in one_line(err)


def test_a_closed_pipe_is_no_error(campus: Path) -> None:
    child = subprocess.Popen(
        [sys.executable, "-m", "erag", "inspect", str(campus), "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert child.stdout is not None
    assert child.stderr is not None
    child.stdout.close()
    assert child.stderr.read() == b""
    assert child.wait() in (0, -signal.SIGPIPE)


def test_hostile_text_is_shown_on_one_line_without_control_characters(
    erag: Run, fake_config: Path, campus: Path
) -> None:
    code, out, err = erag("query", campus, "bench\x1b[31m\nrm -rf", "--config", fake_config)
    assert code == 0
    assert "\x1b" not in out + err


def test_help_imports_nothing_heavy() -> None:
    code = "import sys; from erag.cli.main import run; run(['--help']); print([m for m in sys.modules if m in HEAVY])"
    heavy = "HEAVY = {'torch', 'transformers', 'scipy', 'numpy', 'pydantic', 'networkx', 'rich.progress', 'bm25s'}; "
    done = subprocess.run(
        [sys.executable, "-c", heavy + code],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "COLUMNS": "80"},
    )
    assert done.stdout.splitlines()[-1] == "[]"
    assert all(name in done.stdout for name in ("ingest", "build", "query", "models", "doctor", "demo", "bench"))
