"""Call records as a file: gzipped JSON lines that another memory, or the `replay` backend, can read."""

from __future__ import annotations

import base64
import gzip
import json
import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from erag.core.errors import InputError
from erag.core.output import replacing_bytes
from erag.lm.journal import Key, call_keys
from erag.lm.records import CODECS
from erag.lm.roles import ROLES, RoleName

Halves = npt.NDArray[np.float16]
FORMAT, VERSION = "erag-calls", 1
MAX_LINE = 8 << 20  # bytes of one record
MAX_BYTES = 16 << 30  # of a whole file, unpacked
MAX_WIDTH = 65_536  # of a vector
_MOST_K = 64  # cards a recorded selection may have been asked for beyond those there were
_KEY_BYTES = 16
_DAMAGED = (OSError, EOFError, zlib.error, UnicodeDecodeError)


@dataclass(frozen=True, slots=True)
class Source:
    """What made a record: a role under a fingerprint; `identity` says with which vectors its own can be compared."""

    role: RoleName
    fingerprint: str
    identity: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """One call: a request with its result as JSON, or (for `embed`) a vector (d,) float16, whose text is not kept."""

    source: Source
    key: Key
    request: str = ""
    result: str = ""
    vector: Halves | None = None


@dataclass(frozen=True)
class CallFile:
    """Records in the order of the file, by source and key."""

    sources: tuple[Source, ...]
    records: tuple[Record, ...] = field(repr=False)


def write_calls(path: Path, records: Iterable[Record], *inputs: Path) -> int:
    """Write records, complete or not at all; how many. The same records are the same bytes."""
    ordered = sorted(records, key=lambda r: (r.source.role, r.source.fingerprint, r.key))
    sources = list(dict.fromkeys(r.source for r in ordered))
    number = {source: i for i, source in enumerate(sources)}
    head = {
        "format": FORMAT, "version": VERSION, "records": len(ordered),
        "sources": [{"role": s.role, "fingerprint": s.fingerprint, "identity": s.identity} for s in sources],
    }  # fmt: skip
    with replacing_bytes(path, *inputs) as file, gzip.GzipFile("", "wb", fileobj=file, mtime=0) as packed:
        packed.write(_line(head))
        for record in ordered:
            packed.write(_line(_written(record, number[record.source])))
    return len(ordered)


def read_calls(path: Path) -> CallFile:
    """The records of a file, every one checked: its key, its result, its size.

    Raises InputError, naming the line, for a file that is no call file, is damaged or cut short, or states what is not
    true of itself.
    """
    lines = _lines(path)
    head = _parsed(next(lines, b""), f"{path}:1")
    if head.get("format") != FORMAT or head.get("version") != VERSION:
        what = f"format {head.get('format')!r}, version {head.get('version')!r}"
        raise InputError(what, where=str(path), allowed=f"{FORMAT}, {VERSION}", repair="erag records export M.erag")
    sources = _sources(head, f"{path}:1")
    records = tuple(_read(_parsed(line, where), sources, where) for where, line in _numbered(path, lines))
    if len(records) != head.get("records"):
        what = f"{len(records)} of {head.get('records')!r} records"
        raise InputError(f"is cut short: {what}", where=str(path), repair="export it again")
    return CallFile(sources, records)


def _line(value: Mapping[str, Any]) -> bytes:
    return json.dumps(value, ensure_ascii=False, separators=(",", ":")).encode("utf-8", "surrogatepass") + b"\n"


def _written(record: Record, source: int) -> dict[str, Any]:
    known: dict[str, Any] = {"of": source, "key": record.key.hex()}
    if record.vector is None:
        return {**known, "request": record.request, "result": record.result}
    raw = np.ascontiguousarray(record.vector, np.float16).tobytes()
    return {**known, "vector": base64.b64encode(raw).decode()}


def _lines(path: Path) -> Iterator[bytes]:
    try:
        with gzip.open(path, "rb") as file:
            total = 0
            while line := file.readline(MAX_LINE + 1):
                total += len(line)
                if len(line) > MAX_LINE or total > MAX_BYTES:
                    raise InputError("is too long", where=str(path), allowed=f"lines of {MAX_LINE:,} bytes")
                yield line
    except _DAMAGED as error:
        raise InputError(f"cannot be read: {error}", where=str(path), allowed="a file of erag records export") from None


def _numbered(path: Path, lines: Iterator[bytes]) -> Iterator[tuple[str, bytes]]:
    return ((f"{path}:{number}", line) for number, line in enumerate(lines, 2))


def _parsed(line: bytes, where: str) -> dict[str, Any]:
    try:
        found = json.loads(line.decode("utf-8", "surrogatepass"))
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise InputError("no JSON object", where=where, allowed="a file of erag records export")
    return found


def _sources(head: Mapping[str, Any], where: str) -> tuple[Source, ...]:
    made = []
    stated = head.get("sources")
    for item in stated if isinstance(stated, list) else ():
        texts = [item.get(key) for key in ("role", "fingerprint", "identity")] if isinstance(item, dict) else []
        if len(texts) != 3 or not all(isinstance(text, str) for text in texts) or texts[0] not in ROLES:
            raise InputError("a source without role, fingerprint and identity", where=where, allowed=", ".join(ROLES))
        made.append(Source(cast(RoleName, texts[0]), str(texts[1]), str(texts[2])))
    return tuple(made)


def _read(raw: Mapping[str, Any], sources: tuple[Source, ...], where: str) -> Record:
    try:
        index = raw["of"]
        if type(index) is not int or index < 0:
            raise ValueError("a source that is no number")
        source, key = sources[index], bytes.fromhex(raw["key"])
        if len(key) != _KEY_BYTES:
            raise ValueError(f"a key of {len(key)} bytes")
        if source.role == "embed":
            return Record(source, key, vector=_vector(raw["vector"]))
        request, result = raw["request"], raw["result"]
        value = CODECS[source.role].decode(result)
        if not _belongs(source, key, request, value):
            raise ValueError("a key that is not that of its request")
    except (ValueError, KeyError, IndexError, TypeError, AttributeError) as error:
        raise InputError(f"no record: {error}", where=where, allowed="a file of erag records export") from None
    return Record(source, key, request, result)


def _vector(text: str) -> Halves:
    """(d,) float16, finite and not zero."""
    row = np.frombuffer(base64.b64decode(text, validate=True), np.float16)
    if not (0 < len(row) <= MAX_WIDTH and np.isfinite(row).all() and row.any()):
        raise ValueError("a vector that is empty, zero or not finite")
    return row


def _belongs(source: Source, key: Key, request: str, result: Any) -> bool:
    """Whether a key is that of a request; how many cards a selection was asked for is only known from its key."""
    if source.role != "select":
        return call_keys(source.role, source.fingerprint, [request])[0] == key
    least = len(result)
    return any(
        call_keys("select", source.fingerprint, [request], f"k={k}")[0] == key for k in range(least, least + _MOST_K)
    )
