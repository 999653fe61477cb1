"""Chat messages through a model's own template, so that what a message says can never become a control token."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from erag.core.errors import InputError, ModelError

if TYPE_CHECKING:
    from jinja2 import Template

MAX_TEMPLATE = 64 * 1024  # characters of a template
MAX_FRAME = 256 * 1024  # characters a template may add to the messages
CHAT_ROLES = ("system", "user", "assistant")
PLAIN = "{% for message in messages %}{{ message['content'] }}\n\n{% endfor %}"  # for models without a template

Messages = Sequence[tuple[str, str]]  # (role, text)


@dataclass(frozen=True, slots=True)
class Piece:
    """Part of a rendered chat. Only where `frame` is true, in the template's own text, are control tokens meant."""

    text: str
    frame: bool


class ChatTemplate:
    """The template of a model (`tokenizer.chat_template` of a GGUF), compiled in a sandbox at its first use.

    Messages are rendered as placeholders and spliced in afterwards, word for word: a template that would trim or cut
    them does not.
    """

    def __init__(self, source: str | None, *, bos: str = "", eos: str = "", where: str = "chat template") -> None:
        self.source, self._bos, self._eos, self._where = source or PLAIN, bos, eos, where
        if len(self.source) > MAX_TEMPLATE:
            raise ModelError(f"{len(self.source)} characters", where=where, allowed=f"at most {MAX_TEMPLATE}")

    def render(self, messages: Messages, *, answer: bool = True) -> tuple[Piece, ...]:
        """The pieces of a chat, up to where the assistant begins to speak when `answer`.

        Raises InputError for roles a chat does not have, ModelError when the template cannot render these messages.
        """
        for role, _ in messages:
            if role not in CHAT_ROLES:
                raise InputError(f"unknown role {role!r} in a prompt", allowed=", ".join(CHAT_ROLES))
        marked = [{"role": role, "content": _placeholder(i)} for i, (role, _) in enumerate(messages)]
        rendered = self._render(marked, answer)
        for i, (role, _) in enumerate(messages):
            if _placeholder(i) not in rendered:
                raise ModelError(f"the template leaves out message {i + 1} ({role})", where=self._where)
        return tuple(_splice(rendered, [text for _, text in messages]))

    def text(self, messages: Messages, *, answer: bool = True) -> str:
        """The rendered chat as one string, for printing; to be tokenised it has to stay in pieces."""
        return "".join(piece.text for piece in self.render(messages, answer=answer))

    def _render(self, messages: list[dict[str, str]], answer: bool) -> str:
        import jinja2

        try:
            rendered = self._template.render(
                messages=messages,
                add_generation_prompt=answer,
                bos_token=self._bos,
                eos_token=self._eos,
                tools=None,
                raise_exception=_refuse,
            )
        except (jinja2.TemplateError, ArithmeticError, TypeError, ValueError, LookupError, RecursionError) as error:
            raise ModelError(f"the template cannot render these messages: {error}", where=self._where) from error
        if len(rendered) > MAX_FRAME:
            raise ModelError(f"the template writes {len(rendered)} characters", where=self._where)
        return rendered

    @cached_property
    def _template(self) -> Template:
        from jinja2.exceptions import SecurityError
        from jinja2.sandbox import ImmutableSandboxedEnvironment

        class Sandbox(ImmutableSandboxedEnvironment):
            """No attributes with underscores, no changes to arguments, no arithmetic that fills the memory."""

            intercepted_binops = frozenset({"*", "**", "//", "%", "/"})

            def call_binop(self, context: Any, operator: str, left: Any, right: Any) -> Any:
                small = all(isinstance(side, int) and abs(side) <= 1_000_000 for side in (left, right))
                if operator == "**" or not small:
                    raise SecurityError(f"the operator {operator} is not allowed here")
                return super().call_binop(context, operator, left, right)

        return Sandbox(trim_blocks=True, lstrip_blocks=True).from_string(self.source)


def _placeholder(index: int) -> str:
    return f"\x02{index}\x03"  # control characters that no template writes and `strip` leaves alone


def _splice(rendered: str, texts: Sequence[str]) -> list[Piece]:
    marks = "|".join(map(str, range(len(texts))))
    parts = re.split(f"\x02({marks})\x03", rendered)  # frame, number, frame, number, … frame
    pieces = [Piece(texts[int(part)] if i % 2 else part, frame=not i % 2) for i, part in enumerate(parts)]
    return [piece for piece in pieces if piece.text]


def _refuse(message: str) -> None:
    from jinja2.exceptions import TemplateRuntimeError

    raise TemplateRuntimeError(message)
