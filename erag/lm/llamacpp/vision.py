"""Images for a language model in llama.cpp: a projector (mmproj) makes tokens of them (libmtmd)."""

from __future__ import annotations

import ctypes
import weakref
from functools import lru_cache
from pathlib import Path
from typing import Any

from erag.core.errors import BadModelOutput, ModelError
from erag.lm.images import Pixels
from erag.lm.llamacpp.errors import ContextError
from erag.lm.llamacpp.library import complaint, llama, watch
from erag.lm.llamacpp.native import NativeContext, NativeModel

MARKER = "<__media__>"  # libmtmd's: where in a prompt the image stands
_FLASH_OFF = 0


@lru_cache(maxsize=1)
def mtmd() -> Any:
    """The low-level bindings of libmtmd, silent. Raises ModelError when the package has none."""
    llama()
    try:
        import llama_cpp.mtmd_cpp as library
    except (ImportError, OSError, AttributeError) as error:
        what = f"llama-cpp-python has no libmtmd ({error})"
        raise ModelError(what, where="vlm", repair="pip install 'erag[llamacpp]'") from error
    watch(library.mtmd_log_set, library.mtmd_helper_log_set)
    return library


class Projector:
    """The mmproj of a loaded model. Open only files that a child process has survived (`probe`).

    Raises ModelError when llama.cpp refuses the file or it sees no images.
    """

    def __init__(self, model: NativeModel, path: Path, threads: int) -> None:
        self._mtmd, self._model, self._path = mtmd(), model, path
        settings = self._mtmd.mtmd_context_params_default()
        settings.use_gpu = settings.print_timings = settings.warmup = False
        settings.n_threads, settings.flash_attn_type = threads, _FLASH_OFF
        complaint()
        self._handle = self._mtmd.mtmd_init_from_file(str(path).encode(), model.handle, settings)
        if not self._handle:
            why = complaint() or "llama.cpp gives no reason"
            raise ModelError(f"cannot be loaded: {why}", where=str(path), allowed="the mmproj of this very model")
        self.close = weakref.finalize(self, self._mtmd.mtmd_free, self._handle)
        if not self._mtmd.mtmd_support_vision(self._handle):
            raise ModelError("sees no images", where=str(path), allowed="a projector for images")

    def read(self, context: NativeContext, text: str, pixels: Pixels, room: int) -> int:
        """Read a prompt, in which `MARKER` stands once, with an image (h, w, 3) into a clean context.

        Returns the number of positions taken; the logits after the last are ready. `room` is how many tokens must stay
        free. Raises ContextError when it does not fit.
        """
        library = self._mtmd
        height, width, _ = pixels.shape
        data = (ctypes.c_uint8 * pixels.nbytes).from_buffer_copy(pixels.tobytes())
        bitmap, chunks = library.mtmd_bitmap_init(width, height, data), library.mtmd_input_chunks_init()
        try:
            self._tokenise(chunks, text, bitmap)
            self._refuse_long(chunks, context.room.cells, room)
            return self._evaluate(context, chunks)
        finally:
            library.mtmd_input_chunks_free(chunks)
            library.mtmd_bitmap_free(bitmap)

    def _tokenise(self, chunks: Any, text: str, bitmap: Any) -> None:
        library, data = self._mtmd, text.encode()
        begun = text.startswith(self._model.vocabulary.token_text("bos") or "\0")
        prompt = library.mtmd_input_text(data, len(data), not begun, True)
        bitmaps = (library.mtmd_bitmap_p_ctypes * 1)(bitmap)
        complaint()
        status = library.mtmd_tokenize(self._handle, chunks, ctypes.byref(prompt), bitmaps, 1)
        if status != 0:
            what = f"llama.cpp cannot prepare an image ({status}): {complaint() or 'no reason given'}"
            raise ModelError(what, where=self._path.name)

    def _refuse_long(self, chunks: Any, cells: int, room: int) -> None:
        library = self._mtmd
        parts = [library.mtmd_input_chunks_get(chunks, i) for i in range(library.mtmd_input_chunks_size(chunks))]
        tokens = sum(int(library.mtmd_input_chunk_get_n_tokens(part)) for part in parts)
        if tokens + room > cells:
            raise ContextError(tokens, room, cells, self._path.name)

    def _evaluate(self, context: NativeContext, chunks: Any) -> int:
        library = self._mtmd
        end = llama().llama_pos(0)
        complaint()
        status = library.mtmd_helper_eval_chunks(
            self._handle, context.handle, chunks, 0, 0, context.room.batch, True, ctypes.byref(end)
        )
        if status != 0:
            what = f"llama.cpp failed on an image ({status}): {complaint() or 'no reason given'}"
            raise BadModelOutput(what, where=self._path.name)
        return int(end.value)
