"""Offline Embodied-RAG: a robot's observations become a memory that can be asked.

import erag

memory = erag.open("campus.erag")
memory.ingest(erag.sample())
memory.build()
result = memory.query("Where can I lock up my bicycle?")
print(result.answer.text, result.hits[0].score)
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"
__all__ = ["Memory", "open", "sample"]

if TYPE_CHECKING:
    from erag.data.sample import sample_dir as sample
    from erag.pipeline.session import Memory
    from erag.pipeline.session import open_memory as open

_LAZY = {
    "Memory": ("erag.pipeline.session", "Memory"),
    "open": ("erag.pipeline.session", "open_memory"),
    "sample": ("erag.data.sample", "sample_dir"),
}


def __getattr__(name: str) -> Any:
    """The public names, imported at first use so that `import erag` stays quick."""
    if name not in _LAZY:
        raise AttributeError(f"module 'erag' has no attribute {name!r}")
    from importlib import import_module

    module, attribute = _LAZY[name]
    return getattr(import_module(module), attribute)
