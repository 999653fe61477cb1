"""The HTTP server of `erag serve --openai`: loopback by default, bounded, one request at a time on the models."""

from __future__ import annotations

import hmac
import json
import os
import socket
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, ThreadPoolExecutor
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socketserver import TCPServer
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from erag.core.errors import ConfigError
from erag.lm.openai.config import is_loopback
from erag.lm.openai.protocol import Desk, Refused

Work = Callable[[], dict[str, Any]]
_CONNECTIONS = 64
_STOPPING = Refused(503, "stopping", "the server is stopping")


class ServerConfig(BaseModel):
    """Where the server listens and what it takes.

    `key_env` names the variable of the environment that holds the key clients have to send; it is needed for any host
    but this machine. `queue` requests may wait for the models; more are told to come again (429).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    host: str = "127.0.0.1"
    port: int = Field(8080, ge=0, le=65_535, description="0: any that is free")
    key_env: str | None = Field(None, pattern=r"^[A-Z_][A-Z0-9_]{0,63}$")
    max_body: int = Field(32 << 20, ge=1024, le=1 << 30, description="bytes")
    queue: int = Field(32, ge=1, le=1024)
    patience: float = Field(30, gt=0, le=600, description="seconds a client may take to send a request")


class OpenAIServer:
    """A listening server; `run` answers until `stop`. Raises ConfigError where it cannot listen."""

    def __init__(self, desk: Desk, config: ServerConfig | None = None) -> None:
        self._config = config or ServerConfig()
        if not is_loopback(self._config.host) and self._config.key_env is None:
            what = f"would be open to other machines at {self._config.host}"
            raise ConfigError(what, where="--host", allowed="127.0.0.1", repair="--key-env NAME_OF_A_VARIABLE")
        self._desk, self._key = desk, _key(self._config.key_env)
        self._turns = ThreadPoolExecutor(1, thread_name_prefix="models")  # first come, first served
        self._waiting = threading.BoundedSemaphore(self._config.queue + 1)
        try:
            self._http = _Listener((self._config.host, self._config.port), _handler(self))
        except (OSError, OverflowError) as error:
            where = f"{self._config.host}:{self._config.port}"
            raise ConfigError(f"cannot listen: {error}", where=where, repair="--port 0 for any free one") from error

    @property
    def url(self) -> str:
        """What a client is told as `base_url`."""
        host = f"[{self._config.host}]" if ":" in self._config.host else self._config.host
        return f"http://{host}:{self._http.server_address[1]}/v1"

    def run(self) -> None:
        """Answer requests until `stop` is called from elsewhere, or an interrupt comes."""
        try:
            self._http.serve_forever(poll_interval=0.1)
        finally:
            self._close()

    def stop(self) -> None:
        """End `run` in another thread: the request under way is finished, those that wait are told."""
        self._http.shutdown()

    def _close(self) -> None:
        self._turns.shutdown(wait=True, cancel_futures=True)
        self._http.server_close()

    def respond(self, method: str, path: str, headers: Mapping[str, str], body: bytes) -> dict[str, Any]:
        """The response to a request whose body was read. Raises Refused."""
        if method == "GET":
            if path != "/v1/models":
                raise Refused(404, "not_found", "no such path; known: /v1/models")
            return self._desk.models()
        if headers.get("Content-Type", "").partition(";")[0].strip().lower() != "application/json":
            raise Refused(415, "unsupported_media_type", "Content-Type has to be application/json")
        return self._in_turn(lambda: self._desk.answer(path, body))

    def admit(self, headers: Mapping[str, str]) -> None:
        """Raises Refused for a client without the key, or a page of a browser that found its way here."""
        if self._key and not hmac.compare_digest(
            headers.get("Authorization", "").encode(), f"Bearer {self._key}".encode()
        ):
            raise Refused(401, "invalid_api_key", "a key is needed: Authorization: Bearer …")
        name = headers.get("Host", "").rpartition(":")[0] or headers.get("Host", "")
        if not self._key and not is_loopback(name.strip("[]")):
            raise Refused(403, "forbidden", "this server answers requests to this machine by its own names only")

    def length(self, headers: Mapping[str, str]) -> int:
        """How long a body is. Raises Refused for one that does not say, or is too long."""
        told = headers.get("Content-Length", "")
        if not told.isascii() or not told.isdigit() or "Transfer-Encoding" in headers:
            raise Refused(411, "length_required", "Content-Length is needed")
        if len(told) > 12 or int(told) > self._config.max_body:
            raise Refused(413, "too_large", f"a body of {told[:20]} bytes; at most {self._config.max_body:,}")
        return int(told)

    @property
    def patience(self) -> float:
        return self._config.patience

    def _in_turn(self, work: Work) -> dict[str, Any]:
        if not self._waiting.acquire(blocking=False):
            raise Refused(429, "queue_full", f"{self._config.queue} requests wait already")
        try:
            return self._turns.submit(work).result()
        except (CancelledError, RuntimeError) as error:
            if isinstance(error, RuntimeError) and "shutdown" not in str(error):
                raise
            raise _STOPPING from None
        finally:
            self._waiting.release()


class _Listener(ThreadingHTTPServer):
    """A bounded number of connections, each in a thread."""

    daemon_threads = True  # one that sends nothing must not keep the server from stopping
    block_on_close = False
    allow_reuse_address = True

    def __init__(self, address: tuple[str, int], handler: type[BaseHTTPRequestHandler]) -> None:
        self.address_family = socket.AF_INET6 if ":" in address[0] else socket.AF_INET
        self._places = threading.BoundedSemaphore(_CONNECTIONS)
        super().__init__(address, handler)

    def server_bind(self) -> None:
        """As the base's, without looking up the name of this machine."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = str(self.server_address[0]), int(self.server_address[1])

    def process_request(self, request: Any, client_address: Any) -> None:
        if not self._places.acquire(blocking=False):
            self.shutdown_request(request)
            return
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._places.release()


