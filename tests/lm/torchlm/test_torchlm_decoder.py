"""The network against transformers on the same weights, and its batches against single sequences."""

from pathlib import Path

import numpy as np
import pytest
import torch
from torchlm_worlds import LLAMA, QWEN, Tiny, smaller, transformers_model, weights, write_gguf

from erag.lm.torchlm.attention import Grid, attention
from erag.lm.torchlm.cache import Buffers
from erag.lm.torchlm.container import open_container
from erag.lm.torchlm.decoder import Decoder
from erag.lm.torchlm.kernels import Kernels
from erag.lm.torchlm.prefill import extend
from erag.lm.torchlm.shape import ROPE_FACTORS, shape_of
from erag.lm.torchlm.weights import dequantised, rope_factors


def read(path: Path, kernels: Kernels = "plain", dtype: str = "float32") -> Decoder:
    file = open_container(path)
    shape = shape_of(file)
    return Decoder(shape, dequantised(file, shape, dtype), kernels, rope_factors(file))


def some_tokens(count: int, seed: int = 0) -> list[int]:
    return [int(t) for t in np.random.default_rng(seed).integers(3, 250, count)]


def logits_of(decoder: Decoder, tokens: list[int]) -> torch.Tensor:
    """(t, vocabulary) logits of one sequence."""
    with torch.inference_mode():
        cache = Buffers(decoder.shape, decoder.dtype).cache(1, len(tokens))
        return decoder.logits(extend(decoder, cache, [tokens], [range(len(tokens))]))


@pytest.mark.parametrize(
    "tiny", [LLAMA, QWEN, smaller(LLAMA, head=16, tied=False)], ids=["llama", "qwen2", "wide heads"]
)
@pytest.mark.parametrize("kernels", ["packed", "plain"])
def test_logits_equal_those_of_transformers(tmp_path: Path, tiny: Tiny, kernels: Kernels) -> None:
    tensors, tokens = weights(tiny), some_tokens(300)  # more than two blocks of queries
    with torch.inference_mode():
        expected = transformers_model(tiny, tensors)(torch.tensor([tokens])).logits[0]
    ours = logits_of(read(write_gguf(tmp_path / "t.gguf", tiny, tensors), kernels), tokens)
    assert (ours - expected).abs().max() < 1e-4


def test_bfloat16_stays_close(tmp_path: Path, tiny: Tiny) -> None:
    path, tokens = write_gguf(tmp_path / "t.gguf", tiny, weights(tiny)), some_tokens(50)
    exact, fast = (
        torch.log_softmax(logits_of(read(path, dtype=d), tokens).float(), -1) for d in ("float32", "bfloat16")
    )
    assert (exact.exp() * (exact - fast)).sum(-1).mean() < 0.01  # Kullback–Leibler divergence, nats


