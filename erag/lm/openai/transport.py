"""One HTTP request to one host, from the standard library: no proxy, no redirect, a deadline, a bounded reply."""

from __future__ import annotations

import http.client
import os
import socket
import ssl
import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from urllib.parse import urlsplit

from erag.core.errors import EragError, ModelError
from erag.core.secrets import HIDDEN
from erag.lm.offline import permitted

MAX_REPLY = 64 * 1024 * 1024  # bytes
Connection = http.client.HTTPConnection


@dataclass(frozen=True, slots=True)
class Reply:
    """What a server said: `headers` by lower-case name; the key is taken out of `body` should it be there."""

    status: int
    headers: Mapping[str, str]
    body: str


class Unanswered(EragError):
    """No complete reply came; `sent` says that the server may have done the work."""

    def __init__(self, what: str, where: str, *, sent: bool) -> None:
        super().__init__(what, where=where)
        self.sent = sent


class Transport:
    """POST requests to `base_url`; the key is read from the environment for each request and kept nowhere."""

    def __init__(self, base_url: str, key_env: str | None, timeout: float) -> None:
        self.base_url, self._key_env, self._timeout = base_url, key_env, timeout
        parts = urlsplit(base_url)
        self._host, self._port, self._path = parts.hostname or "", parts.port, parts.path
        self._tls = ssl.create_default_context() if parts.scheme == "https" else None

    def post(self, path: str, payload: bytes) -> Reply:
        """The reply to JSON sent to `base_url` + `path`, whatever its status.

        Raises Unanswered where none came whole and in time, ModelError without a usable key.
        """
        key = self._key()
        headers = {"Content-Type": "application/json", "Accept": "application/json", "Connection": "close"}
        if key:
            headers["Authorization"] = f"Bearer {key}"
        connection = self._connect()
        clock = _Deadline(connection.sock, self._timeout)
        try:
            connection.request("POST", self._path + path, payload, headers)
            reply = _read(connection)
        except (OSError, http.client.HTTPException) as error:
            what = f"no answer within {self._timeout:g} s" if clock.over else f"the connection broke: {_name(error)}"
            raise Unanswered(what, self.base_url, sent=True) from None
        finally:
            clock.stop()
            connection.close()
        if clock.over:
            raise Unanswered(f"no answer within {self._timeout:g} s", self.base_url, sent=True)
        return Reply(reply.status, reply.headers, reply.body.replace(key, HIDDEN) if key else reply.body)

    def _connect(self) -> Connection:
        """An open connection; the only place of the package that reaches for another machine."""
        if self._tls is None:
            connection = Connection(self._host, self._port, timeout=self._timeout)
        else:
            connection = http.client.HTTPSConnection(self._host, self._port, timeout=self._timeout, context=self._tls)
        try:
            with permitted():
                connection.connect()
        except (OSError, UnicodeError) as error:
            connection.close()
            raise Unanswered(f"cannot be reached: {_name(error)}", self.base_url, sent=False) from None
        return connection

    def _key(self) -> str:
        """The key, or nothing where none is wanted. Its value is never part of an error."""
        if self._key_env is None:
            return ""
        key = os.environ.get(self._key_env, "").strip()
        repair = f"export {self._key_env}=…, or key_env: null for a server without keys"
        if not key:
            raise ModelError("the environment has no key", where=self._key_env, repair=repair)
        if not (key.isascii() and key.isprintable()) or " " in key:
            raise ModelError("the key has characters that no key has", where=self._key_env, repair=repair)
        return key


class _Deadline:
    """Shuts a socket down when its time is over, wherever the exchange stands."""

    def __init__(self, sock: socket.socket, seconds: float) -> None:
        self.over = False
        self._sock = sock
        self._timer = threading.Timer(seconds, self._end)
        self._timer.daemon = True
        self._timer.start()

    def stop(self) -> None:
        self._timer.cancel()

    def _end(self) -> None:
        self.over = True
        with suppress(OSError):
            self._sock.shutdown(socket.SHUT_RDWR)


def _read(connection: Connection) -> Reply:
    """The whole reply. Raises HTTPException for one that is cut short or too long."""
    response = connection.getresponse()
    body = response.read(MAX_REPLY + 1)
    if len(body) > MAX_REPLY:
        raise http.client.HTTPException(f"a reply of more than {MAX_REPLY:,} bytes")
    told = response.getheader("Content-Length")
    if told is not None and told.isdigit() and len(body) < int(told):
        raise http.client.IncompleteRead(body, int(told) - len(body))
    headers = {name.lower(): value for name, value in response.getheaders()}
    return Reply(response.status, headers, body.decode("utf-8", "replace"))


def _name(error: Exception) -> str:
    """What went wrong, without anything that was sent."""
    if isinstance(error, http.client.IncompleteRead):
        return "the answer was cut short"
    if isinstance(error, ssl.SSLCertVerificationError):
        return f"its certificate is not valid: {error.verify_message}"
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return type(error).__name__
