"""Draw the map of the shipped sample: `python scripts/draw_sample.py [docs/img/sample.png]`."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.lines import Line2D

from erag.data.sample import sample_dir

PAPER, INK, ROAD, PATH = "#fbf9f4", "#33322e", "#e4ddd0", "#b9ae9b"
NDVI = LinearSegmentedColormap.from_list("ndvi", ["#8c8579", "#cdb88a", "#d9cf7c", "#8fb84f", "#2f7d32"])
OFFSETS: dict[tuple[float, float], str] = {  # offset in points -> nodes whose name stands there
    (0, 9): "n02 n04 n06 n07 n14 n16 n18 p02 s10 s12",
    (9, 0): "n10 n11 n12 n20 n22 n23 n24 s04 s05 s06 s07 s08 s03",
    (-9, 0): "s15 s17 s18 s19",
    (0, -15): "p01 p03 s21 s22 s09 s13",
    (14, 3): "n01 n19 s02",
    (9, -13): "n08 n13 s23",
    (-9, -8): "s14",
}
SHORT = dict(p01="archway", p02="mulberry", p03="pottery", n04="Great Lawn", n12="Bus stop", n14="Engineering")
SHORT |= dict(n16="Chemistry", n20="Physics", n22="Library", n23="Statue", s15="Pond", s22="Marquee")

Place = dict[str, Any]


def lines(name: str) -> list[Place]:
    return [json.loads(line) for line in (sample_dir() / name).read_text(encoding="utf-8").splitlines()]


def metric(places: list[Place]) -> dict[str, tuple[float, float]]:
    """Node id -> (east, north) in metres from the main gate."""
    gate = next(p["pose"] for p in places if p["name"] == "Main gate")
    north = math.pi / 180 * 6_371_008.8
    east = north * math.cos(math.radians(gate["y"]))
    return {p["id"]: ((p["pose"]["x"] - gate["x"]) * east, (p["pose"]["y"] - gate["y"]) * north) for p in places}


def draw_ground(ax: Axes) -> None:
    ax.axvspan(-33, -19, color=ROAD, zorder=0)
    ax.plot([-26, -26], [-200, 200], color="white", lw=1.2, dashes=(6, 6), zorder=1)
    note: dict[str, Any] = {"ha": "center", "size": 8, "color": "#8d8474"}
    ax.text(-26, -70, "Priory Road", rotation=90, va="center", backgroundcolor=ROAD, **note)
    ax.text(-80, 46, "Priory Court\n(no edge leads here)", va="bottom", style="italic", **note)


def draw_paths(ax: Axes, at: dict[str, tuple[float, float]], edges: list[Place]) -> None:
    for e in edges:
        (x0, y0), (x1, y1) = at[e["a"]], at[e["b"]]
        ax.plot([x0, x1], [y0, y1], color=PATH, lw=3.2, solid_capstyle="round", zorder=2)


def draw_places(ax: Axes, at: dict[str, tuple[float, float]], places: list[Place]) -> None:
    """Filled: spring, coloured by NDVI. A ring around: seen again in autumn, coloured likewise."""
    for p in sorted(places, key=lambda p: p["id"][0] != "a"):
        autumn = p["id"][0] == "a"
        colour = NDVI(Normalize(-0.05, 0.75)(p["sensors"]["ndvi"]))
        if autumn:
            ax.plot(*at[p["id"]], "o", ms=12, mfc=PAPER, mec=colour, mew=2.4, zorder=3)
        else:
            ax.plot(*at[p["id"]], "o", ms=7.5, mfc=colour, mec=INK, mew=0.6, zorder=4)


def draw_names(ax: Axes, at: dict[str, tuple[float, float]], places: list[Place]) -> None:
    names = {p["id"]: p["name"] for p in places}
    for (dx, dy), nodes in OFFSETS.items():
        side = "left" if dx > 7 else "right" if dx < -7 else "center"
        level = "center" if abs(dy) < 9 else "bottom" if dy > 0 else "baseline"
        style: dict[str, Any] = {"textcoords": "offset points", "ha": side, "va": level, "size": 8, "color": INK}
        for node in nodes.split():
            ax.annotate(SHORT.get(node, names[node].split(",")[0]), at[node], (dx, dy), zorder=5, **style)


def draw_key(ax: Axes) -> None:
    spring = Line2D([], [], marker="o", ls="", ms=7.5, mfc="#8fb84f", mec=INK, mew=0.6, label="seen in spring")
    autumn = Line2D([], [], marker="o", ls="", ms=12, mfc=PAPER, mec="#d9cf7c", mew=2.4, label="seen again in autumn")
    path = Line2D([], [], color=PATH, lw=3.2, label="path driven")
    ax.legend(handles=[spring, autumn, path], loc="lower left", frameon=False, fontsize=8, labelcolor=INK)
    scale = ScalarMappable(Normalize(-0.05, 0.75), NDVI)
    place: dict[str, Any] = {"shrink": 0.35, "aspect": 22, "pad": 0.01, "anchor": (0.0, 0.06)}
    bar = ax.figure.colorbar(scale, ax=ax, ticks=[0, 0.25, 0.5, 0.75], **place)
    bar.set_label("NDVI", size=8, color=INK)
    bar.ax.tick_params(labelsize=7, length=2, color=INK, labelcolor=INK)
    bar.outline.set_visible(False)
    ax.plot([5, 55], [-192, -192], color=INK, lw=1.5, solid_capstyle="butt")
    ax.text(30, -189, "50 m", ha="center", va="bottom", size=8, color=INK)


def main(out: Path) -> None:
    places, edges = lines("observations.jsonl"), lines("edges.jsonl")
    at = metric(places)
    fig, ax = plt.subplots(figsize=(9.6, 7.2), facecolor=PAPER, layout="constrained")
    draw_ground(ax)
    draw_paths(ax, at, edges)
    draw_places(ax, at, places)
    draw_names(ax, at, places)
    draw_key(ax)
    ax.set(xlim=(-120, 325), ylim=(-202, 168), aspect="equal")
    ax.axis("off")
    out.parent.mkdir(parents=True, exist_ok=True)
    fig.savefig(out, dpi=110, facecolor=PAPER, metadata={"Software": None})


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs/img/sample.png"))
