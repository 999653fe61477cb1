"""How many processors this process may use."""

from __future__ import annotations

import os


def cores() -> int:
    """The processors this process may run on (a container or `taskset` may allow fewer than there are), at least 1."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
