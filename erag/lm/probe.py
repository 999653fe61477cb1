"""What this CPU can do, and the precision that follows; read from its flags, so that every run decides alike."""

from __future__ import annotations

import platform
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

Dtype = Literal["float32", "bfloat16"]
DtypeWish = Literal["auto", "float32", "bfloat16"]
_BF16_FLAGS = frozenset({"amx_bf16", "avx512_bf16"})


@dataclass(frozen=True, slots=True)
class Cpu:
    """The CPU: its name, architecture and (on Linux, x86) feature flags."""

    name: str
    architecture: str
    flags: frozenset[str]

    @property
    def fast_bf16(self) -> bool:
        """Whether bf16 matrix products run in hardware; without it they are slower than float32."""
        return bool(self.flags & _BF16_FLAGS)


@lru_cache(maxsize=1)
def cpu(info: Path = Path("/proc/cpuinfo")) -> Cpu:
    """The CPU of this machine; flags are empty where the system does not tell them."""
    fields: dict[str, str] = {}
    if info.is_file():
        for line in info.read_text(errors="replace").splitlines():
            key, _, value = line.partition(":")
            fields.setdefault(key.strip(), value.strip())
    flags = frozenset(fields.get("flags", "").split())
    return Cpu(fields.get("model name", platform.processor() or "unknown"), platform.machine(), flags)


def choose_dtype(wish: DtypeWish) -> Dtype:
    """`wish`, or for `auto` bf16 where the CPU multiplies it in hardware, else float32."""
    if wish == "auto":
        return "bfloat16" if cpu().fast_bf16 else "float32"
    return wish
