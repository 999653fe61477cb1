"""What `erag quantise` runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, RootModel

from erag.lm.config import LlamaCppRoles, TorchLMRoles
from erag.lm.llamacpp.config import Format
from erag.lm.llamacpp.quantise import FORMATS
from erag.lm.sentence import SentenceConfig
from erag.study.decisions import DecisionSource

TextEngine = Annotated[LlamaCppRoles | TorchLMRoles, Field(discriminator="kind")]


class _Config(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class GgufStudy(_Config):
    """A language model in several GGUF formats, and each of them measured.

    Quality is the mean log-likelihood a token of `texts` captions of `source` (a path, or `sample`), and how often the
    selector agrees with `decisions` (none: with the labels of the sample, among `cards`), of which `choices` are asked.
    Speed is of `words` words read and `answer` tokens written by a single prompt, the median of `repeats`. `engines`
    are measured beside. A variant's file is deleted once it is measured, unless `keep`.
    """

    kind: Literal["gguf"]
    model: str = "smollm2-135m"
    variants: tuple[Format, ...] = FORMATS
    out: Path
    source: str = "sample"
    texts: int = Field(60, ge=1)
    decisions: tuple[DecisionSource, ...] = ()
    choices: int = Field(150, ge=1)
    cards: int = Field(5, ge=2, le=20)
    words: int = Field(200, ge=8)
    answer: int = Field(48, ge=2)
    repeats: int = Field(3, ge=1)
    keep: bool = False
    threads: int | None = Field(None, ge=1, le=1024)
    engines: dict[str, TextEngine] = {}


class SearchStudy(_Config):
    """Nodes of `source` with a text, and the labelled `queries` about them: by path, or `sample` for the package's."""

    source: str = "sample"
    queries: str = "sample"
    where: dict[str, str] = {}


class VectorStudy(SearchStudy):
    """Embeddings in fewer bytes: node vectors as float32, float16, int8 and bits, each with and without rescoring.

    Quality is P@1 and P@5, and the share of the ten nearest by float32 that are found again. Bits are compared by
    Hamming distance; `pools` are how many of the nearest are scored anew by int8 vectors.
    """

    kind: Literal["vectors"]
    embedder: SentenceConfig = SentenceConfig(dtype="float32")
    pools: tuple[int, ...] = (20, 100)
    repeats: int = Field(20, ge=1)
    out: Path = Path("experiments/quantise/vectors")


class EncoderStudy(SearchStudy):
    """A sentence embedder computed in other precisions: float32, bfloat16, int8 weights, int8 products.

    Quality is the cosine to the float32 vector and P@1, P@5; speed is texts a second.
    """

    kind: Literal["encoder"]
    model: str = "minilm-l6"
    out: Path = Path("experiments/quantise/encoder")


class AnyQuantise(RootModel[Annotated[GgufStudy | VectorStudy | EncoderStudy, Field(discriminator="kind")]]):
    """A quantisation study's configuration file."""

    model_config = ConfigDict(frozen=True)
