"""Keeps model libraries, and everything else, off the network. The first must run before their first import."""

from __future__ import annotations

import ipaddress
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from erag.core.errors import EragError

_OFFLINE = {"HF_HUB_OFFLINE": "1", "TRANSFORMERS_OFFLINE": "1", "HF_DATASETS_OFFLINE": "1", "WANDB_MODE": "offline"}
_OPEN: ContextVar[bool] = ContextVar("may connect", default=False)  # in this thread, for the block of `permitted`
_REACHING = frozenset({"socket.connect", "socket.sendto", "socket.sendmsg"})


class Offline(EragError, OSError):
    """Something tried to reach another machine; to libraries it is a network that cannot be reached."""


def go_offline() -> None:
    """Tell the hub clients, through the environment they read at import, that there is no network."""
    os.environ.update(_OFFLINE)


def forbid_network() -> None:
    """From now on this process connects to no other machine, but for blocks of `permitted`; it cannot be undone.

    Native code is out of its reach: what holds for that is tested in a namespace without a network.
    """
    sys.addaudithook(_watch)


@contextmanager
def permitted() -> Iterator[None]:
    """A block, in this thread, that may connect: for the one backend whose purpose it is."""
    token = _OPEN.set(True)
    try:
        yield
    finally:
        _OPEN.reset(token)


def _watch(event: str, arguments: tuple[Any, ...]) -> None:
    if _OPEN.get():
        return
    if event in _REACHING and not _is_here(arguments[-1]):
        raise Offline("erag works offline: a connection was refused", where=event, allowed="the `openai` backend")
    if event == "socket.getaddrinfo" and arguments[0] and not _is_here((arguments[0],)):
        raise Offline("erag works offline: a name was not looked up", where=event, allowed="the `openai` backend")


def _is_here(address: object) -> bool:
    """Whether an address is of this machine; local sockets are named by a path."""
    if not isinstance(address, tuple) or not address:
        return True
    host = address[0].decode("ascii", "replace") if isinstance(address[0], bytes) else str(address[0])
    try:
        return host in ("", "localhost") or ipaddress.ip_address(host.partition("%")[0]).is_loopback
    except ValueError:
        return False
