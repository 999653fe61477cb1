"""What a language model is taught: prompts exactly as a role sends them, with the answers to be learnt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from erag.core.errors import InputError
from erag.core.types import IntArray
from erag.evaluate.statistics import Interval
from erag.lm.chat import Messages
from erag.lm.roles import LMBackend, RoleName
from erag.lm.textroles import TextRolesConfig
from erag.lm.torchlm.plan import Tokens, common
from erag.lm.torchlm.shape import Shape
from erag.lm.torchlm.vocabulary import Vocabulary

Answer = tuple[str, ...]  # of an item: the things named, the card chosen, the parts of a summary


@dataclass(frozen=True, slots=True)
class Lesson:
    """A chat up to where the model speaks, and what it should say."""

    messages: Messages
    answer: str


class Task(Protocol):
    """n items that a teacher has answered: what is taught of them, and how answers to them are judged.

    `groups` (n,) names what an item has in common with others: items of one group are on the same side of a split.
    """

    @property
    def role(self) -> RoleName: ...

    @property
    def text(self) -> TextRolesConfig: ...

    @property
    def groups(self) -> Sequence[str]: ...

    @property
    def quotable(self) -> bool:
        """Whether a card may quote items: data that others published may not be passed on."""
        ...

    @property
    def asked(self) -> Sequence[str]:
        """(n,) what an example shows of each item."""
        ...

    @property
    def taught(self) -> Sequence[Answer]:
        """(n,) the teacher's answers, as far as they count."""
        ...

    def lessons(self, row: int) -> list[Lesson]:
        """What is taught of an item."""
        ...

    def answers(self, backend: LMBackend, rows: Sequence[int]) -> list[Answer]:
        """What a backend answers to the items `rows`."""
        ...

    def others(self, fold: IntArray) -> Mapping[str, Sequence[Answer | None]]:
        """Answers (n,) without a language model, having seen nothing of an item's fold (n,); None: there is none."""
        ...

    def figures(self, rows: Sequence[int], answers: Sequence[Answer], resamples: int) -> dict[str, Interval]:
        """How good answers to the items `rows` are."""
        ...


@dataclass(frozen=True, slots=True)
class Drill:
    """Lessons as tokens: `prefix` that all prompts begin with, and of each lesson what follows it, and its answer."""

    prefix: Tokens
    asked: tuple[Tokens, ...]
    answers: tuple[Tokens, ...]

    def __len__(self) -> int:
        return len(self.asked)

    @property
    def taught(self) -> int:
        """Tokens of all answers."""
        return sum(map(len, self.answers))


def drill(lessons: Sequence[Lesson], vocabulary: Vocabulary, shape: Shape) -> Drill:
    """The tokens that the model reads when it plays its role, up to the answer, and those of the answer.

    Raises InputError for a lesson that is longer than the context.
    """
    chats = [vocabulary.template.render(lesson.messages) for lesson in lessons]
    prompts = [tuple(vocabulary.encode_chat(chat)) for chat in chats]
    answers = [tuple(vocabulary.encode(lesson.answer)) for lesson in lessons]
    longest = max((len(p) + len(a) for p, a in zip(prompts, answers, strict=True)), default=0)
    if longest > shape.context:
        raise InputError(f"a lesson of {longest} tokens", allowed=f"at most {shape.context}")
    shared = min(common(prompts), min(map(len, prompts)) - 1) if prompts else 0
    return Drill(prompts[0][:shared] if prompts else (), tuple(prompt[shared:] for prompt in prompts), tuple(answers))
