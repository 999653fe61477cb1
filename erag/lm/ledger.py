"""The ledger of a run: what was asked of the models, what was replayed, what fell back, what it cost."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field


@dataclass
class Ledger:
    """Counts by role: `calls` items computed by a model, `replayed` items read from records, `seconds` in the models.

    `prompts` counts the texts that language models were given to go on from or to judge, `tokens_in` and `tokens_out`
    what they read (each prompt in full, though shared beginnings are computed once) and wrote. `events` counts what a
    user should see: truncated texts, fallbacks, refused outputs. `cost` is money by what was paid for: a model and its
    currency.
    """

    calls: Counter[str] = field(default_factory=Counter)
    replayed: Counter[str] = field(default_factory=Counter)
    seconds: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))
    prompts: Counter[str] = field(default_factory=Counter)
    tokens_in: Counter[str] = field(default_factory=Counter)
    tokens_out: Counter[str] = field(default_factory=Counter)
    events: Counter[str] = field(default_factory=Counter)
    cost: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))

    def lines(self) -> list[str]:
        """A line a role and a line an event, for printing."""
        roles = sorted(set(self.calls) | set(self.replayed))
        events = (f"{name}: {n:,}" for name, n in sorted(self.events.items()))
        return [
            *map(self._role, roles),
            *events,
            *(f"cost of {m}: {paid:.4f}" for m, paid in sorted(self.cost.items())),
        ]

    def _role(self, role: str) -> str:
        read, wrote = self.tokens_in[role], self.tokens_out[role]
        tokens = f", {read:,} tokens read and {wrote:,} written" if read else ""
        done = f"{self.calls[role]:,} computed in {self.seconds[role]:.1f} s{tokens}"
        return f"{role}: {done}; {self.replayed[role]:,} read from records"
