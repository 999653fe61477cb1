"""A key is sent to its host and is nowhere else: no error, journal, log, ledger, fingerprint or configuration."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from scripted import Turn, said, scripted

from erag.cli.main import run
from erag.core.errors import ConfigError, EragError, ModelError
from erag.core.secrets import without_secrets
from erag.lm.compose import compose
from erag.lm.journal import Journal
from erag.lm.ledger import Ledger
from erag.lm.openai.backend import OpenAI
from erag.lm.openai.config import OpenAIRoles
from erag.lm.roles import ROLES, Prompt, Roles
from erag.memory.file import MemoryFile
from erag.pipeline.config import PipelineConfig, load_config, validate

KEY = "sk-proj-abcdefghijklmnop0123456789"
ASK = Prompt((("user", "hello"),), max_tokens=8)


def test_a_key_reaches_its_host_and_no_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MY_KEY", KEY)
    echo = {"error": {"message": f"Incorrect API key provided: {KEY}; also {KEY[:9]}*******6789"}}
    ledger = Ledger()
    with scripted([Turn(said(f"your key is {KEY}")), Turn(echo, 401)]) as script:
        config = OpenAIRoles(model="m", base_url=script.url, key_env="MY_KEY")
        model = OpenAI(config, ledger)
        backend = compose({"m": model}, Roles(dict.fromkeys(ROLES, "m")))
        with MemoryFile.writing(tmp_path / "m.erag", "test", create=True) as memory:
            journal = Journal(backend, memory.calls, ledger)
            assert journal.generate([ASK])[0].text == "your key is (hidden)"
            with pytest.raises(ModelError) as caught:
                journal.generate([Prompt((("user", "again"),))])
    assert script.requests[0][1]["authorization"] == f"Bearer {KEY}"
    assert "a valid key in MY_KEY" in caught.value.line()
    shown = [caught.value.line(), repr(caught.value.__cause__), *ledger.lines(), config.model_dump_json(), repr(config)]
    shown += [model.fingerprint(role) + model.identity(role) for role in ROLES]
    assert all(KEY not in text and "6789" not in text for text in shown)
    assert KEY.encode() not in (tmp_path / "m.erag").read_bytes()


@pytest.mark.parametrize("value", ["", "  ", "two words", "line\nbreak", "clé-secrète"])
def test_a_key_that_is_none_is_not_shown(value: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MY_KEY", value)
    with scripted([Turn(said("x"))]) as script:
        config = OpenAIRoles(model="m", base_url=script.url, key_env="MY_KEY")
        with pytest.raises(ModelError, match=r"^MY_KEY: ") as caught:
            OpenAI(config).generate([ASK])
        assert not script.requests
    assert "secr" not in caught.value.line()
    assert "words" not in caught.value.line()


@pytest.mark.parametrize(
    "override",
    [
        f"backend.models.m={{kind: openai, model: m, api_key: {KEY}}}",
        f"backend.models.m={{kind: openai, model: m, key_env: {KEY}}}",
        "backend.models.m={kind: openai, model: m, key_env: plainsecret123}",
        f"backend.models.m={{kind: openai, model: m, base_url: 'https://user:{KEY}@example.org/v1'}}",
        f"backend.models.m={{kind: nonsense, api_key: {KEY}}}",
        f"backend.models.m={{kind: openai, api_key: {KEY}}}",
    ],
)
def test_a_key_in_the_configuration_is_refused_unseen(override: str) -> None:
    with pytest.raises(EragError) as caught:
        load_config("tiny", None, [override])
    assert "abcdefgh" not in caught.value.line()
    assert "plainsecret" not in caught.value.line()
    assert caught.value.__cause__ is None  # the validator's own message would have it


def test_the_command_line_does_not_repeat_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["serve", "--openai", "--set", f"backend.models.m.api_key={KEY}"]) == 2
    assert run(["serve", "--openai", "--set", f"backend.models.x={{kind: openai, model: m, token: {KEY}}}"]) == 2
    assert "abcdefgh" not in "".join(capsys.readouterr())


def test_secrets_are_taken_out_of_any_text() -> None:
    raw = {"api_key": "x", "a": [f"Bearer {KEY}", "https://u:p@h/v1"], "key_env": "K", "monkey": "chimp"}
    shown = {
        "api_key": "(hidden)",
        "a": ["(hidden)", "https://(hidden)@h/v1"],
        "key_env": "(hidden)",
        "monkey": "chimp",
    }
    assert without_secrets(raw) == shown
    assert without_secrets("say tomato and to", "tomato") == "say (hidden) and to"


def test_the_configuration_saved_with_a_run_has_no_key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MY_KEY", KEY)
    raw = {"backend": {"models": {"m": {"kind": "openai", "model": "m", "key_env": "MY_KEY"}}, "roles": {"embed": "m"}}}
    saved = validate(PipelineConfig, raw, "test").model_dump(mode="json")
    assert KEY not in json.dumps(saved)
    assert validate(PipelineConfig, saved, "saved").backend.models["m"].key_env == "MY_KEY"  # type: ignore[union-attr]


GUARDED = """
import socket, sys, threading
from erag.lm.offline import Offline, forbid_network, permitted
forbid_network()
def refused(act):
    try: act()
    except Offline: return True
    return False
