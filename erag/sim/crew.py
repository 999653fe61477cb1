"""Rendering in processes of their own: all cores at work, and what pybullet keeps of a scene goes with its process."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import Any

from erag.core.errors import InputError


def run_apart(work: Callable[..., None], jobs: Sequence[tuple[Any, ...]], at_once: int) -> Iterator[int]:
    """Do `work(*job)` for every job, each in a fresh process, `at_once` of them together; the numbers as they are done.

    Jobs are begun in their order. Raises InputError when a process ends before its work is done, after the others that
    were begun have ended.
    """
    threads = ThreadPoolExecutor(at_once)
    try:
        waiting = {threads.submit(_apart, work, job): number for number, job in enumerate(jobs)}
        for done in as_completed(waiting):
            done.result()
            yield waiting[done]
    finally:
        threads.shutdown(cancel_futures=True)


def _apart(work: Callable[..., None], job: tuple[Any, ...]) -> None:
    process = multiprocessing.get_context("spawn").Process(target=work, args=job, daemon=True)
    process.start()
    process.join()
    if process.exitcode:
        what = f"a rendering process ended with code {process.exitcode}"
        raise InputError(what, where=f"job {job[:3]}", repair="the same command goes on; less memory: --jobs 1")
