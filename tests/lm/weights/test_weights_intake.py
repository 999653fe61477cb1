"""Importing: a file is what its sha256 says, and what nobody knows is refused with what is known about it."""

import hashlib
import os
from pathlib import Path

import pytest

from erag.core.errors import InputError, ModelError
from erag.lm.weights import intake
from erag.lm.weights.intake import take_in

FILES = {"a.json": b"{}", "sub/b.bin": b"b" * 50}


@pytest.fixture
def known(depot):
    depot.one(b"weights")
    depot.folder(FILES)
    return depot


def lay(folder: Path, files: dict[str, bytes]) -> Path:
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return folder


def test_a_file_is_recognised_whatever_its_name(known, tmp_path: Path) -> None:
    source = lay(tmp_path, {"download(1).bin": b"weights"}) / "download(1).bin"
    taken = take_in(known.store, source)
    assert (taken.id, taken.how) == ("one", "linked")
    assert taken.path.name == "one.gguf"
    assert taken.path.stat().st_ino == source.stat().st_ino
    assert take_in(known.store, source).how == "present"


def test_a_link_to_a_file_counts_as_the_file(known, tmp_path: Path) -> None:
    lay(tmp_path, {"real": b"weights"})
    (tmp_path / "link").symlink_to("real")
    taken = take_in(known.store, tmp_path / "link")
    assert not taken.path.is_symlink()
    assert taken.path.read_bytes() == b"weights"


def test_from_another_disk_it_is_copied(known, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def other_disk(*_: object) -> None:
        raise OSError(18, "Invalid cross-device link")

    monkeypatch.setattr(intake.os, "link", other_disk)
    source = lay(tmp_path, {"w": b"weights"}) / "w"
    taken = take_in(known.store, source, "one")
    assert taken.how == "copied"
    assert taken.path.read_bytes() == b"weights"
    assert taken.path.stat().st_ino != source.stat().st_ino
    assert not known.store.staging("one").exists()


def test_a_source_that_changes_while_it_is_copied_is_refused(
    known, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = lay(tmp_path, {"w": b"weights"}) / "w"

    def changes_it(*_: object) -> None:
        source.write_bytes(b"malware")
        raise OSError(18, "Invalid cross-device link")

    monkeypatch.setattr(intake.os, "link", changes_it)
    with pytest.raises(ModelError, match="refused, kept as"):
        take_in(known.store, source)
    assert known.store.state("one") == "missing"


def test_an_unknown_file_is_refused_with_its_hash(known, tmp_path: Path) -> None:
    source = lay(tmp_path, {"w": b"unknown"}) / "w"
    with pytest.raises(ModelError) as refused:
        take_in(known.store, source)
    line = refused.value.line()
    assert hashlib.sha256(b"unknown").hexdigest() in line
    assert all(part in line for part in ("7 bytes", "folder, one", "docs/models.md"))
    assert not known.store.files.exists()


def test_a_file_has_to_be_the_model_it_is_called(known, tmp_path: Path) -> None:
    lay(tmp_path, {"w": b"other", "b": FILES["sub/b.bin"]})
    with pytest.raises(ModelError, match="that of one is"):
        take_in(known.store, tmp_path / "w", "one")
    with pytest.raises(ModelError, match="folder of 2 files"):
        take_in(known.store, tmp_path / "b", "folder")
    with pytest.raises(ModelError, match="one of 2 files of folder"):
        take_in(known.store, tmp_path / "b")


@pytest.mark.parametrize("name", [None, "folder"])
def test_a_folder_is_recognised_and_only_its_files_are_taken(known, tmp_path: Path, name: str | None) -> None:
    source = lay(tmp_path / "src", {**FILES, "README.md": b"hello"})
    taken = take_in(known.store, source, name)
    assert taken.id == "folder"
    assert sorted(p.relative_to(taken.path).as_posix() for p in taken.path.rglob("*.*")) == ["a.json", "sub/b.bin"]


def test_a_folder_that_differs_is_refused_by_file(known, tmp_path: Path) -> None:
    source = lay(tmp_path / "src", {"a.json": b"{}", "sub/b.bin": b"c" * 50})
    with pytest.raises(ModelError, match=r"not folder: sub/b\.bin has the sha256"):
        take_in(known.store, source)
    (source / "a.json").unlink()
    with pytest.raises(ModelError, match=r"not folder: a\.json is missing"):
        take_in(known.store, source)
    with pytest.raises(ModelError, match="single file, give its path"):
        take_in(known.store, source, "one")


def test_what_is_not_there_or_no_file_is_refused(known, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere"):
        take_in(known.store, tmp_path / "nowhere")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="pipe"):
        take_in(known.store, tmp_path / "pipe")
