"""How results and requests of the text roles are written down as JSON, and read back."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from erag.lm.roles import Caption, Generation, RoleName, Summary

T = TypeVar("T")


@dataclass(frozen=True)
class Codec(Generic[T]):
    """A pair of functions: a result to JSON text, and back."""

    encode: Callable[[T], str]
    decode: Callable[[str], T]


def plain(value: Any) -> Any:
    """A request as plain JSON values: dataclasses become objects, tuples lists."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    return [plain(v) for v in value] if isinstance(value, tuple | list) else value


def _dump(value: Any) -> str:
    return json.dumps(plain(value), sort_keys=True, ensure_ascii=False)


def _caption(text: str) -> Caption:
    raw = json.loads(text)
    return Caption(raw["text"], tuple(raw["objects"]))


def _summary(text: str) -> Summary:
    raw = json.loads(text)
    return Summary(raw["name"], raw["text"], tuple(raw["relationships"]))


CAPTION: Codec[Caption] = Codec(_dump, _caption)
SUMMARY: Codec[Summary] = Codec(_dump, _summary)
GENERATION: Codec[Generation] = Codec(_dump, lambda text: Generation(**json.loads(text)))
SELECTION: Codec[list[int]] = Codec(_dump, json.loads)
SCORE: Codec[float] = Codec(_dump, json.loads)
CODECS: Mapping[RoleName, Codec[Any]] = {
    "caption": CAPTION, "summarise": SUMMARY, "select": SELECTION, "score": SCORE, "generate": GENERATION,
}  # fmt: skip


def request_text(item: Any) -> str:
    """A request of a text role as it is recorded, the same for equal requests."""
    return _dump(item)
