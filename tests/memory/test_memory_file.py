"""The memory file: what goes in comes out, one writer, and no damage goes unnoticed."""

import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from erag.core.errors import InputError, MemoryFileError, MemoryLocked
from erag.core.types import Cluster, EdgeKind, Frame, Interval, Observation, Pose
from erag.data.reading import GivenCluster, GivenEdge, Issue, Reading
from erag.memory.database import Database
from erag.memory.diff import diff
from erag.memory.file import MemoryFile
from erag.memory.generations import Generation
from erag.memory.inspect import inspect
from erag.memory.lock import writer_lock


def observation(i: int, **changes: object) -> Observation:
    base = Observation(
        f"n{i}", "place", Pose(i, 2.0, 0.5, 0.1 if i % 2 else None), Interval(i, i + 1), f"img/{i}.jpg", f"Place {i}",
        f"A caption, with 'quotes', \"more\" and ünïcode {i}.", {"ndvi": 0.1 * i}, "world",
    )  # fmt: skip
    return replace(base, **changes)  # type: ignore[arg-type]


def reading(*observations: Observation, source: str = "world", frame: Frame = Frame.METRIC, **more: object) -> Reading:
    return Reading(source, Path("data"), frame, observations, sensors={"ndvi": (-1.0, 1.0)}, **more)  # type: ignore[arg-type]


