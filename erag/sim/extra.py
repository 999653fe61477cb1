"""The extra `sim`: what the renderer needs and a plain installation has not."""

from __future__ import annotations

from importlib.util import find_spec

from erag.core.errors import ConfigError

NEEDED = ("pybullet", "PIL")


def require() -> None:
    """Raises ConfigError, with the command that repairs it, where the extra `sim` is not installed."""
    missing = next((name for name in NEEDED if find_spec(name) is None), None)
    if missing is not None:
        raise ConfigError(f"{missing} is not installed", where="erag sim", repair="pip install 'erag[sim]'")
