"""The OpenAI protocol over a local backend: request bodies in, response bodies out. No sockets here."""

from __future__ import annotations

import base64
import binascii
import json
import tempfile
import time
from collections.abc import Callable, Mapping
from itertools import count
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from erag.core.errors import BadModelOutput, EragError, InputError, ModelError, RoleMissing
from erag.lm.roles import Caption, LMBackend, Prompt, RoleName
from erag.lm.textmodel import Continuation, TextModel

ANY = "erag"  # a model name that stands for whichever plays the role
_SUFFIX = {"image/jpeg": ".jpg", "image/png": ".png", "image/webp": ".webp"}
_MOST = 256  # tokens of an answer where the request does not say
Body = dict[str, Any]
Model = TypeVar("Model", bound=BaseModel)


class _Asked(BaseModel):
    """Part of a request; fields that make no difference here are let pass, those that would are refused."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class _Url(_Asked):
    url: str


class _Text(_Asked):
    type: Literal["text"]
    text: str


class _Image(_Asked):
    type: Literal["image_url"]
    image_url: _Url


_Part = Annotated[_Text | _Image, Field(discriminator="type")]


class _Message(_Asked):
    role: Literal["system", "user", "assistant"]
    content: str | tuple[_Part, ...]


class _JsonSchema(_Asked):
    name: str = ""
    schema_: dict[str, Any] = Field(alias="schema")


class _Format(_Asked):
    type: Literal["text", "json_schema"]
    json_schema: _JsonSchema | None = None


class ChatRequest(_Asked):
    """`POST /v1/chat/completions`. Local models are greedy: a temperature is read and makes no difference."""

    model: str
    messages: tuple[_Message, ...] = Field(min_length=1, max_length=256)
    max_tokens: int | None = Field(None, ge=1, le=16_384)
    max_completion_tokens: int | None = Field(None, ge=1, le=16_384)
    temperature: float | None = Field(None, ge=0, le=2)
    seed: int | None = Field(None, ge=-(1 << 63), lt=1 << 63)
    response_format: _Format | None = None
    stream: Literal[False] | None = None
    n: Literal[1] | None = None
    logprobs: Literal[False] | None = None
    tools: None = None
    stop: None = None

    @property
    def most(self) -> int:
        return self.max_completion_tokens or self.max_tokens or _MOST

    @property
    def schema_asked(self) -> Mapping[str, Any] | None:
        wanted = self.response_format
        return wanted.json_schema.schema_ if wanted is not None and wanted.json_schema is not None else None


class EmbeddingRequest(_Asked):
    """`POST /v1/embeddings`. `input_type` (query or document) is ours, and common beside us."""

    model: str
    input: str | Annotated[tuple[str, ...], Field(min_length=1, max_length=2048)]
    encoding_format: Literal["float", "base64"] = "float"
    input_type: Literal["query", "document"] = "document"
    dimensions: None = None


class _Continued(_Asked):
    messages: tuple[_Message, ...] = Field(min_length=1, max_length=256)
    text: str = Field(min_length=1)


class LikelihoodRequest(_Asked):
    """`POST /v1/likelihoods`, an extension: how likely is it that the assistant says `text` after `messages`?"""

    model: str
    continuations: tuple[_Continued, ...] = Field(max_length=4096)


class Refused(EragError):
    """A request that is not answered: an HTTP status and the protocol's code."""

    def __init__(self, status: int, code: str, what: str) -> None:
        self.status, self.code = status, code
        super().__init__(what)


