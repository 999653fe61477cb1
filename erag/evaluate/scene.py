"""A built environment ready to be scored: its map, R and path lengths, and one question's scores from its hits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from erag.core.geometry import distance
from erag.core.types import Pose, TopoMap
from erag.evaluate.answers import Answered, Ground, QueryScore, answer_scores, ranking_scores
from erag.evaluate.dataset import Environment, Question
from erag.evaluate.location import paths, radius, shortest_path
from erag.retrieve.rank import Distances
from erag.topomap.routes import Router


@dataclass(frozen=True, eq=False)
class Scene:
    """An environment and the map built of it. `radius_m` is R: as the environment states it, else the map's."""

    environment: Environment
    topomap: TopoMap
    distances: Distances
    radius_m: float

    @classmethod
    def of(cls, environment: Environment, topomap: TopoMap, distances: Distances | None = None) -> Scene:
        """With path lengths along the map's edges, unless `distances` measures otherwise."""
        stated = environment.radius_m
        r = radius(topomap) if stated is None else stated
        return cls(environment, topomap, distances or Router(topomap), r)

    def pose(self, at: Sequence[float]) -> Pose:
        """A position (x, y[, z]) of the map's frame; without z on the height of the nearest node."""
        x, y = at[0], at[1]
        if len(at) > 2:
            return Pose(x, y, at[2])
        flat = self.topomap.positions * (1, 1, 0)
        return Pose(x, y, float(self.topomap.positions[distance(self.topomap.frame, flat, (x, y, 0)).argmin(), 2]))

    def score(
        self, question: Question, nodes: Sequence[str], probabilities: Sequence[float], at: Pose | None = None
    ) -> QueryScore:
        """All scores of one question: `nodes` as they were answered, best first, and the panel's P(Q|A) for each.

        What depends on L is there where `at` is given, what depends on labels where the question has any. Raises
        ValueError for unequal lengths, KeyError for a node that is not on the map.
        """
        values = answer_scores(self._answered(nodes, probabilities, at), self._ground(question, at))
        if question.relevant:
            values |= ranking_scores(nodes, question.relevant)
        return QueryScore(question.id, self.environment.name, question.kind, values)

    def _answered(self, nodes: Sequence[str], probabilities: Sequence[float], at: Pose | None) -> list[Answered]:
        pairs = list(zip(nodes, probabilities, strict=True))
        if at is None:
            return [Answered(node, p) for node, p in pairs]
        found = paths(self.topomap, self.distances, at, nodes)
        lengths = zip(found.metres.tolist(), found.on_edges.tolist(), strict=True)
        return [Answered(node, p, m, along) for (node, p), (m, along) in zip(pairs, lengths, strict=True)]

    def _ground(self, question: Question, at: Pose | None) -> Ground | None:
        if at is None:
            return None
        on_map = frozenset(question.relevant or ()) & self.topomap.row.keys()
        return Ground(self.radius_m, shortest_path(self.topomap, self.distances, at, on_map) if on_map else None)
