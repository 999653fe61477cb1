"""Files we write: complete or not at all, and never over what must stay."""

import os
from pathlib import Path

import pytest

from erag.core.errors import InputError
from erag.core.output import replacing


def test_a_failure_in_the_middle_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(TypeError), replacing(path) as file:
        file.writelines(["half", 5])  # type: ignore[list-item]
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_links_are_followed_and_folders_made(tmp_path: Path) -> None:
    (tmp_path / "target").write_text("old")
    (tmp_path / "link").symlink_to(tmp_path / "target")
    for path in (tmp_path / "link", tmp_path / "new" / "b.txt"):
        with replacing(path) as file:
            file.write("new")
        assert path.read_text() == "new"
    assert (tmp_path / "link").is_symlink()


def test_inputs_memories_pipes_and_folders_are_refused(tmp_path: Path) -> None:
    (tmp_path / "in").write_text("question")
    (tmp_path / "m.erag").write_bytes(b"SQLite format 3\x00...")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    before = sorted(p.name for p in tmp_path.iterdir())
    for name in ("in", "m.erag", "pipe", "folder", "a" * 300, "a\x00b"):
        with pytest.raises(InputError) as caught, replacing(tmp_path / name, tmp_path / "in"):
            raise AssertionError
        assert "\n" not in caught.value.line()
    assert sorted(p.name for p in tmp_path.iterdir()) == before
    assert (tmp_path / "in").read_text() == "question"