def some(n: int = 5) -> Reading:
    return reading(
        *(observation(i) for i in range(n)),
        edges=(GivenEdge("n1", "n0", EdgeKind.PATH, 1.0), GivenEdge("n1", "n2", EdgeKind.RADIUS)),
        clusters=(GivenCluster("c0", 1, ("n0", "n1"), "name", "summary", ("a beside b",)),),
        issues=(Issue("world.jsonl:3", "NaN pose", "row left out"),),
        notes=("z points down",),
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    with MemoryFile.writing(tmp_path / "m.erag", "test", create=True) as memory:
        memory.observations.put(some())
    return tmp_path / "m.erag"


@pytest.fixture
def memory(path: Path) -> Iterator[MemoryFile]:
    with MemoryFile.writing(path, "test") as file:
        yield file


def test_observations_come_back_as_they_went_in(path: Path) -> None:
    with MemoryFile.reading(path) as memory:
        stored = memory.observations
        assert tuple(stored.nodes()) == some().observations
        assert stored.frame is Frame.METRIC
        assert stored.edges() == [GivenEdge("n0", "n1", EdgeKind.PATH, 1.0), GivenEdge("n1", "n2", EdgeKind.RADIUS)]
        assert stored.clusters() == list(some().clusters)
        assert stored.sensors() == {"ndvi": (-1.0, 1.0)}
        root, notes, issues = stored.sources()["world"]
        assert (root.name, notes, issues) == ("data", ("z points down",), some().issues)


def test_a_second_ingest_adds_replaces_and_leaves(memory: MemoryFile) -> None:
    revision = memory.observations.revision
    counts = memory.observations.put(some())
    assert (counts.added, counts.replaced, counts.unchanged) == (0, 0, 5)
    assert memory.observations.revision == revision
    counts = memory.observations.put(reading(observation(0), observation(1, caption="new"), observation(9)))
    assert (counts.added, counts.replaced, counts.unchanged) == (1, 1, 1)
    assert [n.id for n in memory.observations.nodes()] == ["n0", "n1", "n2", "n3", "n4", "n9"]
    assert memory.observations.nodes()[1].caption == "new"
    assert memory.observations.revision > revision


def test_ids_of_another_source_and_another_frame_are_refused_and_change_nothing(memory: MemoryFile) -> None:
    before = memory.observations.nodes()
    with pytest.raises(InputError, match="--id-prefix"):
        memory.observations.put(reading(observation(0), observation(7), source="other"))
    with pytest.raises(InputError, match="wgs84"):
        memory.observations.put(reading(observation(7), frame=Frame.WGS84))
    assert memory.observations.nodes() == before


def test_clusters_of_another_source_are_refused(memory: MemoryFile) -> None:
    other = reading(observation(7, id="m7"), source="other", clusters=(GivenCluster("c0", 1, ("m7",)),))
    with pytest.raises(InputError, match="cluster id 'c0'"):
        memory.observations.put(other)
    assert memory.observations.clusters()[0].members == ("n0", "n1")


def test_an_observation_keeps_the_source_it_names(memory: MemoryFile) -> None:
    memory.observations.put(reading(observation(8, source="robot7")))
    assert memory.observations.nodes()[-1].source == "robot7"
    assert memory.observations.origins()["n8"] == "world"


def test_a_reader_sees_one_state_while_a_writer_commits(path: Path) -> None:
    with MemoryFile.reading(path) as reader:
        assert len(reader.observations.nodes()) == 5
        other = MemoryFile(path, "write")
        other.db._connection.execute("PRAGMA busy_timeout = 50")
        with pytest.raises(MemoryFileError, match="locked"):
            other.observations.remove(["n0"])
        other.close()
        assert len(reader.observations.nodes()) == 5


def test_removed_nodes_are_gone_at_once_and_purged_with_the_next_build(memory: MemoryFile) -> None:
    assert memory.observations.remove(["n1", "n3"]) == 2
    assert [n.id for n in memory.observations.nodes()] == ["n0", "n2", "n4"]
    assert memory.observations.removed() == {"n1", "n3"}
    with pytest.raises(InputError, match="no node 'n1'"):
        memory.observations.remove(["n0", "n1"])
    assert [n.id for n in memory.observations.nodes()] == ["n0", "n2", "n4"]
    with memory.db.transaction() as connection:
        memory.observations.purge(connection)
    assert memory.observations.removed() == frozenset()
    assert memory.observations.edges() == []


def test_a_removed_node_that_is_seen_again_is_back(memory: MemoryFile) -> None:
    memory.observations.remove(["n1"])
    counts = memory.observations.put(some())
    assert (counts.added, counts.replaced) == (0, 1)
    assert [n.id for n in memory.observations.nodes()] == ["n0", "n1", "n2", "n3", "n4"]


def generation(name: str = "") -> Generation:
    arrays = {
        "node_places": np.full((5, 2), -1, np.int64), "sentence_places": np.empty((0, 2), np.int64),
        "summary_places": np.full((1, 2), -1, np.int64), "vectors": np.eye(3, dtype=np.float32),
    }  # fmt: skip
    cluster = Cluster("L1-0", 1, ("n0", "n1"), (0.5, 2.0, 0.5), 1.0, name, "all", ("a by b",), {"ndvi": 0.05})
    return Generation(1, "{}", "fake", ("level 1: 1",), arrays, (cluster,))


def test_a_generation_comes_back_and_replaces_the_one_before(memory: MemoryFile) -> None:
    assert memory.generations.load() is None
    memory.generations.swap_in(generation("old"), memory.observations.purge)
    memory.generations.swap_in(generation("new"), memory.observations.purge)
    back = memory.generations.load()
    assert back is not None
    assert back.clusters == generation("new").clusters
    assert {k: v.tolist() for k, v in back.arrays.items()} == {k: v.tolist() for k, v in generation().arrays.items()}
    assert memory.db.value("SELECT count(*) FROM clusters") == 1


def test_a_swap_that_fails_leaves_the_old_generation(memory: MemoryFile) -> None:
    memory.generations.swap_in(generation("old"), memory.observations.purge)

    def fail(connection: sqlite3.Connection) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        memory.generations.swap_in(generation("new"), fail)
    back = memory.generations.load()
    assert back is not None
    assert back.clusters[0].name == "old"


def test_diff_finds_each_difference_and_none_in_a_copy(path: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy.erag"
    shutil.copy(path, copy)
    with MemoryFile.reading(path) as a, MemoryFile.reading(copy) as b:
        assert diff(a, b) == []
    with MemoryFile.writing(copy, "test") as changed:
        changed.observations.put(reading(observation(1, caption="new"), observation(9)))
        changed.generations.swap_in(generation(), changed.observations.purge)
    with MemoryFile.reading(path) as a, MemoryFile.reading(copy) as b:
        found = {d.part: d for d in diff(a, b)}
    assert found["nodes"].only_b == ("n9",)
    assert found["nodes"].differ == ("n1",)
    assert found["clusters"].only_b == ("L1-0",)
    assert "1 only in B (n9)" in found["nodes"].line()


def test_inspect_counts_what_is_there(path: Path) -> None:
    with MemoryFile.reading(path) as memory:
        found = inspect(memory)
    assert found.observations == {"place": 5}
    assert found.given_edges == {"path": 1, "radius": 1}
    assert (found.with_text, found.with_image, found.given_clusters) == (5, 5, 1)
    text = "\n".join(found.lines())
    assert "z points down" in text
    assert "not built yet" in text


def test_a_second_writer_is_told_who_holds_the_lock(path: Path) -> None:
    with MemoryFile.writing(path, "erag build"):
        with pytest.raises(MemoryLocked, match=r"erag build, process \d+ on "), MemoryFile.writing(path, "erag ingest"):
            pass
        with MemoryFile.reading(path) as reader:
            assert len(reader.observations.nodes()) == 5
    with MemoryFile.writing(path, "erag ingest"):
        pass


def test_the_lock_of_a_killed_writer_is_free(path: Path) -> None:
    code = (
        "import os, signal; from pathlib import Path; from erag.memory.lock import writer_lock\n"
        f"with writer_lock(Path({str(path)!r}), 'doomed'): os.kill(os.getpid(), signal.SIGKILL)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == -9
    with writer_lock(path, "next"):
        pass


def test_a_reader_never_changes_the_file(path: Path) -> None:
    before = path.read_bytes()
    with MemoryFile.reading(path) as memory, pytest.raises(MemoryFileError, match="readonly"):
        memory.observations.remove(["n0"])
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "not a memory file"),
        (b"PK\x03\x04" + bytes(200), "not a memory file"),
        (b"SQLite format 3\x00", "not a mem"),
    ],
)
def test_foreign_files_are_refused(tmp_path: Path, content: bytes, said: str) -> None:
    file = tmp_path / "f.erag"
    file.write_bytes(content)
    with pytest.raises(MemoryFileError, match=said):
        Database(file, "read")
    assert file.read_bytes() == content


