"""The renderer and the truth read from its mask: areas, NDVI, places, light."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="the extra `sim` is not installed")

from erag.sim.camera import FIELD_OF_VIEW, Camera, Size, directions
from erag.sim.layout import worlds
from erag.sim.light import MOODS, finished
from erag.sim.materials import materials
from erag.sim.mesh import box, sheet
from erag.sim.model import part
from erag.sim.renderer import Lamp, Renderer, Solid
from erag.sim.scene import Visit, parse_scene
from erag.sim.truth import VISIBLE, from_json, ndvi_image, to_json, view

SIZE = Size(160, 120)
DOWN = Camera(0, 0, 10, 0.0, -89.9)
FIELD = """
title: field
kind: field
setting: outdoor
split: train
number: 99
robot: wheeled
ground: asphalt
visits: [{start: "2025-05-01T10:00:00Z", season: summer, light: midday}]
areas:
  - place: lawn
    name: green lawn
    box: [0, -30, 40, 30]
    ground: GROUND
    stands: [{what: car, at: [[6, 30]], colour: red, shape: 1}]
path: {points: [[-0.5, 0], [0, 0]], nodes: 2, look: [0]}
"""


@pytest.fixture
def renderer() -> Iterator[Renderer]:
    with Renderer() as made:
        yield made


def test_the_mask_has_the_area_that_geometry_says(renderer: Renderer) -> None:
    wall = Solid((part("brick", box(0.2, 2.0, 2.0)),), x=5.1)
    renderer.load([wall], [0])
    frame = renderer.draw(Camera(0, 0, 1, 0.0), SIZE, Lamp())
    tall = 2 * 5 * math.tan(math.radians(FIELD_OF_VIEW / 2))
    expected = (2 / tall) * (2 / (tall * SIZE.width / SIZE.height))
    assert (frame.solid == 0).mean() == pytest.approx(expected, rel=0.03)
    assert frame.depth[60, 80] == pytest.approx(5.0, abs=0.1)
    assert {frame.materials[m] for m in np.unique(frame.material) if m >= 0} == {"brick"}


def test_only_what_is_loaded_is_seen(renderer: Renderer) -> None:
    solids = [Solid((part("brick", box(1, 1, 1)),), x=5.0), Solid((part("steel", box(1, 1, 1)),), x=3.0)]
    for rows in ([0, 1], [0]):
        renderer.load(solids, rows)
        frame = renderer.draw(Camera(0, 0, 0.5, 0.0), SIZE, Lamp())
        assert frame.solid.max() == max(rows)
        assert frame.materials[frame.material[60, 80]] == ("steel" if 1 in rows else "brick")


@pytest.mark.parametrize("name", ["good grass", "worn grass", "dry grass", "asphalt", "snow", "water"])
def test_ndvi_is_that_of_the_material(renderer: Renderer, name: str) -> None:
    renderer.load([Solid((part(name, sheet(100, 100)),))], [0])
    index = ndvi_image(renderer.draw(DOWN, SIZE, Lamp()))
    m = materials()[name]
    assert np.unique(index) == pytest.approx([(m.nir - m.red) / (m.nir + m.red)])


def test_ndvi_of_a_mixed_picture_is_the_mean_over_its_pixels(renderer: Renderer) -> None:
    halves = [Solid((part("good grass", sheet(50, 50)),), y=25.0), Solid((part("asphalt", sheet(50, 50)),), y=-25.0)]
    renderer.load(halves, [0, 1])
    index = ndvi_image(renderer.draw(DOWN, SIZE, Lamp()))
    mean = (materials()["good grass"].ndvi + materials()["asphalt"].ndvi) / 2
    assert float(np.nanmean(index)) == pytest.approx(mean, abs=0.01)


@pytest.mark.parametrize(("ground", "least", "most"), [("good grass", 0.6, 0.8), ("dry grass", 0.05, 0.15)])
def test_a_view_knows_its_place_objects_and_grass(renderer: Renderer, ground: str, least: float, most: float) -> None:
    (world,) = worlds("field", parse_scene(FIELD.replace("GROUND", ground), "field"), 0)
    renderer.load(world.solids, range(len(world.solids)))
    stop = world.stops[-1]
    seen = view(world, stop, renderer.draw(stop.camera, SIZE, Lamp()), "n1")
    assert (seen.place, seen.place_name, seen.indoor) == ("lawn", "green lawn", False)
    assert least < seen.ndvi < most
    (car,) = seen.visible
    assert (car.name, car.colour, car.side, car.share > VISIBLE) == ("car", "red", "centre", True)
    assert car.box[0] < 0.5 < car.box[2]
    assert car.metres == pytest.approx(6, abs=0.5)
    assert max(seen.surfaces, key=lambda g: seen.surfaces[g]) == materials()[ground].noun
    assert from_json(to_json(seen)) == seen


def test_the_sky_belongs_to_nobody(renderer: Renderer) -> None:
    renderer.load([Solid((part("asphalt", sheet(300, 300)),))], [0])
    frame = renderer.draw(Camera(0, 0, 1.5, 0.3), SIZE, Lamp())
    assert frame.sky[:40].all()
    assert not frame.sky[-40:].any()
    assert np.isnan(ndvi_image(frame)[:40]).all()


def test_rays_agree_with_what_is_drawn(renderer: Renderer) -> None:
    camera = Camera(0, 0, 1.5, 0.4, -5.0)
    azimuth, elevation = directions(camera, SIZE)
    at = (8 * math.cos(azimuth[80, 40]), 8 * math.sin(azimuth[80, 40]), 1.5 + 8 * math.tan(elevation[80, 40]))
    renderer.load([Solid((part("steel", box(0.3, 0.3, 0.3)),), at[0], at[1], at[2] - 0.15)], [0])
    assert renderer.draw(camera, SIZE, Lamp()).solid[80, 40] == 0


def test_night_is_darker_and_lamps_shine(renderer: Renderer) -> None:
    solids = [Solid((part("paint", box(1, 1, 1)),), 5.0, 1.0), Solid((part("lamp", box(1, 1, 1)),), 5.0, -1.0)]
    renderer.load(solids, [0, 1])
    camera = Camera(0, 0, 0.5, 0.0)
    bright = {}
    for light in ("midday", "night"):
        frame = renderer.draw(camera, SIZE, MOODS[light].lamp)
        image = finished(frame, camera, SIZE, Visit(start="2025-01-01T20:00:00Z", season="winter", light=light))
        bright[light] = [float(image[frame.solid == row].mean()) for row in (0, 1)]
    assert bright["night"][0] < 0.6 * bright["midday"][0]
    assert bright["night"][1] > 1.5 * bright["night"][0]


def test_the_same_is_drawn_twice(renderer: Renderer) -> None:
    (world,) = worlds("field", parse_scene(FIELD.replace("GROUND", "meadow"), "field"), 0)
    frames = []
    for _ in range(2):
        renderer.load(world.solids, range(len(world.solids)))
        frames.append(renderer.draw(world.stops[0].camera, SIZE, Lamp()))
    assert (frames[0].rgb == frames[1].rgb).all()
    assert (frames[0].solid == frames[1].solid).all()
