"""The configuration of the `llamacpp` backend."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Kernels = Literal["fast", "plain"]
KernelWish = Literal["auto", "fast", "plain"]
Format = Literal["f16", "q8_0", "q6_k", "q5_k_m", "q4_k_m", "q4_0", "q3_k_m", "q2_k"]
Form = Literal["shipped", "bf16"] | Format
FormWish = Literal["auto"] | Form
FILE_TYPES: Mapping[Form, int] = {
    "bf16": 32, "f16": 1, "q8_0": 7, "q6_k": 18, "q5_k_m": 17, "q4_k_m": 15, "q4_0": 2, "q3_k_m": 12, "q2_k": 10,
}  # fmt: skip  # llama_ftype


class LlamaCppConfig(BaseModel):
    """A GGUF model of the store, how much text it sees, and how it is computed.

    `kernels`: `fast` lets llama.cpp rearrange weights for this CPU (AMX among them), `plain` forbids it; `auto` is
    `fast` where a child process survives it, else `plain`. `weights`: the form in which the weights are computed with;
    `shipped` is the file as it is, the others are made from it once and kept in the user's cache folder; `auto`
    leaves the file as it is unless llama.cpp has no batched kernels for its format (see docs/llamacpp.md).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["llamacpp"] = "llamacpp"
    model: str = "smollm2-135m"
    context: int = Field(2048, ge=256, le=131_072, description="tokens of a prompt and its answer together")
    sequences: int = Field(16, ge=1, le=128, description="answers that are decoded side by side")
    threads: int | None = Field(None, ge=1, le=1024, description="None: as many as there are CPUs")
    batch_size: int = Field(512, ge=32, le=8192, description="tokens computed together; part of the batch plan")
    call_size: int = Field(64, ge=1, le=65_536, description="items recorded together in one transaction")
    kernels: KernelWish = "auto"
    weights: FormWish = "auto"
    probe_seconds: float = Field(300, gt=0, description="how long the child process that tries a model may take")

    @model_validator(mode="after")
    def _fits(self) -> LlamaCppConfig:
        if self.context % 256:
            raise ValueError(f"context {self.context} is not a multiple of 256")
        return self
