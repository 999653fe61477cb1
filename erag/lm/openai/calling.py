"""Requests that are repeated when it may help: backoff with jitter, Retry-After, pace, budget; no secrets in errors."""

from __future__ import annotations

import json
import random
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from email.utils import parsedate_to_datetime
from typing import Any, Protocol, TypeVar

from erag.core.errors import BadModelOutput, InputError, ModelError, printable
from erag.core.secrets import without_secrets
from erag.lm.ledger import Ledger
from erag.lm.openai.config import OpenAIConfig
from erag.lm.openai.spending import Clock, Pace, Sleep, Spending, Tokens
from erag.lm.openai.transport import Reply, Transport, Unanswered

In = TypeVar("In")
Out = TypeVar("Out")
Answer = dict[str, Any]
_AGAIN = frozenset({408, 409, 425, 429, 500, 502, 503, 504, 529})
_SPENT = ("insufficient_quota", "billing_hard_limit_reached")  # a 429 that no waiting cures


class Poster(Protocol):
    """What sends one request."""

    def post(self, path: str, payload: bytes) -> Reply: ...


@dataclass(frozen=True, slots=True)
class _Failure:
    """Why a request was in vain and how many seconds the server asks to wait, None where it does not say."""

    what: str
    wait: float | None = None


class Caller:
    """Calls one endpoint. `poster`, `clock`, `sleep` and `rng` are replaced in tests."""

    def __init__(
        self, config: OpenAIConfig, ledger: Ledger, *, poster: Poster | None = None, clock: Clock = time.monotonic,
        sleep: Sleep = time.sleep, rng: random.Random | None = None,
    ) -> None:  # fmt: skip
        self._config, self._sleep = config, sleep
        self._poster = poster or Transport(config.base_url, config.key_env, config.timeout)
        self._spending = Spending(config, ledger)
        self._pace = Pace(config.requests_per_minute, config.tokens_per_minute, clock, sleep)
        self._rng = rng or random.Random()  # noqa: S311  # jitter

    def call(self, path: str, request: Mapping[str, Any], guess: Tokens) -> Answer:
        """The JSON object a request is answered with; `guess` is what it may read and write at most.

        Raises ModelError when the endpoint refuses or stays silent, BudgetSpent before too dear a request, InputError
        for what it says is too much or not understood, and BadModelOutput where it says that its model failed.
        """
        payload = json.dumps(request, ensure_ascii=False).encode()
        failures: list[_Failure] = []
        while True:
            found = self._try(path, payload, guess)
            if not isinstance(found, _Failure):
                return found
            failures.append(found)
            if len(failures) > self._config.retries:
                times = f" ({len(failures)} attempts)" if len(failures) > 1 else ""
                raise ModelError(
                    f"{found.what}{times}", where=self._config.base_url, repair="try later; what is done is kept"
                )
            self._spending.event("requests repeated")
            self._sleep(self._wait(len(failures), found))

    def map(self, function: Callable[[In], Out], items: Sequence[In]) -> list[Out]:
        """`function` of every item, same order, some at once; after an error those not begun are not begun."""
        if len(items) <= 1 or self._config.parallel == 1:
            return [function(item) for item in items]
        with ThreadPoolExecutor(min(self._config.parallel, len(items))) as pool:
            waiting = [pool.submit(function, item) for item in items]
            try:
                return [one.result() for one in waiting]
            finally:
                pool.shutdown(wait=True, cancel_futures=True)

    def _try(self, path: str, payload: bytes, guess: Tokens) -> Answer | _Failure:
        reserved = self._spending.reserve(guess)
        spent: Tokens | None = None
        try:
            self._pace.wait(guess.read + guess.wrote)
            reply = self._poster.post(path, payload)
            if reply.status != 200:
                return self._refused(reply)
            answer = _object(reply.body)
            spent = guess if answer is None else used(answer, guess)
        except Unanswered as error:
            spent = guess if error.sent else None
            if error.sent:
                self._spending.event("answers lost, counted at what they may cost")
            return _Failure(error.what)
        finally:
            self._spending.settle(reserved, spent)
        return _Failure("the answer is no whole JSON object") if answer is None else answer

    def _refused(self, reply: Reply) -> _Failure:
        said, code = _complaint(reply.body)
        what, where = f"status {reply.status}{said}", self._config.base_url
        if reply.status == 422:
            raise BadModelOutput(what, where=where)
        if reply.status in (400, 413):
            raise InputError(what, where=where)
        if reply.status not in _AGAIN or code in _SPENT:
            key = self._config.key_env
            repair = f"a valid key in {key}" if reply.status in (401, 403) and key else ""
            raise ModelError(what, where=where, repair=repair)
        return _Failure(what, _retry_after(reply.headers.get("retry-after")))

    def _wait(self, failed: int, failure: _Failure) -> float:
        """Seconds before the next attempt: what the server asks for, else doubled each time; with jitter."""
        if failure.wait is not None:
            if failure.wait > self._config.longest_wait:
                what = f"{failure.what}; it asks to wait {failure.wait:.0f} s"
                raise ModelError(what, where=self._config.base_url, allowed=f"up to {self._config.longest_wait:g} s")
            return failure.wait + self._rng.uniform(0, self._config.backoff)
        doubled = self._config.backoff * 2.0 ** (failed - 1)
        return self._rng.uniform(0.5, 1) * min(doubled, self._config.longest_wait)


def used(answer: Mapping[str, Any], guess: Tokens) -> Tokens:
    """The tokens a server says it used; the guess where it says nothing."""
    usage = answer.get("usage")
    if not isinstance(usage, Mapping):
        return guess
    read, wrote = usage.get("prompt_tokens"), usage.get("completion_tokens", 0)
    sound = all(type(n) is int and 0 <= n < 1 << 31 for n in (read, wrote))
    return Tokens(read, wrote) if sound and isinstance(read, int) else guess


def _object(body: str) -> Answer | None:
    try:
        found = json.loads(body)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def _complaint(body: str) -> tuple[str, str]:
    """What a server says is wrong, without anything that looks like a key, and its code."""
    found = _object(body) or {}
    error = found.get("error", found)
    message = error.get("message", "") if isinstance(error, Mapping) else error
    code = error.get("code") if isinstance(error, Mapping) else None
    said = printable(str(without_secrets(str(message))), 300)
    return (f": {said}" if said else ""), str(code or "")


def _retry_after(value: str | None) -> float | None:
    """Seconds from now of a Retry-After header: a number, or a date; None for anything else."""
    if value is None:
        return None
    try:
        return max(0.0, float(value)) if value.strip().replace(".", "", 1).isdigit() else _until(value)
    except (ValueError, TypeError, OverflowError):
        return None


def _until(date: str) -> float:
    return max(0.0, parsedate_to_datetime(date).timestamp() - time.time())