def test_tables_of_rotary_factors_are_applied(tmp_path: Path) -> None:
    plain, tokens = weights(LLAMA), some_tokens(40)
    twice = plain | {ROPE_FACTORS: np.full(LLAMA.head // 2, 2, np.float32)}
    one, half = (read(write_gguf(tmp_path / f"{i}.gguf", LLAMA, t)) for i, t in enumerate((plain, twice)))
    assert (logits_of(one, tokens) - logits_of(half, tokens)).abs().max() > 0.1
    same = plain | {ROPE_FACTORS: np.ones(LLAMA.head // 2, np.float32)}
    assert torch.equal(logits_of(read(write_gguf(tmp_path / "s.gguf", LLAMA, same)), tokens), logits_of(one, tokens))


def test_ragged_rows_equal_single_sequences(decoder: Decoder) -> None:
    rows = [some_tokens(n, seed=n) for n in (1, 2, 5, 9, 40, 300, 600)]  # several chunks
    with torch.inference_mode():
        cache = Buffers(decoder.shape, decoder.dtype).cache(len(rows), 600)
        together = extend(decoder, cache, rows, [range(len(row)) for row in rows])
    alone = torch.cat([logits_of(decoder, row) for row in rows])
    assert (decoder.logits(together) - alone).abs().max() < 1e-4


def test_rows_that_go_on_with_holes_equal_single_sequences(decoder: Decoder) -> None:
    """Prefill, expansion of a shared beginning, decoding, growth and removal of rows, against one pass each."""
    start, middles = some_tokens(20), [some_tokens(n, seed=n) for n in (3, 7, 11)]
    ends = [some_tokens(6, seed=100 + i) for i in range(3)]
    with torch.inference_mode():
        root = Buffers(decoder.shape, decoder.dtype).cache(1, 20)
        extend(decoder, root, [start], [[]])
        cache = Buffers(decoder.shape, decoder.dtype).cache(3, 31)
        cache.follow(root, [0, 0, 0])
        extend(decoder, cache, middles, [[]] * 3)
        alive = [0, 1, 2]
        for step in range(6):
            if step == 3:
                cache.drop(0)
                alive = [2, 1]
            if cache.width == cache.columns:
                cache.resize(cache.columns + 2)
            hidden = decoder.forward(torch.tensor([[ends[i][step]] for i in alive]), cache)[:, 0]
            cache.advance([1] * len(alive), 1)
            for row, i in enumerate(alive):
                alone = logits_of(decoder, start + middles[i] + ends[i][: step + 1])[-1]
                assert (decoder.logits(hidden[row : row + 1])[0] - alone).abs().max() < 1e-4


@pytest.mark.parametrize("lengths", [(3, 9), (1, 1, 600)])
def test_what_lies_in_unused_memory_is_never_looked_at(decoder: Decoder, lengths: tuple[int, ...]) -> None:
    buffers, rows = Buffers(decoder.shape, decoder.dtype), [some_tokens(n, seed=n) for n in lengths]
    with torch.inference_mode():
        poisoned = buffers.cache(len(rows), 2 * max(lengths))
        for layer in range(3):
            poisoned.layer(layer).fill_(float("nan"))
        cache = buffers.cache(len(rows), max(lengths), room=2 * max(lengths))
        hidden = extend(decoder, cache, rows, [[n - 1] for n in lengths])
        cache.resize(cache.columns + 3)
        step = decoder.forward(torch.tensor([[5]] * len(rows)), cache)[:, 0]
    for row, first, second in zip(rows, decoder.logits(hidden), decoder.logits(step), strict=True):
        alone = logits_of(decoder, [*row, 5])
        assert (torch.stack([first, second]) - alone[-2:]).abs().max() < 1e-4


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
@pytest.mark.parametrize("trunk", [0, 33])
@pytest.mark.parametrize(("rows", "queries", "past", "unused"), [(3, 1, 17, 4), (2, 300, 0, 0), (2, 150, 40, 0)])
def test_attention_equals_the_plain_formula(
    rows: int, queries: int, past: int, unused: int, trunk: int, dtype: torch.dtype
) -> None:
    torch.manual_seed(0)
    columns = past + queries + unused
    q, k, v = torch.randn(rows, queries, 6, 8), torch.randn(rows, 2, columns, 8), torch.randn(rows, 2, columns, 8)
    pair = torch.randn(2, 2, trunk, 8)
    holes = torch.rand(rows, past) < 0.3 if past else None
    look = attention(Grid(rows, queries, past, holes, unused, trunk), 2, 3, 8**-0.5, dtype)
    seen = torch.ones(queries, columns, dtype=torch.bool).tril(past).expand(rows, -1, -1).clone()
    if holes is not None:
        seen[:, :, :past] &= ~holes[:, None]
    expected = torch.nn.functional.scaled_dot_product_attention(
        q.transpose(1, 2),
        torch.cat([pair[0].expand(rows, -1, -1, -1), k], 2),
        torch.cat([pair[1].expand(rows, -1, -1, -1), v], 2),
        attn_mask=torch.cat([torch.ones(rows, queries, trunk, dtype=torch.bool), seen], 2)[:, None],
        enable_gqa=True,
    )
    ours = look(q.to(dtype), k.to(dtype), v.to(dtype), pair.to(dtype) if trunk else None).float()
    assert (ours - expected.transpose(1, 2).flatten(2)).abs().max() < (1e-5 if dtype == torch.float32 else 0.05)


def test_ties_of_bfloat16_logits_are_broken_in_float32(tmp_path: Path) -> None:
    tensors, tokens = weights(LLAMA), some_tokens(400)
    tensors["token_embd.weight"][101:250:2] = tensors["token_embd.weight"][100:249:2]
    tensors["token_embd.weight"][101:250:2, 0] *= 1.02  # pairs of tokens that hardly differ
    fast = read(write_gguf(tmp_path / "t.gguf", LLAMA, tensors), dtype="bfloat16")
    with torch.inference_mode():
        cache = Buffers(fast.shape, fast.dtype).cache(1, 400)
        hidden = extend(fast, cache, [tokens], [range(400)])
        ids, logits = fast.best(hidden)
        normed = torch.nn.functional.rms_norm(hidden, (48,), fast._norm, 1e-5).float()
        exact = (normed @ fast._head_weight.float().T).argmax(-1)
    assert torch.equal(ids, exact)
    assert not torch.equal(logits.argmax(-1), exact)  # the ties are there
