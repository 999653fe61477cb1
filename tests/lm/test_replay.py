"""Records travel: out of a memory, into another, and into a backend that answers from nothing else."""

import gzip
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from erag.cli.main import run
from erag.core.errors import ConfigError, InputError, ModelError
from erag.lm.callfile import read_calls
from erag.lm.compose import compose
from erag.lm.config import BackendConfig, build_backend
from erag.lm.fake import Fake, FakeConfig
from erag.lm.journal import Journal
from erag.lm.ledger import Ledger
from erag.lm.replay import NotRecorded, Replay, ReplayConfig
from erag.lm.roles import ROLES, Group, LMBackend, Prompt, Roles, SelectTask
from erag.lm.weights import default_store
from erag.memory.file import MemoryFile
from erag.pipeline.records import export_records, import_records
from erag.pipeline.session import open_memory

TEXTS = ["a bench", "ein Fluß", "川 and 🌉", "a bin"]
TASKS = [SelectTask("bench", ("a bin", "a bench", "a pond"))]
GROUPS = [Group(("a bench", "a bin"), ("2 of 2 views: a bench",))]
PROMPT = Prompt((("user", "hello you"),), {"type": "integer", "minimum": 4})


def everything(backend: LMBackend, image: Path) -> list[Any]:
    """A result of every role."""
    return [
        backend.caption([image]), backend.embed(TEXTS, "document").tolist(), backend.embed(TEXTS[:1], "query").tolist(),
        backend.summarise(GROUPS), backend.select(TASKS, 1), backend.select(TASKS, 2),
        backend.score([("bench", "a bench")]).tolist(), backend.generate([PROMPT]),
    ]  # fmt: skip


def model(seed: int = 0) -> LMBackend:
    return compose({"m": Fake(FakeConfig(seed=seed))}, Roles(dict.fromkeys(ROLES, "m")))


@pytest.fixture
def image(tmp_path: Path) -> Path:
    path = tmp_path / "i.png"
    Image.new("RGB", (4, 3), "red").save(path)
    return path


@pytest.fixture
def recorded(tmp_path: Path, image: Path) -> Path:
    """A memory in which every role was called once."""
    with MemoryFile.writing(tmp_path / "a.erag", "test", create=True) as memory:
        everything(Journal(model(), memory.calls), image)
    return tmp_path / "a.erag"


@pytest.fixture
def calls(recorded: Path, tmp_path: Path) -> Path:
    export_records(recorded, tmp_path / "calls.jsonl.gz")
    return tmp_path / "calls.jsonl.gz"


def test_a_replay_answers_as_the_journal_did(recorded: Path, calls: Path, image: Path) -> None:
    with MemoryFile.reading(recorded) as memory:
        first = everything(Journal(model(), memory.calls), image)
    config = BackendConfig.model_validate(
        {"models": {"r": {"kind": "replay", "records": calls}}, "roles": dict.fromkeys(ROLES, "r")}
    )
    assert everything(build_backend(config, default_store()), image) == first


def test_imported_records_stand_for_the_model(calls: Path, image: Path, tmp_path: Path) -> None:
    moved = import_records(tmp_path / "b.erag", calls)
    assert moved.new == sum(moved.roles.values()) == 11
    assert import_records(tmp_path / "b.erag", calls).new == 0
    ledger = Ledger()
    with MemoryFile.writing(tmp_path / "b.erag", "test") as memory:
        everything(Journal(model(), memory.calls, ledger), image)
        everything(Journal(compose({"m": Replay(ReplayConfig(records=calls))}, Roles(dict.fromkeys(ROLES, "m"))),
                           memory.calls, ledger), image)  # fmt: skip
    assert not +ledger.calls
    export_records(tmp_path / "b.erag", tmp_path / "again.jsonl.gz")
    assert (tmp_path / "again.jsonl.gz").read_bytes() == calls.read_bytes()


def test_what_is_missing_is_said_precisely(calls: Path, image: Path, tmp_path: Path) -> None:
    replay = Replay(ReplayConfig(records=calls))
    asked = [*TASKS, SelectTask("Wo ist die Brücke?", ("x", "y")), SelectTask("pond", ("x",))]
    with pytest.raises(
        NotRecorded, match=r"no record of 2 of 3 select calls, such as .*Brücke.*erag records export"
    ) as caught:
        replay.select(asked, 1)
    assert (caught.value.role, caught.value.missing, caught.value.asked) == ("select", 2, 3)
    with pytest.raises(NotRecorded, match="1 of 1 select"):
        replay.select(TASKS, 3)
    with pytest.raises(NotRecorded, match="1 of 2 embed calls, such as 'elsewhere'"):
        replay.embed(["a bench", "elsewhere"], "document")
    other = tmp_path / "other.png"
    other.write_bytes(b"other pixels")
    with pytest.raises(NotRecorded, match=r"caption calls, such as 'other\.png \(sha256 "):
        replay.caption([image, other])


