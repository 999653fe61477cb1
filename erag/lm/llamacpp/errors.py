"""Errors that only a language model with a limited context raises."""

from __future__ import annotations

from erag.core.errors import InputError


class ContextError(InputError):
    """A prompt that does not fit the model's context together with the answer asked for. Nothing was cut."""

    def __init__(self, tokens: int, answer: int, limit: int, where: str) -> None:
        self.tokens, self.answer, self.limit = tokens, answer, limit
        super().__init__(
            f"a prompt of {tokens} tokens with an answer of up to {answer} does not fit",
            where=where,
            allowed=f"{limit} tokens together",
            repair="a shorter prompt, or a larger `context` in the configuration",
        )
