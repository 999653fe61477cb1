"""Which models play which roles: the closed registry of backends, and how a configuration becomes a backend."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from erag.lm.compose import compose
from erag.lm.fake import Fake, FakeConfig
from erag.lm.ledger import Ledger
from erag.lm.roles import LMBackend, Model, RoleName, Roles
from erag.lm.sentence import SentenceConfig, SentenceEmbedder
from erag.lm.weights import ModelStore

ModelConfig = Annotated[SentenceConfig | FakeConfig, Field(discriminator="kind")]


def _default_models() -> dict[str, ModelConfig]:
    return {"minilm": SentenceConfig()}


def _default_roles() -> dict[RoleName, str]:
    return {"embed": "minilm"}


class BackendConfig(BaseModel):
    """Named models and the roles they play."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    models: dict[str, ModelConfig] = Field(default_factory=_default_models)
    roles: dict[RoleName, str] = Field(default_factory=_default_roles)


def build_backend(config: BackendConfig, store: ModelStore, ledger: Ledger | None = None) -> LMBackend:
    """The backend of a configuration; nothing is loaded yet. Raises ConfigError for roles that do not fit."""
    return compose({key: _model(c, store, ledger) for key, c in config.models.items()}, Roles(config.roles))


def _model(config: ModelConfig, store: ModelStore, ledger: Ledger | None) -> Model:
    if isinstance(config, FakeConfig):
        return Fake(config)
    return SentenceEmbedder(config, store, ledger)
