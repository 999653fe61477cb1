"""Environments to evaluate in: what a data set is, whatever its files look like."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from erag.core.errors import InputError
from erag.data.contract import QueryLine, read_queries
from erag.evaluate.text import Golden
from erag.evaluate.truth import Asked, Truths

KINDS = ("explicit", "implicit", "global", "counting", "change", "unanswerable", "mixed")


@dataclass(frozen=True, slots=True)
class Question:
    """A query of a data set with its labels.

    `line` is what is asked, with all its conditions. `relevant` are the ids of the nodes that answer it, empty where
    nothing does and None where nobody said; `golden` is the golden answer of a global question; `targets` the object
    classes that satisfy it. `kind` is one of `KINDS`, or another word of the data set.
    """

    line: QueryLine
    kind: str
    relevant: frozenset[str] | None = None
    golden: Golden | None = None
    targets: frozenset[str] | None = None

    @property
    def id(self) -> str:
        return self.line.id

    @property
    def text(self) -> str:
        """What is asked in words; empty for a query that only says where."""
        return str((self.line.raw or {}).get("query") or "")

    @property
    def asked(self) -> Asked:
        """The question as judges see it."""
        return Asked(self.id, self.text, self.targets)


@dataclass(frozen=True)
class Environment:
    """A place with questions about it.

    `source` is what `erag ingest` reads, with `reader`; `truths` what judges see; `radius_m` is R where the data set
    states it. `split` says what it may be used for (`train`, `dev`, `test`).
    """

    name: str
    source: Path
    questions: tuple[Question, ...]
    truths: Truths = field(default_factory=Truths)
    reader: str = "auto"
    radius_m: float | None = None
    split: str = "test"


@dataclass(frozen=True)
class Dataset:
    """Environments under one name. `notes` are what a reader of results should know."""

    name: str
    environments: tuple[Environment, ...]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        names = [e.name for e in self.environments]
        twice = next((n for n in names if names.count(n) > 1), None)
        if not names or twice is not None:
            what = f"the environment {twice!r} is there twice" if names else "no environment"
            raise InputError(what, where=f"data set {self.name}", allowed="one or more, each with a name of its own")

    def of_split(self, split: str) -> Dataset:
        """The environments of one split. Raises InputError when there are none."""
        kept = tuple(e for e in self.environments if e.split == split)
        if not kept:
            known = ", ".join(sorted({e.split for e in self.environments}))
            raise InputError(f"no environment of split {split!r}", where=f"data set {self.name}", allowed=known)
        return replace(self, environments=kept)


Loader = Callable[[Path, Path | None], Dataset]


def questions(path: Path, where: Mapping[str, str] | None = None) -> tuple[Question, ...]:
    """The questions of a `Q.jsonl` with their labels; of those keys only `kind` is ours to interpret.

    Labels are `relevant` (ids), `golden_answer` (text) with `facts` (texts), `targets` (object classes; or one as
    `target`). Raises InputError for a line that is not a JSON object, and for labels of another type.
    """
    return tuple(_question(path, line) for line in read_queries(path, where or {}))


def required(path: Path, what: str) -> Path:
    """`path`, which has to exist. Raises InputError that says what it should be."""
    if not path.exists():
        raise InputError(f"there is no {path.name}", where=str(path.parent), allowed=what)
    return path


def _question(path: Path, line: QueryLine) -> Question:
    where = f"{path}: line {line.number}"
    if line.raw is None:
        raise InputError("not a JSON object", where=where, allowed='{"id": …, "query": …}')
    relevant, targets = _ids(line.raw, "relevant", where), _ids(line.raw, "targets", where)
    if targets is None and isinstance(line.raw.get("target"), str):
        targets = {line.raw["target"]}
    answer, facts = line.raw.get("golden_answer"), _ids(line.raw, "facts", where, ordered=True)
    if answer is not None and (not isinstance(answer, str) or not answer.strip()):
        raise InputError(f"golden_answer is {answer!r}", where=where, allowed="a text")
    golden = Golden(answer, tuple(facts or ())) if answer else None
    return Question(
        line,
        str(line.raw.get("kind", "query")),
        None if relevant is None else frozenset(relevant),
        golden,
        None if targets is None else frozenset(targets),
    )


def _ids(raw: Mapping[str, Any], key: str, where: str, *, ordered: bool = False) -> Iterable[str] | None:
    """A list of texts (numbers are taken as texts), None where the key is absent."""
    value = raw.get(key)
    if value is None:
        return None
    if not isinstance(value, list) or any(isinstance(v, bool) or not isinstance(v, str | int) for v in value):
        raise InputError(f"{key} is {value!r}"[:200], where=where, allowed="a list of texts")
    texts = [str(v) for v in value]
    return texts if ordered else set(texts)
