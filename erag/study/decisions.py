"""Decisions of a teacher: a query, the cards it chose among, and its choice; from records of any kind."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from erag.core.errors import InputError
from erag.core.text import clean, content_hash, name_words
from erag.lm.roles import SelectTask
from erag.pipeline.records import calls_of

FILES = ("train.jsonl", "test.jsonl")  # of the authors' fine-tuning data
_MAX_LINE = 1 << 20  # characters
_ASKED = re.compile(r"\AQuery: (.*?)\nContext: (.*)\nInstruction: ", re.DOTALL)
_CARD = re.compile(r"^(\d+)\. ", re.MULTILINE)
_FIELD = re.compile(r"^ {3}(ID|Name|Summary): (.*)$", re.MULTILINE)


class ChatDecisions(BaseModel):
    """Chats in which a cloud model chose a location by its name (the authors' fine-tuning data): `paths` of JSONL."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["chats"]
    paths: tuple[Path, ...] = Field(min_length=1)


class RecordedDecisions(BaseModel):
    """The recorded `select` calls of memory files, whoever answered them."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["records"]
    paths: tuple[Path, ...] = Field(min_length=1)


DecisionSource = Annotated[ChatDecisions | RecordedDecisions, Field(discriminator="kind")]


@dataclass(frozen=True, slots=True)
class Decision:
    """A choice among cards, by what the teacher chose first."""

    query: str
    cards: tuple[str, ...]
    chosen: int

    @property
    def task(self) -> SelectTask:
        return SelectTask(self.query, self.cards)

    def agrees(self, pick: int) -> bool:
        """Whether a pick has the text of the chosen card: copies of one text cannot be told apart."""
        return self.cards[pick] == self.cards[self.chosen]

    @property
    def group(self) -> str:
        """The set of cards, whatever their order."""
        return "\n".join(sorted(self.cards))


class Part(BaseModel):
    """One part of `folds` of the decisions; `by` says what is kept whole: a question, or a set of cards.

    Which part a decision is in follows from its text alone. A student is judged on a part without a leak where it was
    taught without it.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    number: int = Field(0, ge=0)
    folds: int = Field(5, ge=1, le=20)
    by: Literal["question", "cards"] = "question"

    @model_validator(mode="after")
    def _there(self) -> Self:
        if self.number >= self.folds:
            raise ValueError(f"part {self.number} of {self.folds} folds: they count from 0")
        return self

    def holds(self, decision: Decision) -> bool:
        """Whether a decision is in this part."""
        kept = decision.query if self.by == "question" else decision.group
        digest = content_hash(" ".join(kept.casefold().split()))
        return int.from_bytes(digest[:8], "little") % self.folds == self.number


@dataclass(frozen=True)
class Read:
    """Distinct decisions in the order they first appear; `notes` count what was read and what was left out."""

    decisions: tuple[Decision, ...]
    notes: tuple[str, ...]


def chats_of(folder: Path) -> ChatDecisions | None:
    """The authors' fine-tuning data in a folder; None where there is none."""
    paths = tuple(folder / name for name in FILES if (folder / name).is_file())
    return ChatDecisions(kind="chats", paths=paths) if paths else None


def read_decisions(sources: Sequence[DecisionSource]) -> list[Decision]:
    """The distinct decisions with a choice. Raises InputError for files that cannot be read or hold none."""
    found = [decision for decision in read_all(sources).decisions if len(decision.cards) > 1]
    if not found:
        raise InputError(
            "no decision among two cards or more", where=", ".join(str(p) for s in sources for p in s.paths)
        )
    return found


def read_all(sources: Sequence[DecisionSource]) -> Read:
    """The distinct decisions, those among a single card too.

    Of a decision made more than once the most frequent choice counts, of equally frequent ones the first. Those whose
    choice is none of the cards are left out. Raises InputError for files that cannot be read.
    """
    made: dict[tuple[str, tuple[str, ...]], Counter[int]] = {}
    counts: Counter[str] = Counter()
    for found in _all(sources):
        counts["decisions read"] += 1
        if found is None:
            counts["left out: the choice is none of the cards"] += 1
        else:
            made.setdefault((found.query, found.cards), Counter())[found.chosen] += 1
    counts["decided differently another time"] = sum(len(votes) > 1 for votes in made.values())
    kept = tuple(Decision(query, cards, votes.most_common(1)[0][0]) for (query, cards), votes in made.items())
    counts["distinct"], counts["with a choice"] = len(kept), sum(len(d.cards) > 1 for d in kept)
    return Read(kept, tuple(f"{name}: {n:,}" for name, n in counts.items()))


def _all(sources: Sequence[DecisionSource]) -> Iterator[Decision | None]:
    for source in sources:
        read = _chats if isinstance(source, ChatDecisions) else _records
        for path in source.paths:
            yield from read(path)


def _chats(path: Path) -> Iterator[Decision | None]:
    """The decision of each line, None where the answer is none of the cards. Raises InputError for other lines."""
    for where, line in _lines(path):
        try:
            asked, answer = (str(message["content"]) for message in json.loads(line)["messages"])
        except (ValueError, KeyError, TypeError, RecursionError):
            allowed = '{"messages": [user, assistant]}'
            raise InputError("no chat of a question and an answer", where=where, allowed=allowed) from None
        match = _ASKED.match(asked)
        if match is None:
            raise InputError(f"begins {asked[:40]!r}", where=where, allowed="Query: … Context: … Instruction: …")
        options = [_option(text) for text in _numbered(match[2])]
        if not options:
            raise InputError(
                "no location", where=where, allowed="a list numbered from 1: ID, Name and Summary, or a name"
            )
        yield _chosen(clean(match[1]), options, answer.strip())


def _chosen(query: str, options: Sequence[Mapping[str, str]], answer: str) -> Decision | None:
    """A decision whose answer is the id of a card, or else its name."""
    rows = [row for key in ("ID", "Name") for row, option in enumerate(options) if option[key] == answer]
    return Decision(query, tuple(map(_card, options)), rows[0]) if rows else None


def _numbered(context: str) -> list[str]:
    """The parts of a list numbered from 1; a number out of turn belongs to the text."""
    starts: list[tuple[int, int]] = []
    for match in _CARD.finditer(context):
        if int(match[1]) == len(starts) + 1:
            starts.append(match.span())
    bounds = [(0, 0), *starts, (len(context), len(context))]
    return [context[begin:end] for (_, begin), (end, _) in pairwise(bounds)][1:]


def _option(text: str) -> Mapping[str, str]:
    """An entry of the list: a cluster's id, name and summary, or the name of an object, which is its id too."""
    fields: dict[str, str] = {key: clean(value) for key, value in _FIELD.findall(text)}
    plain = clean(text)
    return {"ID": fields.get("ID", plain), "Name": fields.get("Name", plain), "Summary": fields.get("Summary", "")}


def _card(option: Mapping[str, str]) -> str:
    return ". ".join(filter(None, (name_words(option["Name"]), option["Summary"])))


def _lines(path: Path) -> Iterator[tuple[str, str]]:
    try:
        with path.open(encoding="utf-8") as file:
            for number, line in enumerate(file, 1):
                if len(line) > _MAX_LINE:
                    raise InputError(f"a line of {len(line)} characters", where=f"{path}:{number}")
                if line.strip():
                    yield f"{path}:{number}", line
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {error}", where=str(path)) from error


def _records(path: Path) -> Iterator[Decision]:
    for record in calls_of(path, "select"):
        yield _recorded(json.loads(record.request), json.loads(record.result), str(path))


def _recorded(task: Mapping[str, Any], chosen: Iterable[int], where: str) -> Decision:
    query, cards, picks = str(task["query"]), tuple(map(str, task["cards"])), list(chosen)
    if not picks or not 0 <= picks[0] < len(cards):
        raise InputError(f"a selection {picks} of {len(cards)} cards", where=where)
    return Decision(query, cards, picks[0])
