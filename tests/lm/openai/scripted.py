"""An HTTP server that answers as a script says, over real sockets: faults included."""

from __future__ import annotations

import json
import socketserver
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Turn:
    """One response: `cut` sends only so many bytes of the body, `slow` waits so many seconds before its last byte."""

    body: Any = None
    status: int = 200
    headers: tuple[tuple[str, str], ...] = ()
    cut: int | None = None
    slow: float = 0.0
    drop: bool = False
    length: bool = True


@dataclass
class Script:
    """What was asked, and where."""

    url: str = ""
    requests: list[tuple[str, dict[str, str], Any]] = field(default_factory=list)

    @property
    def bodies(self) -> list[Any]:
        return [body for _, _, body in self.requests]


def said(text: str, *, read: int = 10, wrote: int = 5, end: str = "stop", **message: Any) -> dict[str, Any]:
    """A chat completion."""
    choice = {"index": 0, "message": {"role": "assistant", "content": text, **message}, "finish_reason": end}
    return {"choices": [choice], "usage": {"prompt_tokens": read, "completion_tokens": wrote}}


@contextmanager
def scripted(turns: Sequence[Turn]) -> Iterator[Script]:
    """A server that gives `turns` one after the other, the last one again and again."""
    script, left, lock = Script(), list(turns), threading.Lock()

    class Handler(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            line = self.rfile.readline().decode()
            headers = {}
            while (raw := self.rfile.readline().decode().strip()) != "":
                name, _, value = raw.partition(":")
                headers[name.lower()] = value.strip()
            body = self.rfile.read(int(headers.get("content-length", 0)))
            with lock:
                script.requests.append((line.split()[1], headers, json.loads(body)))
                turn = left.pop(0) if len(left) > 1 else left[0]
            if not turn.drop:
                self._send(turn)

        def _send(self, turn: Turn) -> None:
            data = turn.body.encode() if isinstance(turn.body, str) else json.dumps(turn.body).encode()
            lines = [f"HTTP/1.1 {turn.status} said", *(f"{n}: {v}" for n, v in turn.headers), "Connection: close"]
            lines += [f"Content-Length: {len(data)}"] if turn.length else []
            kept = data if turn.cut is None else data[: turn.cut]
            try:
                self.wfile.write("\r\n".join([*lines, "", ""]).encode() + kept[:-1])
                self.wfile.flush()
                time.sleep(turn.slow)
                self.wfile.write(kept[-1:])
            except OSError:
                return  # the client did not wait

    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Handler) as server:
        server.daemon_threads = True
        script.url = f"http://127.0.0.1:{server.server_address[1]}/v1"
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
        thread.start()
        try:
            yield script
        finally:
            server.shutdown()
            thread.join()
