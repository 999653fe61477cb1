"""All text roles on top of one language model: summarise, select, score, generate."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, Literal, Protocol

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from erag.core.errors import BadModelOutput
from erag.core.text import clean
from erag.lm import prompts
from erag.lm.choosing import Limits, Measure, by_number, by_relevance, relevance
from erag.lm.ledger import Ledger
from erag.lm.roles import Generation, Group, Prompt, RoleName, SelectTask, Summary, Vectors
from erag.lm.textmodel import Continuation, Likelihood, TextModel

CHARS_A_TOKEN = 2  # the fewest that the token cap of a summary allows for


class TextRolesConfig(BaseModel):
    """How a language model plays its roles.

    `selector`: `likelihood` and `yes_no` judge each card on its own; `grammar` shows numbered lists. `scorer`: as the
    first two. `temperature` divides the scorer's log-odds before they become a score in [0, 1].
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    selector: Literal["likelihood", "yes_no", "grammar"] = "likelihood"
    scorer: Measure = "likelihood"
    temperature: float = Field(1.0, gt=0, le=100, allow_inf_nan=False)
    rotations: int = Field(4, ge=1, le=64, description="rotated lists whose votes the grammar selector counts")
    query_chars: int = Field(400, ge=16, le=4000)
    card_chars: int = Field(600, ge=16, le=8000, description="read of a card that is judged on its own")
    listed_chars: int = Field(200, ge=16, le=4000, description="read of a card in a numbered list")
    summary_chars: int = Field(240, ge=40, le=2000)
    name_chars: int = Field(48, ge=8, le=200)
    relationship_chars: int = Field(60, ge=8, le=300)
    relationships: int = Field(3, ge=1, le=16)


class TextEngine(TextModel, Protocol):
    """A `TextModel` that says what it is."""

    def identity(self, role: RoleName) -> str: ...

    def fingerprint(self, role: RoleName) -> str: ...

    def batch_size(self, role: RoleName) -> int: ...


class TextRoles:
    """The summariser, selector, scorer and generator of one language model.

    Nothing it returns can be anything but the model's own choice among what was offered: summaries have the schema's
    lengths, selections are indices of the cards given, scores are probabilities.
    """

    roles: frozenset[RoleName] = frozenset({"summarise", "select", "score", "generate"})

    def __init__(self, engine: TextEngine, config: TextRolesConfig | None = None, ledger: Ledger | None = None) -> None:
        self._engine, self._config, self._ledger = engine, config or TextRolesConfig(), ledger or Ledger()
        c = self._config
        self._limits = Limits(c.query_chars, c.card_chars, c.listed_chars)
        self._schema = prompts.summary_schema(c.summary_chars, c.name_chars, c.relationship_chars, c.relationships)
        most = c.summary_chars + c.name_chars + c.relationships * (c.relationship_chars + 4)
        self._summary_tokens = most // CHARS_A_TOKEN + 40  # 40: keys and marks

    @property
    def engine(self) -> TextEngine:
        """The language model itself."""
        return self._engine

    def identity(self, role: RoleName) -> str:
        """The engine's identity, the version of the role's prompts and its parameters."""
        return self._described(role, self._engine.identity(role))

    def fingerprint(self, role: RoleName) -> str:
        return self._described(role, self._engine.fingerprint(role))

    def batch_size(self, role: RoleName) -> int:
        return self._engine.batch_size(role)

    def _described(self, role: RoleName, engine: str) -> str:
        if role == "generate":
            return engine
        used = self._config.model_dump(include=set(_PARAMETERS.get(role, ())))
        return json.dumps({"engine": engine, "prompt": prompts.version(role), **used}, sort_keys=True)

    def summarise(self, groups: Sequence[Group]) -> list[Summary]:
        """One summary a group, under a schema of capped lengths. Raises BadModelOutput where the schema is not met."""
        asked = [Prompt(prompts.summarise(group), self._schema, self._summary_tokens) for group in groups]
        answers = self._counted("summarise").generate(asked)
        if cut := sum(answer.truncated for answer in answers):
            self._ledger.events["summaries cut at the token cap"] += cut
        return [_summary(answer.text) for answer in answers]

    def select(self, tasks: Sequence[SelectTask], k: int) -> list[list[int]]:
        """For each task min(k, n) distinct indices of its cards, best first, whatever the order of the cards."""
        model = self._counted("select")
        if self._config.selector == "grammar":
            return by_number(model, tasks, k, self._limits, self._config.rotations)
        return by_relevance(model, self._config.selector, tasks, k, self._limits)

    def score(self, pairs: Sequence[tuple[str, str]]) -> Vectors:
        """(p,) float32 in [0, 1] for (query, text) pairs: the logistic function of log-odds, or of the gain in nats."""
        if not pairs:
            return np.empty(0, np.float32)
        odds = relevance(self._counted("score"), self._config.scorer, pairs, self._limits).astype(np.float64)
        return (0.5 * (1 + np.tanh(odds / (2 * self._config.temperature)))).astype(np.float32)

    def generate(self, prompts: Sequence[Prompt]) -> list[Generation]:
        """The engine's own generations."""
        return self._counted("generate").generate(prompts)

    def _counted(self, role: RoleName) -> TextModel:
        return _Counted(self._engine, self._ledger, role)


class _Counted:
    """The engine, with the tokens of one role counted in a ledger."""

    def __init__(self, engine: TextModel, ledger: Ledger, role: RoleName) -> None:
        self._engine, self._ledger, self._role = engine, ledger, role

    def generate(self, prompts: Sequence[Prompt]) -> list[Generation]:
        done = self._engine.generate(prompts)
        self._count(len(prompts), sum(g.tokens_in for g in done), sum(g.tokens_out for g in done))
        return done

    def likelihoods(self, continuations: Sequence[Continuation]) -> list[Likelihood]:
        found = self._engine.likelihoods(continuations)
        self._count(len(continuations), sum(one.prompt + one.tokens for one in found), 0)
        return found

    def _count(self, prompts: int, read: int, wrote: int) -> None:
        self._ledger.prompts[self._role] += prompts
        self._ledger.tokens_in[self._role] += read
        self._ledger.tokens_out[self._role] += wrote


_PARAMETERS: Mapping[RoleName, tuple[str, ...]] = {
    "summarise": ("summary_chars", "name_chars", "relationship_chars", "relationships"),
    "select": ("selector", "rotations", "query_chars", "card_chars", "listed_chars"),
    "score": ("scorer", "temperature", "query_chars", "card_chars"),
}


def _summary(text: str) -> Summary:
    """A summary from the JSON of its schema. Raises BadModelOutput for anything else."""
    try:
        raw: Any = json.loads(text)
        name, said, how = raw["name"], raw["summary"], raw["relationships"]
    except (ValueError, TypeError, KeyError) as error:
        raise BadModelOutput(f"no summary in {text[:80]!r}", allowed="JSON of the schema") from error
    if not (isinstance(name, str) and isinstance(said, str) and isinstance(how, list)):
        raise BadModelOutput(f"no summary in {text[:80]!r}", allowed="JSON of the schema")
    if not all(isinstance(part, str) for part in how):
        raise BadModelOutput(f"no relationships in {text[:80]!r}", allowed="texts")
    return Summary(clean(name), clean(said), tuple(clean(part) for part in how))