class _Handler(BaseHTTPRequestHandler):
    """One request a connection, for the server a subclass names."""

    front: OpenAIServer
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "erag", ""

    def do_GET(self) -> None:
        self._respond("GET")

    def do_POST(self) -> None:
        self._respond("POST")

    def log_message(self, format: str, *arguments: Any) -> None:
        """Nothing: requests hold what a robot saw."""

    def _respond(self, method: str) -> None:
        try:
            status, body = HTTPStatus.OK.value, self._answer(method)
        except Refused as refusal:
            status = refusal.status
            body = {"error": {"message": refusal.line(), "type": refusal.code, "code": refusal.code}}
        except (TimeoutError, ConnectionError):
            self.close_connection = True
            return
        self._send(status, json.dumps(body, ensure_ascii=False).encode("utf-8", "replace"))

    def _answer(self, method: str) -> dict[str, Any]:
        headers: Mapping[str, str] = self.headers  # type: ignore[assignment]
        self.front.admit(headers)
        body = b""
        if method == "POST":
            length = self.front.length(headers)
            body = self.rfile.read(length)
            if len(body) < length:
                raise ConnectionResetError
        return self.front.respond(method, self.path, headers, body)

    def _send(self, status: int, body: bytes) -> None:
        self.close_connection = True
        try:
            self.send_response(status)
            self.send_header("Content-Type", "application/json; charset=utf-8")
            self.send_header("Content-Length", str(len(body)))
            self.send_header("Connection", "close")
            if status == HTTPStatus.TOO_MANY_REQUESTS:
                self.send_header("Retry-After", "1")
            self.end_headers()
            self.wfile.write(body)
        except OSError:
            return  # the client is gone; its answer interests nobody


def _handler(server: OpenAIServer) -> type[BaseHTTPRequestHandler]:
    """The class of handlers of one server."""
    return type("Handler", (_Handler,), {"front": server, "timeout": server.patience})


def _key(name: str | None) -> str:
    if name is None:
        return ""
    key = os.environ.get(name, "").strip()
    if not key:
        raise ConfigError("the environment has no key", where=name, repair=f"export {name}=…")
    return key
