"""Our server under the OpenAI protocol, asked by our client and by plain requests over real HTTP."""

import http.client
import json
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from erag.core.errors import BadModelOutput, ConfigError, InputError, ModelError
from erag.lm.compose import compose
from erag.lm.config import BackendConfig
from erag.lm.fake import Fake
from erag.lm.openai.backend import OpenAI
from erag.lm.openai.config import OpenAIRoles
from erag.lm.openai.protocol import Desk
from erag.lm.openai.server import OpenAIServer, ServerConfig
from erag.lm.roles import ROLES, Generation, Group, Prompt, Roles, SelectTask
from erag.lm.weights import ModelStore, default_store
from erag.pipeline.serving import openai_server

FAKE = BackendConfig.model_validate({"models": {"fake": {"kind": "fake"}}, "roles": dict.fromkeys(ROLES, "fake")})
TEXTS = ["a bench", "ein Fluß", "川 and 🌉"]


@contextmanager
def serving(server: OpenAIServer) -> Iterator[OpenAIServer]:
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.stop()
        thread.join(timeout=10)
        assert not thread.is_alive()


@pytest.fixture
def server() -> Iterator[OpenAIServer]:
    with serving(openai_server(FAKE, default_store(), ServerConfig(port=0))) as running:
        yield running


def client(server: OpenAIServer, model: str = "fake", **raw: Any) -> OpenAI:
    known = {"model": model, "base_url": server.url, "key_env": None, "structured": "full", "retries": 0}
    return OpenAI(OpenAIRoles.model_validate({**known, **raw}))


def asked(server: OpenAIServer, method: str, path: str, body: Any = None, **headers: str) -> tuple[int, Any]:
    """A plain request: the status and the JSON of its response."""
    port = int(server.url.rsplit(":", 1)[1].split("/")[0])
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    data = body if isinstance(body, bytes) else json.dumps(body).encode()
    connection.request(
        method, path, data if method == "POST" else None, {"Content-Type": "application/json", **headers}
    )
    response = connection.getresponse()
    found = json.loads(response.read())
    connection.close()
    return response.status, found


def test_every_role_gives_over_http_what_it_gives_directly(server: OpenAIServer, tmp_path: Path) -> None:
    pillow = pytest.importorskip("PIL.Image")
    pillow.new("RGB", (8, 8)).save(tmp_path / "a.png")
    cloud, local = client(server), Fake()
    assert np.allclose(cloud.embed(TEXTS, "query"), local.embed(TEXTS, "query"), atol=1e-6)
    prompts = [Prompt((("user", f"say {text}"),), max_tokens=3) for text in TEXTS]
    assert cloud.generate(prompts) == local.generate(prompts)
    schema = {"type": "object", "properties": {"n": {"type": "integer", "minimum": 3}}, "required": ["n"]}
    assert cloud.generate([Prompt((("user", "x"),), schema)])[0].text == '{"n": 3}'
    (caption,) = cloud.caption([tmp_path / "a.png"])
    assert caption.text.startswith("A view numbered ")
    (summary,) = cloud.summarise([Group(("a bench",))])
    assert summary.name == "xxx"  # the smallest text of the schema
    assert cloud.select([SelectTask("sit", ("a", "b", "c"))], 2) == [[0, 1]]


def test_models_are_listed_with_their_roles(server: OpenAIServer) -> None:
    status, body = asked(server, "GET", "/v1/models")
    assert status == 200
    assert [(m["id"], m["roles"]) for m in body["data"]] == [("fake", sorted(ROLES))]


def test_a_model_that_is_not_served_is_named(server: OpenAIServer) -> None:
    with pytest.raises(ModelError, match=r"404: no model 'gpt-4o' for this; fake plays the role 'generate'"):
        client(server, "gpt-4o").generate([Prompt((("user", "x"),))])


def test_a_role_that_nobody_plays_is_named() -> None:
    embed = BackendConfig.model_validate({"models": {"fake": {"kind": "fake"}}, "roles": {"embed": "fake"}})
    with serving(openai_server(embed, default_store(), ServerConfig(port=0))) as running:
        with pytest.raises(ModelError, match="404: no model here plays the role 'generate'"):
            client(running, "erag").generate([Prompt((("user", "x"),))])
        assert client(running, "erag").embed(["x"], "query").shape == (1, 64)


