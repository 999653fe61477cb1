"""The cache of dequantised weights: kept, verified, made anew when damaged, done without where it cannot be kept."""

import shutil
from collections import namedtuple
from pathlib import Path

import gguf
import numpy as np
import pytest
import torch
from torchlm_worlds import LLAMA, Tiny, permuted, smaller, weights, write_gguf

from erag.core.errors import ModelError
from erag.lm.ledger import Ledger
from erag.lm.torchlm import weights as module
from erag.lm.torchlm.container import Container, open_container
from erag.lm.torchlm.shape import shape_of
from erag.lm.torchlm.weights import NOT_KEPT, REBUILT, WeightCache, dequantised


def load(container: Container, folder: Path, dtype: str = "float32") -> tuple[dict[str, torch.Tensor], Ledger]:
    ledger = Ledger()
    return WeightCache(folder, "0" * 64, dtype).load(container, shape_of(container), ledger), ledger


def equal(one: dict[str, torch.Tensor], other: dict[str, torch.Tensor]) -> bool:
    return one.keys() == other.keys() and all(torch.equal(one[n], other[n]) for n in one)


def test_rows_of_q_and_k_are_ordered_for_pairs_in_both_architectures(tmp_path: Path, tiny: Tiny) -> None:
    tensors = weights(tiny)
    file = open_container(write_gguf(tmp_path / "t.gguf", tiny, tensors))
    ours = dequantised(file, shape_of(file), "float32")
    assert np.array_equal(ours["blk.0.attn_q.weight"].numpy(), permuted(tensors["blk.0.attn_q.weight"], tiny.heads))
    assert np.array_equal(ours["blk.1.attn_k.weight"].numpy(), permuted(tensors["blk.1.attn_k.weight"], tiny.kv_heads))
    assert np.array_equal(ours["blk.1.attn_v.weight"].numpy(), tensors["blk.1.attn_v.weight"])


def test_a_second_load_reads_the_cache(container: Container, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first, ledger = load(container, tmp_path)
    monkeypatch.setattr(module, "dequantised", None)  # to be called no more
    monkeypatch.setattr(module, "sha256_of", None)  # nor is an unchanged file hashed again
    second, again = load(container, tmp_path)
    assert equal(first, second)
    assert not ledger.events
    assert not again.events


def test_each_dtype_has_its_own(container: Container, tmp_path: Path) -> None:
    load(container, tmp_path)
    fast, _ = load(container, tmp_path, "bfloat16")
    assert {t.dtype for t in fast.values()} == {torch.bfloat16}
    assert len(list(tmp_path.glob("*.safetensors"))) == 2


@pytest.mark.parametrize("damage", ["flip", "cut", "empty", "record", "no record", "other model"])
def test_a_damaged_cache_is_made_anew_and_counted(container: Container, tmp_path: Path, damage: str) -> None:
    expected, _ = load(container, tmp_path)
    expected = {name: tensor.clone() for name, tensor in expected.items()}
    (file,), (record,) = tmp_path.glob("*.safetensors"), tmp_path.glob("*.json")
    data = bytearray(file.read_bytes())
    if damage == "flip":
        data[-5] ^= 1
        file.write_bytes(data)
    elif damage == "cut":
        file.write_bytes(data[:-100])
    elif damage == "empty":
        file.write_bytes(b"")
    elif damage == "record":
        record.write_text("{")
    elif damage == "no record":
        record.unlink()
    else:
        folder = tmp_path / "other"
        WeightCache(folder, "1" * 64, "float32").load(container, shape_of(container), Ledger())
        for path, target in zip(sorted(folder.iterdir()), (record, file), strict=True):
            path.rename(target)
    again, ledger = load(container, tmp_path)
    assert ledger.events[REBUILT] == 1
    assert equal(expected, again)
    assert not load(container, tmp_path)[1].events


def test_without_room_it_works_without_a_cache(
    container: Container, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: usage(10**12, 10**12 - 10**6, 10**6))
    tensors, ledger = load(container, tmp_path)
    assert ledger.events == {NOT_KEPT: 1}
    assert tensors.keys() == shape_of(container).sizes().keys()
    assert not list(tmp_path.iterdir())


def test_where_nothing_may_be_written_it_works_without_a_cache(container: Container, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    tensors, ledger = load(container, tmp_path / "file" / "folder")
    assert ledger.events == {NOT_KEPT: 1}
    assert tensors.keys() == shape_of(container).sizes().keys()


@pytest.mark.parametrize("kind", ["Q4_0", "Q4_1", "Q5_0", "Q8_0", "F16", "BF16"])
def test_quantised_tensors_come_out_as_the_gguf_package_reads_them(tmp_path: Path, kind: str) -> None:
    tiny = smaller(LLAMA, width=32, inner=64, heads=4, kv_heads=4, layers=1)
    tensors, name = weights(tiny), "blk.0.ffn_down.weight"
    form = gguf.GGMLQuantizationType[kind]
    raw = gguf.quants.quantize(tensors[name], form)
    path = tmp_path / "q.gguf"
    original = gguf.GGUFWriter.add_tensor
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            gguf.GGUFWriter,
            "add_tensor",
            lambda self, n, t, **k: original(self, n, raw, raw_dtype=form) if n == name else original(self, n, t, **k),
        )
        write_gguf(path, tiny, tensors)
    file = open_container(path)
    ours = dequantised(file, shape_of(file), "float32")[name].numpy()
    assert np.array_equal(ours, gguf.quants.dequantize(raw, form))
    assert np.abs(ours - tensors[name]).max() < 0.1


def test_numbers_that_are_not_finite_and_bytes_that_are_missing_are_refused(tmp_path: Path) -> None:
    tensors = weights(LLAMA)
    tensors["blk.0.ffn_up.weight"][3, 3] = np.nan
    bad = open_container(write_gguf(tmp_path / "nan.gguf", LLAMA, tensors))
    with pytest.raises(ModelError, match=r"ffn_up.*not finite"):
        dequantised(bad, shape_of(bad), "float32")
    path = write_gguf(tmp_path / "cut.gguf", LLAMA, weights(LLAMA))
    cut = open_container(path)
    path.write_bytes(path.read_bytes()[:-5000])
    with pytest.raises(ModelError, match="erag models verify"):
        dequantised(cut, shape_of(cut), "float32")
