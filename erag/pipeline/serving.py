"""A configuration's models behind the OpenAI protocol."""

from __future__ import annotations

from erag.lm.compose import compose
from erag.lm.config import BackendConfig, build_models
from erag.lm.ledger import Ledger
from erag.lm.metered import Metered
from erag.lm.openai.protocol import Desk
from erag.lm.openai.server import OpenAIServer, ServerConfig
from erag.lm.roles import Roles
from erag.lm.textroles import TextRoles
from erag.lm.weights import ModelStore


def openai_server(
    backend: BackendConfig, store: ModelStore, server: ServerConfig | None = None, ledger: Ledger | None = None
) -> OpenAIServer:
    """A server, listening, of the models that play a role; each is loaded when it is first asked.

    Raises ConfigError where it cannot listen or roles do not fit.
    """
    ledger = ledger or Ledger()
    models = build_models(backend, store, ledger)
    composed = Metered(compose(models, Roles(backend.roles)), ledger)
    speaker = models.get(backend.roles.get("generate", ""))
    engine = speaker.engine if isinstance(speaker, TextRoles) else None
    return OpenAIServer(Desk(composed, backend.roles, engine), server)
