"""llama.cpp itself: imported on first use, kept silent, its last complaint kept."""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from erag.core.errors import ModelError
from erag.core.text import content_hash

PACKAGE = "llama-cpp-python"
_ERROR = 3  # GGML_LOG_LEVEL_ERROR
_KEPT = 400  # characters of a complaint
_SPIN = {"GOMP_SPINCOUNT": "1000"}


class _Complaints(threading.local):
    """The last error line that llama.cpp logged in this thread."""

    last: str = ""


_complaints = _Complaints()


@lru_cache(maxsize=1)
def llama() -> Any:
    """The low-level bindings, initialised and silent. Raises ModelError when the package is not installed."""
    try:
        with _short_spin():
            import llama_cpp.llama_cpp as library
    except ImportError as error:
        repair = "pip install 'erag[llamacpp]'"
        raise ModelError(f"{PACKAGE} is not installed ({error})", where="llamacpp", repair=repair) from error
    _listen(library)
    library.llama_backend_init()
    return library


def library_version() -> str | None:
    """The installed version of the package, without importing it; None when it is not installed."""
    try:
        return version(PACKAGE)
    except PackageNotFoundError:
        return None


@lru_cache(maxsize=1)
def library_stamp() -> str:
    """Version, sizes and times of the installed native files: another build of the same version has another stamp."""
    spec = find_spec("llama_cpp")
    folders = [Path(folder) / "lib" for folder in (spec.submodule_search_locations or ())] if spec else []
    files = sorted(file for folder in folders if folder.is_dir() for file in folder.iterdir() if file.is_file())
    stamps = [f"{file.name}:{file.stat().st_size}:{file.stat().st_mtime_ns}" for file in files]
    return content_hash(library_version() or "", *stamps).hex()


def complaint() -> str:
    """What llama.cpp logged last as an error in this thread; it is forgotten by being read."""
    last, _complaints.last = _complaints.last, ""
    return last


@contextmanager
def _short_spin() -> Iterator[None]:
    """While the library is loaded, tell OpenMP that threads give up their CPU after about 0.1 ms of waiting.

    It waits far longer by itself; with another process at work on one of two CPUs that was 5 to 10 times slower.
    OpenMP reads this only as it is loaded; what the user has set is left alone.
    """
    ours = {name: value for name, value in _SPIN.items() if not {name, "OMP_WAIT_POLICY"} & set(os.environ)}
    os.environ.update(ours)
    try:
        yield
    finally:
        for name in ours:
            del os.environ[name]


def _listen(library: Any) -> None:
    """Send llama.cpp's log to `_keep` instead of stderr. The callback lives as long as the process."""
    global _callback
    _callback = library.llama_log_callback(_keep)
    library.llama_log_set(_callback, ctypes.c_void_p(0))


_callback: Any = None  # the native side holds a bare pointer to it


def watch(*setters: Any) -> None:
    """Send the logs of further native libraries (their `…_log_set`) to where llama.cpp's go."""
    for setter in setters:
        setter(_callback, ctypes.c_void_p(0))


def _keep(level: int, text: bytes | None, data: object) -> None:
    del data
    if level == _ERROR and text:
        _complaints.last = text.decode("utf-8", "replace").strip()[:_KEPT]
