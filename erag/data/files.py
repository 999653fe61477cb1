"""Opening files of a source safely: regular files of bounded size inside the source's folder, as UTF-8 text."""

from __future__ import annotations

import stat
from pathlib import Path

from erag.core.errors import InputError
from erag.data.rows import IssueLog

MAX_FILE = 512 * 1024 * 1024  # bytes
MAX_REPLACED = 0.1  # share of characters that may be unreadable before a file is taken for binary
REPLACEMENT = "\ufffd"
_HEAD = 4096  # bytes read to recognise a format
_SHOWN = 200  # characters of a path in a message


def place(path: Path) -> str:
    """A path in a message: its end, if it is long."""
    shown = str(path)
    return shown if len(shown) <= _SHOWN else f"…{shown[1 - _SHOWN :]}"


def check_source(path: Path) -> None:
    """Refuse what cannot be a source: a missing path, an empty file, a pipe, socket or device. Raises InputError."""
    try:
        mode = path.stat()
    except FileNotFoundError:
        raise InputError("there is no such file or folder", where=place(path)) from None
    except OSError as error:
        raise InputError(f"cannot be opened: {error.strerror}", where=place(path)) from None
    except ValueError:
        raise InputError("cannot be opened: no file can have this name", where=place(path)) from None
    if stat.S_ISDIR(mode.st_mode):
        return
    if not stat.S_ISREG(mode.st_mode):
        raise InputError("is a pipe, socket or device", where=place(path), allowed="a regular file or a folder")
    if mode.st_size == 0:
        raise InputError("the file is empty", where=place(path))


def inside(root: Path, path: Path) -> bool:
    """Whether `path`, with its symbolic links followed, lies in the folder `root`."""
    try:
        return path.resolve().is_relative_to(root.resolve())
    except (OSError, RuntimeError, ValueError):  # a loop of links, a name too long, a byte that no name can have
        return False


def head(path: Path) -> str:
    """The first kilobytes of a file, for sniffing; empty for a folder."""
    if not path.is_file():
        return ""
    with path.open("rb") as file:
        return file.read(_HEAD).decode("utf-8-sig", "replace")


def source_name(path: Path) -> str:
    """The last two parts of a path: the name of a source, the same on every machine."""
    full = path.absolute()
    return f"{full.parent.name}/{full.name}".lstrip("/")


def read_raw(path: Path, root: Path | None = None) -> bytes:
    """The bytes of a regular file; with `root`, only if the file lies in that folder. Raises InputError."""
    if root is not None and not inside(root, path):
        raise InputError("a symbolic link leads out of the folder", where=place(path), allowed=f"files in {root}")
    check_source(path)
    try:
        size = path.stat().st_size
        if size > MAX_FILE:
            raise InputError(f"the file has {size:,} bytes", where=place(path), allowed=f"at most {MAX_FILE:,}")
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=place(path)) from None


def read_text(path: Path, log: IssueLog, root: Path | None = None) -> str:
    """The text of a UTF-8 file, without a byte order mark, with `\\n` at line ends. Raises InputError as `read_raw`."""
    text = decode(read_raw(path, root), log)
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def read_optional(path: Path, log: IssueLog, root: Path) -> str:
    """The text of a file that need not be there; empty, and reported, if it is there and cannot be read."""
    if not path.exists() and not path.is_symlink():
        return ""
    try:
        return read_text(path, log, root)
    except InputError as error:
        log.add(None, error.what, "not read")
        return ""


def decode(raw: bytes, log: IssueLog) -> str:
    """UTF-8 bytes as text. Single bad bytes become U+FFFD and an issue; raises InputError for another encoding."""
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        first = error.start + (3 if raw.startswith(b"\xef\xbb\xbf") else 0)  # offsets count after the mark
    text = raw.decode("utf-8-sig", "replace")
    bad = text.count(REPLACEMENT)
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")) or bad > MAX_REPLACED * len(text):
        what = f"not UTF-8 text: byte {first} (0x{raw[first]:02x})"
        raise InputError(what, where=log.file, repair="save the file as UTF-8")
    line = raw.count(b"\n", 0, first) + 1
    log.add(line, f"{bad} places that are not UTF-8, the first at byte {first}", f"read as {REPLACEMENT}")
    return text


class Lines:
    """Line numbers of offsets in a text, each found by counting on from the last one asked for."""

    def __init__(self, text: str) -> None:
        self._text, self._pos, self._line = text, 0, 1

    def at(self, pos: int) -> int:
        """The line, from 1, that the character at `pos` stands on."""
        if pos >= self._pos:
            self._line += self._text.count("\n", self._pos, pos)
        else:
            self._line -= self._text.count("\n", pos, self._pos)
        self._pos = pos
        return self._line