def test_another_programs_database_and_another_version_are_refused(tmp_path: Path, path: Path) -> None:
    other = tmp_path / "other.erag"
    connection = sqlite3.connect(other)
    connection.execute("CREATE TABLE t (a)")
    connection.close()
    with pytest.raises(MemoryFileError, match="another program"):
        Database(other, "read")
    connection = sqlite3.connect(path)
    connection.execute("PRAGMA user_version = 99")
    connection.close()
    with pytest.raises(MemoryFileError, match="schema version 99"):
        Database(path, "read")


def test_a_truncated_file_is_noticed_before_it_is_used(path: Path) -> None:
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(MemoryFileError, match="truncated: "):
        Database(path, "read")


def test_damage_inside_is_one_line_and_names_the_file(path: Path) -> None:
    whole = bytearray(path.read_bytes())
    whole[4096:] = b"\xff" * (len(whole) - 4096)
    path.write_bytes(whole)
    with pytest.raises(MemoryFileError, match=r"m\.erag: .*malformed"), MemoryFile.reading(path) as memory:
        memory.observations.nodes()


def test_missing_files_and_folders_say_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(MemoryFileError, match="erag ingest SOURCE"):
        Database(tmp_path / "no.erag", "read")
    with (
        pytest.raises(MemoryFileError, match="mkdir"),
        MemoryFile.writing(tmp_path / "no" / "m.erag", "t", create=True),
    ):
        pass


def test_a_disk_that_is_full_is_one_line_and_the_old_data_stay(path: Path) -> None:
    code = f"""
import resource, signal, sys
from pathlib import Path
from erag.core.errors import MemoryFileError
from erag.core.types import Frame, Observation, Pose
from erag.data.reading import Reading
from erag.memory.file import MemoryFile
path = Path({str(path)!r})
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
limit = path.stat().st_size + 8192
many = tuple(Observation(f"x{{i}}", "place", Pose(i, 0), caption="long " * 200) for i in range(2000))
with MemoryFile.writing(path, "test") as memory:
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    try:
        memory.observations.put(Reading("world", Path("data"), Frame.METRIC, many))
    except MemoryFileError as error:
        print(error.line())
"""
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert "run the command again" in done.stdout
    with MemoryFile.reading(path) as memory:
        assert tuple(memory.observations.nodes()) == some().observations
