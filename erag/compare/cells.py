"""One backend or system in one trial, in a process of its own: what it said, how long it took, how much memory."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from copy import deepcopy
from dataclasses import asdict, dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeVar, cast

from erag.bench.memory import peak_mb
from erag.compare.config import ROLE_OF, BackendSpec, CompareConfig, MemoriesTrial
from erag.compare.cosine import Cosine
from erag.compare.sizes import model_mb
from erag.compare.systems import Built, System
from erag.compare.trial import Asked, RoleTrial, Taken
from erag.compare.trials import memories_of, role_trial_of
from erag.core.errors import EragError, ModelError
from erag.core.output import replacing
from erag.core.text import content_hash
from erag.lm.compose import compose
from erag.lm.config import BackendConfig, build_models
from erag.lm.ledger import Ledger
from erag.lm.metered import Metered
from erag.lm.offline import forbid_network
from erag.lm.roles import Embedder, LMBackend, RoleName, Roles
from erag.lm.weights import ModelStore, default_store

RULES = 2  # raised when the same configuration would be measured differently
_KEY = "asked"
Out = TypeVar("Out")


@dataclass(frozen=True)
class Cell:
    """Outputs of a backend or a system on the items of a trial, and what they took.

    `seconds` are those of all items, in the model (of a system: of whole queries), loading (`load_seconds`, with a
    first item) apart; `base_mb` is the process before the model, `peak_mb` its largest resident size, `file_mb` the
    files that have to be there. A system's memories took `build_seconds`, and `peak_mb` is the larger one of building
    and asking. With an `error` there are no outputs.
    """

    trial: str
    backend: str
    digest: str
    outputs: list[Any] = field(default_factory=list, repr=False)
    seconds: float = 0.0
    load_seconds: float = 0.0
    build_seconds: float = 0.0
    base_mb: float = 0.0
    peak_mb: float = 0.0
    file_mb: float | None = None
    tokens_in: int = 0
    tokens_out: int = 0
    cost: float = 0.0
    events: dict[str, int] = field(default_factory=dict)
    error: str = ""


@dataclass(frozen=True)
class Job:
    """What a process is to measure; everything in it can be sent to one. `backend` may name a system."""

    trial: str
    backend: str
    config: CompareConfig
    items: list[Any]
    files: Path  # of the model store

    @property
    def role(self) -> RoleName:
        return ROLE_OF[self.config.trials[self.trial].kind]

    @property
    def spec(self) -> BackendSpec:
        return self.config.backends[self.backend]

    @property
    def whole(self) -> bool:
        """Whether a system is asked."""
        return isinstance(self.config.trials[self.trial], MemoriesTrial)

    def system(self, store: ModelStore) -> System:
        """The system that is asked, over the environments of the trial."""
        trial = memories_of(self.config, self.trial)
        folder = self.config.out / "memories"
        return System(self.config.systems[self.backend], trial.environments, folder, store, trial.given)

    def digest(self, store: ModelStore) -> str:
        """Changes when anything does that determines the outputs or the measurement."""
        trial = self.config.trials[self.trial].model_dump(mode="json", exclude={"backends", "systems"})
        stated = {"rules": RULES, "trial": trial, "items": self.items, "threads": self.config.threads}
        if self.whole:
            stated |= {"system": self.system(store).fingerprint()}
        else:
            backend = self.spec.model_dump(mode="json", exclude_defaults=True)
            stated |= {"backend": backend, "model": built(self.spec, self.role, store).fingerprint(self.role)}
        return content_hash(json.dumps(stated, sort_keys=True, ensure_ascii=False)).hex()


def built(spec: BackendSpec, role: RoleName, store: ModelStore, ledger: Ledger | None = None) -> LMBackend:
    """A backend for one role, nothing loaded yet. Raises ConfigError where it cannot play it."""
    models = build_models(BackendConfig(models={_KEY: spec.model}, roles={}), store, ledger)
    if spec.cosine:
        embedder = compose(models, Roles({"embed": _KEY}))
        models = {_KEY: Cosine(models[_KEY], cast(Embedder, embedder))}
    return compose(models, Roles({role: _KEY}))


def measured(job: Job, folder: Path, store: ModelStore) -> tuple[Cell, bool]:
    """The cell of a job, and whether it was there already: from `folder` where nothing changed, else measured anew."""
    try:
        digest = job.digest(store)
    except EragError as error:
        return Cell(job.trial, job.backend, "", error=error.line()), False
    path = folder / f"{_plain(job.trial)}--{_plain(job.backend)}.json"
    kept = read_cell(path)
    if kept is not None and kept.digest == digest:
        return kept, True
    try:
        cell = _with_memories(job, digest, store) if job.whole else _apart(_measure, job, digest)
    except EragError as error:
        return Cell(job.trial, job.backend, digest, error=error.line()), False
    with replacing(path) as file:
        json.dump(asdict(cell), file, ensure_ascii=False, indent=1)
    return cell, False


def read_cell(path: Path) -> Cell | None:
    """A kept cell; None where there is none that can be read."""
    try:
        raw = json.loads(path.read_text(encoding="utf-8"))
        return Cell(**raw)
    except (OSError, ValueError, TypeError):
        return None


def _with_memories(job: Job, digest: str, store: ModelStore) -> Cell:
    """A system's cell: what is missing of its memories is built first, each in a process of its own."""
    system = job.system(store)
    for environment in system.missing():
        _apart(_build, job, environment.name)
    return _apart(_measure, job, digest, system.built())


