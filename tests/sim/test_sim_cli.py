"""The sim commands: what they print, and errors in one line."""

from __future__ import annotations

from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest

from erag.cli.main import run
from erag.sim import extra


def test_list_names_every_world(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["sim", "list"]) == 0
    out = capsys.readouterr().out
    assert all(f" {name} " in out for name in ("park", "town", "shopping_street"))


def test_without_the_extra_the_repair_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def absent(name: str) -> ModuleSpec | None:
        return None

    monkeypatch.setattr(extra, "find_spec", absent)
    assert run(["sim", "build", "--out", str(tmp_path / "set")]) == 2
    assert "erag[sim]" in capsys.readouterr().err
    assert not (tmp_path / "set").exists()


@pytest.mark.parametrize("size", ["big", "512", "1x1", "9999x9999"])
def test_a_wrong_size_is_refused(size: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("pybullet", reason="the extra `sim` is not installed")
    assert run(["sim", "build", "--out", str(tmp_path / "set"), "--size", size]) == 2
    assert "WxH" in capsys.readouterr().err


def test_an_unknown_world_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("pybullet", reason="the extra `sim` is not installed")
    assert run(["sim", "build", "--out", str(tmp_path / "set"), "--worlds", "moon"]) == 2
    assert "there is no world 'moon'" in capsys.readouterr().err
    assert not (tmp_path / "set").exists()
