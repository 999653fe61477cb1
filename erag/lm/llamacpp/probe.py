"""Which kernels a model survives on this CPU: tried in a child process, chosen, remembered, explained.

llama.cpp's default build faults at the first prompt on CPUs with AMX inside virtual machines. The cure is to keep it
from rearranging the weights (`use_extra_bufts`), which is slower elsewhere: so both are tried where nobody is hurt.
Files that are truncated or hostile end here as well. The user's process opens no file that the child has not survived.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from erag.core.errors import ModelError
from erag.core.text import content_hash
from erag.lm.ledger import Ledger
from erag.lm.llamacpp.config import Kernels, KernelWish
from erag.lm.llamacpp.library import PACKAGE, library_stamp, library_version
from erag.lm.llamacpp.process import ask, child_command
from erag.lm.probe import Cpu, cpu
from erag.lm.weights.digest import write_durably

_ORDER: dict[KernelWish, tuple[Kernels, ...]] = {"auto": ("fast", "plain"), "fast": ("fast",), "plain": ("plain",)}
_KEPT = 64  # choices remembered


class Choice(BaseModel):
    """What the child survived, and why it is not `fast` where it is not. `key` names CPU, library and weights."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    key: str
    cpu: str
    model: str
    kernels: Kernels
    reason: str
    description: str
    file_type: int


class _Remembered(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    choices: tuple[Choice, ...] = ()


@dataclass(frozen=True, slots=True)
class Candidate:
    """A model file: the model's id, where it is, and the sha256 (hex) of what is there.

    `projector` is the file that makes tokens of images, for a model that has one.
    """

    model: str
    path: Path
    sha256: str
    projector: Path | None = None


@dataclass(frozen=True)
class Probe:
    """How models are tried: where choices are remembered, the time and threads of a child, and its command in tests."""

    folder: Path
    seconds: float = 300
    threads: int = 1
    command: tuple[str, ...] = ()
    cpu: Cpu | None = None
    ledger: Ledger = field(default_factory=Ledger)

    @property
    def file(self) -> Path:
        """The file of remembered choices."""
        return self.folder / "probes.json"

    def survive(self, candidate: Candidate, wish: KernelWish) -> Choice:
        """The kernels to use, from memory or from children that try them. Raises ModelError when none is survived."""
        chip = self.cpu or cpu()
        key = _key(chip, candidate, wish)
        known = next((choice for choice in remembered(self.file) if choice.key == key), None)
        if known is not None:
            return known
        failures: list[str] = []
        for kernels in _ORDER[wish]:
            request = {"do": "try", "path": str(candidate.path), "kernels": kernels, "threads": self.threads}
            if candidate.projector is not None:
                request["projector"] = str(candidate.projector)
            outcome = ask(self.command or child_command(), request, self.seconds)
            if outcome.state != "ok":
                failures.append(_failure(kernels, outcome.detail, failures))
                continue
            choice = Choice(
                key=key,
                cpu=chip.name,
                model=candidate.model,
                kernels=kernels,
                reason="; ".join(failures),
                description=str(outcome.answer.get("description", "")),
                file_type=int(outcome.answer.get("file_type", -1)),
            )
            self._remember(choice)
            return choice
        raise _unusable(candidate, failures)

    def _remember(self, choice: Choice) -> None:
        others = [c for c in remembered(self.file) if c.key != choice.key]
        record = _Remembered(choices=(*others[1 - _KEPT :], choice))
        try:
            write_durably(self.file, record.model_dump_json(indent=1))
        except OSError:  # it only costs trying again
            self.ledger.events[f"trials of a model that cannot be remembered in {self.folder}"] += 1


def remembered(file: Path) -> tuple[Choice, ...]:
    """All remembered choices; none where the file is absent or cannot be read, then models are tried again."""
    try:
        return _Remembered.model_validate_json(file.read_bytes()).choices
    except (OSError, ValidationError):
        return ()


def cache_folder() -> Path:
    """The user's cache folder for this backend."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "erag" / "llamacpp"


def explain(folder: Path | None = None, chip: Cpu | None = None) -> list[str]:
    """What `erag doctor` says: the library, whether this CPU is one that can crash, what was chosen for each model."""
    if library_version() is None:
        return [f"{PACKAGE} is not installed (pip install 'erag[llamacpp]')"]
    chip = chip or cpu()
    amx = any(flag.startswith("amx") for flag in chip.flags)
    risk = "this CPU has AMX, on which llama.cpp can crash in virtual machines" if amx else "this CPU has no AMX"
    file = (folder or cache_folder()) / "probes.json"
    here = [choice for choice in remembered(file) if choice.cpu == chip.name]
    return [
        f"{PACKAGE} {library_version()}; {risk}; every model is tried in a child process first",
        *(_line(choice) for choice in here),
    ]


def _line(choice: Choice) -> str:
    why = f" because the child process with {choice.reason}" if choice.reason else ""
    return f"{choice.model} ({choice.description}): {choice.kernels} kernels{why}"


def _key(chip: Cpu, candidate: Candidate, wish: KernelWish) -> str:
    flags = " ".join(sorted(chip.flags))
    return content_hash(chip.name, chip.architecture, flags, library_stamp(), candidate.sha256, wish).hex()


def _failure(kernels: Kernels, detail: str, before: Sequence[str]) -> str:
    text = f"{kernels} kernels {detail}"
    return text if not before or detail not in before[-1] else f"{kernels} kernels likewise"


def _unusable(candidate: Candidate, failures: Sequence[str]) -> ModelError:
    what = f"cannot be used; the child process with {'; '.join(failures)}"
    repair = f"erag models verify {candidate.model}, then rm and pull it anew"
    return ModelError(what, where=str(candidate.path), allowed="a whole GGUF language model", repair=repair)
