"""What a causal language model has to offer so that all text roles can be built on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from erag.lm.roles import Generation, Prompt


@dataclass(frozen=True, slots=True)
class Continuation:
    """A text that might follow chat messages (role, text): what a likelihood is asked of."""

    messages: tuple[tuple[str, str], ...]
    text: str


@dataclass(frozen=True, slots=True)
class Likelihood:
    """The natural log-probability of a continuation, summed over its `tokens` tokens, after `prompt` tokens."""

    logprob: float
    tokens: int
    prompt: int = 0

    @property
    def mean(self) -> float:
        """Log-probability a token."""
        return self.logprob / max(self.tokens, 1)


class TextModel(Protocol):
    """A language model as two batched functions. Chat messages are rendered by the model's own template."""

    def generate(self, prompts: Sequence[Prompt]) -> list[Generation]:
        """Greedy (or seeded) texts, one a prompt, same order; under `schema` the text is JSON of that schema.

        Raises BadModelOutput when a schema was asked and the text does not meet it (for example cut by the token cap).
        """
        ...

    def likelihoods(self, continuations: Sequence[Continuation]) -> list[Likelihood]:
        """One likelihood a continuation, same order; prefixes that several share are computed once."""
        ...
