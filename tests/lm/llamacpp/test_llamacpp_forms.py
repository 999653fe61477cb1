"""Converted weights: when they are made, that they are made once, and what happens when they cannot be."""

import sys
from pathlib import Path

import pytest

from erag.core.errors import ModelError
from erag.lm.llamacpp.forms import Forms, choose_form
from erag.lm.llamacpp.library import library_version
from erag.lm.llamacpp.probe import Candidate, Probe
from erag.lm.probe import Cpu

BF16 = Cpu("new", "x86_64", frozenset({"avx2", "avx512_bf16"}))
OLD = Cpu("old", "x86_64", frozenset({"avx2"}))
Q4_1, Q4_K = 3, 15
WRITE = (
    "import json, sys; r = json.load(sys.stdin); "
    "open(r['target'], 'w').write('converted %d' % r['file_type']); print('{\"ok\": true}')"
)


def forms(folder: Path, code: str) -> Forms:
    return Forms(Probe(folder, seconds=10, command=(sys.executable, "-c", code)))


@pytest.fixture
def source(tmp_path: Path) -> Candidate:
    path = tmp_path / "toy.gguf"
    path.write_text("weights")
    return Candidate("toy", path, "ab" * 32)


def test_only_slow_formats_of_small_files_are_converted() -> None:
    assert choose_form("auto", Q4_1, 100 << 20, BF16) == "bf16"
    assert choose_form("auto", Q4_1, 100 << 20, OLD) == "q8_0"
    assert choose_form("auto", Q4_1, 900 << 20, BF16) == "shipped"
    assert choose_form("auto", Q4_K, 100 << 20, BF16) == "shipped"
    assert choose_form("q4_0", Q4_K, 900 << 20, OLD) == "q4_0"


@pytest.mark.skipif(library_version() is None, reason="no llama.cpp: pip install 'erag[llamacpp]'")
def test_weights_are_converted_once(tmp_path: Path, source: Candidate) -> None:
    made = forms(tmp_path, WRITE).get(source, "bf16")
    assert made.path.read_text() == "converted 32"
    assert made.model == "toy"
    assert made.sha256 != source.sha256
    assert forms(tmp_path, "raise SystemExit(9)").get(source, "bf16") == made
    assert forms(tmp_path, "raise SystemExit(9)").get(source, "shipped") == source
    assert not list(tmp_path.glob("**/*.partial"))


@pytest.mark.parametrize("damage", ["changed", "record", "gone"])
def test_what_was_damaged_is_made_again(tmp_path: Path, source: Candidate, damage: str) -> None:
    made = forms(tmp_path, WRITE).get(source, "q8_0")
    if damage == "changed":
        made.path.write_text("something else")
    elif damage == "record":
        made.path.with_suffix(".json").write_text("{")
    else:
        made.path.unlink()
    assert forms(tmp_path, WRITE).get(source, "q8_0") == made
    assert made.path.read_text() == "converted 7"


def test_other_weights_of_the_same_name_are_not_taken_for_these(tmp_path: Path, source: Candidate) -> None:
    first = forms(tmp_path, WRITE).get(source, "f16")
    other = Candidate("toy", source.path, "ab" * 8 + "cd" * 24)  # even where the file names agree
    assert other.sha256[:16] == source.sha256[:16]
    assert forms(tmp_path, WRITE.replace("converted", "other")).get(other, "f16").sha256 != first.sha256


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("import os; os.abort()", "SIGABRT"),
        ("print('{\"ok\": true}')", "No such file"),
        ('print(\'{"ok": false, "error": "disk full"}\')', "disk full"),
    ],
)
def test_a_conversion_that_fails_says_how_to_do_without(
    tmp_path: Path, source: Candidate, code: str, said: str
) -> None:
    with pytest.raises(ModelError, match=said) as caught:
        forms(tmp_path, code).get(source, "bf16")
    assert "weights: shipped" in caught.value.line()
    assert not list(tmp_path.glob("gguf/*"))
