"""Which models play which roles: the closed registry of backends, and how a configuration becomes a backend."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from erag.lm.blip import Blip, BlipConfig
from erag.lm.clip import Clip, ClipConfig
from erag.lm.compose import compose
from erag.lm.fake import Fake, FakeConfig
from erag.lm.ledger import Ledger
from erag.lm.roles import LMBackend, Model, RoleName, Roles
from erag.lm.sentence import SentenceConfig, SentenceEmbedder
from erag.lm.signs import Signs, SignsConfig
from erag.lm.student import Student, StudentConfig
from erag.lm.tagger import Tagger, TaggerConfig
from erag.lm.vlm import Vlm, VlmConfig
from erag.lm.weights import ModelStore

ModelConfig = Annotated[
    SentenceConfig | TaggerConfig | StudentConfig | ClipConfig | BlipConfig | VlmConfig | SignsConfig | FakeConfig,
    Field(discriminator="kind"),
]
_LEAVES: tuple[tuple[type[BaseModel], Callable[[Any, ModelStore, Ledger | None], Model]], ...] = (
    (SentenceConfig, SentenceEmbedder),
    (TaggerConfig, Tagger),
    (StudentConfig, Student),
    (ClipConfig, Clip),
    (BlipConfig, Blip),
    (VlmConfig, Vlm),
)


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
    if isinstance(config, SignsConfig):
        return Signs(config, _model(config.captioner, store, ledger))
    for kind, leaf in _LEAVES:
        if isinstance(config, kind):
            return leaf(config, store, ledger)
    return Fake(config if isinstance(config, FakeConfig) else None)
