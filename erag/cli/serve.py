"""The `serve` command: local models under the OpenAI protocol."""

from __future__ import annotations

import signal
from typing import Annotated

import typer

from erag.cli import show
from erag.cli.options import Config, Overrides, Preset


def register(app: typer.Typer) -> None:
    """Add this module's command to the command line."""
    app.command()(serve)


def serve(
    openai: Annotated[bool, typer.Option("--openai", help="offer the models under the OpenAI protocol")] = False,
    preset: Preset = "tiny",
    config: Config = None,
    overrides: Overrides = None,
    host: Annotated[str, typer.Option(help="where to listen")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="0: any that is free", min=0, max=65_535)] = 8080,
    key_env: Annotated[str | None, typer.Option(help="variable that holds the key clients have to send")] = None,
    max_body: Annotated[int, typer.Option(help="bytes of a request")] = 32 << 20,
) -> None:
    """Offer the models of a preset to other programs, until interrupted."""
    from erag.core.errors import ConfigError
    from erag.lm.ledger import Ledger
    from erag.lm.openai.server import ServerConfig
    from erag.lm.weights import default_store
    from erag.pipeline.config import load_config, validate
    from erag.pipeline.serving import openai_server

    if not openai:
        raise ConfigError("nothing to serve", where="erag serve", allowed="--openai")
    settings, ledger = load_config(preset, config, overrides or ()), Ledger()
    raw = {"host": host, "port": port, "key_env": key_env, "max_body": max_body}
    server = openai_server(settings.backend, default_store(), validate(ServerConfig, raw, "erag serve"), ledger)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    show.out(server.url)
    roles = ", ".join(f"{role}: {model}" for role, model in sorted(settings.backend.roles.items()))
    show.say(f"serving {roles}; Ctrl-C stops")
    try:
        server.run()
    except KeyboardInterrupt:
        show.say("stopped")
    for line in ledger.lines():
        show.say(line)
