"""Reading GGUF files, whole and hostile."""

import struct
from pathlib import Path

import gguf
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from torchlm_worlds import LLAMA, Tiny, smaller, weights, write_gguf

from erag.core.errors import ModelError
from erag.lm.torchlm.container import Container, open_container
from erag.lm.torchlm.shape import shape_of

SMALL = smaller(LLAMA, layers=1, width=8, heads=2, kv_heads=1, head=4, inner=8)


def head(entries: int = 0, tensors: int = 0, version: int = 3) -> bytes:
    return b"GGUF" + struct.pack("<IQQ", version, tensors, entries)


def entry(kind: int, payload: bytes, key: bytes = b"k") -> bytes:
    return struct.pack("<Q", len(key)) + key + struct.pack("<I", kind) + payload


def test_reads_what_the_gguf_package_reads(container: Container) -> None:
    library = gguf.GGUFReader(str(container.path))
    for key, field in library.fields.items():
        if not key.startswith("GGUF."):
            assert np.array_equal(container.metadata[key], field.contents()), key
    for tensor in library.tensors:
        ours = container.tensors[tensor.name]
        assert ours.shape == tuple(int(n) for n in reversed(tensor.shape))
        assert (ours.start, ours.kind) == (tensor.data_offset, int(tensor.tensor_type))


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"GGML" + head()[4:],
        head(version=1),
        head(entries=1 << 40),
        head(tensors=1 << 40),
        head(entries=1) + struct.pack("<Q", 1 << 60),
        head(entries=1) + entry(8, struct.pack("<Q", 1 << 60)),
        head(entries=1) + entry(9, struct.pack("<IQ", 8, 1 << 60)),
        head(entries=1) + entry(9, struct.pack("<IQ", 10, 1 << 61)),
        head(entries=1) + entry(99, b"\0" * 8),
        head(entries=1) + entry(9, struct.pack("<IQ", 9, 1) * 50),
        head(entries=1) + entry(8, struct.pack("<Q", 2) + b"\xff\xff"),
        head(entries=1) + entry(4, struct.pack("<I", 0), key=b"general.alignment"),
        head(tensors=1) + struct.pack("<Q", 1) + b"t" + struct.pack("<I", 9),
        head(tensors=1) + struct.pack("<Q", 1) + b"t" + struct.pack("<IQ", 1, 1 << 50),
    ],
)
def test_hostile_heads_are_refused(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "bad.gguf"
    path.write_bytes(data)
    with pytest.raises(ModelError, match=r"bad\.gguf"):
        open_container(path)


def test_every_cut_of_a_head_is_refused(tmp_path: Path) -> None:
    data = write_gguf(tmp_path / "whole.gguf", SMALL, weights(SMALL)).read_bytes()
    end = min(t.start for t in open_container(tmp_path / "whole.gguf").tensors.values())
    path = tmp_path / "cut.gguf"
    for size in range(0, end - 32, 97):
        path.write_bytes(data[:size])
        with pytest.raises(ModelError):
            open_container(path)


@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_flipped_bytes_end_in_a_model_error_or_a_model(
    container: Container, tmp_path: Path, data: st.DataObject
) -> None:
    whole = bytearray(container.path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        whole[data.draw(st.integers(0, 12_000))] = data.draw(st.integers(0, 255))
    path = tmp_path / "flipped.gguf"
    path.write_bytes(whole)
    try:
        shape_of(open_container(path))
    except ModelError as error:
        assert "flipped.gguf" in error.line()  # noqa: PT017


def test_shape_says_what_was_written(tmp_path: Path, tiny: Tiny) -> None:
    shape = shape_of(open_container(write_gguf(tmp_path / "t.gguf", tiny, weights(tiny))))
    assert (shape.layers, shape.width, shape.heads, shape.kv_heads, shape.head) == (
        tiny.layers, tiny.width, tiny.heads, tiny.kv_heads, tiny.head,
    )  # fmt: skip
    assert (shape.biased, shape.interleaved, shape.tied) == (
        tiny.arch == "qwen2", tiny.arch == "llama", tiny.tied,
    )  # fmt: skip


def test_models_that_are_not_computed_here_are_refused(tmp_path: Path) -> None:
    tensors = weights(SMALL)
    other = write_gguf(tmp_path / "other.gguf", smaller(SMALL, arch="gemma3"), tensors)
    scaled = write_gguf(tmp_path / "scaled.gguf", SMALL, tensors, **{"llama.rope.scaling.type": "yarn"})
    lacking = write_gguf(tmp_path / "lacking.gguf", SMALL, {k: v for k, v in tensors.items() if "up" not in k})
    more = write_gguf(
        tmp_path / "more.gguf", SMALL, tensors | {"blk.0.ffn_gate_inp.weight": np.ones((4, 8), np.float32)}
    )
    narrow = tensors | {"blk.0.ffn_up.weight": np.ones((8, 4), np.float32)}
    wrong = write_gguf(tmp_path / "wrong.gguf", SMALL, narrow)
    for path, reason in (
        (other, "gemma3"),
        (scaled, "yarn"),
        (lacking, "ffn_up"),
        (more, "gate_inp"),
        (wrong, "ffn_up"),
    ):
        with pytest.raises(ModelError, match=reason):
            shape_of(open_container(path))
