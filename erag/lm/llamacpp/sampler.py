"""Which token comes next: the most probable one, or the most probable one that a grammar admits."""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Sequence

import numpy as np

from erag.core.errors import BadModelOutput, ModelError
from erag.lm.llamacpp.native import Logits, NativeModel

_LADDER = (1, 32, 1024)  # how many candidates are shown to the grammar before it is shown all


class Greedy:
    """The most probable token; of equal ones, the lowest."""

    def choose(self, logits: Logits) -> int:
        """The next token after logits (v,)."""
        return int(logits.argmax())


class Constrained:
    """The most probable token that keeps the text within a grammar (GBNF, root rule `root`)."""

    def __init__(self, model: NativeModel, grammar: str) -> None:
        self._model, self._llama = model, model.llama
        handle = self._llama.llama_sampler_init_grammar(model.vocabulary_handle, grammar.encode(), b"root")
        if not handle:
            raise ModelError("llama.cpp refuses a schema's grammar", where=model.path.name, allowed="a smaller schema")
        self._handle = handle
        self._free = weakref.finalize(self, self._llama.llama_sampler_free, handle)

    def choose(self, logits: Logits) -> int:
        """The next token after logits (v,); the grammar moves on by it. Raises BadModelOutput when it admits none."""
        for count in (*_LADDER, len(logits)):
            best = _largest(logits, count)
            allowed = self._allowed([int(t) for t in best if np.isfinite(logits[t])])
            if allowed is not None:
                if allowed not in self._model.vocabulary.control:
                    self._llama.llama_sampler_accept(self._handle, allowed)
                return allowed
        raise BadModelOutput("no token of the vocabulary fits the schema", where=self._model.path.name)

    def _allowed(self, tokens: Sequence[int]) -> int | None:
        """The first of `tokens` that the grammar admits; tokens that steer a chat are not text."""
        shown = [t for t in tokens if t not in self._model.vocabulary.steering]
        data = (self._llama.llama_token_data * len(shown))()
        for entry, token in zip(data, shown, strict=True):
            entry.id = token
        array = self._llama.llama_token_data_array(data, len(shown), -1, False)
        self._llama.llama_sampler_apply(self._handle, ctypes.byref(array))
        return next((int(entry.id) for entry in data if np.isfinite(entry.logit)), None)


def _largest(logits: Logits, count: int) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """The tokens of the `count` largest logits, best first, of equal ones the lowest first."""
    if count == 1:
        return np.array([logits.argmax()])
    if count >= len(logits):
        return np.argsort(-logits, kind="stable")
    least = np.partition(logits, -count)[-count]
    found = np.flatnonzero(logits >= least)
    return found[np.argsort(-logits[found], kind="stable")]
