"""The ledger of a run: what was asked of the models, what was replayed, what fell back, what it cost."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field


@dataclass
class Ledger:
    """Counts by role: `calls` items computed by a model, `replayed` items read from records, `seconds` in the models.

    `events` counts what a user should see: truncated texts, fallbacks, refused outputs.
    """

    calls: Counter[str] = field(default_factory=Counter)
    replayed: Counter[str] = field(default_factory=Counter)
    seconds: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))
    events: Counter[str] = field(default_factory=Counter)

    def lines(self) -> list[str]:
        """A line a role and a line an event, for printing."""
        roles = sorted(set(self.calls) | set(self.replayed))
        return [
            *(
                f"{r}: {self.calls[r]} computed in {self.seconds[r]:.1f} s, {self.replayed[r]} read from records"
                for r in roles
            ),
            *(f"{name}: {n}" for name, n in sorted(self.events.items())),
        ]
