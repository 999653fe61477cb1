"""How hits become an answer: what code composes, what a language model writes, and when the memory says no."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]


class AnswerConfig(BaseModel):
    """The answers of find and explain queries.

    `reason` of a find: `quote` is the sentence of the place that comes closest to the request, `written` a sentence by
    the generator, checked against what was seen there. `explain`: `quotes` of the hits, or `written` by the generator
    from `views`, sentences near to the question, of which the best `quoted` are shown, and `facts` counted by code that
    at least `least_share` of the views have. With `overview`
    code alone tells what a place is as a whole, its parts, what is seen most, season and weather, and the generator is
    asked for the rest. With less evidence (see `Sufficiency`) than `least_evidence` a find, or
    than `least_explained` an explain query, is answered by "not in this memory".
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    reason: Literal["quote", "written"] = "quote"
    explain: Literal["quotes", "written"] = "quotes"
    least_probability: Share = 0.2
    least_named: Share = 0.75
    overview: bool = True
    least_evidence: Share = 0.3
    least_explained: Share = 0.2
    facts: Annotated[int, Field(ge=0, le=24)] = 6
    views: Annotated[int, Field(ge=1, le=24)] = 6
    least_share: Share = 0.01
    quoted: Annotated[int, Field(ge=0, le=10)] = 3
    reason_chars: Annotated[int, Field(ge=40, le=600)] = 200
    explain_chars: Annotated[int, Field(ge=80, le=1200)] = 300
