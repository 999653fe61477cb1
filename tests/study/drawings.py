"""Worlds that are drawn, not rendered: coloured shapes on a lawn or in a hall, with their truth."""

import json
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

COLOURS = {"red": (200, 30, 30), "blue": (30, 60, 200), "yellow": (230, 210, 40)}
GROUNDS = {"lawn": (70, 150, 60), "hall": (150, 150, 155)}
WIDTH, HEIGHT = 192, 144


def _shape(draw: ImageDraw.ImageDraw, name: str, at: tuple[int, int], size: int, fill: tuple[int, int, int]) -> float:
    """Draw one shape; its area in pixels."""
    x, y = at
    box = (x - size, y - size, x + size, y + size)
    if name == "ball":
        draw.ellipse(box, fill)
        return float(np.pi * size**2)
    if name == "crate":
        draw.rectangle(box, fill)
        for stripe in range(y - size + 3, y + size, 8):
            draw.line((x - size, stripe, x + size, stripe), (10, 10, 10), 3)
        return float((2 * size) ** 2)
    draw.polygon([(x, y - size), (x - size, y + size), (x + size, y + size)], fill)
    draw.polygon([(x, y - size // 2), (x - size // 2, y + size), (x + size // 2, y + size)], (250, 250, 250))
    return float(2 * size**2)


def draw_world(folder: Path, world: str, count: int, seed: int) -> None:
    """Write `count` images and their truth as the simulator does; each holds up to two shapes, one on each half."""
    generator = np.random.default_rng(seed)
    images = folder / "worlds" / world / "images"
    images.mkdir(parents=True)
    (folder / "truth").mkdir(exist_ok=True)
    rows = []
    for i in range(count):
        place = str(generator.choice(sorted(GROUNDS)))
        noise = generator.normal(0, 8, (HEIGHT, WIDTH, 3))
        image = Image.fromarray(np.clip(np.array(GROUNDS[place]) + noise, 0, 255).astype(np.uint8))
        draw, objects = ImageDraw.Draw(image), []
        for half in range(2):
            if generator.random() < 0.3:
                continue
            name, colour = str(generator.choice(["ball", "crate", "tent"])), str(generator.choice(sorted(COLOURS)))
            size = int(generator.integers(16, 28))
            at = (int(generator.integers(32, 64)) + half * 96, int(generator.integers(40, 104)))
            area = _shape(draw, name, at, size, COLOURS[colour])
            objects.append(
                {"name": name, "share": area / (WIDTH * HEIGHT), "colour": colour, "metres": 3.0,
                 "box": [(at[0] - size) / WIDTH, (at[1] - size) / HEIGHT,
                         (at[0] + size) / WIDTH, (at[1] + size) / HEIGHT]}
            )  # fmt: skip
        image.save(images / f"{world}-{i:03}.jpg", quality=95)
        said = " and ".join(f"a {o['colour']} {o['name']}" for o in objects) or "nothing"
        caption = f"A {place}. In view: {said}."
        rows.append(
            {"node": f"{world}-{i:03}", "place": place, "light": "midday", "caption": caption, "objects": objects}
        )
    (folder / "truth" / f"{world}.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
