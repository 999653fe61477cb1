"""What the `openai` backend is told: where, which model, how patient it is and what it may spend. Never a key."""

from __future__ import annotations

import ipaddress
from typing import Annotated, Literal, Self
from urllib.parse import urlsplit

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from erag.lm.textroles import TextRolesConfig

CAPTION = (
    "Describe this view for a robot's memory in two or three sentences: the kind of place, the objects you can see and "
    "where they are, their colours, and any text on signs. List the objects. Say only what is visible."
)


class Price(BaseModel):
    """Money for a million tokens read (`input`) and written (`output`)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    input: float = Field(ge=0, allow_inf_nan=False)
    output: float = Field(0.0, ge=0, allow_inf_nan=False)
    currency: str = Field("USD", pattern=r"^[A-Z]{3}$")

    def of(self, read: int, wrote: int) -> float:
        """What so many tokens cost."""
        return (read * self.input + wrote * self.output) / 1e6


def _address(url: str) -> str:
    parts = urlsplit(url)
    plain = not (parts.username or parts.password or parts.query or parts.fragment)
    try:
        sound = parts.scheme in ("http", "https") and bool(parts.hostname) and plain and parts.port != 0
    except ValueError:  # a port that is no number
        sound = False
    if not sound:
        raise ValueError("an address is http(s)://HOST[:PORT][/PATH], without a user, a password or a query")
    return url.rstrip("/")


def is_loopback(host: str) -> bool:
    """Whether a host name is this machine."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class OpenAIConfig(BaseModel):
    """The `openai` backend: one model of an OpenAI-compatible endpoint, for any role.

    `key_env` names the variable of the environment that holds the key; None asks without one. `timeout` bounds a whole
    request. `budget` (in the currency of `price`) bounds what a run spends; it needs a price. `structured`: `strict`
    sends schemas as OpenAI takes them, lengths told in words and checked here; `full` sends them as they are.
    `likelihoods`: `first_token` reads Yes and No off the first token's log-probabilities; `extension` asks
    `/likelihoods` of our own server.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["openai"] = "openai"
    model: str = Field(min_length=1, max_length=200)
    base_url: Annotated[str, AfterValidator(_address)] = "https://api.openai.com/v1"
    key_env: Annotated[str, Field(pattern=r"^[A-Z_][A-Z0-9_]{0,63}$")] | None = "OPENAI_API_KEY"
    timeout: float = Field(60, gt=0, le=3600, description="seconds")
    retries: int = Field(5, ge=0, le=20)
    backoff: float = Field(0.5, ge=0, le=60, description="seconds before the first repetition; doubled each time")
    longest_wait: float = Field(60, ge=0, le=3600, description="seconds; a server that asks for more is given up")
    requests_per_minute: float | None = Field(None, gt=0)
    tokens_per_minute: float | None = Field(None, gt=0)
    parallel: int = Field(4, ge=1, le=64, description="requests under way at once")
    call_size: int = Field(16, ge=1, le=1024, description="items recorded together in one transaction")
    embed_size: int = Field(128, ge=1, le=2048, description="texts of one request, recorded together")
    price: Price | None = None
    budget: float | None = Field(None, gt=0, allow_inf_nan=False)
    temperature: float | None = Field(0, ge=0, le=2, description="None: not sent")
    seed: bool = Field(True, description="whether seeds are sent")
    token_field: Literal["max_tokens", "max_completion_tokens"] = "max_tokens"  # noqa: S105
    structured: Literal["strict", "full"] = "strict"
    repairs: int = Field(1, ge=0, le=5, description="times a model is told what is wrong with its JSON")
    likelihoods: Literal["first_token", "extension"] = "first_token"
    dimensions: int | None = Field(None, ge=1, le=16_384)
    query_prefix: str = ""
    document_prefix: str = ""
    input_type: bool = Field(False, description="whether the kind of a text (query, document) is sent")
    caption_prompt: str = Field(CAPTION, min_length=1, max_length=4000)
    caption_tokens: int = Field(300, ge=16, le=4096)
    max_side: int = Field(1024, ge=64, le=4096, description="pixels; larger images are made smaller")
    image_tokens: int = Field(1500, ge=0, description="an image is taken to cost before the server says")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.budget is not None and self.price is None:
            raise ValueError("a budget needs a price: price: {input: …, output: …} for a million tokens")
        parts = urlsplit(self.base_url)
        if self.key_env is not None and parts.scheme == "http" and not is_loopback(parts.hostname or ""):
            raise ValueError("a key is sent over https only, or to this machine; key_env: null asks without one")
        return self


_TEXT = TextRolesConfig(selector="grammar", scorer="yes_no", rotations=2)


class OpenAIRoles(OpenAIConfig):
    """An OpenAI-compatible model, and how it plays the text roles (`text`)."""

    text: TextRolesConfig = _TEXT

    @model_validator(mode="after")
    def _measurable(self) -> Self:
        if self.likelihoods == "first_token" and "likelihood" in (self.text.selector, self.text.scorer):
            what = "the likelihood of a query needs likelihoods: extension"
            raise ValueError(f"{what}, which cloud servers do not have; text: {{selector: grammar, scorer: yes_no}}")
        return self
