"""Draw the pictures of docs/sim.md: `python scripts/draw_sim.py [docs/img]`. Needs the extra `sim`."""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image

from erag.sim.camera import Size
from erag.sim.dataset import near_rows, open_world
from erag.sim.light import MOODS, finished
from erag.sim.renderer import Renderer
from erag.sim.scene import scene_names
from erag.sim.sheet import class_page, tiled

SIZE = Size(256, 192)
SHOTS = {  # world -> visit and stop that show it well
    "park": (1, 3), "shopping_street": (1, 24), "residential": (2, 8), "farm": (1, 4), "car_park": (1, 27),
    "sports_ground": (1, 27), "office": (1, 21), "house": (1, 0), "supermarket": (1, 12), "hospital": (1, 16),
    "campus": (1, 4), "city_street": (1, 0), "warehouse": (1, 24), "museum": (1, 44), "apartment": (1, 0),
    "school": (1, 6), "village": (2, 16), "town": (1, 215),
}  # fmt: skip


def worlds_page() -> Image.Image:
    """One frame of every world."""
    shots, labels = [], []
    with Renderer() as renderer:
        for name in scene_names():
            visit, index = SHOTS[name]
            world = open_world(name, 0)[visit - 1]
            camera = world.stops[index].camera
            renderer.load(world.solids, near_rows(world, [(camera.x, camera.y)]))
            frame = renderer.draw(camera, SIZE, MOODS[world.when.light].lamp)
            shots.append(Image.fromarray(finished(frame, camera, SIZE, world.when)))
            labels.append(f"{world.scene.number} {world.scene.title} ({world.when.season}, {world.scene.robot})")
    return tiled(shots, labels, 6)


def main(folder: Path) -> None:
    """Write both pictures as JPEG of modest size."""
    class_page("train").save(folder / "sim_classes.jpg", quality=72, optimize=True)
    worlds_page().save(folder / "sim_worlds.jpg", quality=78, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs/img"))
