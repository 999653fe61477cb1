"""The `committee` backend: students that select and score together, by the mean of their log-odds."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from erag.lm.adapter import Adapter, AdapterConfig
from erag.lm.cross import CrossEncoder, CrossEncoderConfig
from erag.lm.ledger import Ledger
from erag.lm.odds import Chooser, Pair
from erag.lm.roles import RoleName, Vectors
from erag.lm.weights import ModelStore

Member = Annotated[AdapterConfig | CrossEncoderConfig, Field(discriminator="kind")]


class CommitteeConfig(BaseModel):
    """The `committee` backend: its members, by default the adapter and the cross-encoder of the project."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["committee"] = "committee"
    members: tuple[Member, ...] = Field((AdapterConfig(), CrossEncoderConfig()), min_length=2, max_length=16)
    call_size: int = Field(256, ge=1, le=65_536, description="decisions or pairs recorded together")


class Committee(Chooser):
    """The select and score roles: what one of its members misjudges others may not."""

    def __init__(self, config: CommitteeConfig, store: ModelStore, ledger: Ledger | None = None) -> None:
        self._config = config
        self._members = [
            Adapter(member, store, ledger) if isinstance(member, AdapterConfig) else CrossEncoder(member, store, ledger)
            for member in config.members
        ]

    def identity(self, role: RoleName) -> str:
        """Those of its members."""
        return json.dumps({"kind": "committee", "members": [json.loads(m.identity(role)) for m in self._members]})

    def fingerprint(self, role: RoleName) -> str:
        """Those of its members."""
        return json.dumps({"kind": "committee", "members": [json.loads(m.fingerprint(role)) for m in self._members]})

    def batch_size(self, role: RoleName) -> int:
        del role
        return self._config.call_size

    def log_odds(self, pairs: Sequence[Pair], owners: Sequence[int] | None = None) -> Vectors:
        """(p,) float32, the mean of the members'."""
        found: Vectors = np.mean([member.log_odds(pairs, owners) for member in self._members], axis=0)
        return found
