"""`erag run`: a whole experiment from the command line, its tables anew, the joined page, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from erag.cli.main import run

FAKE = "backend={models: {fake: {kind: fake}}, roles: {embed: fake, generate: fake}}"
SMALL = {
    "title": "Small",
    "work": "work",
    "similarity": "fake",
    "pictures": False,
    "data": {"campus": {"dataset": "sample", "questions_per_set": 2}},
    "sets": {"explicit": {"where": {"kind": "explicit"}}},
    "systems": {"tree": {"overrides": [FAKE, "answer={least_evidence: 0, explain: quotes}"]}},
    "tables": [{"title": "T", "columns": [{"title": "P", "set": "explicit", "metric": "p_q_a@1"}]}],
}


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A small experiment's file, in a folder of its own that is the working folder."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "small.yaml"
    path.write_text(yaml.safe_dump(SMALL))
    return path


def test_a_run_its_tables_and_the_joined_page(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["run", "--config", str(small), "--set", "title=Changed"]) == 0
    told = capsys.readouterr()
    assert told.out == "experiments/small/README.md\n"
    assert "2 questions asked now" in told.err
    assert Path("experiments/small/README.md").read_text().startswith("# Changed\n")
    assert "[small](small/README.md)" in Path("experiments/README.md").read_text()
    Path("experiments/README.md").unlink()
    assert run(["run", "--config", str(small), "--tables-only"]) == 0
    assert "0 questions asked now" in capsys.readouterr().err
    Path("experiments/README.md").unlink()
    assert run(["run", "--join"]) == 0
    assert Path("experiments/README.md").is_file()


def test_what_is_refused_is_one_line(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, said in (
        ([], "no experiment"),
        (["--config", str(small), "--set", "seed=x"], "seed"),
        (["--config", str(small), "--tables-only", "--out", "new"], "nothing was asked yet"),
        (["--config", str(small), "--again", "none"], "no system 'none'"),
        (["--join"], "no run in it"),
    ):
        assert run(["run", *arguments]) == 2
        told = capsys.readouterr().err
        assert said in told
        assert told.count("\n") == 1


def test_it_is_logged_to_wandb_offline(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("wandb", reason="no wandb: pip install 'erag[experiment]'")
    assert run(["run", "--config", str(small), "--out", "out", "--wandb"]) == 0
    assert "offline-run" in capsys.readouterr().err
    assert list(Path("out/wandb").glob("offline-run-*/run-*.wandb"))
