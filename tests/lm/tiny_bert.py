"""A BERT of random weights in a store of its own, small enough to be trained in a test."""

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

import torch
import yaml
from safetensors.torch import save_file
from tokenizers import Tokenizer
from tokenizers.models import WordLevel
from tokenizers.normalizers import Lowercase
from tokenizers.pre_tokenizers import Whitespace
from tokenizers.processors import TemplateProcessing

from erag.lm.weights import ModelStore

SPECIAL = ("[PAD]", "[UNK]", "[CLS]", "[SEP]")
DIM, WIDE, LAYERS, HEADS, POSITIONS = 32, 64, 2, 2, 48
NAME = "tiny-bert"


def tiny_store(root: Path, words: Sequence[str], seed: int = 0) -> ModelStore:
    """A store with the BERT, which knows `words`."""
    folder = root / "files" / NAME
    (folder / "1_Pooling").mkdir(parents=True)
    (root / "manifests").mkdir()
    vocabulary = [*SPECIAL, *words]
    shape = {
        "model_type": "bert", "hidden_act": "gelu", "num_hidden_layers": LAYERS, "num_attention_heads": HEADS,
        "hidden_size": DIM, "intermediate_size": WIDE, "vocab_size": len(vocabulary), "type_vocab_size": 2,
        "max_position_embeddings": POSITIONS, "layer_norm_eps": 1e-6,
    }  # fmt: skip
    steps = [{"type": f"sentence_transformers.models.{step}"} for step in ("Transformer", "Pooling", "Normalize")]
    files = {
        "config.json": shape, "modules.json": steps, "sentence_bert_config.json": {"max_seq_length": POSITIONS},
        "1_Pooling/config.json": {"pooling_mode_mean_tokens": True},
    }  # fmt: skip
    for name, content in files.items():
        (folder / name).write_text(json.dumps(content))
    _tokenizer(vocabulary).save(str(folder / "tokenizer.json"))
    save_file(_weights(len(vocabulary), seed), folder / "model.safetensors")
    listed = [
        {"path": name, "sha256": hashlib.sha256((folder / name).read_bytes()).hexdigest()}
        for name in (*files, "tokenizer.json", "model.safetensors")
    ]
    manifest = {
        "id": NAME, "title": "Tiny BERT", "kind": "sentence", "format": "safetensors", "roles": ["embed"],
        "licence": "MIT", "files": listed,
    }  # fmt: skip
    (root / "manifests" / f"{NAME}.yaml").write_text(yaml.safe_dump(manifest))
    return ModelStore(root / "manifests", root / "files")


def _tokenizer(vocabulary: Sequence[str]) -> Tokenizer:
    tokenizer = Tokenizer(WordLevel({word: row for row, word in enumerate(vocabulary)}, unk_token="[UNK]"))
    tokenizer.normalizer, tokenizer.pre_tokenizer = Lowercase(), Whitespace()
    tokenizer.add_special_tokens(list(SPECIAL))
    ends = [(name, vocabulary.index(name)) for name in ("[CLS]", "[SEP]")]
    tokenizer.post_processor = TemplateProcessing(single="[CLS] $A [SEP]", special_tokens=ends)
    return tokenizer


def _weights(words: int, seed: int) -> dict[str, torch.Tensor]:
    generator = torch.Generator().manual_seed(seed)

    def drawn(*shape: int, scale: float = DIM**-0.5) -> torch.Tensor:
        return torch.randn(*shape, generator=generator) * scale

    tables = {"word": words, "position": POSITIONS, "token_type": 2}
    found = {f"embeddings.{name}_embeddings.weight": drawn(rows, DIM) for name, rows in tables.items()}
    found["embeddings.position_embeddings.weight"] *= 0.1
    norms = ["embeddings.LayerNorm"]
    for layer in (f"encoder.layer.{number}" for number in range(LAYERS)):
        sizes = {f"attention.self.{part}": (DIM, DIM) for part in ("query", "key", "value")}
        sizes |= {"attention.output.dense": (DIM, DIM), "intermediate.dense": (WIDE, DIM), "output.dense": (DIM, WIDE)}
        for name, size in sizes.items():
            found[f"{layer}.{name}.weight"], found[f"{layer}.{name}.bias"] = drawn(*size), drawn(size[0], scale=0.02)
        norms += [f"{layer}.attention.output.LayerNorm", f"{layer}.output.LayerNorm"]
    for name in norms:
        found[f"{name}.weight"], found[f"{name}.bias"] = 1 + drawn(DIM, scale=0.1), drawn(DIM, scale=0.1)
    return found
