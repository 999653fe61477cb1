"""The journal: every distinct call once, resumed where it stopped, replayed without a model."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from erag.core.errors import BadModelOutput
from erag.core.text import content_hash
from erag.lm.compose import compose
from erag.lm.fake import Fake, FakeConfig
from erag.lm.journal import Journal, plan
from erag.lm.ledger import Ledger
from erag.lm.roles import ROLES, Group, LMBackend, Prompt, Roles, SelectTask, TextKind, Vectors
from erag.memory.database import Database
from erag.memory.file import MemoryFile

TEXTS = [f"place number {i} with {'many ' * (i % 7)}words" for i in range(40)]


@pytest.fixture
def memory(tmp_path: Path) -> Iterator[MemoryFile]:
    Database.create(tmp_path / "m.erag")
    file = MemoryFile(tmp_path / "m.erag", "write")
    yield file
    file.close()


class Counting(Fake):
    """Counts what it computes, and breaks after `limit` texts."""

    def __init__(self, limit: int = 10**9) -> None:
        super().__init__(FakeConfig(call_size=8))
        self.seen: list[str] = []
        self.limit = limit

    def embed(self, texts: Sequence[str], kind: TextKind) -> Vectors:
        if len(self.seen) >= self.limit:
            raise BadModelOutput("it broke")
        self.seen += texts
        return super().embed(texts, kind)


def backend(model: Fake) -> LMBackend:
    return compose({"m": model}, Roles(dict.fromkeys(ROLES, "m")))


def attempts(memory: MemoryFile) -> list[tuple[bytes, str]]:
    return memory.db.rows("SELECT key, status FROM call_attempts JOIN call_batches USING (batch)")  # type: ignore[return-value]


def test_equal_texts_are_computed_once_and_kinds_apart(memory: MemoryFile) -> None:
    model, ledger = Counting(), Ledger()
    journal = Journal(backend(model), memory.calls, ledger)
    first = journal.embed([*TEXTS, *TEXTS], "document")
    again = journal.embed(TEXTS[::-1], "document")[::-1]
    assert sorted(model.seen) == sorted(TEXTS)
    assert np.array_equal(first[:40], first[40:])
    assert np.array_equal(first[:40], again)
    assert (ledger.calls["embed"], ledger.replayed["embed"]) == (40, 40)
    journal.embed(TEXTS[:1], "query")
    assert len(model.seen) == 41


def test_what_is_returned_now_is_what_is_read_later(memory: MemoryFile, tmp_path: Path) -> None:
    now = Journal(backend(Counting()), memory.calls).embed(TEXTS, "document")
    later = MemoryFile(tmp_path / "m.erag", "write")
    assert np.array_equal(now, Journal(backend(Counting(0)), later.calls).embed(TEXTS, "document"))
    later.close()


def test_a_broken_run_goes_on_without_repeating_a_finished_call(memory: MemoryFile) -> None:
    with pytest.raises(BadModelOutput, match="it broke"):
        Journal(backend(Counting(limit=16)), memory.calls).embed(TEXTS, "document")
    assert sum(status == "done" for _, status in attempts(memory)) == 16
    rest = Counting()
    Journal(backend(rest), memory.calls).embed(TEXTS, "document")
    assert len(rest.seen) == 24
    done = [key for key, status in attempts(memory) if status == "done"]
    assert len(done) == len(set(done)) == 40
    failed = memory.db.rows("SELECT error FROM call_batches WHERE status = 'failed'")
    assert failed == [("it broke",)]


def test_every_text_role_is_replayed_from_records(memory: MemoryFile, tmp_path: Path) -> None:
    image = tmp_path / "i.png"
    Image.new("RGB", (4, 4), (9, 9, 9)).save(image)
    groups = [Group(("a bench", "a bin"), ("2 of 2 views: a bench",)), Group(("ein Fluß",))]
    tasks = [SelectTask("bench", ("a bin", "a bench"))]
    prompt = Prompt((("user", "hello"),), max_tokens=4)

    def all_roles(journal: Journal) -> list[object]:
        scores = journal.score([("bench", "a bench"), ("bench", "a bin")]).tolist()
        return [
            journal.caption([image]), journal.summarise(groups), journal.select(tasks, 1), scores,
            journal.generate([prompt]),
        ]  # fmt: skip

    first = all_roles(Journal(backend(Fake()), memory.calls))
    ledger = Ledger()

    class Absent(Fake):
        caption = summarise = select = score = generate = None  # type: ignore[assignment]

    assert all_roles(Journal(backend(Absent()), memory.calls, ledger)) == first
    assert not +ledger.calls
    requests = memory.db.rows("SELECT role, request FROM call_results WHERE role = 'summarise' ORDER BY request")
    assert "2 of 2 views: a bench" in requests[0][1]


def test_another_fingerprint_or_k_is_another_call(memory: MemoryFile) -> None:
    Journal(backend(Fake()), memory.calls).embed(TEXTS[:1], "document")
    other = Ledger()
    Journal(backend(Fake(FakeConfig(seed=1))), memory.calls, other).embed(TEXTS[:1], "document")
    assert other.calls["embed"] == 1
    journal = Journal(backend(Fake()), memory.calls)
    task = [SelectTask("bench", ("a bin", "a bench"))]
    assert (journal.select(task, 1), journal.select(task, 2)) == ([[1]], [[1, 0]])


def test_the_plan_depends_on_content_alone_and_resumes_whole_batches() -> None:
    keys = [content_hash(t) for t in TEXTS]
    sizes = [len(t) for t in TEXTS]
    batches = plan(keys, sizes, 8)
    back = plan(keys[::-1], sizes[::-1], 8)
    assert [[keys[i] for i in b] for b in batches] == [[keys[::-1][i] for i in b] for b in back]
    assert plan([*keys, *keys], [*sizes, *sizes], 8) == batches
    assert sorted(i for b in batches for i in b) == list(range(40))
    assert plan([], [], 8) == []


def test_progress_is_told(memory: MemoryFile) -> None:
    told: list[tuple[str, int, int]] = []
    Journal(backend(Counting()), memory.calls, progress=lambda *step: told.append(step)).embed(TEXTS, "document")
    assert told[0] == ("embed", 0, 40)
    assert told[-1] == ("embed", 40, 40)
