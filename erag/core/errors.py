"""Errors a user can act on: one line that says what, where, what is allowed and what repairs it."""

from __future__ import annotations


class EragError(Exception):
    """A wrong input or configuration. The command line prints it as one line and exits with code 2."""

    def __init__(self, what: str, *, where: str = "", allowed: str = "", repair: str = "") -> None:
        self.what, self.where, self.allowed, self.repair = what, where, allowed, repair
        super().__init__(self.line())

    def line(self) -> str:
        """The message as a single line, with control characters of hostile input made visible."""
        parts = [f"{self.where}: {self.what}" if self.where else self.what]
        if self.allowed:
            parts.append(f"allowed: {self.allowed}")
        if self.repair:
            parts.append(f"try: {self.repair}")
        return printable("; ".join(parts))


class InputError(EragError):
    """A file, record or argument that cannot be used."""


class ConfigError(EragError):
    """A configuration value that cannot be used."""


class MemoryFileError(EragError):
    """A memory file that is missing, foreign, damaged, of another version, or cannot be written."""


class MemoryLocked(MemoryFileError):
    """Another process is writing this memory file."""


class ModelError(EragError):
    """A model that is missing, fails its hash, or cannot be loaded."""


class RoleMissing(ModelError):
    """The configuration assigns no model to the role that was called."""


class BadModelOutput(EragError):
    """A model answered in a way that its role does not allow; nothing was padded or replaced."""


def printable(text: str, limit: int = 600) -> str:
    """`text` on one line: control characters escaped, at most `limit` characters."""
    shown = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    return shown if len(shown) <= limit else f"{shown[: limit - 1]}…"
