"""What runs in the child process: trying a model, rendering a chat template, converting weights; one of them a run."""

from __future__ import annotations

import json
import os
import resource
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from erag.core.errors import EragError, ModelError

_GIB = 1 << 30
_TEMPLATE_MEMORY, _TEMPLATE_SECONDS = 1 * _GIB, 10
_TRIAL = "A bench by the lake, 3 m from the café; “größer”, 公園 🌳\n\n\t<|im_end|> and then: "

Request = Mapping[str, Any]


def main() -> None:
    """Answer the request on stdin. Native code that writes to stdout or stderr reaches nobody."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    answer_to = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    request = json.load(sys.stdin)
    try:
        answer = {"ok": True, **_WORK[request["do"]](request)}
    except EragError as error:
        answer = {"ok": False, "error": error.what}
    except MemoryError:
        answer = {"ok": False, "error": "it asks for more memory than it may have"}
    os.write(answer_to, json.dumps(answer).encode())


def _limit(memory: int, seconds: int | None = None) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    if seconds is not None:
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))


def _try(request: Request) -> dict[str, Any]:
    """Load a model with the given kernels, read a prompt, then decode a batch of four and a single token."""
    path = Path(request["path"])
    parts = [path, *([Path(request["projector"])] if request.get("projector") else [])]
    _limit(4 * sum(part.stat().st_size for part in parts) + 8 * _GIB)
    from erag.lm.llamacpp.native import NativeContext, NativeModel, Room, Row

    model = NativeModel(path, request["kernels"], check=True)
    context = NativeContext(model, Room(256, 4, 128, 4, request["threads"]))
    tokens = (model.vocabulary.encode(_TRIAL) * 96)[:96]
    if not tokens or not model.vocabulary.control:
        raise ModelError("its vocabulary cannot be used")
    for sequence in range(4):
        rows = [Row(t, i, sequence, i == len(tokens) - 1) for i, t in enumerate(tokens)]
        best = [int(logits.argmax()) for logits in context.decode(rows)]
    for step, count in enumerate((4, 1)):
        rows = [Row(best[0], len(tokens) + step, sequence, True) for sequence in range(count)]
        best = [int(logits.argmax()) for logits in context.decode(rows)]
    model.vocabulary.decode(best)
    if request.get("projector"):
        _see(model, Path(request["projector"]), request["threads"])
    return {"description": model.description, "file_type": model.file_type}


def _see(model: Any, path: Path, threads: int) -> None:
    """Load a projector, read a small image with a prompt, and compute a token after it."""
    import numpy as np

    from erag.lm.llamacpp.native import NativeContext, Room, Row
    from erag.lm.llamacpp.vision import MARKER, Projector

    projector = Projector(model, path, threads)
    context = NativeContext(model, Room(4096, 1, 1024, 1, threads))
    picture = np.random.default_rng(0).integers(0, 255, (96, 128, 3)).astype(np.uint8)
    end = projector.read(context, f"{MARKER}\nWhat is this?", picture, room=1)
    context.decode([Row(int(context.last().argmax()), end, 0, True)])


def _render(request: Request) -> dict[str, Any]:
    """The pieces of a chat whose messages are numbers, through a template that nobody has reason to trust."""
    from erag.lm.chat import ChatTemplate

    _limit(_TEMPLATE_MEMORY, _TEMPLATE_SECONDS)
    template = ChatTemplate(request["template"], bos=request["bos"], eos=request["eos"])
    pieces = template.render([(role, str(i)) for i, role in enumerate(request["roles"])])
    return {"pieces": [[piece.text, piece.frame] for piece in pieces]}


def _convert(request: Request) -> dict[str, Any]:
    """Write a model with its weights in another form."""
    import ctypes

    source = Path(request["path"])
    _limit(8 * source.stat().st_size + 8 * _GIB)
    from erag.lm.llamacpp.library import complaint, llama

    settings = llama().llama_model_quantize_default_params()
    settings.ftype, settings.nthread = request["file_type"], request["threads"]
    settings.allow_requantize = True
    target = str(request["target"]).encode()
    if llama().llama_model_quantize(str(source).encode(), target, ctypes.byref(settings)) != 0:
        raise ModelError(f"cannot be converted: {complaint() or 'llama.cpp gives no reason'}")
    return {}


_WORK: dict[str, Callable[[Request], dict[str, Any]]] = {"try": _try, "render": _render, "convert": _convert}

if __name__ == "__main__":
    main()
