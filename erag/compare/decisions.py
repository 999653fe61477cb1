"""Choices that a cloud teacher made among cards: the authors' fine-tuning data (`train.jsonl`, `test.jsonl`)."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from erag.core.errors import InputError
from erag.core.text import clean, content_hash, name_words
from erag.lm.roles import SelectTask

FILES = ("train.jsonl", "test.jsonl")
MAX_LINE = 1 << 20  # characters
_ASKED = re.compile(r"\AQuery: (.*?)\nContext: (.*)\nInstruction: ", re.DOTALL)
_CARD = re.compile(r"^(\d+)\. ", re.MULTILINE)
_FIELD = re.compile(r"^ {3}(ID|Name|Summary): (.*)$", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Decision:
    """A question, the cards there were, and which of them the teacher chose."""

    question: str
    cards: tuple[str, ...]
    choice: int

    @property
    def task(self) -> SelectTask:
        return SelectTask(self.question, self.cards)

    def agrees(self, choice: int) -> bool:
        """Whether a choice is the teacher's; cards that read the same are the same."""
        return self.cards[choice] == self.cards[self.choice]


@dataclass(frozen=True)
class Decisions:
    """Distinct decisions in the order they first appear; what was left out is counted in `notes`."""

    decisions: tuple[Decision, ...]
    notes: tuple[str, ...]


def has_decisions(folder: Path) -> bool:
    """Whether a folder holds such data."""
    return any((folder / name).is_file() for name in FILES)


def read_decisions(folder: Path) -> Decisions:
    """The distinct decisions of a folder. A decision that was made twice, differently, counts as made most often.

    Raises InputError for a folder without the files, and for a line that is none of theirs.
    """
    paths = [folder / name for name in FILES if (folder / name).is_file()]
    if not paths:
        raise InputError("holds no decisions", where=str(folder), allowed=" and ".join(FILES))
    made: dict[tuple[str, tuple[str, ...]], Counter[int]] = {}
    counts: Counter[str] = Counter()
    for path in paths:
        for where, line in _lines(path):
            counts["decisions read"] += 1
            found = _decision(line, where)
            if found is None:
                counts["left out: the choice is none of the cards"] += 1
            else:
                made.setdefault((found.question, found.cards), Counter())[found.choice] += 1
    counts["decided differently another time"] = sum(len(c) > 1 for c in made.values())
    kept = tuple(Decision(q, cards, c.most_common(1)[0][0]) for (q, cards), c in made.items())
    counts["distinct"], counts["with a choice"] = len(kept), sum(len(d.cards) > 1 for d in kept)
    return Decisions(kept, tuple(f"{name}: {n:,}" for name, n in counts.items()))


def fold(text: str, folds: int) -> int:
    """Which of `folds` parts a question falls into: by its content alone, so that everyone splits alike."""
    return int.from_bytes(content_hash(" ".join(text.casefold().split()))[:8], "little") % folds


def held_out(decisions: Sequence[Decision], folds: int, part: int, by: str) -> list[Decision]:
    """The decisions of one part: `question` keeps questions whole, `cards` sets of candidates.

    A student is judged without a leak where it was taught with the other parts only.
    """
    if by == "question":
        return [d for d in decisions if fold(d.question, folds) == part]
    return [d for d in decisions if fold("\n".join(sorted(d.cards)), folds) == part]


def _lines(path: Path) -> Iterator[tuple[str, str]]:
    try:
        with path.open(encoding="utf-8") as file:
            for number, line in enumerate(file, 1):
                if len(line) > MAX_LINE:
                    raise InputError(f"a line of {len(line)} characters", where=f"{path}:{number}")
                if line.strip():
                    yield f"{path}:{number}", line
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {error}", where=str(path)) from None


def _decision(line: str, where: str) -> Decision | None:
    """A line's decision, None where the answer is none of the cards. Raises InputError for a line that is no chat."""
    try:
        asked, answer = (str(message["content"]) for message in json.loads(line)["messages"])
    except (ValueError, KeyError, TypeError, RecursionError):
        raise InputError("no chat of a question and an answer", where=where, allowed='{"messages": […, …]}') from None
    match = _ASKED.match(asked)
    if match is None:
        raise InputError(f"begins {asked[:40]!r}", where=where, allowed="Query: … Context: … Instruction: …")
    options = [_option(text) for text in _numbered(match[2])]
    wanted = answer.strip()
    ids = [i for i, option in enumerate(options) if wanted == option["ID"]]
    names = [i for i, option in enumerate(options) if wanted == option["Name"]]
    if not (ids or names):
        return None
    return Decision(clean(match[1]), tuple(_card(option) for option in options), (ids or names)[0])


def _numbered(context: str) -> list[str]:
    """The parts of a list numbered from 1; a number out of turn belongs to the text."""
    starts: list[tuple[int, int]] = []
    for match in _CARD.finditer(context):
        if int(match[1]) == len(starts) + 1:
            starts.append(match.span())
    ends = [start for start, _ in starts[1:]] + [len(context)]
    return [context[begin:end] for (_, begin), end in zip(starts, ends, strict=True)]


def _option(text: str) -> Mapping[str, str]:
    fields: dict[str, Any] = {key: clean(value) for key, value in _FIELD.findall(text)}
    plain = clean(text)
    return {"ID": fields.get("ID", plain), "Name": fields.get("Name", plain), "Summary": fields.get("Summary", "")}


def _card(option: Mapping[str, str]) -> str:
    return ". ".join(filter(None, (name_words(option["Name"]), option["Summary"])))
