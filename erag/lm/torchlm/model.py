"""The `torchlm` backend: a GGUF model of the store in PyTorch, many prompts at a time."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from erag.core.errors import InputError
from erag.lm.chat import Messages
from erag.lm.ledger import Ledger
from erag.lm.local import LocalModel
from erag.lm.probe import DtypeWish, choose_dtype
from erag.lm.roles import Generation, Prompt, RoleName
from erag.lm.textmodel import Continuation, Likelihood
from erag.lm.torchlm.cache import Pool
from erag.lm.torchlm.container import Container, open_container
from erag.lm.torchlm.decoder import Decoder
from erag.lm.torchlm.generating import Generator, Request
from erag.lm.torchlm.kernels import KernelsWish, choose_kernels
from erag.lm.torchlm.lexicon import Lexicon
from erag.lm.torchlm.lora import LoraFile, check_base, lora_file
from erag.lm.torchlm.plan import Limits, Tokens
from erag.lm.torchlm.schema import compile_schema
from erag.lm.torchlm.scoring import Due, Scorer
from erag.lm.torchlm.shape import Shape, shape_of
from erag.lm.torchlm.vocabulary import Vocabulary
from erag.lm.torchlm.weights import WeightCache, cache_folder, dequantised, rope_factors
from erag.lm.torchlm.writer import FreeWriter, JsonWriter, Writer
from erag.lm.weights import ModelStore

if TYPE_CHECKING:
    import torch

RULES = 1  # changes when other texts or numbers would come out of the same weights

CUT_TEXTS = "texts cut at their cap of tokens"
CUT_STRINGS = "strings of a schema cut at their longest"


class TorchLMConfig(BaseModel):
    """The `torchlm` backend: a GGUF model of the store, its precision, and how much is computed together."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["torchlm"] = "torchlm"
    model: str = "smollm2-135m"
    lora: Path | None = Field(
        None, description="an adapter of `erag distil` trained on this model: a file, or the name of a shipped one"
    )
    dtype: DtypeWish = "auto"
    kernels: KernelsWish = "auto"
    context: int = Field(4096, ge=64, le=131_072, description="tokens of a prompt and its answer; at most the model's")
    batch_size: int = Field(32, ge=1, le=1024, description="sequences computed together; part of the batch plan")
    batch_cells: int = Field(24_576, ge=1024, description="sequences of a batch times its longest, in tokens")
    call_size: int = Field(64, ge=1, le=65_536, description="items recorded together in one transaction")


@dataclass(frozen=True)
class _Loaded:
    """A model ready to compute."""

    vocabulary: Vocabulary
    lexicon: Lexicon
    generator: Generator
    scorer: Scorer
    context: int


