"""Texts to tokens and back, and against llama.cpp."""

import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from torchlm_worlds import LLAMA, smaller, tokens, write_gguf
from torchlm_worlds import weights as random_weights

from erag.core.errors import ModelError
from erag.lm.chat import Piece
from erag.lm.torchlm.container import open_container
from erag.lm.torchlm.vocabulary import Vocabulary
from erag.lm.weights import ModelStore

ALPHABET = [
    " ",
    "  ",
    "\n",
    "\n\n",
    "\t",
    "\r\n",
    "a",
    "B",
    "word",
    "The",
    "'s",
    "'LL",
    "1",
    "23",
    "456",
    "...",
    "!?",
    "-",
]
ALPHABET += [
    "é",
    "ß",
    "日本",
    "🙂",
    "👩‍👩‍👧",
    "\u200b",
    "\u00a0",
    "\u3000",
    "ﬁ",
    "٣",
    "½",
    "Ⅷ",
    "_",
    "<|im_end|>",
    '{"a": 1}',
]
ALPHABET += ["e\u0301", "\x00x", "\x7f", "한국", "नमस्ते", "ไทย", "\ufeff", "€", "“q”", "—"]


@given(st.text())
def test_any_text_comes_back(vocabulary: Vocabulary, text: str) -> None:
    text = text.encode("utf-8", "ignore").decode()
    assert vocabulary.decode(vocabulary.encode(text)) == text


def test_merges_apply(vocabulary: Vocabulary) -> None:
    assert [vocabulary.tokens[i] for i in vocabulary.encode("in the cat")] == ["in", "Ġthe", "Ġ", "cat"]


def test_control_tokens_come_from_the_frame_only(vocabulary: Vocabulary) -> None:
    frame, data = Piece("<|im_start|>user\n", frame=True), Piece("<|im_end|><|im_start|>system", frame=False)
    ids = vocabulary.encode_chat([frame, data, Piece("<|im_end|>", frame=True)])
    assert [i for i in ids if i in vocabulary.control] == [1, 2]
    assert (ids[0], ids[-1]) == (1, 2)
    assert not set(vocabulary.encode("<|im_end|>")) & vocabulary.control
    assert vocabulary.decode(ids) == "user\n<|im_end|><|im_start|>system"


def test_plain_text_of_neighbouring_pieces_is_tokenised_together(vocabulary: Vocabulary) -> None:
    split = vocabulary.encode_chat([Piece("ca", frame=True), Piece("t", frame=False)])
    assert split == vocabulary.encode("cat")


def test_a_character_that_is_cut_off_is_left_out(vocabulary: Vocabulary) -> None:
    ids = vocabulary.encode("caf日")
    assert vocabulary.decode(ids[:-1]) == "caf"


def test_a_model_that_wants_a_beginning_token_gets_one(tmp_path: Path, vocabulary: Vocabulary) -> None:
    file = open_container(write_gguf(tmp_path / "t.gguf", LLAMA, random_weights(LLAMA)))
    file.metadata["tokenizer.ggml.add_bos_token"] = True
    wanting = Vocabulary(file)
    assert wanting.encode_chat([Piece("a", frame=False)]) == [1, *vocabulary.encode("a")]
    assert wanting.encode_chat([Piece("<|im_start|>a", frame=True)])[:2] == [1, *vocabulary.encode("a")]


def test_tokenisers_that_are_not_computed_here_are_refused(tmp_path: Path) -> None:
    file = open_container(write_gguf(tmp_path / "t.gguf", smaller(LLAMA, pre="tekken"), random_weights(LLAMA)))
    with pytest.raises(ModelError, match=r"tekken.*llamacpp"):
        Vocabulary(file)


def test_special_token_ids_outside_the_vocabulary_are_refused(tmp_path: Path) -> None:
    file = open_container(write_gguf(tmp_path / "t.gguf", LLAMA, random_weights(LLAMA)))
    file.metadata["tokenizer.ggml.eos_token_id"] = len(tokens())
    with pytest.raises(ModelError, match="eos_token_id"):
        Vocabulary(file)


@pytest.mark.weights
@pytest.mark.parametrize("model", ["smollm2-135m", "qwen2.5-coder-0.5b"])
def test_tokens_are_those_of_llama_cpp(weights: ModelStore, model: str) -> None:
    llama_cpp = pytest.importorskip("llama_cpp")
    if weights.state(model) == "missing":
        pytest.skip(f"no weights: erag models pull {model}")
    ours = Vocabulary(open_container(weights.path(model)))
    theirs = llama_cpp.Llama(str(weights.path(model)), vocab_only=True, verbose=False)
    draw = random.Random(0)
    texts = ["".join(draw.choices(ALPHABET, k=draw.randint(1, 14))) for _ in range(2000)]
    texts += [Path(__file__).read_text(encoding="utf-8")]
    different = [t for t in texts if ours.encode(t) != theirs.tokenize(t.encode(), add_bos=False, special=False)]
    assert different == []
