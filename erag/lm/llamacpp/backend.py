"""The `llamacpp` backend: a GGUF model on the CPU as a `TextModel`, many prompts at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from erag.core.errors import BadModelOutput
from erag.lm.ledger import Ledger
from erag.lm.llamacpp.chats import Chats
from erag.lm.llamacpp.config import LlamaCppConfig
from erag.lm.llamacpp.errors import ContextError
from erag.lm.llamacpp.forms import Forms, choose_form
from erag.lm.llamacpp.generation import Chooser, Completion, Generator, Request
from erag.lm.llamacpp.grammar import parse, to_grammar
from erag.lm.llamacpp.library import library_version
from erag.lm.llamacpp.likelihood import OUTPUTS, Due, likelihoods
from erag.lm.llamacpp.native import NativeContext, NativeModel, Room
from erag.lm.llamacpp.openings import Openings
from erag.lm.llamacpp.plan import LEAST
from erag.lm.llamacpp.probe import Candidate, Choice
from erag.lm.llamacpp.probed import ProbedModel
from erag.lm.llamacpp.sampler import Constrained, Greedy
from erag.lm.probe import cpu
from erag.lm.roles import Generation, Prompt, RoleName
from erag.lm.textmodel import Continuation, Likelihood
from erag.lm.weights import ModelStore

Purpose = Literal["generate", "likelihood"]
_STEP = 256  # tokens: contexts are multiples of it
_SIMD = ("amx_int8", "avx512_bf16", "avx512_vnni", "avx512f", "avx_vnni", "avx2")


@dataclass(frozen=True, slots=True)
class _Loaded:
    model: NativeModel
    chats: Chats


class LlamaCpp(ProbedModel[LlamaCppConfig]):
    """A `TextModel`. Weights are verified, tried in a child process and loaded at the first call."""

    roles: frozenset[RoleName] = frozenset({"generate"})

    def __init__(
        self,
        config: LlamaCppConfig,
        store: ModelStore,
        ledger: Ledger | None = None,
        *,
        cache: Path | None = None,
        command: Sequence[str] = (),
    ) -> None:
        super().__init__(config, store, ledger, cache=cache, command=command)
        self._loaded: _Loaded | None = None
        self._contexts: dict[Purpose, NativeContext] = {}
        self._openings = Openings()

    def _stated(self) -> Mapping[str, Any]:
        """The weights and their form; the template is part of the weights. Decoding is greedy in every role."""
        weights = self._store.fingerprint(self._config.model)
        return {"kind": "llamacpp", "weights": weights, "form": self._config.weights}

    def _runtime(self) -> Mapping[str, Any]:
        """Known without the weights: what `auto` leads to depends on them, this CPU and the library alone."""
        return {
            "llama-cpp-python": library_version(),
            "kernels": self._config.kernels,
            "simd": next((flag for flag in _SIMD if flag in cpu().flags), cpu().architecture),
            "batch_size": self._config.batch_size,
            "sequences": self._config.sequences,
        }

    def generate(self, prompts: Sequence[Prompt]) -> list[Generation]:
        """Greedy texts, one a prompt, same order (a prompt's `seed` changes nothing).

        Raises ContextError for a prompt that does not fit with its answer, BadModelOutput when the cap ends a text
        that has a schema, ConfigError for a schema that cannot be a grammar.
        """
        if not prompts:
            return []
        grammars = [None if p.schema is None else to_grammar(p.schema) for p in prompts]
        loaded = self._load()
        requests = [self._request(loaded, p, grammar) for p, grammar in zip(prompts, grammars, strict=True)]
        needed = max(len(r.prompt) + max(r.max_tokens, 0) for r in requests)
        streams = min(self._config.sequences, len(set(requests)))
        context = self._context(loaded, "generate", needed, streams, outputs=max(streams, LEAST + 1))
        control = loaded.model.vocabulary.control

        def chooser(request: Request) -> Chooser:
            return Greedy() if request.grammar is None else Constrained(loaded.model, request.grammar)

        done = Generator(context, control, chooser, self._openings).run(requests)
        texts = [loaded.model.vocabulary.decode(c.tokens, cut=c.truncated) for c in done]
        _refuse_cut(prompts, done, texts)
        return [
            Generation(text, c.truncated, tokens_in=len(r.prompt), tokens_out=len(c.tokens))
            for text, c, r in zip(texts, done, requests, strict=True)
        ]

    def likelihoods(self, continuations: Sequence[Continuation]) -> list[Likelihood]:
        """One likelihood a continuation, same order; its tokens are those of the text on its own, after the prompt's.

        Raises ContextError for a continuation that does not fit with its prompt.
        """
        if not continuations:
            return []
        loaded = self._load()
        dues = []
        for c in continuations:
            text = loaded.chats.plain(c.text)
            dues.append(Due(self._prompt(loaded, c.messages, len(text)), text))
        context = self._context(loaded, "likelihood", max(len(due.path) for due in dues), 1, OUTPUTS)
        return likelihoods(context, dues)

    def _request(self, loaded: _Loaded, prompt: Prompt, grammar: str | None) -> Request:
        tokens = self._prompt(loaded, prompt.messages, prompt.max_tokens)
        return Request(tokens, prompt.max_tokens, grammar, loaded.chats.opening(prompt.messages, tokens))

    def _prompt(self, loaded: _Loaded, messages: Sequence[tuple[str, str]], answer: int) -> tuple[int, ...]:
        tokens = loaded.chats.tokens(messages)
        if len(tokens) + answer > self._config.context:
            raise ContextError(len(tokens), answer, self._config.context, loaded.model.path.name)
        return tokens

    def _context(self, loaded: _Loaded, purpose: Purpose, cells: int, sequences: int, outputs: int) -> NativeContext:
        """A context of at least this size; one a purpose is kept, and replaced by another when it is too small."""
        room = Room(-(-cells // _STEP) * _STEP, sequences, self._config.batch_size, outputs, self._threads)
        kept = self._contexts.get(purpose)
        if kept is not None and kept.room.holds(room):
            return kept
        if kept is not None:
            del self._contexts[purpose]
            kept.close()  # its memory is free before the other one is made
        self._contexts[purpose] = NativeContext(loaded.model, room)
        return self._contexts[purpose]

    def _load(self) -> _Loaded:
        if self._loaded is None:
            model = self._open()
            self._loaded = _Loaded(model, Chats(model, self._config.context, self._command))
        return self._loaded

    def file(self) -> Path:
        """The file that is computed with, made where it is not there yet."""
        return self._chosen()[0].path

    def _open(self) -> NativeModel:
        candidate, choice = self._chosen()
        return NativeModel(candidate.path, choice.kernels)

    def _chosen(self) -> tuple[Candidate, Choice]:
        """The weights in their form, and the kernels they survive."""
        config, probe = self._config, self._probe()
        path = self._store.path(config.model)
        shipped = Candidate(config.model, path, self._store.fingerprint(config.model))
        choice = probe.survive(shipped, config.kernels)
        form = choose_form(config.weights, choice.file_type, path.stat().st_size, cpu())
        candidate = Forms(probe).get(shipped, form)
        if candidate != shipped:
            choice = probe.survive(candidate, config.kernels)
        return candidate, choice


def _refuse_cut(prompts: Sequence[Prompt], done: Sequence[Completion], texts: Sequence[str]) -> None:
    """Raise BadModelOutput for the first text that does not meet the schema it was asked under."""
    for i, (prompt, completion, text) in enumerate(zip(prompts, done, texts, strict=True)):
        if prompt.schema is None:
            continue
        if completion.truncated:
            what, where = f"the text was cut at {prompt.max_tokens} tokens: …{text[-60:]!r}", f"prompt {i + 1}"
            raise BadModelOutput(what, where=where, allowed="JSON of the schema", repair="a larger max_tokens")
        parse(prompt.schema, text)
