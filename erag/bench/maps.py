"""Generated maps of any size: places on a grid of streets, captions of which no two are alike, cheap vectors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from erag.core.types import Edges, Frame, IntArray, Observation, Pose, TopoMap
from erag.lm.roles import Vectors

STEP_M, BLOCK_M, QUARTER_M = 10.0, 100.0, 200.0  # between places, between streets, side of a quarter
OWN_THINGS, OWN_SHARE = 6, 0.7  # things that are common in a quarter, and the share of its things that are these
_ROWS = 20_000  # captions whose vectors are made at once

LOOKS = (
    *("red", "green", "blue", "yellow", "white", "black", "grey", "brown", "orange", "wooden", "metal", "stone"),
    *("old", "new", "broken", "rusty", "tall", "small", "round", "painted", "striped", "dusty", "glass", "plastic"),
)
THINGS = (
    *("bench", "lamp post", "fountain", "statue", "bicycle", "bus stop", "mailbox", "litter bin", "fire hydrant"),
    *("telephone box", "parking meter", "traffic light", "fence", "gate", "hedge", "flower bed", "oak tree", "pine"),
    *("picnic table", "swing", "slide", "sandpit", "ladder", "crane", "lorry", "tractor", "taxi", "van", "scooter"),
    *("pram", "newspaper stand", "vending machine", "cash machine", "notice board", "street sign", "clock", "flag"),
    *("awning", "shop window", "doorway", "staircase", "ramp", "railing", "chimney", "water tap", "well", "pond"),
    *("canoe", "jetty", "buoy", "umbrella", "chair", "sofa", "barrel", "crate", "pallet", "container", "skip"),
    *("billboard", "mural", "bollard", "cone", "barrier", "manhole", "drain", "pump", "generator", "antenna", "shed"),
    *("greenhouse", "beehive", "scarecrow", "trough", "cart", "wheelbarrow", "hose", "tent", "kiosk", "piano"),
)
MOODS = ("quiet", "busy", "narrow", "wide", "shady", "sunny", "windy", "muddy", "paved", "cobbled", "steep", "empty")
GROUNDS = (
    *("square", "park", "car park", "alley", "avenue", "crossing", "courtyard", "market", "playground", "schoolyard"),
    *(
        "riverside",
        "harbour",
        "cemetery",
        "garden",
        "campus",
        "station forecourt",
        "building site",
        "farmyard",
        "plaza",
    ),
    *("footpath", "lane", "promenade", "lawn", "orchard", "roundabout", "bridge", "terrace", "yard", "meadow", "quay"),
)
RELATIONS = ("beside", "behind", "near", "in front of", "next to")


def thing_phrases() -> tuple[str, ...]:
    """Every thing with every look, by thing."""
    return tuple(f"{look} {thing}" for thing in THINGS for look in LOOKS)


def ground_phrases() -> tuple[str, ...]:
    """Every ground in every mood, by ground."""
    return tuple(f"{mood} {ground}" for ground in GROUNDS for mood in MOODS)


@dataclass(frozen=True, eq=False)
class Town:
    """n places: `positions` (n, 2) in metres; `things` (n, 2) rows of `thing_phrases`, which stand in one sentence.

    `grounds` (n,) rows of `ground_phrases`, the second sentence; `relations` (n,) rows of `RELATIONS`. No two places
    have the same two things on the same ground.
    """

    positions: npt.NDArray[np.float64]
    things: IntArray
    grounds: IntArray
    relations: IntArray

    def topomap(self) -> TopoMap:
        """The map, without edges."""
        places = zip(self.positions.tolist(), self.captions(), strict=True)
        nodes = (Observation(f"n{i}", "place", Pose(x, y), caption=said) for i, ((x, y), said) in enumerate(places))
        return TopoMap(Frame.METRIC, tuple(nodes), Edges.empty())

    def captions(self) -> list[str]:
        """(n) texts of two sentences: *A red bench beside a tall clock. A quiet square.*"""
        things, grounds = [_some(t) for t in thing_phrases()], [_some(g).capitalize() for g in ground_phrases()]
        said = zip(self.things.tolist(), self.grounds.tolist(), self.relations.tolist(), strict=True)
        return [
            f"{things[a].capitalize()} {RELATIONS[between]} {things[b]}. {grounds[ground]}."
            for (a, b), ground, between in said
        ]

    def vectors(self, things: Vectors, grounds: Vectors) -> tuple[Vectors, Vectors]:
        """Vectors (n, d) of the texts and (2n, d) of their sentences, unit rows.

        A sentence is the normalised mean of the vectors of its phrases, `things` (t, d) and `grounds` (g, d), a text
        that of all three: a real embedder would take hours for a map of this size.
        """
        n, d = len(self.grounds), things.shape[1]
        nodes, spoken = np.empty((n, d), np.float32), np.empty((n, 2, d), np.float32)
        for start in range(0, n, _ROWS):
            part = slice(start, start + _ROWS)
            pair, ground = things[self.things[part]].sum(1), grounds[self.grounds[part]]
            nodes[part], spoken[part, 0], spoken[part, 1] = _units(pair + ground), _units(pair), ground
        return nodes, spoken.reshape(2 * n, d)


def town(nodes: int, seed: int) -> Town:
    """`nodes` places, the same for the same seed; another size is another town."""
    rng = np.random.default_rng([seed, nodes])
    positions = _street_places(nodes)
    quarter = np.unique((positions // QUARTER_M).astype(np.int64), axis=0, return_inverse=True)[1].ravel()
    count = int(quarter.max()) + 1
    own = rng.integers(0, len(THINGS), (count, OWN_THINGS))
    grounds = rng.integers(0, len(GROUNDS), (count, 2))
    chosen = own[quarter[:, None], rng.integers(0, OWN_THINGS, (nodes, 2))]
    chosen = np.where(rng.random((nodes, 2)) < OWN_SHARE, chosen, rng.integers(0, len(THINGS), (nodes, 2)))
    things = chosen * len(LOOKS) + rng.integers(0, len(LOOKS), (nodes, 2))
    ground = grounds[quarter, rng.integers(0, 2, nodes)] * len(MOODS) + rng.integers(0, len(MOODS), nodes)
    _make_distinct(things, ground, rng)
    return Town(positions, things, ground, rng.integers(0, len(RELATIONS), nodes))


def _street_places(nodes: int) -> npt.NDArray[np.float64]:
    """(n, 2): streets every `BLOCK_M` in both directions, a place every `STEP_M`, crossings once."""
    per, streets = round(BLOCK_M / STEP_M), 1
    while (2 * per - 1) * streets * streets < nodes:
        streets += 1
    along = np.arange(streets * per) * STEP_M
    street = np.arange(streets) * BLOCK_M
    across = along[np.arange(len(along)) % per != 0]
    east = np.stack(np.meshgrid(along, street), -1).reshape(-1, 2)
    north = np.stack(np.meshgrid(street, across), -1).reshape(-1, 2)
    return np.concatenate([east, north])[np.argsort(np.r_[east.max(1), north.max(1)], kind="stable")[:nodes]]


def _make_distinct(things: IntArray, grounds: IntArray, rng: np.random.Generator) -> None:
    """Draw the second thing again, in place, until all texts differ by more than the order of their things."""
    kinds = len(THINGS) * len(LOOKS)
    while True:
        low, high = things.min(1), things.max(1)
        first = np.unique((grounds * kinds + low) * kinds + high, return_index=True)[1]
        again = np.ones(len(things), np.bool_)
        again[first] = False
        again |= low == high
        if not again.any():
            return
        things[again, 1] = rng.integers(0, kinds, int(again.sum()))


def _some(phrase: str) -> str:
    return f"{'an' if phrase[0] in 'aeiou' else 'a'} {phrase}"


def _units(rows: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True), np.float32)


@dataclass(frozen=True)
class Asked:
    """A query about a generated map, and which of `thing_phrases` a right place shows."""

    text: str
    things: tuple[int, ...]

    def right(self, shown: Sequence[int]) -> bool:
        """Whether a place that shows the phrases `shown` has all that was asked for."""
        return set(self.things) <= set(shown)


def questions(places: Town, count: int, seed: int) -> list[Asked]:
    """`count` queries about places that there are: in turn for one thing, and for a thing with what it stands by."""
    rng, phrases = np.random.default_rng([seed, len(places.grounds), 1]), thing_phrases()
    asked: list[Asked] = []
    for i, row in enumerate(rng.integers(0, len(places.grounds), count).tolist()):
        a, b = places.things[row].tolist()
        relation = RELATIONS[int(places.relations[row])]
        one = Asked(f"Find {_some(phrases[a])}.", (a,))
        both = Asked(f"Find {_some(phrases[a])} {relation} {_some(phrases[b])}.", (a, b))
        asked.append(both if i % 2 else one)
    return asked
