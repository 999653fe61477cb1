"""The same weights in llama.cpp: logits, likelihoods and greedy texts."""

import json
import subprocess
import sys
from pathlib import Path

import gguf
import numpy as np
import pytest
import torch
from torchlm_worlds import Tiny, store_of, write_gguf
from torchlm_worlds import weights as random_weights

from erag.lm.roles import Prompt
from erag.lm.textmodel import Continuation
from erag.lm.torchlm import TorchLM, TorchLMConfig
from erag.lm.torchlm.cache import Buffers
from erag.lm.torchlm.container import open_container
from erag.lm.torchlm.prefill import extend
from erag.lm.torchlm.weights import _numbers
from erag.lm.weights import ModelStore

pytest.importorskip("llama_cpp")
CHILD = Path(__file__).with_name("llama_child.py")
QUESTIONS = (
    "Describe a campus square with three benches in one sentence.",
    "Name three things found in a library.",
    "A robot sees a fountain and an old oak. Where is it?",
    "Write one sentence about rain.",
    "List the colours of a traffic light.",
)
MOST = 40


class Llama:
    """What llama.cpp says of prompts: logits (t, v) and the greedy text of each."""

    def __init__(self, folder: Path, path: Path, prompts: list[list[int]], ends: frozenset[int]) -> None:
        asked = {"prompts": prompts, "ends": sorted(ends), "most": MOST}
        (folder / "asked.json").write_text(json.dumps(asked))
        out = folder / "found.npz"
        command = [sys.executable, str(CHILD), str(path), str(folder / "asked.json"), str(out)]
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, f"llama.cpp ended with {done.returncode}: {done.stderr[-500:]}"
        with np.load(out) as found:
            self.logits = [torch.from_numpy(found[f"logits{i}"]) for i in range(len(prompts))]
            self.texts = [found[f"text{i}"].astype(int).tolist() for i in range(len(prompts))]


def prompts_of(model: TorchLM) -> list[list[int]]:
    vocabulary = model.vocabulary()
    return [vocabulary.encode_chat(vocabulary.template.render((("user", q),))) for q in QUESTIONS]


def logits_of(model: TorchLM, prompt: list[int]) -> torch.Tensor:
    decoder = model.generator().decoder
    with torch.inference_mode():
        cache = Buffers(decoder.shape, decoder.dtype).cache(1, len(prompt))
        return decoder.logits(extend(decoder, cache, [prompt], [range(len(prompt))]))


def distance(model: TorchLM, llama: Llama, prompts: list[list[int]]) -> torch.Tensor:
    """|Δ log-probability| of each next token of the prompts."""
    parts = []
    for prompt, theirs in zip(prompts, llama.logits, strict=True):
        both = (torch.log_softmax(x.float(), -1) for x in (logits_of(model, prompt), theirs))
        ours, other = (x[range(len(prompt) - 1), prompt[1:]] for x in both)
        parts.append((ours - other).abs())
    return torch.cat(parts)


def texts_of(model: TorchLM) -> list[str]:
    return [g.text for g in model.generate([Prompt((("user", q),), max_tokens=MOST) for q in QUESTIONS])]


def test_a_tiny_model_computes_the_same(tmp_path: Path, tiny: Tiny) -> None:
    path = write_gguf(tmp_path / "tiny.gguf", tiny, random_weights(tiny))
    store = store_of(tmp_path / "store", path)
    model = TorchLM(TorchLMConfig(model="tiny", dtype="float32"), store, cache=tmp_path / "cache")
    prompts, vocabulary = prompts_of(model), model.vocabulary()
    llama = Llama(tmp_path, store.path("tiny"), prompts, vocabulary.ends)
    assert distance(model, llama, prompts).max() < 1e-3
    assert texts_of(model) == [vocabulary.decode(text) for text in llama.texts]


def whole_precision(source: Path, target: Path) -> Path:
    """The same GGUF with every tensor dequantised to float32."""
    reader, file = gguf.GGUFReader(str(source)), open_container(source)
    writer = gguf.GGUFWriter(str(target), str(file.text("general.architecture")))
    for key, field in reader.fields.items():
        if key.startswith("GGUF.") or key in ("general.architecture", "general.file_type"):
            continue
        kind, value = field.types[0], field.contents()
        if kind == gguf.GGUFValueType.ARRAY:
            writer.add_array(key, value)
        else:
            writer.add_key_value(key, value, kind)
    for entry in file.tensors.values():
        writer.add_tensor(entry.name, _numbers(file, entry))
    writer.write_header_to_file()
    writer.write_kv_data_to_file()
    writer.write_tensors_to_file()
    writer.close()
    return target


@pytest.fixture(scope="module")
def smollm(weights: ModelStore) -> ModelStore:
    if weights.state("smollm2-135m") == "missing":
        pytest.skip("no weights: erag models pull smollm2-135m")
    return weights


@pytest.mark.weights
def test_smollm2_in_float32_computes_the_same(smollm: ModelStore, tmp_path: Path) -> None:
    model = TorchLM(TorchLMConfig(dtype="float32"), smollm, cache=tmp_path / "cache")
    path = whole_precision(smollm.path("smollm2-135m"), tmp_path / "whole.gguf")
    prompts, vocabulary = prompts_of(model), model.vocabulary()
    llama = Llama(tmp_path, path, prompts, vocabulary.ends)
    path.unlink()  # 540 MB
    assert distance(model, llama, prompts).max() < 1e-3
    assert texts_of(model) == [vocabulary.decode(text) for text in llama.texts]


@pytest.mark.weights
def test_likelihoods_are_those_of_llama_cpp(smollm: ModelStore, tmp_path: Path) -> None:
    """On the quantised file llama.cpp rounds activations to 8 bits, so that its numbers are near, not equal."""
    model = TorchLM(TorchLMConfig(dtype="float32"), smollm, cache=tmp_path / "cache")
    prompts, vocabulary = prompts_of(model), model.vocabulary()
    answers = ["A square with benches.", "Books.", "In a park.", "Rain falls.", "Red, yellow and green."]
    whole = [p + vocabulary.encode(a) for p, a in zip(prompts, answers, strict=True)]
    llama = Llama(tmp_path, smollm.path("smollm2-135m"), whole, vocabulary.ends)
    found = model.likelihoods([Continuation((("user", q),), a) for q, a in zip(QUESTIONS, answers, strict=True)])
    for ours, prompt, ids, theirs in zip(found, prompts, whole, llama.logits, strict=True):
        logs = torch.log_softmax(theirs.float(), -1)[range(len(prompt) - 1, len(ids) - 1), ids[len(prompt) :]]
        assert ours.mean == pytest.approx(float(logs.mean()), abs=0.25)
    assert distance(model, llama, whole).mean() < 0.15
