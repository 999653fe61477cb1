"""The `openai` backend: one model of an OpenAI-compatible endpoint in every role."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from erag.core.errors import BadModelOutput
from erag.core.text import clean
from erag.lm.images import Pixels, load_all, resized
from erag.lm.ledger import Ledger
from erag.lm.openai.calling import Caller, used
from erag.lm.openai.chat import ChatEngine
from erag.lm.openai.config import OpenAIConfig, OpenAIRoles
from erag.lm.openai.spending import Tokens, guessed
from erag.lm.openai.structured import Form
from erag.lm.roles import (
    ROLES,
    Caption,
    Generation,
    Group,
    ImagePath,
    Prompt,
    RoleName,
    SelectTask,
    Summary,
    TextKind,
    Vectors,
)
from erag.lm.textroles import TextRoles

CAPTION_SCHEMA = {
    "type": "object",
    "properties": {
        "description": {"type": "string", "minLength": 3, "maxLength": 1500},
        "objects": {"type": "array", "items": {"type": "string", "minLength": 1, "maxLength": 80}, "maxItems": 40},
    },
    "required": ["description", "objects"],
}  # fmt: skip
_QUALITY = 85  # of the JPEG that is sent


class OpenAI:
    """All six roles by an endpoint; whether its model can play one shows when it is asked."""

    roles: frozenset[RoleName] = frozenset(ROLES)

    def __init__(self, config: OpenAIRoles, ledger: Ledger | None = None, caller: Caller | None = None) -> None:
        self._config, self._ledger = config, ledger or Ledger()
        self._caller = caller or Caller(config, self._ledger)
        self._chat = ChatEngine(config, self._caller)
        self._text = TextRoles(self._chat, config.text, self._ledger)
        self._form = Form(CAPTION_SCHEMA, config.structured)

    def identity(self, role: RoleName) -> str:
        if role not in ("embed", "caption"):
            return self._text.identity(role)
        kept = {
            "embed": {"dimensions", "query_prefix", "document_prefix", "input_type"},
            "caption": {"caption_prompt", "caption_tokens", "max_side", "structured", "temperature"},
        }[role]
        return json.dumps(self._config.model_dump(include={"kind", "model", "base_url"} | kept), sort_keys=True)

    def fingerprint(self, role: RoleName) -> str:
        return self._text.fingerprint(role) if role not in ("embed", "caption") else self.identity(role)

    def batch_size(self, role: RoleName) -> int:
        return self._config.embed_size if role == "embed" else self._config.call_size

    def caption(self, images: Sequence[ImagePath]) -> list[Caption]:
        """One caption an image, same order. Images are sent as JPEG without metadata, at most `max_side` pixels wide.

        Raises BadImages naming every image that cannot be used, BadModelOutput for an answer without a caption.
        """
        pictures = load_all(images)
        answers = self._caller.map(lambda picture: self._caption(picture.pixels), pictures)
        self._count("caption", [tokens for _, tokens in answers])
        return [caption for caption, _ in answers]

    def embed(self, texts: Sequence[str], kind: TextKind) -> Vectors:
        """(n, d) float32 unit rows. Raises BadModelOutput for vectors that are not one a text and finite."""
        if not texts:
            return np.empty((0, 0), np.float32)
        prefix = self._config.query_prefix if kind == "query" else self._config.document_prefix
        size = self._config.embed_size
        batches = [texts[i : i + size] for i in range(0, len(texts), size)]
        found = self._caller.map(lambda batch: self._embedded([prefix + text for text in batch], kind), batches)
        self._count("embed", [tokens for _, tokens in found])
        if len({rows.shape[1] for rows, _ in found}) != 1:
            raise BadModelOutput("vectors of different widths", where=self._config.model)
        return np.concatenate([rows for rows, _ in found])

    def summarise(self, groups: Sequence[Group]) -> list[Summary]:
        return self._text.summarise(groups)

    def select(self, tasks: Sequence[SelectTask], k: int) -> list[list[int]]:
        return self._text.select(tasks, k)

    def score(self, pairs: Sequence[tuple[str, str]]) -> Vectors:
        return self._text.score(pairs)

    def generate(self, prompts: Sequence[Prompt]) -> list[Generation]:
        return self._text.generate(prompts)

    def _caption(self, pixels: Pixels) -> tuple[Caption, Tokens]:
        asked = " ".join(filter(None, (self._config.caption_prompt, self._form.instruction)))
        parts = [{"type": "text", "text": asked}, {"type": "image_url", "image_url": {"url": self._url(pixels)}}]
        messages: list[dict[str, Any]] = [{"role": "user", "content": parts}]
        said = self._chat.fill(messages, self._form, self._config.caption_tokens)
        raw = json.loads(said.text)
        objects = dict.fromkeys(filter(None, (clean(name) for name in raw["objects"])))
        return Caption(clean(raw["description"]), tuple(objects)), Tokens(said.tokens_in, said.tokens_out)

    def _url(self, pixels: Pixels) -> str:
        from PIL import Image

        height, width, _ = pixels.shape
        scale = self._config.max_side / max(height, width)
        if scale < 1:
            pixels = resized(pixels, max(1, round(width * scale)), max(1, round(height * scale)))
        file = io.BytesIO()
        Image.fromarray(pixels).save(file, "JPEG", quality=_QUALITY)
        return f"data:image/jpeg;base64,{base64.b64encode(file.getvalue()).decode()}"

    def _embedded(self, texts: list[str], kind: TextKind) -> tuple[Vectors, Tokens]:
        request: dict[str, Any] = {"model": self._config.model, "input": texts, "encoding_format": "float"}
        if self._config.dimensions is not None:
            request["dimensions"] = self._config.dimensions
        if self._config.input_type:
            request["input_type"] = kind
        guess = Tokens(guessed(texts))
        answer = self._caller.call("/embeddings", request, guess)
        return _rows(answer.get("data"), len(texts), self._config), used(answer, guess)

    def _count(self, role: RoleName, tokens: Sequence[Tokens]) -> None:
        self._ledger.tokens_in[role] += sum(t.read for t in tokens)
        self._ledger.tokens_out[role] += sum(t.wrote for t in tokens)


def _rows(data: Any, n: int, config: OpenAIConfig) -> Vectors:
    """(n, d) unit rows in the order of their indices. Raises BadModelOutput for any that is missing, or is none."""
    try:
        by_index = {int(item["index"]): item["embedding"] for item in data}
        rows = np.array([by_index[i] for i in range(n)], np.float32)
    except (TypeError, KeyError, ValueError):
        by_index, rows = {}, np.empty(0, np.float32)
    lengths = np.linalg.norm(rows, axis=1, keepdims=True) if rows.ndim == 2 else np.zeros(1)
    if len(by_index) != n or len(data) != n or not (np.isfinite(lengths) & (lengths > 0)).all():
        raise BadModelOutput(f"no vectors for {n} texts", where=config.model, allowed="a finite one a text, not zero")
    unit: Vectors = (rows / lengths).astype(np.float32)
    return unit
