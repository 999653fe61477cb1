"""Decisions of a teacher: a query, the cards it chose among, and its choice; from records of any kind."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from erag.core.errors import InputError
from erag.core.text import clean, name_words

_MAX_LINE = 1 << 20
_ASKED = re.compile(
    r"Query: (?P<query>.*?)\nContext: Available Locations for Selection:\n\n(?P<cards>.*)\nInstruction: ", re.DOTALL
)
_ENTRY = re.compile(r"\n(?=\d+\. )")
_CLUSTER = re.compile(
    r"\d+\. Location Details:\n\s*ID: (?P<id>.*?)\n\s*Name: (?P<name>.*?)\n\s*Summary: (?P<summary>.*?)\n\s*---\s*",
    re.DOTALL,
)
_LEAF = re.compile(r"\d+\. (?P<id>\S+)\s*")


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

    def agrees(self, pick: int) -> bool:
        """Whether a pick has the text of the chosen card: copies of one text cannot be told apart."""
        return self.cards[pick] == self.cards[self.chosen]

    @property
    def group(self) -> str:
        """The set of cards, whatever their order."""
        return "\n".join(sorted(self.cards))


def read_decisions(sources: Sequence[DecisionSource]) -> list[Decision]:
    """Distinct decisions with a choice, in the order they first appear.

    Of a decision made more than once the most frequent choice counts, of equally frequent ones the first. Those whose
    choice is none of the cards are left out. Raises InputError for files that cannot be read or hold no decision.
    """
    made: dict[tuple[str, tuple[str, ...]], Counter[int]] = {}
    for found in _all(sources):
        if len(found.cards) > 1:
            made.setdefault((found.query, found.cards), Counter())[found.chosen] += 1
    if not made:
        raise InputError(
            "no decision among two cards or more", where=", ".join(str(p) for s in sources for p in s.paths)
        )
    return [Decision(query, cards, votes.most_common(1)[0][0]) for (query, cards), votes in made.items()]


def _all(sources: Sequence[DecisionSource]) -> Iterator[Decision]:
    for source in sources:
        read = _chats if isinstance(source, ChatDecisions) else _records
        for path in source.paths:
            yield from read(path)


def _chats(path: Path) -> Iterator[Decision]:
    for where, line in _lines(path):
        try:
            messages = json.loads(line)["messages"]
            asked, answer = str(messages[0]["content"]), str(messages[1]["content"])
        except (ValueError, KeyError, IndexError, TypeError) as error:
            raise InputError(f"no chat: {error}", where=where, allowed='{"messages": [user, assistant]}') from error
        found = _ASKED.match(asked)
        if found is None:
            raise InputError("not a choice among locations", where=where, allowed="Query, Context and Instruction")
        cards = dict(_card(entry, where) for entry in _ENTRY.split(found["cards"]))
        if answer.strip() in cards:
            yield Decision(clean(found["query"]), tuple(cards.values()), list(cards).index(answer.strip()))


def _card(entry: str, where: str) -> tuple[str, str]:
    """The id of an entry of the list, and its text: a cluster's name and summary, or the name of an object."""
    if cluster := _CLUSTER.fullmatch(entry.strip("\n") + "\n"):
        return cluster["id"], f"{name_words(cluster['name'])}. {clean(cluster['summary'])}"
    if leaf := _LEAF.fullmatch(entry.strip("\n")):
        return leaf["id"], name_words(leaf["id"])
    raise InputError(f"no location: {entry[:60]!r}", where=where, allowed="ID, Name and Summary, or a name")


def _lines(path: Path) -> Iterator[tuple[str, str]]:
    try:
        with path.open(encoding="utf-8") as file:
            for number, line in enumerate(file, 1):
                if len(line) > _MAX_LINE:
                    raise InputError(f"a line of {len(line)} characters", where=f"{path}:{number}")
                yield f"{path}:{number}", line
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {error}", where=str(path)) from error


def _records(path: Path) -> Iterator[Decision]:
    from erag.memory.database import Database

    database = Database(path, "read")
    try:
        rows = database.rows("SELECT request, result FROM call_results WHERE role = 'select' ORDER BY key")
    finally:
        database.close()
    for request, result in rows:
        yield _recorded(json.loads(request), json.loads(result), str(path))


def _recorded(task: Mapping[str, Any], chosen: Iterable[int], where: str) -> Decision:
    query, cards, picks = str(task["query"]), tuple(map(str, task["cards"])), list(chosen)
    if not picks or not 0 <= picks[0] < len(cards):
        raise InputError(f"a selection {picks} of {len(cards)} cards", where=where)
    return Decision(query, cards, picks[0])
