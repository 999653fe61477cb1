"""Which models play which roles: the closed registry of backends, and how a configuration becomes a backend."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from erag.lm.compose import compose
from erag.lm.fake import Fake, FakeConfig
from erag.lm.ledger import Ledger
from erag.lm.llamacpp.backend import LlamaCpp
from erag.lm.llamacpp.config import LlamaCppConfig
from erag.lm.roles import LMBackend, Model, RoleName, Roles
from erag.lm.sentence import SentenceConfig, SentenceEmbedder
from erag.lm.textroles import TextRoles, TextRolesConfig
from erag.lm.torchlm import TorchLM, TorchLMConfig
from erag.lm.weights import ModelStore


class LlamaCppRoles(LlamaCppConfig):
    """A GGUF model in llama.cpp, and how it plays the text roles (`text`)."""

    text: TextRolesConfig = TextRolesConfig()


class TorchLMRoles(TorchLMConfig):
    """A GGUF model in PyTorch, and how it plays the text roles (`text`)."""

    text: TextRolesConfig = TextRolesConfig()


ModelConfig = Annotated[SentenceConfig | LlamaCppRoles | TorchLMRoles | FakeConfig, Field(discriminator="kind")]


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


def text_engine(
    config: LlamaCppConfig | TorchLMConfig, store: ModelStore, ledger: Ledger | None = None
) -> LlamaCpp | TorchLM:
    """The engine of a language model, without roles; nothing is loaded yet."""
    if isinstance(config, LlamaCppConfig):
        return LlamaCpp(config, store, ledger)
    return TorchLM(config, store, ledger)


def _model(config: ModelConfig, store: ModelStore, ledger: Ledger | None) -> Model:
    match config:
        case FakeConfig():
            return Fake(config)
        case SentenceConfig():
            return SentenceEmbedder(config, store, ledger)
        case _:
            return TextRoles(text_engine(config, store, ledger), config.text, ledger)