def test_a_role_that_was_never_recorded_and_one_of_two_models(recorded: Path, tmp_path: Path) -> None:
    export_records(recorded, tmp_path / "e.jsonl.gz", ["embed"])
    with pytest.raises(ModelError, match=r"no score calls are recorded; allowed: recorded roles: embed"):
        Replay(ReplayConfig(records=tmp_path / "e.jsonl.gz")).score([("a", "b")])
    with MemoryFile.writing(recorded, "test") as memory:
        Journal(model(seed=1), memory.calls).embed(TEXTS, "document")
    export_records(recorded, tmp_path / "two.jsonl.gz")
    with pytest.raises(ConfigError, match=r"2 models played 'embed'.*of: \{embed: PART\}"):
        Replay(ReplayConfig(records=tmp_path / "two.jsonl.gz")).embed(TEXTS, "document")
    chosen = Replay(ReplayConfig(records=tmp_path / "two.jsonl.gz", of={"embed": '"seed": 1'}))
    assert np.allclose(chosen.embed(TEXTS, "document"), model(seed=1).embed(TEXTS, "document"), atol=1e-3)


def test_a_built_memory_is_asked_without_its_embedder(campus: Path, tmp_path: Path, fake_config: Path) -> None:
    """The recorded identity lets vectors of a replay be compared with those of the memory."""
    made = tmp_path / "c.erag"
    made.write_bytes(campus.read_bytes())
    memory = open_memory(made, config=fake_config)
    question = "Where is the pond?"
    with MemoryFile.writing(made, "test") as file:
        Journal(build_backend(memory.config.backend, default_store()), file.calls).embed([question], "query")
    export_records(made, tmp_path / "c.jsonl.gz")
    overrides = [
        f"backend={{models: {{r: {{kind: replay, records: {tmp_path / 'c.jsonl.gz'}}}}}, roles: {{embed: r}}}}"
    ]
    replayed = open_memory(made, overrides=[*overrides, "answer.explain=quotes", "retrieve.retriever={kind: node}"])
    plain = open_memory(made, config=fake_config, overrides=["retrieve.retriever={kind: node}"])
    ours, theirs = replayed.query(question), plain.query(question)
    assert [h.node for h in ours.hits] == [h.node for h in theirs.hits]


Change = Callable[[list[dict[str, Any]]], object]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda rows: rows[0].update(version=2), "version 2"),
        (lambda rows: rows[0].update(format="x"), "format 'x'"),
        (lambda rows: rows.pop(), "is cut short: 10 of 11"),
        (lambda rows: rows[0].update(sources=[{"role": "cook"}]), "a source"),
        (lambda rows: rows[1].update(of=99), "index out of range"),
        (lambda rows: rows[1].update(of=-1), "no number"),
        (lambda rows: rows[1].update(key="00"), "a key of 1 bytes"),
        (lambda rows: rows[1].update(key="0" * 32), "not that of its request"),
        (lambda rows: [row.update(request="x") for row in rows if "request" in row], "not that of its request"),
        (lambda rows: [row.update(result="{") for row in rows if "result" in row], "no record"),
        (lambda rows: [row.update(vector="AAAA") for row in rows if "vector" in row], "no record"),
        (lambda rows: [row.update(vector="!") for row in rows if "vector" in row], "no record"),
    ],
)
def test_a_file_that_is_not_true_of_itself_is_refused(calls: Path, tmp_path: Path, change: Change, told: str) -> None:
    rows = [json.loads(line) for line in gzip.decompress(calls.read_bytes()).splitlines()]
    change(rows)
    calls.write_bytes(gzip.compress(b"\n".join(json.dumps(row).encode() for row in rows)))
    with pytest.raises(InputError, match=told):
        read_calls(calls)
    with pytest.raises(InputError):
        import_records(tmp_path / "b.erag", calls)


@pytest.mark.parametrize("cut", [0, 5, 40, -9, -1])
def test_a_file_cut_anywhere_is_refused(calls: Path, cut: int) -> None:
    calls.write_bytes(calls.read_bytes()[:cut])
    with pytest.raises(InputError, match=r"calls\.jsonl\.gz"):
        read_calls(calls)


def test_the_commands(recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "x.jsonl.gz"
    assert run(["records", "export", str(recorded), "--out", str(out), "--role", "select", "--role", "embed"]) == 0
    assert run(["records", "import", str(tmp_path / "n.erag"), str(out)]) == 0
    assert "5 embed, 2 select; 7 of them new" in capsys.readouterr().out
    assert run(["records", "export", str(recorded), "--out", str(out), "--role", "cook"]) == 2
    assert run(["records", "export", str(recorded), "--out", str(recorded)]) == 2
    assert run(["records", "import", str(recorded), str(tmp_path / "none.gz")]) == 2
    empty = tmp_path / "empty.erag"
    with MemoryFile.writing(empty, "test", create=True):
        pass
    assert run(["records", "export", str(empty), "--out", str(out)]) == 2
    assert "holds no records of" in capsys.readouterr().err