CHAT = {"model": "fake", "messages": [{"role": "user", "content": "hello there"}]}


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"stream": True}, "stream"), ({"n": 2}, "n: "), ({"tools": []}, "tools"), ({"logprobs": True}, "logprobs"),
        ({"messages": []}, "messages"), ({"messages": [{"role": "tool", "content": "x"}]}, "role"),
        ({"max_tokens": 0}, "max_tokens"), ({"response_format": {"type": "json_object"}}, "response_format"),
        ({"response_format": {"type": "json_schema", "json_schema": {"schema": {"type": "object"}}},
          "messages": [{"role": "user", "content": [{"type": "image_url", "image_url": {"url": "https://a/b.jpg"}}]}]},
         "nothing is fetched"),
    ],
)  # fmt: skip
def test_what_would_be_answered_otherwise_is_refused(server: OpenAIServer, change: dict[str, Any], told: str) -> None:
    status, body = asked(server, "POST", "/v1/chat/completions", {**CHAT, **change})
    assert status == 400
    assert told in body["error"]["message"]


@pytest.mark.parametrize(
    ("body", "headers", "status"),
    [
        (b"{", {}, 400), (b"\xff", {}, 400), (b"[" * 100_000, {}, 400), (b"{}", {"Content-Type": "text/plain"}, 415),
        (b"{}", {"Content-Length": "x"}, 411), (b"{}", {"Content-Length": "99999999999"}, 413),
        (b"{}", {"Host": "evil.example:80"}, 403),
    ],
)  # fmt: skip
def test_hostile_requests_get_one_line(server: OpenAIServer, body: bytes, headers: dict[str, str], status: int) -> None:
    found, said = asked(server, "POST", "/v1/chat/completions", body, **headers)
    assert found == status
    assert set(said) == {"error"}


def test_other_paths_and_methods(server: OpenAIServer) -> None:
    assert asked(server, "POST", "/v1/files", {})[0] == 404
    assert asked(server, "GET", "/etc/passwd")[0] == 404
    assert asked(server, "POST", "/v1/embeddings", {"model": "fake", "input": ["a", " "]})[0] == 400


def test_an_unknown_field_makes_no_difference(server: OpenAIServer) -> None:
    status, body = asked(server, "POST", "/v1/chat/completions", {**CHAT, "user": "u", "temperature": 1})
    assert (status, body["choices"][0]["message"]["content"]) == (200, "hello there")
    parts = [{"type": "text", "text": "one"}, {"type": "text", "text": "two"}]
    again = {**CHAT, "messages": [{"role": "user", "content": parts}]}
    assert asked(server, "POST", "/v1/chat/completions", again)[1]["choices"][0]["message"]["content"] == "one two"


def test_vectors_as_base64(server: OpenAIServer) -> None:
    import base64

    request = {"model": "fake", "input": "a bench", "encoding_format": "base64"}
    _, body = asked(server, "POST", "/v1/embeddings", request)
    row = np.frombuffer(base64.b64decode(body["data"][0]["embedding"]), "<f4")
    assert np.array_equal(row, Fake().embed(["a bench"], "document")[0])


class Slow(Fake):
    """Waits until it is let go; counts how many are at work at once."""

    def __init__(self) -> None:
        super().__init__()
        self.begun, self.go = threading.Semaphore(0), threading.Event()
        self.at_work = self.most = 0

    def generate(self, prompts: Sequence[Prompt]) -> list[Generation]:
        self.at_work += 1
        self.most = max(self.most, self.at_work)
        self.begun.release()
        assert self.go.wait(10)
        self.at_work -= 1
        return super().generate(prompts)


def desk(model: Fake) -> Desk:
    roles = dict.fromkeys(ROLES, "fake")
    return Desk(compose({"fake": model}, Roles(roles)), roles)


def test_models_answer_one_at_a_time_and_a_full_queue_says_when_to_come_again() -> None:
    slow = Slow()
    done: list[int] = []
    with serving(OpenAIServer(desk(slow), ServerConfig(port=0, queue=1))) as running:
        threads = [
            threading.Thread(target=lambda: done.append(asked(running, "POST", "/v1/chat/completions", CHAT)[0]))
            for _ in range(2)
        ]
        for thread in threads:
            thread.start()
        assert slow.begun.acquire(timeout=10)
        for _ in range(1000):  # the second waits in the queue, sooner or later
            status, body = asked(running, "POST", "/v1/chat/completions", CHAT) if running_full(running) else (0, {})
            if status:
                break
            threading.Event().wait(0.01)
        assert (status, body["error"]["code"]) == (429, "queue_full")
        assert asked(running, "GET", "/v1/models")[0] == 200  # needs no model
        slow.go.set()
        for thread in threads:
            thread.join(timeout=10)
    assert done == [200, 200]
    assert slow.most == 1


def running_full(server: OpenAIServer) -> bool:
    """Whether no place is left in the queue."""
    free = server._waiting.acquire(blocking=False)
    if free:
        server._waiting.release()
    return not free


