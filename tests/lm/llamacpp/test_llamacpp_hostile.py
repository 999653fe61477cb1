"""Truncated and hostile model files: they may kill the child, never this process."""

import random
import struct
from collections.abc import Iterator
from pathlib import Path

import pytest

from erag.core.errors import ModelError
from erag.lm.llamacpp.probe import Candidate, Probe
from erag.lm.weights import ModelStore

pytestmark = pytest.mark.weights

MAGIC, STRING, ARRAY = b"GGUF", 8, 9


def text(value: bytes, length: int | None = None) -> bytes:
    return struct.pack("<Q", len(value) if length is None else length) + value


def header(tensors: int, entries: int, *parts: bytes, magic: bytes = MAGIC, version: int = 3) -> bytes:
    return magic + struct.pack("<IQQ", version, tensors, entries) + b"".join(parts)


ARCHITECTURE = text(b"general.architecture") + struct.pack("<I", STRING) + text(b"llama")
TENSOR = text(b"token_embd.weight") + struct.pack("<I", 2)
FORGED = {
    "no bytes": b"",
    "magic alone": MAGIC,
    "wrong magic": header(0, 0, magic=b"GGML"),
    "wrong version": header(0, 0, version=99),
    "nothing in it": header(0, 0),
    "absurd number of tensors": header(1 << 60, 1, ARCHITECTURE),
    "absurd number of entries": header(0, 1 << 60, ARCHITECTURE),
    "endless string": header(0, 1, text(b"general.architecture"), struct.pack("<I", STRING), text(b"llama", 1 << 62)),
    "endless array": header(0, 1, text(b"x"), struct.pack("<IIQ", ARRAY, 4, 1 << 40)),
    "unknown type": header(0, 1, text(b"x"), struct.pack("<I", 77)),
    "unknown architecture": header(0, 1, text(b"general.architecture"), struct.pack("<I", STRING), text(b"x" * 300)),
    "absurd tensor": header(1, 1, ARCHITECTURE, TENSOR, struct.pack("<QQIQ", 1 << 40, 1 << 40, 0, 0)),
    "tensor elsewhere": header(1, 1, ARCHITECTURE, TENSOR, struct.pack("<QQIQ", 64, 64, 0, 1 << 50)),
    "no vocabulary": header(0, 1, ARCHITECTURE),
    "random bytes": random.Random(0).randbytes(20_000),
    "random after magic": MAGIC + struct.pack("<I", 3) + random.Random(1).randbytes(20_000),
}


@pytest.fixture
def probe(tmp_path: Path) -> Probe:
    return Probe(tmp_path / "cache", seconds=120)


def refused(probe: Probe, path: Path) -> None:
    with pytest.raises(ModelError) as caught:
        probe.survive(Candidate("toy", path, path.name), "plain")
    assert str(path) in caught.value.line()
    assert caught.value.line().isprintable()


@pytest.mark.parametrize("name", FORGED)
def test_forged_files_are_refused(name: str, tmp_path: Path, probe: Probe, gguf: ModelStore) -> None:
    path = tmp_path / "forged.gguf"
    path.write_bytes(FORGED[name])
    refused(probe, path)


@pytest.mark.parametrize("size", [100, 100_000, 2_000_000, 50_000_000, -1])
def test_truncated_files_are_refused(size: int, tmp_path: Path, probe: Probe, gguf: ModelStore) -> None:
    path = tmp_path / "cut.gguf"
    path.write_bytes(gguf.path("smollm2-135m").read_bytes()[:size])
    refused(probe, path)


def damaged(whole: bytes) -> Iterator[bytes]:
    dice = random.Random(2)
    for _ in range(4):
        data = bytearray(whole)
        for _ in range(12):
            data[dice.randrange(1_500_000)] = dice.randrange(256)  # the metadata, the vocabulary, the tensor table
        yield bytes(data)


def test_damaged_files_end_in_an_answer_or_an_error(tmp_path: Path, probe: Probe, gguf: ModelStore) -> None:
    path = tmp_path / "damaged.gguf"
    ended = []
    for i, data in enumerate(damaged(gguf.path("smollm2-135m").read_bytes())):
        path.write_bytes(data)
        try:
            ended.append(probe.survive(Candidate("toy", path, str(i)), "plain").kernels)
        except ModelError as error:
            ended.append(error.line())
    assert all(end == "plain" or str(path) in end for end in ended)
    assert len(ended) == 4
