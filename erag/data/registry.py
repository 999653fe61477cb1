"""The closed list of readers, and the one function that reads a source."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from erag.core.errors import InputError
from erag.data.coex import CoexReader
from erag.data.files import check_source, place
from erag.data.gmlreader import GmlReader
from erag.data.jsonl import JsonlReader
from erag.data.reading import Reader, Reading

AUTO = "auto"
# In the order of sniffing.
READERS: Mapping[str, Reader] = {r.kind: r for r in (JsonlReader(), CoexReader(), GmlReader())}


def read(path: Path, reader: str = AUTO) -> Reading:
    """Read a source with the reader named, or with the first that recognises it.

    Raises InputError, and nothing else, for what cannot be read; what is damaged in part is read in part, with issues.
    """
    if reader != AUTO and reader not in READERS:
        raise InputError(f"there is no reader {reader!r}", where="--reader", allowed=", ".join((AUTO, *READERS)))
    check_source(path)
    try:
        found = READERS.get(reader) or next((r for r in READERS.values() if r.sniff(path)), None)
        if found:
            return found.read(path)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=place(path)) from None
    known = "a .gml file, a folder with observations.jsonl and meta.json, a .jsonl file beside meta.json, a COEX folder"
    repair = f"--reader {'|'.join(READERS)}"
    raise InputError("no reader recognises it", where=place(path), allowed=known, repair=repair)
