"""Tiny models with random weights in real GGUF files, and the same weights in transformers."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import gguf
import numpy as np
import yaml

from erag.lm.torchlm.vocabulary import _BYTES
from erag.lm.weights import ModelStore

CHATML = (
    "{% for message in messages %}{{'<|im_start|>' + message['role'] + '\n' + message['content'] + '<|im_end|>\n'}}"
    "{% endfor %}{% if add_generation_prompt %}{{ '<|im_start|>assistant\n' }}{% endif %}"
)
CONTROL = ["<|endoftext|>", "<|im_start|>", "<|im_end|>"]
MERGES = ["Ġ t", "h e", "i n", 'Ġ "', '" ,', '" :', '{ "', '" }', '" ]', '. "', "Ġt he", "c a", "ca t", "Ġ a", '[ "']
MERGES += ["Ã ¤", "Ã ¶", '\\ "']  # ä, ö, an escaped quote


@dataclass(frozen=True)
class Tiny:
    """The dimensions of a tiny model. `arch` decides the order of rows in q and k, and whether they have biases."""

    arch: str = "llama"
    layers: int = 3
    width: int = 48
    heads: int = 6
    kv_heads: int = 2
    head: int = 8
    inner: int = 64
    context: int = 1024
    tied: bool = True
    seed: int = 0
    pre: str = "smollm"


QWEN = Tiny(arch="qwen2", tied=False, pre="qwen2", heads=3, kv_heads=1, head=16, seed=1)
LLAMA = Tiny()


def tokens() -> list[str]:
    """Control tokens, the 256 bytes, and what the merges make."""
    return [*CONTROL, *_BYTES, *(merge.replace(" ", "") for merge in MERGES)]


def weights(tiny: Tiny) -> dict[str, np.ndarray]:
    """Random float32 weights in the order of transformers (rotating halves), by GGUF name."""
    rng = np.random.default_rng(tiny.seed)
    d, q, kv, f = tiny.width, tiny.heads * tiny.head, tiny.kv_heads * tiny.head, tiny.inner
    sizes = {"attn_q": (q, d), "attn_k": (kv, d), "attn_v": (kv, d), "attn_output": (d, q)}
    sizes |= {"ffn_gate": (f, d), "ffn_up": (f, d), "ffn_down": (d, f)}
    made = {"token_embd.weight": rng.normal(0, 1, (len(tokens()), d)), "output_norm.weight": rng.uniform(0.5, 1.5, d)}
    if not tiny.tied:
        made["output.weight"] = rng.normal(0, 0.3, (len(tokens()), d))
    for i in range(tiny.layers):
        made |= {f"blk.{i}.{n}.weight": rng.normal(0, s[1] ** -0.5, s) for n, s in sizes.items()}
        made |= {f"blk.{i}.{n}.weight": rng.uniform(0.5, 1.5, d) for n in ("attn_norm", "ffn_norm")}
        if tiny.arch == "qwen2":
            made |= {f"blk.{i}.attn_{p}.bias": rng.normal(0, 0.5, n) for p, n in (("q", q), ("k", kv), ("v", kv))}
    return {name: tensor.astype(np.float32) for name, tensor in made.items()}


def permuted(tensor: np.ndarray, heads: int) -> np.ndarray:
    """What llama.cpp's converter does to the q and k of Llama models."""
    return (
        tensor.reshape(heads, 2, tensor.shape[0] // heads // 2, *tensor.shape[1:]).swapaxes(1, 2).reshape(tensor.shape)
    )


def write_gguf(path: Path, tiny: Tiny, tensors: dict[str, np.ndarray], **extra: Any) -> Path:
    """A GGUF file of a tiny model; `extra` are further string entries (arch.key → value)."""
    writer = gguf.GGUFWriter(str(path), tiny.arch)
    writer.add_block_count(tiny.layers)
    writer.add_context_length(tiny.context)
    writer.add_embedding_length(tiny.width)
    writer.add_feed_forward_length(tiny.inner)
    writer.add_head_count(tiny.heads)
    writer.add_head_count_kv(tiny.kv_heads)
    writer.add_key_length(tiny.head)
    writer.add_value_length(tiny.head)
    writer.add_rope_dimension_count(tiny.head)
    writer.add_rope_freq_base(10_000.0)
    writer.add_layer_norm_rms_eps(1e-5)
    for key, value in extra.items():
        writer.add_string(key, value)
    write_vocabulary(writer, tiny)
    heads = {"attn_q": tiny.heads, "attn_k": tiny.kv_heads}
    for name, tensor in tensors.items():
        part = name.split(".")[2] if name.startswith("blk.") else ""
        turned = permuted(tensor, heads[part]) if tiny.arch == "llama" and part in heads else tensor
        writer.add_tensor(name, np.ascontiguousarray(turned))
    writer.write_header_to_file()
    writer.write_kv_data_to_file()
    writer.write_tensors_to_file()
    writer.close()
    return path


def write_vocabulary(writer: gguf.GGUFWriter, tiny: Tiny) -> None:
    writer.add_tokenizer_model("gpt2")
    writer.add_tokenizer_pre(tiny.pre)
    writer.add_token_list(tokens())
    writer.add_token_types([3] * len(CONTROL) + [1] * (len(tokens()) - len(CONTROL)))
    writer.add_token_merges(MERGES)
    writer.add_bos_token_id(1)
    writer.add_eos_token_id(2)
    writer.add_add_bos_token(False)
    writer.add_chat_template(CHATML)


def store_of(folder: Path, path: Path) -> ModelStore:
    """A model store that holds the GGUF file as the model `tiny`."""
    manifests, files = folder / "manifests", folder / "files"
    manifests.mkdir(parents=True)
    (files / "tiny").mkdir(parents=True)
    path.rename(files / "tiny" / "tiny.gguf")
    digest = hashlib.sha256((files / "tiny" / "tiny.gguf").read_bytes()).hexdigest()
    manifest = {
        "id": "tiny",
        "title": "Tiny",
        "kind": "gguf",
        "format": "gguf",
        "roles": ["generate"],
        "licence": "MIT",
    }
    manifest["files"] = [{"path": "tiny.gguf", "sha256": digest}]
    (manifests / "tiny.yaml").write_text(yaml.safe_dump(manifest))
    return ModelStore(manifests, files)


def tiny_store(folder: Path, tiny: Tiny = LLAMA) -> ModelStore:
    """A store with a tiny model of random weights."""
    return store_of(folder, write_gguf(folder / "tiny.gguf", tiny, weights(tiny)))


def transformers_model(tiny: Tiny, tensors: dict[str, np.ndarray]) -> Any:
    """The same model in transformers, float32."""
    import torch
    from transformers import LlamaConfig, LlamaForCausalLM, Qwen2Config, Qwen2ForCausalLM

    config, model = (LlamaConfig, LlamaForCausalLM) if tiny.arch == "llama" else (Qwen2Config, Qwen2ForCausalLM)
    network = model(
        config(
            vocab_size=len(tokens()),
            hidden_size=tiny.width,
            intermediate_size=tiny.inner,
            num_hidden_layers=tiny.layers,
            num_attention_heads=tiny.heads,
            num_key_value_heads=tiny.kv_heads,
            head_dim=tiny.head,
            rms_norm_eps=1e-5,
            rope_parameters={"rope_type": "default", "rope_theta": 10_000.0},
            max_position_embeddings=tiny.context,
            tie_word_embeddings=tiny.tied,
        )
    )
    state = {_HF[n] if n in _HF else _layer_name(n): torch.from_numpy(t) for n, t in tensors.items()}
    if tiny.tied:
        state["lm_head.weight"] = state["model.embed_tokens.weight"]
    network.load_state_dict(state)
    return network.eval()


_HF = {
    "token_embd.weight": "model.embed_tokens.weight",
    "output_norm.weight": "model.norm.weight",
    "output.weight": "lm_head.weight",
}
_PARTS = {
    "attn_norm": "input_layernorm",
    "attn_q": "self_attn.q_proj",
    "attn_k": "self_attn.k_proj",
    "attn_v": "self_attn.v_proj",
    "attn_output": "self_attn.o_proj",
    "ffn_norm": "post_attention_layernorm",
    "ffn_gate": "mlp.gate_proj",
    "ffn_up": "mlp.up_proj",
    "ffn_down": "mlp.down_proj",
}


def _layer_name(name: str) -> str:
    _, layer, part, kind = name.split(".")
    return f"model.layers.{layer}.{_PARTS[part]}.{kind}"


def meets(schema: dict[str, Any], value: Any) -> bool:
    """Whether a value is of a schema (of the kinds the tests use)."""
    if "anyOf" in schema:
        return any(meets(option, value) for option in schema["anyOf"])
    if "enum" in schema:
        return json.dumps(value) in [json.dumps(v) for v in schema["enum"]]
    kind = schema["type"]
    if kind == "object":
        keys = schema["properties"]
        return (
            isinstance(value, dict) and list(value) == list(keys) and all(meets(s, value[k]) for k, s in keys.items())
        )
    if kind == "array":
        right = isinstance(value, list) and schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", 16)
        return right and all(meets(schema["items"], item) for item in value)
    if kind == "string":
        return isinstance(value, str) and schema.get("minLength", 0) <= len(value) <= schema.get("maxLength", 400)
    if kind == "integer":
        right = isinstance(value, int) and not isinstance(value, bool)
        return right and schema.get("minimum", value) <= value <= schema.get("maximum", value)
    types: dict[str, Any] = {"number": (int, float), "boolean": bool, "null": type(None)}
    return isinstance(value, types[kind]) and (kind == "boolean" or not isinstance(value, bool))


def smaller(tiny: Tiny, **changes: Any) -> Tiny:
    """A variation of a tiny model."""
    return replace(tiny, **changes)
