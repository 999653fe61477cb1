"""Keeps model libraries off the network. Must run before their first import."""

from __future__ import annotations

import os

_OFFLINE = {"HF_HUB_OFFLINE": "1", "TRANSFORMERS_OFFLINE": "1", "HF_DATASETS_OFFLINE": "1", "WANDB_MODE": "offline"}


def go_offline() -> None:
    """Tell the hub clients, through the environment they read at import, that there is no network."""
    os.environ.update(_OFFLINE)
