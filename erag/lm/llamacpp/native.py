"""A GGUF model in memory and contexts to compute with it: thin, typed, freed in time; nothing is decided here."""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from erag.core.errors import BadModelOutput, ModelError
from erag.lm.llamacpp.library import complaint, llama
from erag.lm.llamacpp.vocabulary import Vocabulary

if TYPE_CHECKING:
    from erag.lm.llamacpp.config import Kernels

Logits = npt.NDArray[np.float32]  # (v,)
_FLASH_OFF = 0
_LOAD_READ = 0  # LLAMA_LOAD_MODE_NONE: the file is read, not mapped; a file that shrinks later cannot kill us


@dataclass(frozen=True, slots=True)
class Row:
    """A token of a batch: where it stands in which sequence, and whether the logits after it are wanted."""

    token: int
    position: int
    sequence: int
    wanted: bool = False


@dataclass(frozen=True, slots=True)
class Room:
    """The size of a context: `cells` tokens for each of `sequences`, `batch` tokens computed at a time.

    `outputs` (at least `sequences`) is how many rows of a batch may ask for logits.
    """

    cells: int
    sequences: int
    batch: int
    outputs: int
    threads: int

    def holds(self, other: Room) -> bool:
        """Whether what needs `other` can be computed here, with the same results."""
        bigger = self.cells >= other.cells and self.sequences >= other.sequences and self.outputs >= other.outputs
        return bigger and (self.batch, self.threads) == (other.batch, other.threads)


class NativeModel:
    """Weights in memory. Open only files that a child process has survived (`probe`).

    Raises ModelError when llama.cpp refuses the file.
    """

    def __init__(self, path: Path, kernels: Kernels, *, check: bool = False) -> None:
        self.llama, self.path = llama(), path
        settings = self.llama.llama_model_default_params()
        settings.use_extra_bufts = kernels == "fast"
        settings.check_tensors = check
        settings.n_gpu_layers = 0
        settings.load_mode = _LOAD_READ
        complaint()
        self.handle = self.llama.llama_model_load_from_file(str(path).encode(), settings)
        if not self.handle:
            why = complaint() or "llama.cpp gives no reason"
            raise ModelError(f"cannot be loaded: {why}", where=str(path), allowed="a GGUF language model")
        self.close = weakref.finalize(self, self.llama.llama_model_free, self.handle)
        vocabulary = self.llama.llama_model_get_vocab(self.handle)
        self.vocabulary = Vocabulary(self.llama, vocabulary, where=path.name)
        self.vocabulary_handle = vocabulary

    @property
    def trained_context(self) -> int:
        """Tokens that the model saw at once in its training."""
        return int(self.llama.llama_model_n_ctx_train(self.handle))

    @property
    def template(self) -> str | None:
        """The chat template the file brings, None where it has none."""
        found: bytes | None = self.llama.llama_model_chat_template(self.handle, None)
        return found.decode("utf-8", "replace") if found else None

    @property
    def description(self) -> str:
        """Architecture, size and format in llama.cpp's words, as in "llama 135M Q4_1"."""
        buffer = ctypes.create_string_buffer(256)
        self.llama.llama_model_desc(self.handle, buffer, 256)
        return buffer.value.decode("utf-8", "replace")

    @property
    def file_type(self) -> int:
        """The format of most weights, as llama.cpp numbers them (3 is Q4_1)."""
        return int(self.llama.llama_model_ftype(self.handle))


