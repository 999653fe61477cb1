"""A chat endpoint as a `TextModel`: generations under a schema, and log-probabilities of Yes and No."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from erag.core.errors import BadModelOutput, InputError
from erag.lm.chat import CHAT_ROLES
from erag.lm.openai.calling import Answer, Caller, used
from erag.lm.openai.config import OpenAIConfig
from erag.lm.openai.spending import Tokens, guessed
from erag.lm.openai.structured import Form
from erag.lm.roles import Generation, Prompt, RoleName
from erag.lm.textmodel import Continuation, Likelihood

TOP = 20  # log-probabilities of the first token that are asked for
_WRAP = 8  # tokens that the wrapping of a schema takes
Messages = list[dict[str, Any]]


@dataclass(frozen=True, slots=True)
class Said:
    """One answer of a chat, whether the token cap ended it, and its tokens."""

    text: str
    truncated: bool
    tokens: Tokens


class ChatEngine:
    """Chat completions of one model. Threads may share it."""

    def __init__(self, config: OpenAIConfig, caller: Caller) -> None:
        self._config, self._caller = config, caller

    def identity(self, role: RoleName) -> str:
        del role
        kept = {"kind", "model", "base_url", "temperature", "structured", "likelihoods"}
        return json.dumps(self._config.model_dump(include=kept), sort_keys=True)

    def fingerprint(self, role: RoleName) -> str:
        """As the identity: which weights and machines answer there, only the endpoint knows."""
        return self.identity(role)

    def batch_size(self, role: RoleName) -> int:
        del role
        return self._config.call_size

    def generate(self, prompts: Sequence[Prompt]) -> list[Generation]:
        """See `TextModel`. JSON that is not of its schema is asked for again, with what is wrong, `repairs` times."""
        return self._caller.map(self._generation, prompts)

    def likelihoods(self, continuations: Sequence[Continuation]) -> list[Likelihood]:
        """See `TextModel`. With `first_token` only single words can be asked for: Yes and No.

        Raises InputError for other continuations, BadModelOutput where the server gives no log-probabilities.
        """
        if self._config.likelihoods == "extension":
            return self._extended(continuations)
        for one in continuations:
            if not one.text.isalpha():
                allowed = "one word; likelihoods: extension for whole texts"
                raise InputError(f"the likelihood of {one.text[:40]!r}", where=self._config.model, allowed=allowed)
        chats = list(dict.fromkeys(one.messages for one in continuations))
        found = dict(zip(chats, self._caller.map(self._first_token, chats), strict=True))
        return [Likelihood(_logprob(found[c.messages][0], c.text), 1, found[c.messages][1]) for c in continuations]

    def say(self, messages: Messages, form: Form | None, most: int, seed: int = 0) -> Said:
        """One answer to messages as the protocol has them. Raises BadModelOutput for a refusal or no text."""
        request: dict[str, Any] = {"model": self._config.model, "messages": messages}
        request[self._config.token_field] = most + (_WRAP if form is not None and form.wrapped else 0)
        if form is not None:
            request["response_format"] = form.response_format
        if self._config.seed:
            request["seed"] = seed
        return _said(*self._completed(request, messages, most))

    def _completed(self, request: dict[str, Any], messages: Messages, most: int) -> tuple[Answer, Tokens]:
        if self._config.temperature is not None:
            request["temperature"] = self._config.temperature
        guess = Tokens(self._guess(messages), most)
        answer = self._caller.call("/chat/completions", request, guess)
        return answer, used(answer, guess)

    def _generation(self, prompt: Prompt) -> Generation:
        messages = _messages(prompt.messages)
        if prompt.schema is None:
            said = self.say(messages, None, prompt.max_tokens, prompt.seed)
            return Generation(said.text, said.truncated, said.tokens.read, said.tokens.wrote)
        form = Form(prompt.schema, self._config.structured)
        return self.fill(_instructed(messages, form.instruction), form, prompt.max_tokens, prompt.seed)

    def fill(self, messages: Messages, form: Form, most: int, seed: int = 0) -> Generation:
        """JSON of a form, asked for again with what is wrong, `repairs` times. Raises BadModelOutput at the end."""
        read = wrote = 0
        wrong = text = ""
        for attempt in range(self._config.repairs + 1):
            said = self.say(messages, form, most, seed + attempt)
            read, wrote = read + said.tokens.read, wrote + said.tokens.wrote
            value, wrong = form.read(said.text)
            if not wrong:
                return Generation(value, said.truncated, read, wrote)
            again = f"That does not fit: {wrong}. Answer again, with JSON of the schema and nothing else."
            messages = [*messages, _message("assistant", said.text), _message("user", again)]
            text = said.text
        raise BadModelOutput(f"{wrong}: {text[:80]!r}", where=self._config.model, allowed="JSON of the schema")

    def _first_token(self, messages: tuple[tuple[str, str], ...]) -> tuple[Mapping[str, float], int]:
        """The log-probabilities of the likeliest first tokens of an answer, and the tokens read."""
        request = {"model": self._config.model, "messages": _messages(messages), "logprobs": True, "top_logprobs": TOP}
        answer, tokens = self._completed({**request, self._config.token_field: 1}, _messages(messages), 1)
        try:
            first = answer["choices"][0]["logprobs"]["content"][0]["top_logprobs"]
            return {str(one["token"]): float(one["logprob"]) for one in first}, tokens.read
        except (LookupError, TypeError, ValueError):
            what = "the server gives no log-probabilities"
            raise BadModelOutput(what, where=self._config.model, allowed="text: {selector: grammar}") from None

    def _extended(self, continuations: Sequence[Continuation]) -> list[Likelihood]:
        if not continuations:
            return []
        asked = [{"messages": _messages(one.messages), "text": one.text} for one in continuations]
        request = {"model": self._config.model, "continuations": asked}
        answer = self._caller.call("/likelihoods", request, Tokens(guessed([json.dumps(asked, ensure_ascii=False)])))
        try:
            rows = answer["data"]
            found = [Likelihood(float(r["logprob"]), int(r["tokens"]), int(r["prompt_tokens"])) for r in rows]
        except (LookupError, TypeError, ValueError):
            found = []
        if len(found) != len(continuations) or not all(math.isfinite(one.logprob) for one in found):
            what = f"{len(found)} likelihoods for {len(continuations)} texts"
            raise BadModelOutput(what, where=self._config.model, allowed="one a text")
        return found

    def _guess(self, messages: Messages) -> int:
        """Tokens that messages may be read as, pictures at what the configuration says."""
        texts, images = [], 0
        for message in messages:
            parts = message["content"] if isinstance(message["content"], list) else [{"text": message["content"]}]
            texts += [part["text"] for part in parts if "text" in part]
            images += sum("text" not in part for part in parts)
        return guessed(texts) + images * self._config.image_tokens


def _message(role: str, content: str) -> dict[str, Any]:
    return {"role": role, "content": content}


def _messages(turns: Sequence[tuple[str, str]]) -> Messages:
    """Raises InputError for roles a chat does not have."""
    if wrong := [role for role, _ in turns if role not in CHAT_ROLES]:
        raise InputError(f"unknown role {wrong[0]!r} in a prompt", allowed=", ".join(CHAT_ROLES))
    return [_message(role, text) for role, text in turns]


def _instructed(messages: Messages, instruction: str) -> Messages:
    """The messages with an instruction at the end of the first one of the system, which is made where there is none."""
    if not instruction:
        return messages
    if messages and messages[0]["role"] == "system":
        return [_message("system", f"{messages[0]['content']}\n{instruction}"), *messages[1:]]
    return [_message("system", instruction), *messages]


def _said(answer: Answer, tokens: Tokens) -> Said:
    try:
        choice = answer["choices"][0]
        message = choice["message"]
        text, refusal, end = message.get("content"), message.get("refusal"), choice.get("finish_reason")
    except (LookupError, TypeError, AttributeError):
        raise BadModelOutput("an answer without choices", allowed="a chat completion") from None
    if refusal or end == "content_filter":
        raise BadModelOutput(f"the model refused: {str(refusal or 'filtered')[:120]!r}")
    if not isinstance(text, str):
        raise BadModelOutput("an answer without a text", allowed="a chat completion")
    return Said(text, end == "length", tokens)


def _logprob(top: Mapping[str, float], word: str) -> float:
    """Log-probability that the first token is `word`; where it is not listed, the least that is bounds it."""
    mass = sum(math.exp(min(logprob, 0.0)) for token, logprob in top.items() if token.strip() == word)
    if mass > 0:
        return math.log(mass)
    return min(top.values(), default=-30.0)
