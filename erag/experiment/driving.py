"""Whether a simulated robot gets to what was answered: navigation success, kept apart from generation success."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pydantic import BaseModel, ConfigDict

from erag.evaluate.navigation.planner import WaypointFollower
from erag.evaluate.navigation.trips import Course, Status, Trip, random_blockages
from erag.experiment.asking import Ground
from erag.experiment.config import TripsConfig
from erag.experiment.predictions import Key, Metres, Prediction


class Driven(BaseModel):
    """How the trip from L to the first answer of a prediction ended."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    system: str
    data: str
    environment: str
    id: str
    mode: str
    status: Status
    metres: Metres = 0.0
    replans: int = 0
    spl: float = 0.0

    @property
    def key(self) -> Key:
        return (self.system, self.data, self.environment, self.id, self.mode)


def driven(predictions: Sequence[Prediction], ground: Ground, config: TripsConfig, seed: int) -> Iterator[Driven]:
    """A trip for every answer in places about this environment whose question told L; none answered is no route.

    The same L and goal are driven once: on blocked edges and with errors of the position that the seed draws.
    """
    scene = ground.scene
    blocked = random_blockages(scene.topomap, config.blocked, seed)
    course = Course(scene.topomap, WaypointFollower(config.planner), blocked, config.success_m)
    asked = {q.key: q for q in ground.questions}
    known: dict[tuple[tuple[float, ...], str], Trip] = {}
    for p in predictions:
        posed = asked.get(p.question)
        if posed is None or posed.at is None or p.kind != "find" or "L" not in p.mode.split(","):
            continue
        trip = Trip("no_route")
        if p.answers:
            goal = p.answers[0].node
            if (posed.at, goal) not in known:
                known[posed.at, goal] = course.trip(scene.pose(posed.at), goal, seed)
            trip = known[posed.at, goal]
        yield Driven(
            system=p.system, data=p.data, environment=p.environment, id=p.id, mode=p.mode, status=trip.status,
            metres=trip.metres, replans=trip.replans, spl=trip.spl,
        )  # fmt: skip