class Desk:
    """Answers requests from a backend, one at a time. `served` says which model plays which role."""

    def __init__(
        self, backend: LMBackend, served: Mapping[RoleName, str], engine: TextModel | None = None,
        clock: Callable[[], float] = time.time,
    ) -> None:  # fmt: skip
        self._backend, self._served, self._engine, self._clock = backend, dict(served), engine, clock
        self._number = count(1)

    def models(self) -> Body:
        """`GET /v1/models`: each model with the roles it plays here."""
        roles: dict[str, list[str]] = {}
        for role, name in sorted(self._served.items()):
            roles.setdefault(name, []).append(role)
        rows = [{"id": n, "object": "model", "created": 0, "owned_by": "erag", "roles": r} for n, r in roles.items()]
        return {"object": "list", "data": rows}

    def answer(self, path: str, body: bytes) -> Body:
        """The response to a POST. Raises Refused."""
        handlers = {
            "/v1/chat/completions": lambda: self._chat(_parsed(ChatRequest, body)),
            "/v1/embeddings": lambda: self._embeddings(_parsed(EmbeddingRequest, body)),
            "/v1/likelihoods": lambda: self._likelihoods(_parsed(LikelihoodRequest, body)),
        }
        if path not in handlers:
            raise Refused(404, "not_found", f"no such path; known: {', '.join(sorted(handlers))}, /v1/models")
        try:
            return handlers[path]()
        except Refused:
            raise
        except RoleMissing as error:
            raise Refused(404, "model_not_found", error.line()) from error
        except BadModelOutput as error:
            raise Refused(422, "bad_model_output", error.line()) from error
        except ModelError as error:
            raise Refused(503, "model_error", error.line()) from error
        except EragError as error:
            raise Refused(400, "invalid_request_error", error.line()) from error

    def _chat(self, asked: ChatRequest) -> Body:
        images = [p.image_url.url for m in asked.messages for p in _parts(m) if isinstance(p, _Image)]
        if images:
            return self._seen(asked, images)
        self._check(asked.model, "generate")
        prompt = Prompt(_turns(asked.messages), asked.schema_asked, asked.most, asked.seed or 0)
        (said,) = self._backend.generate([prompt])
        return self._completion(asked.model, said.text, said.truncated, said.tokens_in, said.tokens_out)

    def _seen(self, asked: ChatRequest, images: list[str]) -> Body:
        """A caption: as JSON where a schema with `description` and `objects` is asked for, else as text."""
        self._check(asked.model, "caption")
        if len(images) > 1:
            raise InputError(f"{len(images)} images", where="messages", allowed="one image a request")
        data, suffix = _image(images[0])
        with tempfile.TemporaryDirectory(prefix="erag-serve-") as folder:
            path = Path(folder) / f"image{suffix}"
            path.write_bytes(data)
            try:
                (caption,) = self._backend.caption([path])
            except InputError as error:
                raise InputError(error.what, where="the image", allowed=error.allowed) from error
        return self._completion(asked.model, _told(caption, asked.schema_asked), False, 0, 0)

    def _embeddings(self, asked: EmbeddingRequest) -> Body:
        self._check(asked.model, "embed")
        texts = (asked.input,) if isinstance(asked.input, str) else asked.input
        if not all(text.strip() for text in texts):
            raise InputError("an empty text", where="input", allowed="texts with a word at least")
        rows = np.asarray(self._backend.embed(list(texts), asked.input_type), np.float32)
        made = [{"object": "embedding", "index": i, "embedding": _coded(row, asked)} for i, row in enumerate(rows)]
        return {"object": "list", "model": asked.model, "data": made, "usage": _usage(0, 0)}

    def _likelihoods(self, asked: LikelihoodRequest) -> Body:
        self._check(asked.model, "generate")
        if self._engine is None:
            raise RoleMissing("the model that generates measures no likelihoods", allowed="torchlm, llamacpp")
        found = self._engine.likelihoods([Continuation(_turns(c.messages), c.text) for c in asked.continuations])
        data = [{"logprob": f.logprob, "tokens": f.tokens, "prompt_tokens": f.prompt} for f in found]
        read = sum(f.prompt + f.tokens for f in found)
        return {"object": "list", "model": asked.model, "data": data, "usage": _usage(read, 0)}

    def _check(self, model: str, role: RoleName) -> None:
        if role not in self._served:
            raise RoleMissing(f"no model here plays the role {role!r}")
        if model not in (ANY, self._served[role]):
            what = f"no model {model[:80]!r} for this; {self._served[role]} plays the role {role!r}"
            raise Refused(404, "model_not_found", what)

    def _completion(self, model: str, text: str, cut: bool, read: int, wrote: int) -> Body:
        message = {"role": "assistant", "content": text, "refusal": None}
        choice = {"index": 0, "message": message, "finish_reason": "length" if cut else "stop", "logprobs": None}
        return {
            "id": f"chatcmpl-{next(self._number)}", "object": "chat.completion", "created": int(self._clock()),
            "model": model, "choices": [choice], "usage": _usage(read, wrote),
        }  # fmt: skip


def _usage(read: int, wrote: int) -> Body:
    return {"prompt_tokens": read, "completion_tokens": wrote, "total_tokens": read + wrote}


def _parsed(model: type[Model], body: bytes) -> Model:
    """A request. Raises Refused naming the first field that is wrong."""
    try:
        return model.model_validate(json.loads(body))
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        at = ".".join(map(str, first["loc"]))
        raise Refused(400, "invalid_request_error", f"{at}: {first['msg']}") from None
    except (ValueError, RecursionError):
        raise Refused(400, "invalid_request_error", "the body is no JSON") from None


def _parts(message: _Message) -> tuple[_Part, ...]:
    return () if isinstance(message.content, str) else message.content


def _turns(messages: tuple[_Message, ...]) -> tuple[tuple[str, str], ...]:
    return tuple((m.role, _spoken(m)) for m in messages)


def _spoken(message: _Message) -> str:
    if isinstance(message.content, str):
        return message.content
    return "\n".join(part.text for part in message.content if isinstance(part, _Text))


def _image(url: str) -> tuple[bytes, str]:
    """The bytes of an image given as a data URL, and the ending of its name. Raises InputError otherwise."""
    head, _, data = url.partition(",")
    kind = head.removeprefix("data:").removesuffix(";base64")
    if kind not in _SUFFIX or head != f"data:{kind};base64":
        allowed = f"data:TYPE;base64,… with {', '.join(_SUFFIX)}: nothing is fetched"
        raise InputError(f"the image is given as {head[:40]!r}", where="image_url", allowed=allowed)
    try:
        return base64.b64decode(data, validate=True), _SUFFIX[kind]
    except binascii.Error as error:
        raise InputError(f"the image is no base64: {error}", where="image_url") from None


def _told(caption: Caption, schema: Mapping[str, Any] | None) -> str:
    if schema is None:
        return caption.text
    if set(schema.get("properties", {})) != {"description", "objects"}:
        raise InputError("a schema for captions", where="response_format", allowed="description and objects")
    return json.dumps({"description": caption.text, "objects": list(caption.objects)}, ensure_ascii=False)


def _coded(row: np.ndarray, asked: EmbeddingRequest) -> str | list[float]:
    if asked.encoding_format == "base64":
        return base64.b64encode(row.astype("<f4").tobytes()).decode()
    return [float(x) for x in row]
