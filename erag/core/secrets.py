"""What must never be shown: values that are, or look like, keys and passwords."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

HIDDEN = "(hidden)"
_NAMES = re.compile(r"(?i)(^|_)(api_?key|key|key_env|token|secret|password|passwd|authorization|bearer)$")
_VALUES = re.compile(r"\b(?:sk|pk|rk|gsk|xai|hf|ghp|AIza)[-_][\w*.-]{6,}|(?<=//)[^/@\s]+(?=@)|(?i:\bbearer\s+)\S+")


def secret_name(name: object) -> bool:
    """Whether a value under this name is a secret."""
    return isinstance(name, str) and _NAMES.search(name) is not None


def without_secrets(value: Any, *known: str) -> Any:
    """`value` with secrets replaced: under telling names, of telling forms, in addresses, and the `known` ones."""
    if isinstance(value, Mapping):
        return {k: HIDDEN if secret_name(k) else without_secrets(v, *known) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [without_secrets(v, *known) for v in value]
    if not isinstance(value, str):
        return value
    for secret in known:
        value = value.replace(secret, HIDDEN) if secret else value
    return _VALUES.sub(HIDDEN, value)
