"""Death at any transaction of ingest and build leaves a memory from which the same result is reached."""

import signal
import subprocess
import sys
from pathlib import Path

from erag.data.sample import sample_dir
from erag.memory.diff import diff
from erag.memory.file import MemoryFile
from erag.pipeline.session import open_memory

# Dies at the n-th time a transaction begins (odd n) or is about to be committed (even n).
DOOMED = """
import contextlib, os, signal, sys
from erag.memory.database import Database
from erag.pipeline.session import open_memory

memory, config, source, n = sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4])
left = [n]
whole = Database.transaction

def tick():
    left[0] -= 1
    if left[0] == 0:
        os.kill(os.getpid(), signal.SIGKILL)

@contextlib.contextmanager
def transaction(self):
    with whole(self) as connection:
        tick()
        yield connection
        tick()

Database.transaction = transaction
opened = open_memory(memory, config=config)
opened.ingest(source)
opened.build()
"""


def test_the_same_memory_after_death_at_any_transaction(tmp_path: Path, fake_config: Path, campus: Path) -> None:
    broken = tmp_path / "broken.erag"
    deaths = 0
    for n in (1, 2, 3, 4, 5, 6, 9, 14, 19, 24):
        done = subprocess.run(
            [sys.executable, "-c", DOOMED, str(broken), str(fake_config), str(sample_dir()), str(n)], check=False
        )
        deaths += done.returncode == -signal.SIGKILL
    assert deaths >= 8
    memory = open_memory(broken, config=fake_config)
    memory.ingest(sample_dir())
    memory.build()
    with MemoryFile.reading(campus) as a, MemoryFile.reading(broken) as b:
        assert diff(a, b) == []
        repeated = b.db.rows(
            """SELECT key FROM call_attempts JOIN call_batches USING (batch) WHERE status = 'done'
               GROUP BY key HAVING count(*) > 1"""
        )
        assert repeated == []
        assert b.db.value("SELECT count(*) FROM call_batches WHERE status = 'started'") > 0