class TorchLM(LocalModel[TorchLMConfig]):
    """A `TextModel`. Weights are verified and loaded at the first prompt.

    Answers are greedy, so that a prompt's seed makes no difference.
    """

    roles: frozenset[RoleName] = frozenset({"generate"})

    def __init__(
        self, config: TorchLMConfig, store: ModelStore, ledger: Ledger | None = None, cache: Path | None = None
    ) -> None:
        """`cache`: the folder for dequantised weights, by default the user's."""
        super().__init__(config, store, ledger)
        self._dtype, self._kernels = choose_dtype(config.dtype), choose_kernels(config.kernels)
        self._cache = cache
        self._taught: LoraFile | None = None
        self._loaded: _Loaded | None = None

    def _stated(self) -> Mapping[str, Any]:
        taught = self._adapter()
        weights = self._store.fingerprint(self._config.model)
        return {"kind": "torchlm", "rules": RULES, "weights": weights, **({"lora": taught.sha256} if taught else {})}

    def _runtime(self) -> Mapping[str, Any]:
        config = self._config
        return {
            "dtype": self._dtype,
            "kernels": self._kernels,
            "torch": version("torch"),
            "tokenizers": version("tokenizers"),
            "batch": [config.batch_size, config.batch_cells],
        }

    def generate(self, prompts: Sequence[Prompt]) -> list[Generation]:
        """Greedy texts, one a prompt, same order; equal prompts are answered once.

        Under a schema the text is always JSON of that schema: from `max_tokens` on what is open is closed, and the
        result says `truncated`. Raises ConfigError for schemas that are not understood, InputError for prompts that
        are longer than the context.
        """
        loaded = self._load()
        keys = [_key(prompt) for prompt in prompts]
        distinct = dict(zip(keys, prompts, strict=True))
        tokens = {key: self._tokens(p.messages, p.max_tokens) for key, p in distinct.items()}
        writers = {key: self._writer(p) for key, p in distinct.items()}
        loaded.generator.run([Request(tokens[key], p.max_tokens, writers[key]) for key, p in distinct.items()])
        self._count(writers.values())
        texts = {
            key: Generation(loaded.vocabulary.decode(w.tokens), w.truncated, len(tokens[key]), len(w.tokens))
            for key, w in writers.items()
        }
        return [texts[key] for key in keys]

    def likelihoods(self, continuations: Sequence[Continuation]) -> list[Likelihood]:
        """The log-probability of each text right after its chat, in float32; an empty text has 0.

        Raises InputError for a chat and text that are longer than the context.
        """
        loaded = self._load()
        chats = {
            c.messages: loaded.vocabulary.encode_chat(loaded.vocabulary.template.render(c.messages))
            for c in continuations
        }
        dues = [Due(tuple(chats[c.messages]), tuple(loaded.vocabulary.encode(c.text))) for c in continuations]
        for due in dues:
            self._fits(len(due.prompt) + len(due.continuation))
        found = loaded.scorer.run([due for due in dues if due.continuation])
        return [Likelihood(found.get(due, 0.0), len(due.continuation), len(due.prompt)) for due in dues]

    def vocabulary(self) -> Vocabulary:
        """The vocabulary and the chat template; loads the model."""
        return self._load().vocabulary

    def generator(self) -> Generator:
        """What answers prompts given as tokens; loads the model."""
        return self._load().generator

    def _tokens(self, messages: Messages, room: int) -> Tokens:
        vocabulary = self._load().vocabulary
        tokens = vocabulary.encode_chat(vocabulary.template.render(messages))
        self._fits(len(tokens) + room)
        return tuple(tokens)

    def _fits(self, tokens: int) -> None:
        context = self._load().context
        if tokens > context:
            raise InputError(
                f"a prompt and its answer take {tokens} tokens",
                where=f"model {self._config.model}",
                allowed=f"at most {context}",
                repair="shorten the prompt, or --set context higher, up to the model's own",
            )

    def _writer(self, prompt: Prompt) -> Writer:
        loaded = self._load()
        if prompt.schema is None:
            return FreeWriter(loaded.vocabulary.ends, prompt.max_tokens)
        return JsonWriter(compile_schema(prompt.schema), loaded.lexicon, prompt.max_tokens)

    def _count(self, writers: Collection[Writer]) -> None:
        cut = [(CUT_TEXTS, sum(w.truncated for w in writers)), (CUT_STRINGS, sum(w.cut for w in writers))]
        self._ledger.events.update({event: times for event, times in cut if times})

    def _adapter(self) -> LoraFile | None:
        """The adapter to be merged in. Raises ModelError for a file that is none, or of other weights."""
        if self._taught is None and self._config.lora is not None:
            found = lora_file(self._config.lora)
            check_base(found, self._store.fingerprint(self._config.model))
            self._taught = found
        return self._taught

    def _load(self) -> _Loaded:
        if self._loaded is None:
            self._loaded = self._read()
        return self._loaded

    def _read(self) -> _Loaded:
        file = open_container(self._store.path(self._config.model))
        shape, vocabulary = shape_of(file), Vocabulary(file)
        decoder = Decoder(shape, self._tensors(file, shape), self._kernels, rope_factors(file))
        limits = Limits(self._config.batch_size, self._config.batch_cells)
        context = min(self._config.context, shape.context)
        pool = Pool(shape, decoder.dtype)
        generator, scorer = Generator(decoder, limits, pool), Scorer(decoder, limits, pool)
        return _Loaded(vocabulary, Lexicon(vocabulary), generator, scorer, context)

    def _tensors(self, file: Container, shape: Shape) -> dict[str, torch.Tensor]:
        """From the cache; with an adapter they are made anew, so that no cache of every adapter piles up."""
        taught = self._adapter()
        if taught is not None:
            return dequantised(file, shape, self._dtype, taught.terms(shape))
        cache = WeightCache(self._cache or cache_folder(), self._store.fingerprint(self._config.model), self._dtype)
        return cache.load(file, shape, self._ledger)


def _key(prompt: Prompt) -> str:
    return json.dumps([prompt.messages, prompt.schema, prompt.max_tokens], default=dict)
