"""The store: only verified files get out, what has not changed is not hashed again, and only our files are removed."""

import os
from pathlib import Path

import pytest

from erag.core.errors import ModelError
from erag.lm.weights import ModelStore, default_store, store
from erag.lm.weights.fetch import pull

FILES = {"config.json": b"{}", "sub/model.bin": b"weights" * 100}


@pytest.fixture
def filled(depot) -> ModelStore:
    depot.one(b"first weights")
    depot.folder(FILES)
    for model in ("one", "folder"):
        pull(depot.store, model, depot.origins)
    depot.declare("absent", {"a.gguf": b"a"}, [{"kind": "hub", "repo": "a/b", "revision": "r", "file": "f"}])
    depot.declare("mine", {"m.gguf": b"m"}, [])
    return depot.store


@pytest.fixture
def hashed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the files hashed so far."""
    names: list[str] = []
    real = store.sha256_of
    monkeypatch.setattr(store, "sha256_of", lambda path, seen=None: (names.append(path.name), real(path, seen))[1])
    return names


def test_path_gives_the_file_or_the_folder(filled: ModelStore) -> None:
    assert filled.path("one").read_bytes() == b"first weights"
    assert (filled.path("folder") / "sub/model.bin").read_bytes() == FILES["sub/model.bin"]


@pytest.mark.parametrize(
    ("model", "repair"), [("absent", "erag models pull absent"), ("mine", "erag models import FILE --name mine")]
)
def test_a_missing_model_says_how_to_get_it(filled: ModelStore, model: str, repair: str) -> None:
    with pytest.raises(ModelError, match="missing") as missing:
        filled.path(model)
    assert missing.value.repair == repair


def test_an_unknown_model_names_the_known_ones(filled: ModelStore) -> None:
    with pytest.raises(ModelError, match=r"'two'.*absent, folder, mine, one"):
        filled.path("two")


def test_what_was_verified_is_hashed_again_only_when_it_changed(filled: ModelStore, hashed: list[str]) -> None:
    file = filled.path("one")
    filled.path("folder")
    assert hashed == []  # pulling had hashed them
    later = file.stat().st_mtime_ns + 10**9
    os.utime(file, ns=(later, later))
    filled.path("one")
    filled.path("one")
    assert hashed == ["one.gguf"]


def test_a_change_of_the_same_size_is_refused(filled: ModelStore) -> None:
    file = filled.path("one")
    file.write_bytes(b"FIRST WEIGHTS")
    later = file.stat().st_mtime_ns + 10**9
    os.utime(file, ns=(later, later))
    with pytest.raises(ModelError, match=r"one\.gguf has the sha256 .* expected") as wrong:
        filled.path("one")
    assert wrong.value.repair == "erag models pull one"


def test_a_file_swapped_for_another_inode_is_refused(filled: ModelStore, tmp_path: Path) -> None:
    file = filled.path("one")
    before = file.stat()
    (tmp_path / "other").write_bytes(b"FIRST WEIGHTS")
    os.utime(tmp_path / "other", ns=(before.st_atime_ns, before.st_mtime_ns))
    (tmp_path / "other").replace(file)
    with pytest.raises(ModelError, match="expected"):
        filled.path("one")


def test_a_forged_record_of_another_hash_is_not_believed(filled: ModelStore) -> None:
    record = filled.files / ".verified" / "one.json"
    file = filled.path("one")
    file.write_bytes(b"other")
    stamp = store.Stamp.of(file)
    record.write_text(f'{{"files": {{"one.gguf": [{list(stamp)}, "{"0" * 64}"]}}}}')
    with pytest.raises(ModelError, match="expected"):
        filled.path("one")


def test_a_damaged_record_costs_only_hashing(filled: ModelStore, hashed: list[str]) -> None:
    (filled.files / ".verified" / "one.json").write_text("{")
    assert filled.path("one").is_file()
    assert hashed == ["one.gguf"]


def test_a_store_that_cannot_be_written_still_serves(
    filled: ModelStore, hashed: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    record = filled.files / ".verified" / "one.json"
    record.unlink()
    monkeypatch.setattr(store.os, "access", lambda path, mode: False)
    filled.path("one")
    filled.path("one")
    assert hashed == ["one.gguf", "one.gguf"]
    assert not record.exists()


def test_a_folder_with_a_file_nobody_vouches_for_is_refused(filled: ModelStore) -> None:
    (filled.folder("folder") / "adapter_config.json").write_text("{}")
    (filled.folder("folder") / ".DS_Store").write_text("")
    with pytest.raises(ModelError, match=r"adapter_config\.json is not in the manifest") as refused:
        filled.path("folder")
    assert ".DS_Store" not in refused.value.line()
    assert filled.state("folder") == "wrong"


def test_states(filled: ModelStore) -> None:
    assert [filled.state(m) for m in ("one", "folder", "absent")] == ["verified", "verified", "missing"]
    (filled.files / ".verified" / "one.json").unlink()
    assert filled.state("one") == "present"
    filled.path("one")
    assert filled.state("one") == "verified"
    filled.path("one").write_bytes(b"longer than it was")
    assert filled.state("one") == "wrong"
    (filled.folder("folder") / "config.json").unlink()
    assert filled.state("folder") == "partial"


def test_verifying_anew_finds_what_the_stamp_hides(filled: ModelStore) -> None:
    file = filled.path("one")
    before = file.stat()
    with file.open("r+b") as raw:
        raw.write(b"F")
    os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert filled.check("one").state == "ok"
    assert filled.check("one", anew=True).state == "wrong"
    assert filled.check("one").state == "wrong"  # the record is gone too


def test_removing_takes_only_the_files_of_the_manifest(filled: ModelStore) -> None:
    note = filled.folder("folder") / "sub" / "note.txt"
    note.write_text("mine")
    assert filled.remove("folder") == sum(map(len, FILES.values()))
    assert [p for p in filled.folder("folder").rglob("*") if p.is_file()] == [note]
    assert filled.remove("one") == len(b"first weights")
    assert not filled.folder("one").exists()
    assert filled.remove("one") == 0
    assert filled.state("one") == "missing"


def test_removing_from_a_store_that_was_never_used_makes_nothing(depot) -> None:
    depot.one(b"x")
    assert depot.store.remove("one") == 0
    assert not depot.store.files.exists()


def test_fingerprints_need_no_files(depot) -> None:
    depot.one(b"x")
    assert depot.store.fingerprint("one") == "2d711642b726b04401627ca9fbac32f5c8530fb1903cc4db02258717921a4881"


def test_the_default_store_reads_the_users_manifests_too(
    depot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    depot.declare("mine", {"m.gguf": b"m"}, [])
    (tmp_path / "erag" / "models").mkdir(parents=True)
    (tmp_path / "manifests").rename(tmp_path / "erag" / "models" / "manifests")
    found = default_store(tmp_path / "elsewhere")
    assert {"mine", "minilm-l6"} <= {manifest.id for manifest in found.all()}
    assert found.location("mine") == tmp_path / "elsewhere" / "mine" / "m.gguf"
    assert found.quarantine == tmp_path / "elsewhere" / "quarantine"


def test_an_installed_package_keeps_files_in_the_users_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "__file__", str(tmp_path / "site" / "erag" / "lm" / "weights" / "store.py"))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    found = default_store()
    assert found.manifests == tmp_path / "site" / "erag" / "_models"
    assert found.files == tmp_path / "data" / "erag" / "models" / "files"
    assert found.quarantine == tmp_path / "data" / "erag" / "models" / "quarantine"


def test_a_disk_that_cannot_be_read_is_one_line(filled: ModelStore, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(path: Path, seen: object = None) -> str:
        raise OSError(5, "Input/output error", str(path))

    monkeypatch.setattr(store, "sha256_of", broken)
    with pytest.raises(ModelError, match=r"model one: Input/output error .*one\.gguf"):
        filled.check("one", anew=True)


@pytest.mark.weights
def test_the_real_embedder_is_what_its_manifest_says() -> None:
    real = default_store()
    if real.state("minilm-l6") == "missing":
        pytest.skip("minilm-l6 is not here: erag models pull minilm-l6")
    assert real.check("minilm-l6", anew=True).problems == ""
    assert (real.path("minilm-l6") / "modules.json").is_file()
