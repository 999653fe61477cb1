"""The town: a grid of streets with a block of some kind between them, from a short plan and a seed."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from pydantic import Field

from erag.sim.scene import Area, Ground, Path, Point2, Scene, Stand, _Strict
from erag.sim.vocabulary import parse, validated


class Block(_Strict):
    """A kind of block: how often it occurs, its name, and what stands in it (metres from its south-west corner)."""

    place: str
    name: str
    weight: float = Field(gt=0)
    ground: str
    stands: tuple[Stand, ...]


class Plan(_Strict):
    """The plan of a town: the grid in blocks, sizes in metres, the kinds of blocks, street names and furniture."""

    columns: int = Field(ge=1)
    rows: int = Field(ge=1)
    block: float = Field(gt=10)
    street: float = Field(gt=4)
    spacing: float = Field(gt=0.5)
    names: tuple[str, ...]
    furniture: tuple[Stand, ...]
    blocks: tuple[Block, ...]


def town_scene(text: str, where: str, seed: int) -> Scene:
    """The scene of a town's description: all keys of a scene but areas, grounds and path, which follow from `plan`.

    Raises ConfigError naming the field that is wrong.
    """
    raw = parse(text, where)
    plan = validated(Plan, raw.pop("plan", None), where)
    rng = np.random.default_rng([seed, zlib.crc32(b"town")])
    points = tuple(_serpentine(plan))
    metres = sum(abs(a[0] - b[0]) + abs(a[1] - b[1]) for a, b in pairwise(points))
    made: dict[str, Any] = {
        "areas": tuple([*_blocks(plan, rng), *_streets(plan)]),
        "grounds": tuple(_roads(plan)),
        "path": Path(points=points, nodes=int(metres / plan.spacing) + 1, look=(0.0, "thing", 70.0, "thing", -70.0)),
    }
    return validated(Scene, raw | made, where)


def _pitch(plan: Plan) -> float:
    return plan.block + plan.street


def _blocks(plan: Plan, rng: np.random.Generator) -> Iterator[Area]:
    weights = np.array([b.weight for b in plan.blocks])
    for row in range(plan.rows):
        for column in range(plan.columns):
            b = plan.blocks[int(rng.choice(len(plan.blocks), p=weights / weights.sum()))]
            x, y = column * _pitch(plan) + plan.street / 2, row * _pitch(plan) + plan.street / 2
            yield Area(
                place=b.place, name=f"{b.name} on {_street(plan, row)}", ground=b.ground, stands=b.stands,
                box=(x, y, x + plan.block, y + plan.block),
            )  # fmt: skip


def _streets(plan: Plan) -> Iterator[Area]:
    """One area for each stretch of street between two crossings, with its furniture."""
    for row in range(plan.rows + 1):
        for column in range(plan.columns):
            x, y = column * _pitch(plan) + plan.street / 2, row * _pitch(plan)
            half = plan.street / 2
            box = (x, y - half, x + plan.block, y + half)
            yield Area(place="street", name=_street(plan, row), box=box, stands=plan.furniture)


def _roads(plan: Plan) -> Iterator[Ground]:
    w, h = plan.columns * _pitch(plan), plan.rows * _pitch(plan)
    for material, half in (("paving", plan.street / 2), ("asphalt", plan.street / 2 - 2.2)):
        for row in range(plan.rows + 1):
            yield Ground(material=material, box=(-half, row * _pitch(plan) - half, w + half, row * _pitch(plan) + half))
        for column in range(plan.columns + 1):
            yield Ground(
                material=material, box=(column * _pitch(plan) - half, -half, column * _pitch(plan) + half, h + half)
            )


def _serpentine(plan: Plan) -> Iterator[Point2]:
    """Along every street from west to east and back, then along every cross street."""
    w, h = plan.columns * _pitch(plan), plan.rows * _pitch(plan)
    for row in range(plan.rows + 1):
        ends = [(0.0, row * _pitch(plan)), (w, row * _pitch(plan))]
        yield from ends if row % 2 == 0 else ends[::-1]
    east = plan.rows % 2 == 0
    for i in range(plan.columns + 1):
        x = (plan.columns - i if east else i) * _pitch(plan)
        ends = [(x, h), (x, 0.0)]
        yield from ends if i % 2 == 0 else ends[::-1]


def _street(plan: Plan, row: int) -> str:
    return plan.names[row % len(plan.names)]