def test_a_model_that_fails_is_told_from_a_request_that_is_wrong() -> None:
    class Broken(Fake):
        def generate(self, prompts: Sequence[Prompt]) -> list[Generation]:
            raise BadModelOutput("no JSON in it")

        def embed(self, texts: Sequence[str], kind: str) -> Any:
            raise ModelError("weights are missing", repair="erag models pull x")

    with serving(OpenAIServer(desk(Broken()), ServerConfig(port=0))) as running:
        with pytest.raises(BadModelOutput, match="no JSON in it"):
            client(running).generate([Prompt((("user", "x"),))])
        with pytest.raises(ModelError, match="status 503: weights are missing; try: erag models pull x"):
            client(running).embed(["x"], "query")


def test_likelihoods_need_a_language_model(server: OpenAIServer) -> None:
    text = {"selector": "likelihood", "scorer": "likelihood"}
    with pytest.raises(ModelError, match="404: the model that generates measures no likelihoods"):
        client(server, likelihoods="extension", text=text).score([("sit", "a bench")])


@pytest.mark.weights
def test_a_local_model_scores_over_http_as_directly(smollm2: ModelStore) -> None:
    raw = {"kind": "torchlm", "model": "smollm2-135m"}
    roles = {role: "smol" for role in ("summarise", "select", "score", "generate")}
    backend = BackendConfig.model_validate({"models": {"smol": raw}, "roles": roles})
    pairs = [("Where can I sit?", "A wooden bench."), ("Where can I sit?", "A fire hydrant.")]
    from erag.lm.config import build_backend

    with serving(openai_server(backend, smollm2, ServerConfig(port=0))) as running:
        text = {"selector": "likelihood", "scorer": "likelihood"}
        cloud = client(running, "smol", likelihoods="extension", text=text)
        local = build_backend(backend, smollm2)
        assert np.allclose(cloud.score(pairs), local.score(pairs), atol=1e-6)
        tasks = [SelectTask("Where can I sit?", tuple(card for _, card in pairs))]
        assert cloud.select(tasks, 1) == local.select(tasks, 1)
        groups = [Group(("A bench by a pond.",), ("often: bench, pond",))]
        assert cloud.summarise(groups) == local.summarise(groups)


def test_other_machines_are_let_in_with_a_key_only(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ConfigError, match="would be open to other machines"):
        OpenAIServer(desk(Fake()), ServerConfig(host="0.0.0.0", port=0))
    monkeypatch.setenv("OURS", "s3cret-key")
    with serving(OpenAIServer(desk(Fake()), ServerConfig(port=0, key_env="OURS"))) as running:
        assert asked(running, "POST", "/v1/chat/completions", CHAT)[0] == 401
        assert asked(running, "GET", "/v1/models", Authorization="Bearer wrong")[0] == 401
        assert client(running, key_env="OURS").generate([Prompt((("user", "hi"),))])[0].text == "hi"


def test_a_port_that_is_taken_is_one_line(server: OpenAIServer) -> None:
    port = int(server.url.rsplit(":", 1)[1].split("/")[0])
    with pytest.raises(ConfigError, match=r"cannot listen.*--port 0"):
        OpenAIServer(desk(Fake()), ServerConfig(port=port))


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_the_command_serves_until_it_is_stopped(fake_config: Path, stop: signal.Signals) -> None:
    command = [sys.executable, "-m", "erag.cli.main", "serve", "--openai", "--config", str(fake_config), "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        url = process.stdout.readline().strip()
        config = OpenAIRoles(model="fake", base_url=url, key_env=None)
        assert OpenAI(config).embed(["a bench"], "query").shape == (1, 64)
        process.send_signal(stop)
        out, err = process.communicate(timeout=20)
    assert (process.returncode, out) == (0, "")
    assert "embed: 1 computed" in err


def test_serve_says_what_it_can_serve() -> None:
    from erag.cli.main import run

    assert run(["serve"]) == 2


def test_a_bad_image_is_named_as_the_image(server: OpenAIServer) -> None:
    del server

    class Eyes(Fake):
        def caption(self, images: Sequence[Path]) -> Any:
            raise InputError("is no image", where=str(images[0]))

    with serving(OpenAIServer(desk(Eyes()), ServerConfig(port=0))) as running:
        part = {"type": "image_url", "image_url": {"url": "data:image/png;base64,AAAA"}}
        body = {**CHAT, "messages": [{"role": "user", "content": [part]}]}
        status, found = asked(running, "POST", "/v1/chat/completions", body)
    assert (status, found["error"]["message"]) == (400, "the image: is no image")
