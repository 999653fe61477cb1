"""How runs are logged to Weights & Biases: on this machine, in silence, and without telling about the machine."""

from __future__ import annotations

from typing import Any


def offline_settings() -> Any:
    """The `wandb.Settings` of every run. Raises ImportError where wandb is not installed."""
    import wandb

    return wandb.Settings(
        mode="offline", silent=True, console="off", disable_git=True, save_code=False, x_disable_stats=True,
        x_disable_meta=True,
    )  # fmt: skip
