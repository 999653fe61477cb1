"""Weights in another form than the file's, made once by llama.cpp in a child process and kept in the cache folder.

llama.cpp multiplies some formats (Q4_1, Q5_1) one row at a time however many sequences wait, and others many rows at
once: the default model is 3–4 times as fast in bfloat16 or Q8_0, at the price of memory.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from erag.core.errors import ModelError
from erag.lm.llamacpp.config import FILE_TYPES, Form, FormWish
from erag.lm.llamacpp.library import library_version
from erag.lm.llamacpp.probe import Candidate, Probe
from erag.lm.llamacpp.process import ask, child_command
from erag.lm.probe import Cpu
from erag.lm.weights.digest import Stamp, replace_durably, sha256_of, write_durably

_ONE_ROW_AT_A_TIME = frozenset({3, 9})  # Q4_1, Q5_1
_LARGEST = 400 << 20  # bytes of a file that `auto` converts: the result is up to 3 times as large, in memory too


def choose_form(wish: FormWish, file_type: int, size: int, chip: Cpu) -> Form:
    """`wish`; for `auto` `shipped` where the format is fast or the file large, else bf16 if the CPU has it, or q8_0."""
    if wish != "auto":
        return wish
    if file_type not in _ONE_ROW_AT_A_TIME or size > _LARGEST:
        return "shipped"
    return "bf16" if "avx512_bf16" in chip.flags else "q8_0"


class _Record(BaseModel):
    """What a converted file was made of, and how it looked when it was hashed."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    source: str
    library: str
    sha256: str
    stamp: Stamp


@dataclass(frozen=True)
class Forms:
    """Converted files beside the probe's memory; the probe's child does the work."""

    probe: Probe

    def get(self, source: Candidate, form: Form) -> Candidate:
        """`source` in another form, converted if it is not there yet. Raises ModelError when that fails."""
        if form == "shipped":
            return source
        path = self.probe.folder / "gguf" / f"{source.sha256[:16]}-{form}.gguf"
        record = _read(path)
        if record is None or (record.source, record.library) != (source.sha256, library_version()):
            record = self._make(source, form, path)
        return Candidate(source.model, path, record.sha256)

    def _make(self, source: Candidate, form: Form, path: Path) -> _Record:
        partial = path.with_suffix(f".{os.getpid()}.partial")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._convert(source, form, partial)
            digest = sha256_of(partial)
            replace_durably(partial, path)
            library = library_version() or ""
            record = _Record(source=source.sha256, library=library, sha256=digest, stamp=Stamp.of(path))
            write_durably(_record_path(path), record.model_dump_json())
        except OSError as error:
            raise _failed(source, form, f"{error.strerror} ({error.filename or path})") from error
        finally:
            partial.unlink(missing_ok=True)
        return record

    def _convert(self, source: Candidate, form: Form, target: Path) -> None:
        request = {
            "do": "convert",
            "path": str(source.path),
            "target": str(target),
            "file_type": FILE_TYPES[form],
            "threads": self.probe.threads,
        }
        outcome = ask(self.probe.command or child_command(), request, self.probe.seconds)
        if outcome.state != "ok":
            raise _failed(source, form, f"the child process {outcome.detail}")


def _read(path: Path) -> _Record | None:
    """The record of a converted file that has not changed since; else None, and it is made again."""
    try:
        record = _Record.model_validate_json(_record_path(path).read_bytes())
        return record if Stamp.of(path) == record.stamp else None
    except (OSError, ValidationError):
        return None


def _record_path(path: Path) -> Path:
    return path.with_suffix(".json")


def _failed(source: Candidate, form: Form, why: str) -> ModelError:
    repair = "free disk space or set XDG_CACHE_HOME, or weights: shipped in the configuration"
    return ModelError(f"no {form} weights of {source.model}: {why}", where=str(source.path), repair=repair)
