"""Kill ingest and build at random moments, run them again, and compare with an uninterrupted run.

    python scripts/kill_test.py [SOURCE] [--kills 10] [--seed 0]

SOURCE is a file or folder `erag ingest` reads (default: the street view map beside the repository, else the sample).
Prints one line a kill; exits with 1 when a memory differs or a finished call was repeated.
"""

from __future__ import annotations

import argparse
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from erag.data.sample import sample_dir
from erag.memory.diff import diff
from erag.memory.file import MemoryFile

OUTSIDE = Path(__file__).resolve().parents[2] / "shared/data/cmu_500/topological_map.gml"


START_UP_S = 2.0


def main() -> int:
    """Run the test and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source", nargs="?", type=Path, default=OUTSIDE if OUTSIDE.exists() else sample_dir())
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    rng = random.Random(args.seed)
    with tempfile.TemporaryDirectory() as folder:
        whole, broken = Path(folder) / "whole.erag", Path(folder) / "broken.erag"
        lengths = {step: _run(step, args.source, whole) for step in ("ingest", "build")}
        print(f"uninterrupted: ingest {lengths['ingest']:.1f} s, build {lengths['build']:.1f} s")
        of_ingest = args.kills // 3
        killed = 0
        for _ in range(of_ingest):
            killed += _kill("ingest", args.source, broken, rng.uniform(0.1, 0.98) * lengths["ingest"])
        _run("ingest", args.source, broken)
        step = lengths["build"] / (args.kills - of_ingest)  # each build goes on from the last, so each gets a share
        for _ in range(args.kills - of_ingest):
            killed += _kill("build", args.source, broken, START_UP_S + rng.uniform(0, 1.2) * step)
        _run("build", args.source, broken)
        print(f"{killed} of {args.kills} runs were killed in the middle")
        return _verdict(whole, broken) or int(killed < args.kills // 2)


def _command(step: str, source: Path, memory: Path) -> list[str]:
    erag = [sys.executable, "-m", "erag"]
    return [*erag, "ingest", str(source), "--out", str(memory)] if step == "ingest" else [*erag, "build", str(memory)]


def _run(step: str, source: Path, memory: Path) -> float:
    start = time.perf_counter()
    subprocess.run(_command(step, source, memory), check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.perf_counter() - start


def _kill(step: str, source: Path, memory: Path, after: float) -> bool:
    child = subprocess.Popen(
        _command(step, source, memory), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    try:
        child.wait(after)
    except subprocess.TimeoutExpired:
        child.send_signal(signal.SIGKILL)
    killed = child.wait() == -signal.SIGKILL
    end = "killed" if killed else "finished before it could be killed"
    print(f"{step} {end} after {after:.2f} s; {_calls(memory)}")
    return killed


def _calls(memory: Path) -> str:
    if not memory.exists():
        return "no memory file yet"
    with MemoryFile.reading(memory) as file:
        rows = file.db.rows("SELECT status, count(*) FROM call_attempts JOIN call_batches USING (batch) GROUP BY 1")
    return "calls: " + (", ".join(f"{n} {status}" for status, n in rows) or "none")


def _verdict(whole: Path, broken: Path) -> int:
    with MemoryFile.reading(whole) as a, MemoryFile.reading(broken) as b:
        differences = diff(a, b)
        repeated = b.db.rows(
            """SELECT key FROM call_attempts JOIN call_batches USING (batch) WHERE status = 'done'
               GROUP BY key HAVING count(*) > 1"""
        )
    for part in differences:
        print(part.line())
    print(f"{len(differences)} parts differ, {len(repeated)} finished calls repeated; {_calls(broken)}")
    return int(bool(differences or repeated))


if __name__ == "__main__":
    sys.exit(main())
