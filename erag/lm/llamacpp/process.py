"""A child process that does what may kill a process: it is asked one thing, and only its answer comes back."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

_PACKAGES = Path(__file__).resolve().parents[3]


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a child ended. `refused`: it said no, for the reason in `detail`; `died`, `hung`: it said nothing."""

    state: Literal["ok", "refused", "died", "hung"]
    detail: str = ""
    answer: Mapping[str, Any] = field(default_factory=dict)


def child_command() -> tuple[str, ...]:
    """The command of the real child; `-P` keeps the working folder's files from being imported."""
    return (sys.executable, "-P", "-m", "erag.lm.llamacpp.child")


def ask(command: Sequence[str], request: Mapping[str, Any], seconds: float) -> Outcome:
    """Run a child on a request (JSON on its stdin) and read its answer (a line of JSON on its stdout).

    It ends after `seconds` at the latest. Whatever it writes elsewhere is lost.
    """
    try:
        done = subprocess.run(
            command,
            input=json.dumps(request).encode(),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=seconds,
            env={**os.environ, "PYTHONPATH": os.pathsep.join([str(_PACKAGES), *filter(None, sys.path)])},
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Outcome("hung", f"did not end within {seconds:g} s")
    if done.returncode < 0:
        return Outcome("died", f"was killed by {_signal_name(-done.returncode)}")
    return _read(done.stdout, done.returncode)


def _read(output: bytes, code: int) -> Outcome:
    try:
        answer = json.loads(output)
    except ValueError:
        return Outcome("died", f"ended with exit code {code} and no answer")
    if not isinstance(answer, dict) or code != 0:
        return Outcome("died", f"ended with exit code {code} and a wrong answer")
    if answer.get("ok") is not True:
        return Outcome("refused", str(answer.get("error", "no reason given")))
    return Outcome("ok", "", answer)


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
