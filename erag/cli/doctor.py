"""The `doctor` command: what this machine and this installation can do, and what is missing."""

from __future__ import annotations

import json
import shutil
import socket
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import typer

from erag.cli import show
from erag.cli.options import AsJson
from erag.core.cores import cores

LIBRARIES = ("torch", "tokenizers", "safetensors", "gguf", "Jinja2", "sentence-transformers", "transformers", "bm25s")


def register(app: typer.Typer) -> None:
    """Add this module's command to the command line."""
    app.command()(doctor)


def doctor(json_: AsJson = False) -> None:
    """Check CPU, precision, libraries, models, memory, disk and network."""
    facts = {**_machine(), **_installed(), **_llamacpp(), **_models(), "network": _network()}
    if json_:
        show.out(json.dumps(facts, ensure_ascii=False, indent=2))
        return
    width = max(map(len, facts)) + 2
    show.lines(f"{name:<{width}}{value}" for name, value in facts.items())


def _machine() -> dict[str, str]:
    from erag.lm.probe import choose_dtype, cpu

    chip = cpu()
    known = sorted(chip.flags & {"avx2", "avx512f", "avx512_bf16", "avx512_vnni", "amx_bf16", "amx_int8"})
    why = "multiplied in hardware" if chip.fast_bf16 else "no bf16 in hardware"
    extensions = ", ".join(known) or "no known extensions"
    return {
        "cpu": f"{chip.name} ({chip.architecture}), {cores()} cores, {extensions}",
        "precision": f"{choose_dtype('auto')} ({why})",
        "memory": _memory(),
        "disk": f"{shutil.disk_usage(Path.cwd()).free / 1e9:.0f} GB free here",
    }


def _memory() -> str:
    info = Path("/proc/meminfo")
    if not info.is_file():
        return "unknown"
    fields = dict(line.split(":", 1) for line in info.read_text().splitlines() if ":" in line)
    total, free = (int(fields[name].split()[0]) / 1e6 for name in ("MemTotal", "MemAvailable"))
    return f"{free:.1f} of {total:.1f} GB available"


def _installed() -> dict[str, str]:
    found = {name: _version(name) for name in LIBRARIES}
    missing = [name for name, v in found.items() if v is None]
    present = ", ".join(f"{name} {v}" for name, v in found.items() if v)
    return {
        "libraries": present + (f"; missing: {', '.join(missing)} (pip install 'erag[sentence]')" if missing else "")
    }


def _llamacpp() -> dict[str, str]:
    """Which kernels of llama.cpp each model survived in a child process, and why."""
    from erag.lm.llamacpp.probe import explain

    first, *tried = explain()
    return {"llama.cpp": first, **{f"llama.cpp {i}": line for i, line in enumerate(tried, 1)}}


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _models() -> dict[str, str]:
    from erag.lm.weights import default_store

    store = default_store()
    return {f"model {m.id}": store.state(m.id) for m in store.all()}


def _network() -> str:
    """Whether this machine has a route to the outside; connecting a datagram socket looks it up and sends nothing."""
    from erag.lm.offline import permitted

    with permitted(), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # TEST-NET-1, an address that belongs to nobody
        except OSError:
            return "no route to the outside (only `erag models pull` and the `openai` backend would need one)"
    return "there is a route to the outside (only `erag models pull` and the `openai` backend use it)"
