"""The shape of a decoder: what the metadata of a GGUF says of its architecture, and the tensors that follow from it."""

from __future__ import annotations

from dataclasses import dataclass

from erag.core.errors import ModelError
from erag.lm.torchlm.container import Container

ARCHITECTURES = ("llama", "qwen2")
EMBEDDING, HEAD, FINAL_NORM, ROPE_FACTORS = (
    "token_embd.weight",
    "output.weight",
    "output_norm.weight",
    "rope_freqs.weight",
)
_MAX = 1 << 20  # of any dimension


@dataclass(frozen=True, slots=True)
class Shape:
    """A Llama-like decoder: RMS norm, rotary positions, grouped-query attention, SwiGLU; `biased` q, k, v in Qwen2.

    `interleaved` says that the rows of q and k in the file are ordered for rotating neighbouring pairs (llama.cpp
    writes Llama so); otherwise they are ordered for rotating halves.
    """

    layers: int
    width: int
    heads: int
    kv_heads: int
    head: int  # width of one head
    inner: int
    vocabulary: int
    context: int
    rope_base: float
    epsilon: float
    biased: bool
    interleaved: bool
    tied: bool  # the output head is the token embedding

    @property
    def group(self) -> int:
        """Query heads that share one key head."""
        return self.heads // self.kv_heads

    @property
    def kv_numbers(self) -> int:
        """Numbers that a token leaves in the cache."""
        return self.layers * 2 * self.kv_heads * self.head

    def sizes(self) -> dict[str, tuple[int, ...]]:
        """The shape of every tensor of the network, by its GGUF name."""
        q, kv, d, f = self.heads * self.head, self.kv_heads * self.head, self.width, self.inner
        layer = {
            "attn_norm.weight": (d,),
            "attn_q.weight": (q, d),
            "attn_k.weight": (kv, d),
            "attn_v.weight": (kv, d),
            "attn_output.weight": (d, q),
            "ffn_norm.weight": (d,),
            "ffn_gate.weight": (f, d),
            "ffn_up.weight": (f, d),
            "ffn_down.weight": (d, f),
        }
        if self.biased:
            layer |= {"attn_q.bias": (q,), "attn_k.bias": (kv,), "attn_v.bias": (kv,)}
        whole: dict[str, tuple[int, ...]] = {EMBEDDING: (self.vocabulary, d), FINAL_NORM: (d,)}
        if not self.tied:
            whole[HEAD] = (self.vocabulary, d)
        return whole | {f"blk.{i}.{name}": size for i in range(self.layers) for name, size in layer.items()}


def shape_of(file: Container) -> Shape:
    """The shape of the model in a GGUF file.

    Raises ModelError for an architecture or a kind of rotary scaling that is not computed here, and for tensors that
    are missing, of another shape, or that the network has no place for.
    """
    arch = file.text("general.architecture")
    if arch not in ARCHITECTURES:
        allowed = f"{', '.join(ARCHITECTURES)} (others run in the llamacpp backend)"
        raise ModelError(f"architecture {arch!r}", where=file.path.name, allowed=allowed)
    _refuse_scaling(file, arch)

    def whole(key: str, default: float | None = None) -> int:
        value = file.number(f"{arch}.{key}", default)
        if not float(value).is_integer() or not 1 <= value <= _MAX:
            raise ModelError(f"{arch}.{key} is {value}", where=file.path.name, allowed=f"1 to {_MAX}")
        return int(value)

    width, heads = whole("embedding_length"), whole("attention.head_count")
    head = whole("attention.key_length", width // heads)
    shape = Shape(
        layers=whole("block_count"),
        width=width,
        heads=heads,
        kv_heads=whole("attention.head_count_kv", heads),
        head=head,
        inner=whole("feed_forward_length"),
        vocabulary=len(file.strings("tokenizer.ggml.tokens")),
        context=whole("context_length"),
        rope_base=float(file.number(f"{arch}.rope.freq_base", 10_000.0)),
        epsilon=float(file.number(f"{arch}.attention.layer_norm_rms_epsilon")),
        biased="blk.0.attn_q.bias" in file.tensors,
        interleaved=arch == "llama",
        tied=HEAD not in file.tensors,
    )
    if shape.heads % shape.kv_heads or head % 2 or whole("rope.dimension_count", head) != head:
        what = f"{heads} heads of {head}, {shape.kv_heads} key heads, rotated {whole('rope.dimension_count', head)}"
        raise ModelError(what, where=file.path.name, allowed="even heads in equal groups, rotated whole")
    _check_tensors(file, shape)
    return shape


def _refuse_scaling(file: Container, arch: str) -> None:
    scaling = file.text(f"{arch}.rope.scaling.type") or "none"
    if scaling != "none":
        raise ModelError(f"rotary scaling {scaling!r}", where=file.path.name, allowed="none, or a table rope_freqs")


def _check_tensors(file: Container, shape: Shape) -> None:
    expected = shape.sizes()
    for name, size in expected.items():
        entry = file.tensors.get(name)
        if entry is None or entry.shape != size:
            what = f"tensor {name} is {'missing' if entry is None else entry.shape}"
            raise ModelError(what, where=file.path.name, allowed=str(size))
    optional = {ROPE_FACTORS: (shape.head // 2,)}
    unknown = [n for n, t in file.tensors.items() if n not in expected and optional.get(n) != t.shape]
    if unknown:
        raise ModelError(
            f"tensor {unknown[0]} has no place here", where=file.path.name, allowed=", ".join(ARCHITECTURES)
        )
