"""Where and with what a run was made: revision of the code, versions, models by hash, hardware."""

from __future__ import annotations

import os
import platform
import subprocess
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import erag
from erag.core.cores import cores
from erag.lm.probe import cpu
from erag.lm.weights import ModelStore

PACKAGES = ("erag", "numpy", "scipy", "torch", "sentence-transformers", "bm25s", "llama-cpp-python", "matplotlib")


def revision() -> str:
    """The git revision of the code, with `+changes` where files differ from it; `unknown` outside a repository."""
    root = Path(erag.__file__).resolve().parents[1]

    def git(*arguments: str) -> str:
        return subprocess.run(
            ["git", "-C", str(root), *arguments], capture_output=True, text=True, timeout=20, check=True
        ).stdout.strip()

    try:
        found, changed = git("rev-parse", "HEAD"), git("status", "--porcelain", "--untracked-files=no")
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return f"{found}+changes" if changed else found


def machine(models: Iterable[str], store: ModelStore) -> dict[str, Any]:
    """Revision, versions, hashes of the named models' files, processor, cores, memory."""
    known = {m.id: m for m in store.all()}
    files = {name: store.fingerprint(name) for name in sorted(set(models)) if name in known}
    return {
        "revision": revision(),
        "python": platform.python_version(),
        "packages": {name: found for name in PACKAGES if (found := _version(name))},
        "models": files,
        "cpu": _processor(),
        "cores": cores(),
        "memory_gb": _memory_gb(),
        "flags": sorted(f for f in cpu().flags if f.startswith(("amx", "avx"))),
        "system": f"{platform.system()} {platform.machine()}",
    }


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _processor() -> str:
    told = Path("/proc/cpuinfo")
    if told.is_file():
        names = [
            line.partition(":")[2].strip() for line in told.read_text().splitlines() if line.startswith("model name")
        ]
        if names:
            return names[0]
    return platform.processor() or platform.machine()


def _memory_gb() -> float:
    return round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9, 1)
