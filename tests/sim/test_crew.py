"""Work in processes of their own: all of it is done, and a process that dies is told."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from erag.core.errors import InputError
from erag.sim.crew import run_apart


def note(folder: Path, number: int) -> None:
    (folder / str(number)).write_text(str(os.getpid()))


def die(folder: Path, number: int) -> None:
    if number == 1:
        os._exit(7)
    note(folder, number)


def test_every_job_is_done_in_a_process_of_its_own(tmp_path: Path) -> None:
    assert sorted(run_apart(note, [(tmp_path, i) for i in range(3)], 2)) == [0, 1, 2]
    pids = {path.read_text() for path in tmp_path.iterdir()}
    assert len(pids) == 3
    assert str(os.getpid()) not in pids


def test_a_process_that_dies_is_told_and_nothing_new_is_begun(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"ended with code 7.*--jobs 1"):
        list(run_apart(die, [(tmp_path, i) for i in range(4)], 1))
    assert not (tmp_path / "3").exists()
