"""Money and pace: what a run may spend, and how many requests and tokens a minute it may send."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from erag.core.errors import ModelError
from erag.lm.ledger import Ledger
from erag.lm.openai.config import OpenAIConfig, Price

Clock = Callable[[], float]
Sleep = Callable[[float], None]
_FREE = Price(input=0)
_BYTES_A_TOKEN, _FRAME = 2, 8  # of UTF-8; tokens around a text


class BudgetSpent(ModelError):
    """The next request could cost more than is left; it was not sent."""


@dataclass(frozen=True, slots=True)
class Tokens:
    """Tokens read and written, as a server counts them, or as they are guessed before it did."""

    read: int = 0
    wrote: int = 0


def guessed(texts: Iterable[str]) -> int:
    """Tokens that texts may be read as, each with its frame; so many that a guess is seldom too low."""
    return sum(len(text.encode("utf-8", "replace")) // _BYTES_A_TOKEN + _FRAME for text in texts)


class Spending:
    """Counts what requests cost into a ledger, and refuses those that could pass the budget. Threads may share it."""

    def __init__(self, config: OpenAIConfig, ledger: Ledger) -> None:
        self._ledger, self._price, self._budget = ledger, config.price or _FREE, config.budget
        self._paid = config.price is not None
        self._name = f"{config.model} in {self._price.currency}"
        self._lock, self._reserved = threading.Lock(), 0.0

    def reserve(self, guess: Tokens) -> float:
        """Set aside what a request may cost. Raises BudgetSpent where that is more than what is left."""
        cost = self._price.of(guess.read, guess.wrote)
        with self._lock:
            spent = sum(self._ledger.cost.values())
            if self._budget is not None and spent + self._reserved + cost > self._budget:
                what = f"the next request may cost {cost:.4f} and {spent:.4f} of {self._budget:g} is spent"
                repair = "a higher budget; what is recorded is not paid for again"
                raise BudgetSpent(f"{what} ({self._price.currency})", where=self._name, repair=repair)
            self._reserved += cost
        return cost

    def settle(self, reserved: float, used: Tokens | None) -> None:
        """Count what a request cost; None: nothing, it was not answered."""
        with self._lock:
            self._reserved -= reserved
            if used is not None and self._paid:
                self._ledger.cost[self._name] += self._price.of(used.read, used.wrote)

    def event(self, name: str) -> None:
        """Count something a user should see."""
        with self._lock:
            self._ledger.events[name] += 1


class Pace:
    """Spaces requests so that neither their number nor their tokens pass a rate a minute. Threads may share it.

    Each request moves the time of the next: there are no bursts, and a long pause earns none.
    """

    def __init__(
        self, requests: float | None, tokens: float | None, clock: Clock = time.monotonic, sleep: Sleep = time.sleep
    ) -> None:
        self._request = 60.0 / requests if requests else 0.0  # seconds
        self._token = 60.0 / tokens if tokens else 0.0
        self._clock, self._sleep = clock, sleep
        self._lock, self._next = threading.Lock(), clock()

    def wait(self, tokens: int) -> None:
        """Return when a request of so many tokens may be sent."""
        with self._lock:
            now = self._clock()
            start = max(now, self._next)
            self._next = start + max(self._request, self._token * tokens)
        if start > now:
            self._sleep(start - now)
