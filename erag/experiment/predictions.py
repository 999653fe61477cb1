"""What systems answered, a line an answer: appended and synced one by one, so that nothing is asked twice."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from erag.core.errors import InputError
from erag.core.output import replacing

Score = Annotated[float, Field(ge=0, le=1)]
Metres = Annotated[float, Field(ge=0, allow_inf_nan=False)]
QuestionKey = tuple[str, str, str]  # data set, environment, id
Key = tuple[str, str, str, str, str]  # system, data set, environment, id, mode
R = TypeVar("R", bound=BaseModel)
# What of a prediction is the system's answer, apart from its places and from who asked what where.
ANSWER = frozenset(
    {"kind", "text", "reason", "refused", "waypoint", "route", "route_m", "seconds", "visited", "calls", "tokens_in",
     "tokens_out", "notes", "error"}
)  # fmt: skip


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Place(_Record):
    """One place of an answer: the node, its scores as the system gave them, and what the map says of it.

    `metres` is the way from the question's L, whether or not the system was told L; `on_edges` whether it runs along
    edges; `reading` that of the sensor the question wishes for.
    """

    node: str
    score: float | None = None
    semantic: float | None = None
    spatial: float | None = None
    sensor: float | None = None
    metres: Metres | None = None
    on_edges: bool | None = None
    reading: float | None = None


class Prediction(_Record):
    """The answer of a system to a question in a mode. `refused`: it said that the memory holds nothing of the kind.

    `hits` are best first, also where the answer was refused; `waypoint` and `route_m` are those of the answer.
    `first` marks the first mode a question was asked in: later ones may find models and texts warm. `fingerprint` is
    of all that determines the answer: configuration, memory, models.
    """

    system: str
    data: str
    environment: str
    id: str
    mode: str
    hits: tuple[Place, ...] = ()
    kind: str = "find"
    text: str = ""
    reason: str = ""
    refused: bool = False
    waypoint: str | None = None
    route: str | None = None
    route_m: Metres | None = None
    seconds: Metres = 0.0
    visited: Annotated[int, Field(ge=0)] = 0
    calls: dict[str, int] = {}
    tokens_in: Annotated[int, Field(ge=0)] = 0
    tokens_out: Annotated[int, Field(ge=0)] = 0
    first: bool = True
    notes: tuple[str, ...] = ()
    error: str | None = None
    fingerprint: str = ""

    @property
    def key(self) -> Key:
        return (self.system, self.data, self.environment, self.id, self.mode)

    @property
    def question(self) -> QuestionKey:
        return (self.data, self.environment, self.id)

    @property
    def answers(self) -> tuple[Place, ...]:
        """What counts as answered: the hits, none where the system refused."""
        return () if self.refused or self.error is not None else self.hits


def line_of(record: BaseModel) -> str:
    """A record as one line of JSON, without what has its default."""
    return json.dumps(_rounded(record.model_dump(mode="json", exclude_defaults=True)), ensure_ascii=False)


def _rounded(value: Any) -> Any:
    """Numbers to seven digits: enough for any table, and short in the file."""
    if isinstance(value, float):
        return float(f"{value:.7g}")
    if isinstance(value, Mapping):
        return {k: _rounded(v) for k, v in value.items()}
    return [_rounded(v) for v in value] if isinstance(value, list) else value


class Appender:
    """A file to which lines are appended, each on disk when `add` returns."""

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("a", encoding="utf-8")

    def add(self, record: BaseModel) -> None:
        self._file.write(line_of(record) + "\n")
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        self._file.close()

    def __enter__(self) -> Appender:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def read_predictions(path: Path) -> list[Prediction]:
    """The predictions of a file, none where there is no file; see `read_records`."""
    found = read_records(path, Prediction)
    seen = set[Key]()
    for prediction in found:
        if prediction.key in seen:
            what = f"{' / '.join(prediction.key)} is there twice"
            raise InputError(what, where=str(path), allowed="one line an answer")
        seen.add(prediction.key)
    return found


def read_records(path: Path, model: type[R]) -> list[R]:
    """The records of a file of JSON lines. A last line without its end was cut by a kill and is left out.

    Raises InputError with the line for anything else that is no such record.
    """
    if not path.exists():
        return []
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {error}", where=str(path), allowed="UTF-8 text") from error
    whole = text[: text.rfind("\n") + 1]
    return [_record(line, model, f"{path}: line {i}") for i, line in enumerate(whole.split("\n"), 1) if line.strip()]


def _record(line: str, model: type[R], where: str) -> R:
    try:
        return model.model_validate_json(line)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        at = ".".join(str(part) for part in first["loc"])
        raise InputError(f"{at or 'line'}: {first['msg']}", where=where, allowed="a line this program wrote") from error


def write_records(path: Path, records: Iterable[BaseModel]) -> None:
    """Write a file of records anew, complete or not at all."""
    with replacing(path) as file:
        file.writelines(f"{line_of(record)}\n" for record in records)
