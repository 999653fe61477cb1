"""Call records out of a memory file and into another one."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from erag.core.errors import InputError
from erag.lm.callfile import Record, read_calls, write_calls
from erag.lm.roles import ROLES, RoleName
from erag.memory.file import MemoryFile


@dataclass(frozen=True, slots=True)
class Moved:
    """Records by role, and how many of them were new to where they went."""

    roles: Mapping[str, int]
    new: int

    def line(self) -> str:
        """What was moved, in one line."""
        return ", ".join(f"{n:,} {role}" for role, n in sorted(self.roles.items())) or "no records"


def calls_of(memory: Path, role: RoleName) -> list[Record]:
    """The recorded calls of a role, in the order of their keys."""
    with MemoryFile.reading(memory) as file:
        return sorted(file.calls.records({role}), key=lambda record: record.key)


def export_records(memory: Path, out: Path, roles: Collection[RoleName] = ROLES) -> Moved:
    """Write the call records of a memory. Raises InputError where it has none of these roles."""
    with MemoryFile.reading(memory) as file:
        records = list(file.calls.records(roles, _identities(file)))
        if not records:
            allowed = "a memory whose models were called: erag build"
            raise InputError(f"holds no records of {', '.join(sorted(roles))}", where=str(memory), allowed=allowed)
        write_calls(out, records, memory)
    return Moved(Counter(r.source.role for r in records), len(records))


def import_records(memory: Path, calls: Path) -> Moved:
    """Take the records of a file into a memory, which is made when absent; what it has already stays as it is."""
    read = read_calls(calls)
    with MemoryFile.writing(memory, "erag records import", create=True) as file:
        new = file.calls.adopt(read.records)
    return Moved(Counter(r.source.role for r in read.records), new)


def _identities(file: MemoryFile) -> dict[str, str]:
    """The embedder's identity for the fingerprints that contain it."""
    generation = file.generations.load()
    if generation is None:
        return {}
    made = {str(row[0]) for row in file.db.rows("SELECT DISTINCT fingerprint FROM vectors")}
    return {fingerprint: generation.embedder for fingerprint in made if _contains(fingerprint, generation.embedder)}


def _contains(fingerprint: str, identity: str) -> bool:
    """Whether everything an identity states is stated by a fingerprint."""
    try:
        whole, part = json.loads(fingerprint), json.loads(identity)
    except ValueError:
        return fingerprint == identity
    return isinstance(whole, dict) and isinstance(part, dict) and part.items() <= whole.items()