def _apart(work: Callable[..., Out], job: Job, *more: Any) -> Out:
    """`work` in a fresh process. Raises EragError with what it raised, ModelError for a process that died."""
    try:
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            return pool.submit(_begun, work, job, *more).result()
    except BrokenProcessPool:
        raise ModelError("its process died: out of memory, or a crash in native code") from None


def _begun(work: Callable[..., Out], job: Job, *more: Any) -> Out:
    if job.config.threads is not None:
        os.environ["OMP_NUM_THREADS"] = str(job.config.threads)  # read by the numeric libraries, not imported yet
    forbid_network()
    try:
        return work(job, *more)
    except EragError as error:
        raise EragError(error.line()) from None  # one that can be sent back, whatever its own kind needs


def _build(job: Job, environment: str) -> None:
    system = job.system(default_store(job.files))
    system.build(system.environments[environment])


def _measure(job: Job, digest: str, memories: Built | None = None) -> Cell:
    store, base = default_store(job.files), peak_mb()
    if memories is not None:
        system = job.system(store)
        taken, models = system.ask(job.items), list(system.config.backend.models.values())
    else:
        taken, models = _asked(job, role_trial_of(job.config, job.trial, store), store), [job.spec.model]
    told = memories or Built()
    return Cell(
        job.trial, job.backend, digest, base_mb=base, peak_mb=max(peak_mb(), told.peak_mb), build_seconds=told.seconds,
        file_mb=model_mb(models, store), **vars(taken),
    )  # fmt: skip


def _asked(job: Job, trial: RoleTrial, store: ModelStore) -> Taken:
    ledger = Ledger()
    backend = Metered(built(job.spec, job.role, store, ledger), ledger)
    asked = Asked(backend, ledger, job.spec.vectors)
    if job.role == "embed":
        backend.embed(["warm up"], "query")
    else:
        trial.ask(asked, job.items[:1])  # the model is loaded: the seconds of the items are theirs alone
    before = deepcopy(ledger)
    outputs = trial.ask(asked, job.items)
    loading, role = before.seconds[job.role], job.role
    return Taken.since(before, ledger, outputs, ledger.seconds[role] - loading, loading)


def _plain(name: str) -> str:
    """A name as part of a file's name; what is left out is told apart by a hash."""
    kept = "".join(c if c.isalnum() or c in "._-" else "-" for c in name)
    return kept if kept == name else f"{kept}-{content_hash(name).hex()[:6]}"