class NativeContext:
    """Memory of what sequences have seen, and the computation that extends it."""

    def __init__(self, model: NativeModel, room: Room) -> None:
        self.room, self._model, self._llama = room, model, model.llama
        settings = self._llama.llama_context_default_params()
        settings.n_ctx = room.cells * room.sequences
        settings.n_seq_max = room.sequences
        settings.n_batch = settings.n_ubatch = max(room.batch, room.sequences)
        settings.n_outputs_max = room.outputs
        settings.n_threads = settings.n_threads_batch = room.threads
        settings.kv_unified = False  # each sequence has cells of its own, so that it never looks past others'
        settings.flash_attn_type = _FLASH_OFF  # its half-precision sums depend on the number of threads
        settings.no_perf = True
        complaint()
        handle = self._llama.llama_init_from_model(model.handle, settings)
        if not handle:
            why = complaint() or "not enough memory?"
            what = f"no context of {settings.n_ctx} tokens: {why}"
            raise ModelError(what, where=model.path.name, repair="a smaller `context` or fewer `sequences`")
        self._handle = handle
        self._capacity = int(settings.n_batch)
        self._batch = self._llama.llama_batch_init(self._capacity, 0, 1)
        self._memory = self._llama.llama_get_memory(handle)
        self.close = weakref.finalize(self, _free, self._llama, handle, self._batch)

    @property
    def handle(self) -> Any:
        """The native context."""
        return self._handle

    def last(self) -> Logits:
        """The logits (v,) after the row that was computed last, valid until the next call. Raises BadModelOutput."""
        return self._logits(-1)

    def clear(self) -> None:
        """Forget all sequences, down to the bytes: later results do not depend on earlier ones."""
        self._llama.llama_memory_clear(self._memory, True)

    def copy(self, source: int, target: int, length: int) -> None:
        """Make sequence `target` the first `length` tokens of `source`."""
        self._llama.llama_memory_seq_cp(self._memory, source, target, -1, -1)
        self.keep(target, length)

    def keep(self, sequence: int, length: int) -> None:
        """Forget what a sequence has seen after its first `length` tokens."""
        if not self._llama.llama_memory_seq_rm(self._memory, sequence, length, -1):
            raise ModelError("its memory cannot be cut back", where=self._model.path.name, allowed="a transformer")

    def save(self, sequence: int) -> bytes:
        """Everything a sequence has seen, as llama.cpp writes it."""
        size = self._llama.llama_state_seq_get_size(self._handle, sequence)
        buffer = (ctypes.c_uint8 * size)()
        written = self._llama.llama_state_seq_get_data(self._handle, buffer, size, sequence)
        return bytes(buffer[:written])

    def restore(self, sequence: int, state: bytes) -> None:
        """Make an empty sequence what another of the same model was when it was saved."""
        buffer = (ctypes.c_uint8 * len(state)).from_buffer_copy(state)
        if not self._llama.llama_state_seq_set_data(self._handle, buffer, len(state), sequence):
            raise ModelError("its memory cannot be put back", where=self._model.path.name, allowed="a transformer")

    def decode(self, rows: Sequence[Row]) -> list[Logits]:
        """Compute a batch; the logits (v,) after each wanted row, in order, valid until the next call.

        Raises BadModelOutput for logits that are not numbers, ModelError when llama.cpp fails.
        """
        wanted = sum(row.wanted for row in rows)
        if not 0 < len(rows) <= self._capacity or wanted > self.room.outputs:  # llama.cpp would end the process
            limits = f"at most {self._capacity} rows and {self.room.outputs} wanted"
            raise ValueError(f"a batch of {len(rows)} rows, {wanted} wanted; {limits}")
        self._fill(rows)
        complaint()
        status = self._llama.llama_decode(self._handle, self._batch)
        if status != 0:
            what = f"llama.cpp failed on a batch of {len(rows)} ({status}): {complaint() or 'no reason given'}"
            raise ModelError(what, where=self._model.path.name)
        return [self._logits(i) for i, row in enumerate(rows) if row.wanted]

    def _fill(self, rows: Sequence[Row]) -> None:
        batch = self._batch
        batch.n_tokens = len(rows)
        for i, row in enumerate(rows):
            batch.token[i], batch.pos[i], batch.logits[i] = row.token, row.position, row.wanted
            batch.n_seq_id[i], batch.seq_id[i][0] = 1, row.sequence

    def _logits(self, row: int) -> Logits:
        pointer = self._llama.llama_get_logits_ith(self._handle, row)
        logits: Logits = np.ctypeslib.as_array(pointer, shape=(self._model.vocabulary.size,))
        if not np.isfinite(logits.max()):
            raise BadModelOutput("logits that are not numbers", where=self._model.path.name)
        return logits


def _free(library: Any, context: Any, batch: Any) -> None:
    library.llama_batch_free(batch)
    library.llama_free(context)
