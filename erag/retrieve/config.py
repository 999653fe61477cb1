"""How a query is answered from a corpus: which retriever, and how location and sensors weigh in."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Form = Literal["sum", "product"]
# The weight of location that a user may prefer: the nearest that will do, `auto`, or the best anywhere.
PREFERENCES: dict[str, dict[Form, float]] = {
    "near": {"sum": 0.5, "product": 0.9},
    "balanced": {"sum": 0.2, "product": 0.6},
    "best": {"sum": 0.0, "product": 0.0},
}
POOL = 50  # hits that are ranked again where their scores are no probabilities, or by sensors
Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class _Config(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class NodeConfig(_Config):
    """One vector per node: the cosine of query and text."""

    kind: Literal["node"] = "node"


class SentenceConfig(_Config):
    """One vector per sentence: the best sentence of a node counts."""

    kind: Literal["sentence"] = "sentence"


class Bm25Config(_Config):
    """Words in common, by BM25 (Lucene's form): `k1` saturates repetition, `b` discounts long texts.

    `stop_words`: `none` leaves common words to the weight BM25 gives them; `english` drops 179 of them first.
    """

    kind: Literal["bm25"] = "bm25"
    k1: Positive = 1.5
    b: Share = 0.75
    stop_words: Literal["none", "english"] = "none"


class FusionConfig(_Config):
    """Reciprocal rank fusion of node, sentence and BM25: the sum of 1 / (k + rank)."""

    kind: Literal["fusion"] = "fusion"
    k: Positive = 60.0
    bm25: Bm25Config = Field(default_factory=Bm25Config)


class RelevanceConfig(_Config):
    """The probability that a node answers, by a model over all evidence that was fitted on training worlds.

    With `uses` a lexicon of what things are good for finds what serves a wish that names nothing. With `literal` it
    speaks, where a request names a thing by a name that the map mentions, only for nodes that mention it.
    """

    kind: Literal["relevance"] = "relevance"
    uses: bool = True
    literal: bool = True


FlatConfig = Annotated[
    NodeConfig | SentenceConfig | Bm25Config | FusionConfig | RelevanceConfig, Field(discriminator="kind")
]


class JudgeConfig(_Config):
    """A language model decides which clusters are opened: it reads a card of each candidate and selects.

    A card is a cluster's name and summary, a leaf's text; with `evidence` also the sentence below a cluster that comes
    closest to the query. `shortlist`: how many candidates of a decision it is shown, the best by score; None for all.
    """

    evidence: bool = True
    shortlist: Annotated[int, Field(ge=1)] | None = 8


class TreeConfig(_Config):
    """Descent through the forest: of the clusters below each opened cluster the best `branches` are opened next.

    A cluster is judged by `evidence` × (the best leaf score below it) + (1 - `evidence`) × (its own similarity to the
    query): 0 is the paper's descent through summaries, 1 cannot lose the best leaf. `cluster_embedding` says what a
    cluster is like: the vector of its `summary` (of its `mean` where it has none), or always the `mean` of its nodes.
    `leaves` says which leaves below an opened cluster are scored: `all`, or as in the paper the `best` `branches`,
    chosen together with the clusters beside them. `scores` gives the leaves their scores; where the tree is `located`
    they count in the descent, as far as `evidence` does, as in the ranking: with the way there. With `judge` a language
    model decides instead of the scores.
    """

    kind: Literal["tree"] = "tree"
    branches: Annotated[int, Field(ge=1)] = 3
    evidence: Share = 0.5
    scores: FlatConfig = Field(default_factory=FusionConfig)
    cluster_embedding: Literal["summary", "mean"] = "summary"
    leaves: Literal["all", "best"] = "all"
    located: bool = False
    judge: JudgeConfig | None = None


class _ForestBaselineConfig(_Config):
    """What the rules of other systems share here: which vector a cluster has, and the context they fill, in tokens."""

    cluster_embedding: Literal["summary", "mean"] = "summary"
    tokens: Annotated[int, Field(ge=1)]


class CollapsedConfig(_ForestBaselineConfig):
    """RAPTOR's collapsed tree: leaves and clusters in one list, the most similar fill a context of `tokens`."""

    kind: Literal["collapsed"] = "collapsed"
    tokens: Annotated[int, Field(ge=1)] = 2000


class CommunityConfig(_ForestBaselineConfig):
    """GraphRAG's global search: the clusters at `level` are rated by helpfulness, the best fill a context."""

    kind: Literal["community"] = "community"
    level: Annotated[int, Field(ge=1)] = 1
    tokens: Annotated[int, Field(ge=1)] = 12_000


class DualConfig(_ForestBaselineConfig):
    """LightRAG's two levels: the `top_k` nodes for what is specific and the `top_k` clusters for themes, in turn.

    Only those whose cosine is above `threshold` count; a cluster brings the `related` nodes below it that fit best.
    """

    kind: Literal["dual"] = "dual"
    top_k: Annotated[int, Field(ge=1)] = 40
    threshold: Share = 0.2
    related: Annotated[int, Field(ge=1)] = 5
    tokens: Annotated[int, Field(ge=1)] = 30_000


RetrieverConfig = Annotated[
    NodeConfig
    | SentenceConfig
    | Bm25Config
    | FusionConfig
    | RelevanceConfig
    | TreeConfig
    | CollapsedConfig
    | CommunityConfig
    | DualConfig,
    Field(discriminator="kind"),
]


class RescoreConfig(_Config):
    """A language model scores what was found (paper, phase 2): (1 - `weight`) × score + `weight` × its score.

    Of each query the best `pool` leaves are scored and the others dropped; None scores all.
    """

    pool: Annotated[int, Field(ge=1)] | None = 10
    weight: Share = 0.5


class ExpandConfig(_Config):
    """A language model says what would satisfy a query, at most `things`, and that is searched for too.

    score = (1 - `weight`) × score of the query + `weight` × score of what the model named. With `literal` it is not
    asked where the request names a thing by a name that the map mentions.
    """

    weight: Share = 0.5
    things: Annotated[int, Field(ge=1, le=12)] = 5
    literal: bool = True


class PlacesConfig(_Config):
    """Nodes within `metres` are views of one place, of which the best comes first.

    A further view comes before another place only where `further` of its score is more; 0: only where no other is left.
    """

    metres: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 1.0
    further: Share = 0.7


class RetrieveConfig(_Config):
    """A retriever, and the re-ranking of its best `pool` hits by location and sensors (paper, phase 2).

    score = (1 - alpha_rank) × semantic + alpha_rank × spatial, spatial = exp(-metres / theta_rank), where `location` is
    a `sum` (the paper's); as a `product` semantic × (1 - alpha_rank + alpha_rank × spatial): what answers better is
    worth a longer way, what hardly answers none. Then score = (1 - sensor_weight) × score + sensor_weight × sensor.
    `auto` is for scores that are probabilities of relevance a product, its weight 0.6, of all that was reached (of the
    best 50 where sensors are asked for, which are added); for others a sum, its weight 0.2, of the best 50.
    `theta_rank` is in metres; `auto` is the median distance of the map's nodes from their centre. With `conditions` a
    query is read for what must not be in the view, near or far; only where the scores are those of a `relevance`
    retriever. With `places` hits are spread over places.
    """

    retriever: RetrieverConfig = Field(default_factory=FusionConfig)
    expand: ExpandConfig | None = None
    rescore: RescoreConfig | None = None
    conditions: bool = True
    location: Literal["auto", "sum", "product"] = "auto"
    alpha_rank: Share | Literal["auto"] = "auto"
    theta_rank: Positive | Literal["auto"] = "auto"
    sensor_weight: Share = 0.3
    places: PlacesConfig | None = None
    pool: Annotated[int, Field(ge=1)] | Literal["all", "auto"] = "auto"

    @property
    def gives_probabilities(self) -> bool:
        """Whether scores are probabilities of relevance."""
        kind = self.retriever.scores if isinstance(self.retriever, TreeConfig) else self.retriever
        return isinstance(kind, RelevanceConfig) and self.rescore is None

    @property
    def form(self) -> Form:
        """How location joins."""
        if self.location == "auto":
            return "product" if self.gives_probabilities else "sum"
        return self.location

    @property
    def location_weight(self) -> float:
        """The weight of location."""
        return PREFERENCES["balanced"][self.form] if self.alpha_rank == "auto" else self.alpha_rank

    def ranked(self, top: int, *, sensed: bool) -> int | None:
        """How many hits are ranked again for the `top` ones, with sensors or without; None for all."""
        if self.pool == "all" or (self.pool == "auto" and self.gives_probabilities and not sensed):
            return None
        return max(POOL if self.pool == "auto" else self.pool, top)