def away(): socket.create_connection(("192.0.2.1", 9), timeout=0.2)
def datagram(): socket.socket(socket.AF_INET, socket.SOCK_DGRAM).sendto(b"x", ("192.0.2.1", 9))
def name(): socket.getaddrinfo("example.org", 80)
with socket.create_server(("127.0.0.1", 0)) as here:
    socket.create_connection(here.getsockname()[:2]).close()
    socket.create_connection(("localhost", here.getsockname()[1])).close()
outcomes = [refused(away), refused(datagram), refused(name)]
with permitted():
    other = []
    thread = threading.Thread(target=lambda: other.append(refused(away))); thread.start(); thread.join()
    try: socket.create_connection(("192.0.2.1", 9), timeout=0.05)
    except Offline: outcomes.append(False)
    except OSError: outcomes.append(True)
print(outcomes + other)
"""


def test_only_a_permitted_block_of_its_own_thread_reaches_another_machine() -> None:
    made = subprocess.run([sys.executable, "-c", GUARDED], capture_output=True, text=True, check=True, timeout=60)
    assert made.stdout.strip() == "[True, True, True, True, True]"


CLIENT = """
import sys
reached = []
def watch(event, arguments):
    if event == "socket.connect": reached.append(arguments[1])
    if event == "socket.getaddrinfo": reached.append((arguments[0], arguments[1]))
sys.addaudithook(watch)
from erag.lm.offline import forbid_network
from erag.lm.openai.backend import OpenAI
from erag.lm.openai.config import OpenAIRoles
from erag.lm.roles import Prompt
forbid_network()
OpenAI(OpenAIRoles(model="m", base_url=sys.argv[1], key_env=None)).generate([Prompt((("user", "x"),))])
print(sorted(set(reached)))
"""


def test_the_client_connects_to_its_host_and_nothing_else() -> None:
    proxies = {
        "http_proxy": "http://192.0.2.1:9",
        "HTTPS_PROXY": "http://192.0.2.1:9",
        "ALL_PROXY": "http://192.0.2.1:9",
    }
    with scripted([Turn(said("x"))]) as script:
        port = int(script.url.split(":")[2].split("/")[0])
        command = [sys.executable, "-c", CLIENT, script.url]
        made = subprocess.run(
            command, capture_output=True, text=True, timeout=60, env={**proxies, "PYTHONPATH": ":".join(sys.path)}
        )
    assert made.stdout.strip() == str([("127.0.0.1", port)]), made.stderr


def test_a_key_for_another_machine_needs_tls() -> None:
    with pytest.raises(ConfigError, match="over https only"):
        validate(OpenAIRoles, {"model": "m", "base_url": "http://192.0.2.1/v1"}, "test")
    assert (
        validate(OpenAIRoles, {"model": "m", "base_url": "http://localhost:1/v1"}, "test").key_env == "OPENAI_API_KEY"
    )
