"""Which models play which roles: the closed registry of backends, and how a configuration becomes a backend."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any, cast

from pydantic import BaseModel, ConfigDict, Field

from erag.core.errors import ConfigError
from erag.lm.adapter import Adapter, AdapterConfig
from erag.lm.blip import Blip, BlipConfig
from erag.lm.clip import Clip, ClipConfig
from erag.lm.committee import Committee, CommitteeConfig
from erag.lm.compose import compose
from erag.lm.cross import CrossEncoder, CrossEncoderConfig
from erag.lm.fake import Fake, FakeConfig
from erag.lm.ledger import Ledger
from erag.lm.llamacpp.backend import LlamaCpp
from erag.lm.llamacpp.config import LlamaCppConfig
from erag.lm.openai.backend import OpenAI
from erag.lm.openai.config import OpenAIRoles
from erag.lm.replay import Replay, ReplayConfig
from erag.lm.roles import LMBackend, Model, RoleName, Roles
from erag.lm.sentence import SentenceConfig, SentenceEmbedder
from erag.lm.signs import Signs, SignsConfig
from erag.lm.student import Student, StudentConfig
from erag.lm.tagger import Tagger, TaggerConfig
from erag.lm.textroles import TextRoles, TextRolesConfig
from erag.lm.torchlm import TorchLM, TorchLMConfig
from erag.lm.understanding import OtherGenerator, Understanding, UnderstandingConfig
from erag.lm.vlm import Vlm, VlmConfig
from erag.lm.weights import ModelStore


class LlamaCppRoles(LlamaCppConfig):
    """A GGUF model in llama.cpp, and how it plays the text roles (`text`)."""

    text: TextRolesConfig = TextRolesConfig()


class TorchLMRoles(TorchLMConfig):
    """A GGUF model in PyTorch, and how it plays the text roles (`text`)."""

    text: TextRolesConfig = TextRolesConfig()


CaptionerConfig = TaggerConfig | StudentConfig | ClipConfig | BlipConfig | VlmConfig | SignsConfig
ModelConfig = Annotated[
    SentenceConfig
    | LlamaCppRoles
    | TorchLMRoles
    | CaptionerConfig
    | AdapterConfig
    | CrossEncoderConfig
    | CommitteeConfig
    | UnderstandingConfig
    | OpenAIRoles
    | ReplayConfig
    | FakeConfig,
    Field(discriminator="kind"),
]
# What writes and judges text: every kind of model that generates and scores.
WriterConfig = Annotated[LlamaCppRoles | TorchLMRoles | FakeConfig, Field(discriminator="kind")]
_LEAVES: Mapping[type[BaseModel], Callable[[Any, ModelStore, Ledger | None], Model]] = {
    SentenceConfig: SentenceEmbedder,
    AdapterConfig: Adapter,
    CrossEncoderConfig: CrossEncoder,
    CommitteeConfig: Committee,
    TaggerConfig: Tagger,
    StudentConfig: Student,
    ClipConfig: Clip,
    BlipConfig: Blip,
    VlmConfig: Vlm,
}


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
    return compose(build_models(config, store, ledger), Roles(config.roles))


def build_models(config: BackendConfig, store: ModelStore, ledger: Ledger | None = None) -> dict[str, Model]:
    """The models of a configuration by their keys; nothing is loaded yet."""
    models = {
        key: _model(c, store, ledger) for key, c in config.models.items() if not isinstance(c, UnderstandingConfig)
    }
    students = {key: c for key, c in config.models.items() if isinstance(c, UnderstandingConfig)}
    return models | {key: Understanding(c, store, ledger, _other(key, c, models)) for key, c in students.items()}


def _other(key: str, config: UnderstandingConfig, models: Mapping[str, Model]) -> OtherGenerator | None:
    """The model that takes the prompts which a student of understanding does not."""
    if config.otherwise is None:
        return None
    able = [name for name, model in models.items() if "generate" in model.roles]
    if config.otherwise not in able:
        where = f"models.{key}.otherwise"
        raise ConfigError(
            f"no model {config.otherwise!r} that generates", where=where, allowed=", ".join(able) or "none"
        )
    return cast(OtherGenerator, models[config.otherwise])


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
        case ReplayConfig():
            return Replay(config)
        case OpenAIRoles():
            return OpenAI(config, ledger)
        case SignsConfig():
            return Signs(config, _model(config.captioner, store, ledger))
        case LlamaCppRoles() | TorchLMRoles():
            return TextRoles(text_engine(config, store, ledger), config.text, ledger)
        case _:
            return _LEAVES[type(config)](config, store, ledger)
